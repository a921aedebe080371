"""Specific attenuation of the air and of what falls through it [dB/km, one way], and the loss over a radar path."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ._gas_lines import OXYGEN_LINES, WATER_LINES
from .permittivity import water_permittivity

__all__ = ["fog_attenuation", "gas_attenuation", "liquid_water_content", "rain_attenuation", "two_way_loss"]

FloatArray = NDArray[np.float64]

#: Water vapour of the ITU reference atmosphere at the ground (Recommendation ITU-R P.835-6) [g/m^3].
STANDARD_VAPOUR_G_M3 = 7.5
#: Dry pressure of the same atmosphere at the ground [hPa].
STANDARD_PRESSURE_HPA = 1013.25

# Recommendation ITU-R P.838-3 (2005), Tables 1 to 4: rows (a_j, b_j, c_j), then slope m and offset c of the line.
_RAIN_K = {
    "H": (
        (
            (-5.33980, -0.10008, 1.13098),
            (-0.35351, 1.26970, 0.45400),
            (-0.23789, 0.86036, 0.15354),
            (-0.94158, 0.64552, 0.16817),
        ),
        -0.18961,
        0.71147,
    ),
    "V": (
        (
            (-3.80595, 0.56934, 0.81061),
            (-3.44965, -0.22911, 0.51059),
            (-0.39902, 0.73042, 0.11899),
            (0.50167, 1.07319, 0.27195),
        ),
        -0.16398,
        0.63297,
    ),
}
_RAIN_ALPHA = {
    "H": (
        (
            (-0.14318, 1.82442, -0.55187),
            (0.29591, 0.77564, 0.19822),
            (0.32177, 0.63773, 0.13164),
            (-5.37610, -0.96230, 1.47828),
            (16.1721, -3.29980, 3.43990),
        ),
        0.67849,
        -1.95537,
    ),
    "V": (
        (
            (-0.07771, 2.33840, -0.76284),
            (0.56727, 0.95545, 0.54039),
            (-0.20238, 1.14520, 0.26809),
            (-48.2991, 0.791669, 0.116226),
            (48.5833, 0.791459, 0.116479),
        ),
        -0.053739,
        0.83433,
    ),
}


def _regression(log_f: FloatArray, fit: tuple[tuple[tuple[float, float, float], ...], float, float]) -> FloatArray:
    """Return sum_j a_j exp(-((log f - b_j)/c_j)^2) + m log f + c."""
    curves, slope, offset = fit
    a, b, c = np.array(curves).T
    return np.asarray(np.sum(a * np.exp(-(((log_f[..., None] - b) / c) ** 2)), axis=-1) + slope * log_f + offset)


def rain_attenuation(frequency_hz: ArrayLike, rain_mm_h: ArrayLike, polarization: str = "V") -> FloatArray:
    """Return the specific attenuation of rain on a horizontal path.

    Parameters
    ----------
    frequency_hz : array_like
        Frequency, 1 to 1000 GHz. [Hz]
    rain_mm_h : array_like
        Rain rate, >= 0. [mm/h]
    polarization : {"V", "H", "VV", "HH"}
        Only its first letter counts.

    Returns
    -------
    array of the broadcast shape [dB/km, one way]

    Raises
    ------
    InputError
        Frequency outside the recommendation, negative rain, another polarisation.

    References
    ----------
    .. [1] Recommendation ITU-R P.838-3 (2005): gamma = k R^alpha.

    Examples
    --------
    >>> round(float(rain_attenuation(77e9, 25.0, "H")), 2)
    11.41
    """
    frequency, rain = np.asarray(frequency_hz, dtype=np.float64), np.asarray(rain_mm_h, dtype=np.float64)
    if np.any(~((frequency >= 1e9) & (frequency <= 1e12))):
        raise InputError(f"frequency {frequency_hz!r} Hz; allowed: 1e9 to 1e12 (ITU-R P.838-3)")
    if np.any(~(rain >= 0.0)):
        raise InputError(f"rain rate {rain_mm_h!r} mm/h; allowed: >= 0")
    letter = polarization[:1].upper()
    if letter not in _RAIN_K:
        raise InputError(f"polarization {polarization!r}; allowed: V, H, VV, HH")
    log_f = np.log10(frequency / 1e9)
    k = 10.0 ** _regression(log_f, _RAIN_K[letter])
    return np.asarray(k * rain ** _regression(log_f, _RAIN_ALPHA[letter]))


def _line_shape(f: FloatArray, f0: FloatArray, width: FloatArray, interference: FloatArray | float) -> FloatArray:
    near, far = f0 - f, f0 + f
    return np.asarray(
        f
        / f0
        * ((width - interference * near) / (near**2 + width**2) + (width - interference * far) / (far**2 + width**2))
    )


def _oxygen(f: FloatArray, p: FloatArray, e: FloatArray, theta: FloatArray) -> FloatArray:
    """Return N'' of dry air: 44 oxygen lines, their Debye spectrum, pressure-induced nitrogen; inputs (..., 1)."""
    f0, a1, a2, a3, a5, a6 = OXYGEN_LINES.T
    strength = a1 * 1e-7 * p * theta**3 * np.exp(a2 * (1.0 - theta))
    width = a3 * 1e-4 * (p * theta**0.8 + 1.1 * e * theta)
    width = np.sqrt(width**2 + 2.25e-6)  # Zeeman splitting
    interference = (a5 + a6 * theta) * 1e-4 * (p + e) * theta**0.8
    lines = np.sum(strength * _line_shape(f, f0, width, interference), axis=-1)
    f, p, e, theta = f[..., 0], p[..., 0], e[..., 0], theta[..., 0]
    debye = 5.6e-4 * (p + e) * theta**0.8
    dry = 6.14e-5 / (debye * (1.0 + (f / debye) ** 2)) + 1.4e-12 * p * theta**1.5 / (1.0 + 1.9e-5 * f**1.5)
    return np.asarray(lines + f * p * theta**2 * dry)


def _water(f: FloatArray, p: FloatArray, e: FloatArray, theta: FloatArray) -> FloatArray:
    """Return N'' of water vapour: 34 lines and the continuum as a pseudo-line at 1780 GHz."""
    f0, b1, b2, b3, b4, b5, b6 = WATER_LINES.T
    strength = b1 * 1e-1 * e * theta**3.5 * np.exp(b2 * (1.0 - theta))
    width = b3 * 1e-4 * (p * theta**b4 + b5 * e * theta**b6)
    width = 0.535 * width + np.sqrt(0.217 * width**2 + 2.1316e-12 * f0**2 / theta)  # Doppler broadening
    return np.asarray(np.sum(strength * _line_shape(f, f0, width, 0.0), axis=-1))


def gas_attenuation(
    frequency_hz: ArrayLike,
    temperature_c: ArrayLike = 15.0,
    *,
    dry_pressure_hpa: ArrayLike = STANDARD_PRESSURE_HPA,
    vapour_g_m3: ArrayLike = STANDARD_VAPOUR_G_M3,
) -> FloatArray:
    """Return the specific attenuation of air, line by line.

    Parameters
    ----------
    frequency_hz : array_like
        Frequency, 1 to 1000 GHz. [Hz]
    temperature_c : array_like
        Temperature. [degC]
    dry_pressure_hpa : array_like
        Pressure of the dry air (total pressure less that of the vapour). [hPa]
    vapour_g_m3 : array_like
        Water vapour density, >= 0. [g/m^3]

    Returns
    -------
    array of the broadcast shape [dB/km, one way]

    Raises
    ------
    InputError
        A frequency or a state of the air outside the recommendation.

    References
    ----------
    .. [1] Recommendation ITU-R P.676-12 (2019), Annex 1: gamma = 0.1820 f N''(f).

    Examples
    --------
    >>> round(float(gas_attenuation(77e9)), 3)
    0.348
    """
    shapes = np.broadcast_arrays(frequency_hz, temperature_c, dry_pressure_hpa, vapour_g_m3)
    f, celsius, p, rho = (np.asarray(x, dtype=np.float64)[..., None] for x in shapes)
    if np.any(~((f >= 1e9) & (f <= 1e12))):
        raise InputError(f"frequency {frequency_hz!r} Hz; allowed: 1e9 to 1e12 (ITU-R P.676-12)")
    kelvin = celsius + 273.15
    if np.any(~((kelvin > 0.0) & (p > 0.0) & (rho >= 0.0))):
        raise InputError(
            "state of the air: allowed are temperature > -273.15 degC, dry pressure > 0 hPa, vapour >= 0 g/m3"
        )
    f_ghz, theta, e = f / 1e9, 300.0 / kelvin, rho * kelvin / 216.7
    refractivity = _oxygen(f_ghz, p, e, theta) + _water(f_ghz, p, e, theta)
    return np.asarray(0.1820 * f_ghz[..., 0] * refractivity)


def liquid_water_content(visibility_m: ArrayLike) -> FloatArray:
    """Return the liquid water [g/m^3] of fog with a given optical visibility [m].

    Notes
    -----
    M = (0.024/V_km)^1.54. V = 50 m gives 0.32 g/m^3 and V = 300 m gives 0.02 g/m^3, where ITU-R P.840 quotes 0.5 and
    0.05 for thick and medium fog: a factor of about two, which is 0.2 dB of two-way loss over 100 m at most.

    References
    ----------
    .. [1] R. G. Eldridge, J. Atmos. Sci. 23, 605-613 (1966), as used by E. E. Altshuler, IEEE Trans. Antennas
       Propag. 32, 757-758 (1984), doi:10.1109/TAP.1984.1143395.
    """
    visibility = np.asarray(visibility_m, dtype=np.float64)
    if np.any(~(visibility > 0.0)):
        raise InputError(f"fog visibility {visibility_m!r} m; allowed: > 0, or none for no fog")
    return np.asarray((0.024 / (visibility / 1e3)) ** 1.54)


def fog_attenuation(frequency_hz: ArrayLike, visibility_m: ArrayLike, temperature_c: ArrayLike = 15.0) -> FloatArray:
    """Return the specific attenuation of fog by Rayleigh absorption in its droplets.

    Parameters
    ----------
    frequency_hz : array_like
        Frequency, up to 200 GHz. [Hz]
    visibility_m : array_like
        Optical visibility, > 0. [m]
    temperature_c : array_like
        Temperature of the water. [degC]

    Returns
    -------
    array of the broadcast shape [dB/km, one way]

    References
    ----------
    .. [1] Recommendation ITU-R P.840-8 (2019): gamma = K_l M,
       K_l = 0.819 f/(eps'' (1 + eta^2)), eta = (2 + eps')/eps''.
    """
    eps = water_permittivity(frequency_hz, temperature_c)
    loss = -eps.imag
    coefficient = 0.819 * np.asarray(frequency_hz) / 1e9 / (loss * (1.0 + ((2.0 + eps.real) / loss) ** 2))
    return np.asarray(coefficient * liquid_water_content(visibility_m))


def two_way_loss(
    range_m: ArrayLike,
    frequency_hz: float,
    *,
    rain_mm_h: float = 0.0,
    fog_visibility_m: float | None = None,
    temperature_c: float = 15.0,
    polarization: str = "V",
) -> FloatArray:
    """Return the linear factor by which air, rain and fog divide an echo's power.

    Parameters
    ----------
    range_m : array_like
        One-way distance, >= 0. [m]
    frequency_hz : float
        Frequency. [Hz]
    rain_mm_h, fog_visibility_m, temperature_c : float
        The scene's weather; None means no fog.
    polarization : {"V", "H", "VV", "HH"}
        For rain.

    Returns
    -------
    array of the shape of range_m, >= 1

    Notes
    -----
    The vapour is that of the reference atmosphere, 7.5 g/m^3, but never more than saturated air of that temperature
    holds (Magnus formula, WMO-No. 8).
    """
    saturation_hpa = 6.112 * np.exp(17.62 * temperature_c / (243.12 + temperature_c))
    vapour = min(STANDARD_VAPOUR_G_M3, 216.7 * float(saturation_hpa) / (temperature_c + 273.15))
    db_per_km = float(gas_attenuation(frequency_hz, temperature_c, vapour_g_m3=vapour))
    db_per_km += float(rain_attenuation(frequency_hz, rain_mm_h, polarization))
    if fog_visibility_m is not None:
        db_per_km += float(fog_attenuation(frequency_hz, fog_visibility_m, temperature_c))
    return np.asarray(10.0 ** (0.1 * 2.0 * db_per_km * np.asarray(range_m, dtype=np.float64) / 1e3))
