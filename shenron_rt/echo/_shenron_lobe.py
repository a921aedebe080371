"""What the lobes of the ``shenron`` model add up to over the half space, so that they hold the power they are given."""

from __future__ import annotations

import functools
import math

import numpy as np

from .._typing import FloatArray
from ._shenron_loss import LOBE_EXPONENT, LOBE_SHARE, SPECULAR_HALF_ANGLE

__all__ = ["SPECULAR_SOLID_ANGLE", "lobe_solid_angle"]

#: Directions into which normals within the mask reflect: a cone of twice its half-angle [sr]. With a lobe uniform over
#: it, a flat plate reads pi R^2 and a sphere pi r^2, as geometrical optics has it.
SPECULAR_SOLID_ANGLE = 2 * math.pi * (1 - math.cos(2 * SPECULAR_HALF_ANGLE))
#: Angles of incidence of the table, and nodes of the quadrature; the lobe is a polynomial, so few are exact.
_ANGLES, _POLAR, _AZIMUTH = 257, 24, 48


def lobe_solid_angle(angle: FloatArray, power: int) -> FloatArray:
    """Return the integral of the lobe's ``power`` over the half space, at angles of incidence.

    Parameters
    ----------
    angle : (n,) float
        0 to pi/2 [rad].
    power : int
        1, or 2 where the lobe is squared.

    Returns
    -------
    (n,) float
        [sr], of a lobe scaled like :func:`~shenron_rt.echo._shenron_loss.lobe`.
    """
    grid, table = _table(power)
    return np.interp(angle, grid, table)


@functools.cache
def _table(power: int) -> tuple[FloatArray, FloatArray]:
    """Integrate 0.9 ((1 + cos a_s)/2)^4 + 0.1 ((1 + cos a_i)/2)^4, a_s and a_i from the mirror and the way back.

    Towards the radar a_s is twice the angle of incidence and a_i is 0: the released bracket.
    """
    grid = np.linspace(0.0, math.pi / 2, _ANGLES)
    nodes, weights = np.polynomial.legendre.leggauss(_POLAR)
    up, turn = (nodes + 1) / 2, 2 * math.pi * np.arange(_AZIMUTH) / _AZIMUTH
    along = np.sqrt(1 - up[:, None] ** 2) * np.cos(turn)
    across_weights = np.repeat(weights / 2, _AZIMUTH) * (2 * math.pi / _AZIMUTH)
    sin, cos = np.sin(grid)[:, None], np.cos(grid)[:, None]
    height, shift = np.repeat(up, _AZIMUTH), along.ravel()
    lobes = [((1 + cos * height + sign * sin * shift) / 2) ** (LOBE_EXPONENT // 2) for sign in (1, -1)]
    value = (LOBE_SHARE * lobes[0] + (1 - LOBE_SHARE) * lobes[1]) / 1.09
    return grid, np.einsum("gq,q->g", value**power, across_weights)
