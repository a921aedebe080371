"""Directions to the radar and their polarisation basis."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..._typing import ArrayLike, FloatArray

__all__ = ["Look", "look_from"]


class Look(NamedTuple):
    """Unit vectors (..., 3) in the target's frame."""

    to_radar: FloatArray
    v: FloatArray  #: of increasing elevation
    h: FloatArray  #: of increasing azimuth

    @property
    def basis(self) -> FloatArray:
        """V and H, stacked: (..., 2, 3)."""
        return np.stack([self.v, self.h], axis=-2)


def look_from(azimuth: ArrayLike, elevation: ArrayLike) -> Look:
    """Return the direction to the radar and its basis for azimuth and elevation [rad], broadcast to (...).

    Azimuth 0 is +x, positive toward +y; elevation is positive toward +z. At the poles the basis is that of the azimuth.
    """
    az, el = np.broadcast_arrays(np.asarray(azimuth, dtype=np.float64), np.asarray(elevation, dtype=np.float64))
    ca, sa, ce, se = np.cos(az), np.sin(az), np.cos(el), np.sin(el)
    u = np.stack([ce * ca, ce * sa, se], axis=-1)
    v = np.stack([-se * ca, -se * sa, ce], axis=-1)
    h = np.stack([-sa, ca, np.zeros_like(az)], axis=-1)
    return Look(u, v, h)
