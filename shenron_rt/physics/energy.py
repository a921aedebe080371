"""How much a surface may scatter: the hemispherical energy of a backscatter curve, and the limit it must keep.

What a rough surface sends back incoherently is power that its mirror-like reflection lost, or power that entered and
was scattered out again. Published sigma0 curves know nothing of a model's permittivity and roughness; this makes them
fit.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from .roughness import coherent_factor

__all__ = ["diffuse_albedo", "diffuse_budget", "limit_sigma0"]

FloatArray = NDArray[np.float64]


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
