"""What small-scale roughness takes from the mirror-like part of an echo."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["coherent_factor", "rayleigh_height"]


def coherent_factor(wavenumber: ArrayLike, roughness_rms_m: ArrayLike, cos_incidence: ArrayLike) -> NDArray[np.float64]:
    """Return the factor by which Gaussian roughness reduces the coherent reflected *amplitude*.

    Parameters
    ----------
    wavenumber : array_like
        k = 2 pi/lambda. [rad/m]
    roughness_rms_m : array_like
        RMS height deviation, >= 0. [m]
    cos_incidence : array_like
        Cosine of the angle of incidence, 0 to 1. [-]

    Returns
    -------
    array in (0, 1]
        exp(-2 (k s cos)^2); its square is the power factor exp(-4 k^2 s^2 cos^2).

    References
    ----------
    .. [1] W. S. Ament, Proc. IRE 41, 142-146 (1953), doi:10.1109/JRPROC.1953.274171.

    Examples
    --------
    >>> round(float(20 * np.log10(coherent_factor(1613.8, 0.3e-3, 1.0))), 2)
    -4.07
    """
    phase = np.asarray(wavenumber) * np.asarray(roughness_rms_m) * np.asarray(cos_incidence)
    return np.asarray(np.exp(-2.0 * phase**2), dtype=np.float64)


def rayleigh_height(wavelength_m: ArrayLike, cos_incidence: ArrayLike) -> NDArray[np.float64]:
    """Return the RMS height lambda/(8 cos) [m] above which the Rayleigh criterion calls a surface rough.

    Grazing incidence (cosine 0) gives infinity: every surface is smooth there.
    """
    with np.errstate(divide="ignore"):
        return np.asarray(np.asarray(wavelength_m) / (8.0 * np.asarray(cos_incidence, dtype=np.float64)))
