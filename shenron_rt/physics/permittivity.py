"""Complex relative permittivity of materials against frequency: ITU-R P.2040 fits, water, conductors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, did_you_mean

__all__ = [
    "P2040",
    "P2040Fit",
    "cole_cole_permittivity",
    "conductor_permittivity",
    "p2040_permittivity",
    "water_permittivity",
]

#: sigma/(2 pi eps0 f) with sigma in S/m and f in GHz, as rounded in P.2040-3, equation (12).
_LOSS_FACTOR = 17.98


class P2040Fit(NamedTuple):
    """Constants of eps' = a f^b, sigma = c f^d [S/m], f in GHz, and the frequencies they were fitted over [Hz]."""

    a: float
    b: float
    c: float
    d: float
    valid_hz: tuple[float, float]


#: Recommendation ITU-R P.2040-3 (08/2023), Table 3.
P2040: dict[str, P2040Fit] = {
    "vacuum": P2040Fit(1.0, 0.0, 0.0, 0.0, (1e6, 100e9)),
    "concrete": P2040Fit(5.24, 0.0, 0.0462, 0.7822, (1e9, 100e9)),
    "brick": P2040Fit(3.91, 0.0, 0.0238, 0.16, (1e9, 40e9)),
    "plasterboard": P2040Fit(2.73, 0.0, 0.0085, 0.9395, (1e9, 100e9)),
    "wood": P2040Fit(1.99, 0.0, 0.0047, 1.0718, (1e6, 100e9)),
    "glass": P2040Fit(6.31, 0.0, 0.0036, 1.3394, (0.1e9, 100e9)),
    "glass_subTHz": P2040Fit(5.79, 0.0, 0.0004, 1.658, (220e9, 450e9)),
    "ceiling_board": P2040Fit(1.48, 0.0, 0.0011, 1.0750, (1e9, 100e9)),
    "ceiling_board_subTHz": P2040Fit(1.52, 0.0, 0.0029, 1.029, (220e9, 450e9)),
    "chipboard": P2040Fit(2.58, 0.0, 0.0217, 0.78, (1e9, 100e9)),
    "plywood": P2040Fit(2.71, 0.0, 0.33, 0.0, (1e9, 40e9)),
    "marble": P2040Fit(7.074, 0.0, 0.0055, 0.9262, (1e9, 60e9)),
    "floorboard": P2040Fit(3.66, 0.0, 0.0044, 1.3515, (50e9, 100e9)),
    "metal": P2040Fit(1.0, 0.0, 1e7, 0.0, (1e9, 100e9)),
    "very_dry_ground": P2040Fit(3.0, 0.0, 0.00015, 2.52, (1e9, 10e9)),
    "medium_dry_ground": P2040Fit(15.0, -0.1, 0.035, 1.63, (1e9, 10e9)),
    "wet_ground": P2040Fit(30.0, -0.4, 0.15, 1.30, (1e9, 10e9)),
}


def p2040_permittivity(name: str, frequency_hz: ArrayLike) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
    """Return the permittivity of a material of ITU-R P.2040-3 and whether the fit is used outside its range.

    Parameters
    ----------
    name : str
        A key of :data:`P2040`.
    frequency_hz : array_like
        Frequency, > 0. [Hz]

    Returns
    -------
    eps : complex array
        Relative permittivity eps' - j 17.98 sigma/f_GHz. [-]
    extrapolated : bool array
        True where the frequency lies outside the range of the fit.

    Raises
    ------
    InputError
        An unknown name or a frequency that is not positive.

    References
    ----------
    .. [1] Recommendation ITU-R P.2040-3 (08/2023), section 3, Table 3.
    """
    if name not in P2040:
        raise InputError(f"unknown P.2040 material {name!r}; {did_you_mean(name, P2040)}")
    frequency = np.asarray(frequency_hz, dtype=np.float64)
    if np.any(~(frequency > 0.0)):
        raise InputError(f"frequency {frequency_hz!r} Hz; allowed: > 0")
    fit = P2040[name]
    f_ghz = frequency / 1e9
    eps = fit.a * f_ghz**fit.b - 1j * (_LOSS_FACTOR * fit.c * f_ghz**fit.d / f_ghz)
    return np.asarray(eps), np.asarray((frequency < fit.valid_hz[0]) | (frequency > fit.valid_hz[1]))


