"""Lobing of a low target over a flat, smooth road."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..constants import SPEED_OF_LIGHT
from ..errors import InputError
from .fresnel import fresnel_cos

__all__ = ["two_ray_factor"]


def two_ray_factor(
    eps: ArrayLike,
    height_radar_m: ArrayLike,
    height_target_m: ArrayLike,
    ground_range_m: ArrayLike,
    frequency_hz: ArrayLike,
    polarization: str = "VV",
) -> NDArray[np.complex128]:
    """Return the complex factor by which the ground changes the *one-way* field at a point target.

    Parameters
    ----------
    eps : complex array_like
        Relative permittivity of the ground, eps' - j eps''. [-]
    height_radar_m, height_target_m : array_like
        Heights above the ground, >= 0. [m]
    ground_range_m : array_like
        Horizontal distance, > 0. [m]
    frequency_hz : array_like
        Frequency. [Hz]
    polarization : {"V", "H", "VV", "HH"}
        Vertical is TM on the ground, horizontal TE.

    Returns
    -------
    complex array of the broadcast shape
        1 + R (r_d/r_i) e^{-jk(r_i - r_d)}. An echo goes both ways, so its power changes by |factor|^4
        (all four paths coherent).

    Notes
    -----
    In the limit of equal media at grazing R tends to -1 for both polarisations, hence the deep fades near the horizon.
    For vertical polarisation R_TM is the ratio of the fields along the (common) vertical direction.

    References
    ----------
    .. [1] M. I. Skolnik, Radar Handbook, 3rd ed. 2008, chapter 26.
    """
    letter = polarization[:1].upper()
    if letter not in ("V", "H"):
        raise InputError(f"polarization {polarization!r}; allowed: V, H, VV, HH")
    h1, h2, ground = (np.asarray(x, dtype=np.float64) for x in (height_radar_m, height_target_m, ground_range_m))
    direct, indirect = np.hypot(ground, h1 - h2), np.hypot(ground, h1 + h2)
    te, tm = fresnel_cos(eps, (h1 + h2) / indirect)
    wavenumber = 2.0 * math.pi * np.asarray(frequency_hz, dtype=np.float64) / SPEED_OF_LIGHT
    # difference of the paths without cancellation: r_i^2 - r_d^2 = 4 h1 h2
    extra = 4.0 * h1 * h2 / (direct + indirect)
    reflection = tm if letter == "V" else te
    return np.asarray(1.0 + reflection * (direct / indirect) * np.exp(-1j * wavenumber * extra))
