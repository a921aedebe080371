"""Lobing of a low target over a flat road."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..constants import SPEED_OF_LIGHT
from ..errors import InputError
from .fresnel import fresnel_cos
from .roughness import coherent_factor

__all__ = ["four_path_factor", "two_ray_factor"]


def two_ray_factor(
    eps: ArrayLike,
    height_radar_m: ArrayLike,
    height_target_m: ArrayLike,
    ground_range_m: ArrayLike,
    frequency_hz: ArrayLike,
    polarization: str = "VV",
    *,
    roughness_rms_m: ArrayLike = 0.0,
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
    roughness_rms_m : array_like
        RMS height of the ground's roughness, >= 0; weakens its mirror image by :func:`coherent_factor`. [m]

    Returns
    -------
    complex array of the broadcast shape
        1 + rho R (r_d/r_i) e^{-jk(r_i - r_d)}. An echo goes both ways, so its power changes by |factor|^4
        (all four paths coherent), for a target that scatters alike along them; :func:`four_path_factor` for others.

    Notes
    -----
    In the limit of equal media at grazing R tends to -1 for both polarisations, hence the deep fades near the horizon.
    For vertical polarisation R_TM is the ratio of the fields along the (common) vertical direction.

    References
    ----------
    .. [1] M. I. Skolnik, Radar Handbook, 3rd ed. 2008, chapter 26.
    """
    return np.asarray(
        1.0 + _image(eps, height_radar_m, height_target_m, ground_range_m, frequency_hz, polarization, roughness_rms_m)
    )


def four_path_factor(
    eps: ArrayLike,
    height_radar_m: ArrayLike,
    height_target_m: ArrayLike,
    ground_range_m: ArrayLike,
    frequency_hz: ArrayLike,
    polarization: str = "VV",
    *,
    roughness_rms_m: ArrayLike = 0.0,
    mixed: ArrayLike = 1.0,
    reflected: ArrayLike = 1.0,
) -> NDArray[np.complex128]:
    """Return the complex factor by which the ground changes the *echo* of a point-like target.

    Parameters
    ----------
    eps, height_radar_m, height_target_m, ground_range_m, frequency_hz, polarization, roughness_rms_m
        As :func:`two_ray_factor`.
    mixed, reflected : complex array_like
        Scattering amplitude of the target over its direct, monostatic one: bistatic between the direct and the
        reflected direction, and monostatic toward the reflected one, antenna patterns included. A corner reflector's
        bistatic echo is narrow, and its reflected ray comes from below. [-]

    Returns
    -------
    complex array of the broadcast shape
        1 + 2 mixed q + reflected q^2 with q = rho R (r_d/r_i) e^{-jk(r_i - r_d)}: direct, the two mixed paths (alike by
        reciprocity), reflected both ways. With both amplitudes 1 it is the square of :func:`two_ray_factor`. The
        echo's power changes by |factor|^2.
    """
    q = _image(eps, height_radar_m, height_target_m, ground_range_m, frequency_hz, polarization, roughness_rms_m)
    return np.asarray(1.0 + 2.0 * np.asarray(mixed) * q + np.asarray(reflected) * q * q)


def _image(
    eps: ArrayLike,
    height_radar_m: ArrayLike,
    height_target_m: ArrayLike,
    ground_range_m: ArrayLike,
    frequency_hz: ArrayLike,
    polarization: str,
    roughness_rms_m: ArrayLike,
) -> NDArray[np.complex128]:
    """Return the reflected field over the direct one."""
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
    rho = coherent_factor(wavenumber, roughness_rms_m, (h1 + h2) / indirect)
    return np.asarray(rho * reflection * (direct / indirect) * np.exp(-1j * wavenumber * extra))
