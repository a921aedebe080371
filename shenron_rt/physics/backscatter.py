"""Normalised backscatter sigma0 of rough surfaces [m^2 per m^2]: theory, working models, and the energy bound.

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
from collections.abc import Callable
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..constants import SPEED_OF_LIGHT
from ..errors import InputError
from .fresnel import fresnel_cos
from .roughness import coherent_factor

__all__ = [
    "Correlation",
    "constant_gamma",
    "diffuse_albedo",
    "diffuse_budget",
    "geometric_optics",
    "kirchhoff",
    "lambertian",
    "limit_sigma0",
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


@lru_cache(maxsize=8)
def _gauss_legendre(nodes: int) -> tuple[FloatArray, FloatArray]:
    x, weight = np.polynomial.legendre.leggauss(nodes)
    return x, weight


def _root_integral(sigma0: Callable[[FloatArray], FloatArray], nodes: int) -> float:
    """Return the integral of sqrt(sigma0) over mu = cos(theta) from 0 to 1, by Gauss-Legendre in w, mu = 1 - w^2.

    The substitution crowds nodes at normal incidence, where the lobe of a gently rough surface is a few degrees wide.
    """
    x, weight = _gauss_legendre(nodes)
    w = 0.5 * (x + 1.0)
    return float(np.sum(np.sqrt(np.maximum(sigma0(1.0 - w * w), 0.0)) * w * weight))


def diffuse_albedo(
    sigma0: Callable[[FloatArray], FloatArray], cos_incidence: ArrayLike, *, nodes: int = 256
) -> FloatArray:
    """Return the share of the incident power that a surface with this backscatter scatters into the hemisphere.

    Parameters
    ----------
    sigma0 : callable
        Backscatter [m^2/m^2] as a function of an array of cosines.
    cos_incidence : array_like
        Cosine of the angle of incidence, > 0. [-]
    nodes : int
        Gauss-Legendre nodes of the integral.

    Returns
    -------
    array of the shape of cos_incidence

    Notes
    -----
    Backscatter alone does not fix the energy: an assumption on the bistatic pattern is needed. Here the incoherent
    scatter is separable, sigma0(i, s) = sqrt(sigma0(i) sigma0(s)), without dependence on azimuth. It is reciprocal,
    returns the given backscatter for s = i, is exact for a Lambert surface (albedo gamma/4), and gives

        albedo(i) = integral of sigma0(i, s) dOmega_s/(4 pi cos_i)
                  = sqrt(sigma0(i))/(2 cos_i) * integral_0^1 sqrt(sigma0) dmu.
    """
    cos = np.asarray(cos_incidence, dtype=np.float64)
    return np.asarray(np.sqrt(sigma0(cos)) * _root_integral(sigma0, nodes) / (2.0 * cos))


def diffuse_budget(
    power_te: ArrayLike,
    power_tm: ArrayLike,
    wavenumber: float,
    roughness_rms_m: float,
    volume_albedo: float,
    cos_incidence: ArrayLike,
) -> FloatArray:
    """Return the share of the incident power that may be scattered incoherently.

    Parameters
    ----------
    power_te, power_tm : array_like
        |R|^2 of the smooth surface. [-]
    wavenumber : float
        k = 2 pi/lambda. [rad/m]
    roughness_rms_m : float
        RMS height. [m]
    volume_albedo : float
        Share of the power that enters the material and comes out again by volume scattering, 0 to 1. [-]
    cos_incidence : array_like
        Cosine of the angle of incidence. [-]

    Returns
    -------
    array
        |R|^2 (1 - e^{-4 k^2 s^2 cos^2}) + volume_albedo (1 - |R|^2), the smaller of TE and TM. The first term is what
        roughness takes from the coherent echo, so nothing is counted twice; with the coherent
        |R|^2 e^{-4 k^2 s^2 cos^2} the sum is at most 1 for either polarisation.
    """
    if not 0.0 <= volume_albedo <= 1.0:
        raise InputError(f"volume_albedo {volume_albedo}; allowed: 0 to 1")
    lost = 1.0 - coherent_factor(wavenumber, roughness_rms_m, cos_incidence) ** 2
    te, tm = np.asarray(power_te, dtype=np.float64), np.asarray(power_tm, dtype=np.float64)
    return np.asarray(np.minimum(te * lost + volume_albedo * (1.0 - te), tm * lost + volume_albedo * (1.0 - tm)))


def limit_sigma0(
    sigma0: Callable[[FloatArray], FloatArray],
    budget: Callable[[FloatArray], FloatArray],
    cos_incidence: ArrayLike,
    *,
    cross_ratio: float = 0.0,
    nodes: int = 256,
) -> FloatArray:
    """Return sigma0, reduced where the surface would otherwise scatter more than its budget.

    Parameters
    ----------
    sigma0 : callable
        Co-polarised backscatter [m^2/m^2] of an array of cosines.
    budget : callable
        Share of the incident power that may be scattered, of an array of cosines; see :func:`diffuse_budget`.
    cos_incidence : array_like
        Cosine of the angle of incidence, 0 to 1. [-]
    cross_ratio : float
        Cross-polarised over co-polarised power, >= 0; counts against the same budget. [-]
    nodes : int
        Gauss-Legendre nodes of the hemisphere integral.

    Returns
    -------
    array [m^2/m^2]

    Notes
    -----
    In the separable model of :func:`diffuse_albedo`, sqrt(sigma0) is multiplied by min(1, budget/albedo) at each angle.
    The integral over the limited function can only be smaller, so the limited surface keeps the bound at every angle.
    """
    cos = np.maximum(np.asarray(cos_incidence, dtype=np.float64), 1e-9)
    plain = sigma0(cos)
    albedo = np.sqrt(plain) * _root_integral(sigma0, nodes) / (2.0 * cos) * (1.0 + cross_ratio)
    allowed = np.maximum(budget(cos), 0.0)
    share = np.where(albedo > allowed, allowed / np.where(albedo > 0.0, albedo, 1.0), 1.0)
    return np.asarray(plain * share**2)