def conductor_permittivity(conductivity_s_per_m: float, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
    """Return 1 - j sigma/(omega eps0) of a good conductor.

    Parameters
    ----------
    conductivity_s_per_m : float
        Conductivity, > 0. [S/m]
    frequency_hz : array_like
        Frequency, > 0. [Hz]
    """
    if not (math.isfinite(conductivity_s_per_m) and conductivity_s_per_m > 0.0):
        raise InputError(f"conductivity {conductivity_s_per_m} S/m; allowed: finite, > 0")
    f_ghz = np.asarray(frequency_hz, dtype=np.float64) / 1e9
    return np.asarray(1.0 - 1j * _LOSS_FACTOR * conductivity_s_per_m / f_ghz)


def water_permittivity(frequency_hz: ArrayLike, temperature_c: ArrayLike = 20.0) -> NDArray[np.complex128]:
    """Return the permittivity of pure liquid water by the double-Debye model.

    Parameters
    ----------
    frequency_hz : array_like
        Frequency, up to 1000 GHz. [Hz]
    temperature_c : array_like
        Temperature, about -20 to 60. [degC]

    Returns
    -------
    complex array of the broadcast shape, eps' - j eps''

    References
    ----------
    .. [1] Recommendation ITU-R P.840-4 (2009), equations (3) to (10); the model of H. J. Liebe, G. A. Hufford,
       T. Manabe, Int. J. Infrared Millimeter Waves 12, 659-675 (1991), doi:10.1007/BF01008897.
    """
    f = np.asarray(frequency_hz, dtype=np.float64) / 1e9
    t = 300.0 / (np.asarray(temperature_c, dtype=np.float64) + 273.15) - 1.0
    static = 77.66 + 103.3 * t
    middle = 0.0671 * static
    optical = 3.52
    principal_ghz = 20.20 - 146.0 * t + 316.0 * t**2
    secondary_ghz = 39.8 * principal_ghz
    eps = (static - middle) / (1.0 + 1j * f / principal_ghz)
    return np.asarray(eps + (middle - optical) / (1.0 + 1j * f / secondary_ghz) + optical)


def cole_cole_permittivity(
    frequency_hz: ArrayLike,
    eps_inf: float,
    terms: Sequence[tuple[float, float, float]],
    conductivity_s_per_m: float = 0.0,
) -> NDArray[np.complex128]:
    """Return the permittivity of a sum of Cole-Cole relaxations.

    Parameters
    ----------
    frequency_hz : array_like
        Frequency, > 0. [Hz]
    eps_inf : float
        Permittivity far above all relaxations. [-]
    terms : sequence of (delta, relaxation_s, alpha)
        Step [-], relaxation time [s] and broadening [-, 0 to 1] of each dispersion; alpha = 0 is Debye's.
    conductivity_s_per_m : float
        Static ionic conductivity. [S/m]

    Returns
    -------
    complex array, eps' - j eps''

    References
    ----------
    .. [1] K. S. Cole, R. H. Cole, J. Chem. Phys. 9, 341 (1941), doi:10.1063/1.1750906.
    """
    omega = 2.0 * math.pi * np.asarray(frequency_hz, dtype=np.float64)
    eps = eps_inf - 1j * conductivity_s_per_m * _LOSS_FACTOR * 1e9 * 2.0 * math.pi / omega
    for delta, relaxation, alpha in terms:
        eps = eps + delta / (1.0 + (1j * omega * relaxation) ** (1.0 - alpha))
    return np.asarray(eps)
