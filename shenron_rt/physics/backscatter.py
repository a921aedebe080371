"""Normalised backscatter sigma0 of rough surfaces [m^2 per m^2]: theory and working models.

The analytic models are those of Gaussian-height random surfaces: first-order small perturbation (SPM), the scalar
Kirchhoff series, and geometric optics. Outside their validity they still return numbers; check k s and k l first. The
working models (constant gamma, Lambert) carry one measured constant. "VV" and "HH" are local: V is TM, H is TE in the
plane of incidence.

References
----------
F. T. Ulaby, R. K. Moore, A. K. Fung, Microwave Remote Sensing, vol. 2, Artech House 1982, chapter 12.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..constants import SPEED_OF_LIGHT
from ..errors import InputError
from .fresnel import fresnel_cos

__all__ = [
    "Correlation",
    "constant_gamma",
    "geometric_optics",
    "kirchhoff",
    "lambertian",
    "small_perturbation",
]

FloatArray = NDArray[np.float64]
#: Autocorrelation of the surface heights: exp(-r/l) or exp(-r^2/l^2).
Correlation = Literal["exponential", "gaussian"]


def _power_spectrum(
    correlation: Correlation, length: float, wavenumber: FloatArray, order: ArrayLike = 1.0
) -> FloatArray:
    """Return the Hankel transform [m^2] of the n-th power of the height correlation."""
    n = np.asarray(order, dtype=np.float64)
    if correlation == "exponential":
        return np.asarray((length / n) ** 2 * (1.0 + (wavenumber * length / n) ** 2) ** -1.5)
    if correlation == "gaussian":
        return np.asarray(length**2 / (2.0 * n) * np.exp(-((wavenumber * length) ** 2) / (4.0 * n)))
    raise InputError(f"unknown correlation {correlation!r}; known: exponential, gaussian")


def _wavenumber(frequency_hz: float) -> float:
    if not (math.isfinite(frequency_hz) and frequency_hz > 0.0):
        raise InputError(f"frequency {frequency_hz} Hz; allowed: finite, > 0")
    return 2.0 * math.pi * frequency_hz / SPEED_OF_LIGHT


def _is_vertical(polarization: str) -> bool:
    if polarization not in ("VV", "HH"):
        raise InputError(f"polarization {polarization!r} has no closed form here; allowed: VV, HH")
    return polarization == "VV"


def small_perturbation(
    eps: complex,
    roughness_rms_m: float,
    correlation_m: float,
    correlation: Correlation,
    frequency_hz: float,
    cos_incidence: ArrayLike,
    polarization: str,
) -> FloatArray:
    """Return sigma0 by the first-order small-perturbation method.

    Parameters
    ----------
    eps : complex
        Relative permittivity eps' - j eps''. [-]
    roughness_rms_m, correlation_m : float
        RMS height s and correlation length l. [m]
    correlation : {"exponential", "gaussian"}
        Shape of the autocorrelation.
    frequency_hz : float
        Frequency. [Hz]
    cos_incidence : array_like
        Cosine of the angle of incidence, 0 to 1. [-]
    polarization : {"VV", "HH"}
        Cross-polarised backscatter is of second order, hence absent.

    Returns
    -------
    array of the shape of cos_incidence [m^2/m^2]

    Notes
    -----
    8 k^4 s^2 cos^4 |alpha|^2 W(2 k sin), alpha_HH = R_TE,
    alpha_VV = (eps - 1)(sin^2 - eps (1 + sin^2))/(eps cos + q)^2, q = sqrt(eps - sin^2).
    Valid for k s < 0.3 and slopes sqrt(2) s/l < 0.3.
    """
    k, cos = _wavenumber(frequency_hz), np.asarray(cos_incidence, dtype=np.float64)
    sin2 = 1.0 - cos * cos
    te, _ = fresnel_cos(eps, cos)
    alpha = te
    if _is_vertical(polarization):
        q = np.sqrt(complex(eps) - sin2)
        alpha = (eps - 1.0) * (sin2 - eps * (1.0 + sin2)) / (eps * cos + q) ** 2
    spectrum = _power_spectrum(correlation, correlation_m, 2.0 * k * np.sqrt(sin2))
    return np.asarray(8.0 * k**4 * roughness_rms_m**2 * cos**4 * np.abs(alpha) ** 2 * spectrum)


def kirchhoff(
    eps: complex,
    roughness_rms_m: float,
    correlation_m: float,
    correlation: Correlation,
    frequency_hz: float,
    cos_incidence: ArrayLike,
    polarization: str,
    *,
    terms: int | None = None,
    reflectivity: ArrayLike | None = None,
) -> FloatArray:
    """Return the incoherent sigma0 by the scalar Kirchhoff approximation.

    Parameters and result are those of :func:`small_perturbation`; ``terms`` cuts the series short, None sums it
    until it has converged; ``reflectivity`` is |R|^2 at each cosine where the surface is coated and ``eps`` does not
    tell it.

    Notes
    -----
    2 k^2 cos^2 |R|^2 e^{-g} sum_n g^n/n! W_n(2 k sin), g = 4 k^2 s^2 cos^2, R the Fresnel coefficient at the angle of
    incidence. The loop is over orders; terms beyond g + 12 sqrt(g) + 40 are below 1e-16 of the Poisson weight.
    Valid for k l > 6, l^2 > 2.76 s lambda and slopes < 0.25.
    """
    k, cos = _wavenumber(frequency_hz), np.asarray(cos_incidence, dtype=np.float64)
    te, tm = fresnel_cos(eps, cos)
    bare = np.abs(tm if _is_vertical(polarization) else te) ** 2
    power = bare if reflectivity is None else np.asarray(reflectivity, dtype=np.float64)
    exponent = 4.0 * (k * roughness_rms_m * cos) ** 2
    spatial = 2.0 * k * np.sqrt(1.0 - cos * cos)
    largest = float(np.max(exponent, initial=0.0))
    log_exponent = np.log(np.maximum(exponent, np.finfo(np.float64).tiny))
    total, log_factorial = np.zeros_like(cos), 0.0
    count = math.ceil(largest + 12.0 * math.sqrt(largest) + 40.0) if terms is None else terms
    for n in range(1, count + 1):
        log_factorial += math.log(n)
        weight = np.exp(n * log_exponent - exponent - log_factorial)
        total = total + weight * _power_spectrum(correlation, correlation_m, spatial, n)
    return np.asarray(2.0 * (k * cos) ** 2 * power * total)


def geometric_optics(eps: complex, slope_rms: float, cos_incidence: ArrayLike) -> FloatArray:
    """Return sigma0 of a surface much rougher than the wavelength, by the density of facets that face the radar.

    Parameters
    ----------
    eps : complex
        Relative permittivity eps' - j eps''. [-]
    slope_rms : float
        RMS slope m, > 0; sqrt(2) s/l for a Gaussian correlation. [-]
    cos_incidence : array_like
        Cosine of the angle of incidence, 0 to 1. [-]

    Returns
    -------
    array of the shape of cos_incidence [m^2/m^2]; the same for VV and HH

    Notes
    -----
    |R(0)|^2 exp(-tan^2/(2 m^2))/(2 m^2 cos^4), valid for (2 k s cos)^2 > 10.
    """
    if not slope_rms > 0.0:
        raise InputError(f"slope_rms {slope_rms}; allowed: > 0")
    cos = np.asarray(cos_incidence, dtype=np.float64)
    cos2 = np.maximum(cos * cos, np.finfo(np.float64).tiny)
    at_normal, _ = fresnel_cos(eps, 1.0)
    with np.errstate(over="ignore"):
        decay = np.exp(-(1.0 / cos2 - 1.0) / (2.0 * slope_rms**2))
    # at grazing the exponential is 0 long before cos^4 is: form the quotient only where it counts
    shape = np.where(decay > 0.0, decay / np.maximum(cos2, 1e-6) ** 2, 0.0)
    return np.asarray(np.abs(at_normal) ** 2 * shape / (2.0 * slope_rms**2))


def constant_gamma(gamma: ArrayLike, cos_incidence: ArrayLike) -> FloatArray:
    """Return gamma cos(theta) = gamma sin(grazing): brightness independent of the angle, the usual clutter model.

    Parameters
    ----------
    gamma : array_like
        Constant, >= 0. [m^2/m^2]
    cos_incidence : array_like
        Cosine of the angle of incidence, 0 to 1. [-]
    """
    return np.asarray(np.asarray(gamma) * np.asarray(cos_incidence, dtype=np.float64))


def lambertian(gamma: ArrayLike, cos_incidence: ArrayLike) -> FloatArray:
    """Return gamma cos^2(theta): a perfectly diffuse surface whose hemispherical albedo is gamma/4.

    Parameters
    ----------
    gamma : array_like
        sigma0 at normal incidence, 0 to 4. [m^2/m^2]
    cos_incidence : array_like
        Cosine of the angle of incidence, 0 to 1. [-]
    """
    return np.asarray(np.asarray(gamma) * np.asarray(cos_incidence, dtype=np.float64) ** 2)
