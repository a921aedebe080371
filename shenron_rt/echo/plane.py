"""How much of the antenna's V lies across the plane of incidence: on a road none of it, on a wall beside it all."""

from __future__ import annotations

import numpy as np

from .._typing import FloatArray, IntArray
from ..scatterers import Scatterers
from ..tags import SemanticTag

__all__ = ["across_share", "swapped"]

#: Surfaces that stand upright, for points whose normal is not known.
_UPRIGHT = np.zeros(256, dtype=bool)
_UPRIGHT[
    [SemanticTag[k] for k in ("Buildings", "Walls", "Fences", "GuardRail", "Poles", "TrafficSigns", "TrafficLight")]
] = True


def across_share(scatterers: Scatterers, rows: IntArray, direction: FloatArray) -> FloatArray:
    """Return sin^2 of the angle between the antenna's V and the plane of incidence.

    Parameters
    ----------
    scatterers : Scatterers
        Rows without a normal are taken to stand upright where their tag says so, with what their cosine leaves open,
        and elsewhere to have V in the plane, as level ground has.
    rows : (k,) int
    direction : (k, 3) float
        From the radar to the rows, unit vectors.

    Returns
    -------
    (k,) float
        n_H^2 / (n_H^2 + n_V^2); of an upright surface n_H^2 = cos^2(el) - cos^2(theta), n_V = sin(el) cos(theta).
    """
    u = direction
    sine = u[:, 2] ** 2
    c = scatterers.cos_incidence[rows] ** 2
    upright = _UPRIGHT[scatterers.tag[rows]]
    n_h = np.where(upright, np.maximum(1.0 - sine - c, 0.0), 0.0)
    n_v = np.where(upright, sine * c, 1.0)
    if scatterers.normal is not None:
        normal = scatterers.normal[rows]
        known = np.any(normal != 0.0, axis=1)
        h = normal[:, 1] * u[:, 0] - normal[:, 0] * u[:, 1]
        v = (1.0 - sine) * normal[:, 2] - u[:, 2] * (normal[:, 0] * u[:, 0] + normal[:, 1] * u[:, 1])
        n_h, n_v = np.where(known, h**2, n_h), np.where(known, v**2, n_v)
    total = n_h + n_v
    share: FloatArray = np.divide(n_h, total, out=np.zeros_like(total), where=total > 0)
    return share


def swapped(polarization: str) -> str:
    """Return the polarisation that lies across: V of the antenna is H to a wall beside the road."""
    return polarization.translate(str.maketrans("VH", "HV"))
