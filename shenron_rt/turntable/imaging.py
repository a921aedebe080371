"""Range profiles and inverse synthetic aperture images of a target on a turntable.

Both read a point scatterer of RCS sigma as sigma where it stands. Its amplitude is sqrt(sigma) e^{+j 2 k u.p}, with u
the direction to the radar and p its position: phase falls with the distance that it lies behind the origin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._typing import ArrayLike, ComplexArray, FloatArray
from ..constants import SPEED_OF_LIGHT
from ..dsp.windows import window as taper
from ..errors import InputError

__all__ = ["IsarImage", "RangeProfile", "equally_spaced", "isar_image", "range_profile"]

#: Points of a range profile, and pixels of an image, per cell of c/2B or lambda/(2 delta theta).
OVERSAMPLING = 4
#: Most pixels along a side of an image.
_MOST_PIXELS = 1024
#: Error of the nonuniform transform, relative to the brightest pixel of a point.
_ACCURACY = 1e-9
#: How far steps of an axis may differ, as a share of the step.
_UNEVEN = 1e-6


@dataclass(frozen=True, eq=False)
class RangeProfile:
    """High-resolution range profiles.

    Parameters
    ----------
    range_m : (m,) float
        Down range from the target's origin: negative on the radar's side, positive behind it [m].
    amplitude : (m, ...) complex
        Modulus squared is RCS [m].
    cell_m : float
        c/2B, with B the number of frequencies times their step [m].
    extent_m : float
        c/(2 step), beyond which echoes fold [m].
    window : str
        Taper over frequency.
    """

    range_m: FloatArray
    amplitude: ComplexArray
    cell_m: float
    extent_m: float
    window: str


@dataclass(frozen=True, eq=False)
class IsarImage:
    """Inverse synthetic aperture image in the target's x-y plane.

    Parameters
    ----------
    x_m, y_m : (m,) float
        Of the pixels, target frame [m].
    amplitude : (n_y, n_x) complex
        Modulus squared is RCS [m].
    down_cell_m, cross_cell_m : float
        c/2B along the mean direction to the radar, lambda/(2 delta theta) across it [m].
    down_extent_m, cross_extent_m : float
        Beyond which echoes fold: c/(2 step), lambda/(2 step of angle) [m].
    azimuth_deg : float
        Mean direction to the radar.
    window : str
        Taper over frequency and over angle.
    """

    x_m: FloatArray
    y_m: FloatArray
    amplitude: ComplexArray
    down_cell_m: float
    cross_cell_m: float
    down_extent_m: float
    cross_extent_m: float
    azimuth_deg: float
    window: str


def equally_spaced(values: ArrayLike, least: int = 2) -> bool:
    """Return whether values ascend in equal steps, and are at least so many."""
    axis = np.asarray(values, dtype=np.float64)
    if axis.ndim != 1 or len(axis) < max(least, 2):
        return False
    steps = np.diff(axis)
    return bool(steps.min() > 0.0 and np.ptp(steps) <= _UNEVEN * steps.mean())


def range_profile(amplitude: ComplexArray, frequency_hz: ArrayLike, *, window: str = "hann") -> RangeProfile:
    """Return range profiles by a windowed inverse Fourier transform over frequency.

    Parameters
    ----------
    amplitude : (n_freq, ...) complex
        Scattering amplitude, phase referred to the target's origin, as :class:`shenron_rt.RcsSweep` has it [m].
    frequency_hz : (n_freq,) array_like
        Ascending in equal steps, two or more [Hz].
    window : str
        Taper, see :func:`shenron_rt.dsp.window`.

    Returns
    -------
    RangeProfile
        Over one unambiguous extent, with the target's origin in its middle.

    Raises
    ------
    InputError
        Frequencies that are not equally spaced, or of another number than the amplitudes.

    Notes
    -----
    sum of w_n A(f_n) e^{+j 4 pi f_n r/c} over sum of w_n. Two points are told apart by about the window's width
    (1.44 cells at -3 dB for ``hann``).
    """
    frequency = _axis("frequency_hz", frequency_hz, amplitude.shape[0])
    step = float(np.diff(frequency).mean())
    n = len(frequency)
    weight = taper(window, n, False)
    if float(weight.sum()) <= 0.0:
        raise InputError(f"frequency_hz: {n} frequencies are too few for the window {window!r}; give more, or 'rect'")
    points = OVERSAMPLING * n
    extent = SPEED_OF_LIGHT / (2.0 * step)
    number = np.arange(points) - points // 2
    shaped = weight.reshape(-1, *[1] * (amplitude.ndim - 1)) / weight.sum() * amplitude
    profile = np.fft.fftshift(np.fft.ifft(shaped, points, axis=0), axes=0) * points
    range_m = number * extent / points
    carrier = np.exp(4j * np.pi * frequency[0] / SPEED_OF_LIGHT * range_m)
    profile = profile * carrier.reshape(-1, *[1] * (amplitude.ndim - 1))
    return RangeProfile(range_m, profile, extent / n, extent, window)


def isar_image(
    amplitude: ComplexArray,
    frequency_hz: ArrayLike,
    azimuth_deg: ArrayLike,
    *,
    elevation_deg: float = 0.0,
    size_m: float | None = None,
    window: str = "hann",
) -> IsarImage:
    """Return an image by direct back-projection of every frequency and angle onto the target's x-y plane.

    Parameters
    ----------
    amplitude : (n_freq, n_az) complex
        Scattering amplitude, phase referred to the target's origin, far field [m].
    frequency_hz : (n_freq,) array_like
        Ascending in equal steps [Hz].
    azimuth_deg : (n_az,) array_like
        Ascending in equal steps, less than a full circle.
    elevation_deg : float
        Of the radar.
    size_m : float, optional
        Side of the square image, centred on the target's origin. Default: the smaller unambiguous extent.
    window : str
        Taper over both, see :func:`shenron_rt.dsp.window`.

    Returns
    -------
    IsarImage

    Raises
    ------
    InputError
        Axes that are not equally spaced or do not fit the amplitudes, a full circle, or a size that is not positive.

    Notes
    -----
    sum of w A e^{-j 2 k u.p} over sum of w, by a type-1 nonuniform FFT over the polar grid of wave vectors: exact for
    any span of angles, no polar reformatting and no blur by rotation. A point of sigma that keeps its amplitude over
    the span reads sigma; glints that do not read less. What lies above or below the plane is moved towards or from the
    radar by z tan(elevation) (layover).

    References
    ----------
    .. [1] D. L. Mensa, *High Resolution Radar Cross-Section Imaging*, Artech House, 1991, chapter 4.
    """
    import finufft

    frequency = _axis("frequency_hz", frequency_hz, amplitude.shape[0])
    azimuth = _axis("azimuth_deg", azimuth_deg, amplitude.shape[1])
    f_step, a_step = float(np.diff(frequency).mean()), np.radians(float(np.diff(azimuth).mean()))
    span = a_step * len(azimuth)
    if span > 2.0 * np.pi:
        raise InputError(f"azimuth_deg: {np.degrees(span):.0f} degrees; an image needs less than a full circle")
    flat = float(np.cos(np.radians(elevation_deg)))
    wavelength = SPEED_OF_LIGHT / (float(frequency.mean()) * flat)
    extents = SPEED_OF_LIGHT / (2.0 * f_step * flat), wavelength / (2.0 * a_step)
    cells = extents[0] / len(frequency), wavelength / (2.0 * span)
    size = min(extents) if size_m is None else size_m
    if not size > 0.0:
        raise InputError(f"size_m: {size_m}; allowed: > 0")
    pixels = int(min(np.ceil(OVERSAMPLING * size / min(cells) / 2.0) * 2, _MOST_PIXELS))
    pixel = size / pixels
    along = 4.0 * np.pi * flat / SPEED_OF_LIGHT * frequency[:, None] * pixel
    angle = np.radians(azimuth)[None, :]
    weight = np.outer(taper(window, len(frequency), False), taper(window, len(azimuth), False))
    if float(weight.sum()) <= 0.0:
        raise InputError(f"isar_image: too few frequencies or angles for the window {window!r}; give more, or 'rect'")
    strengths = np.ascontiguousarray((weight / weight.sum() * amplitude).ravel(), dtype=np.complex128)
    turns = [_principal(along * part).ravel() for part in (np.sin(angle), np.cos(angle))]  # y runs over rows
    image = finufft.nufft2d1(*turns, strengths, (pixels, pixels), isign=-1, eps=_ACCURACY, nthreads=1)
    place = (np.arange(pixels) - pixels // 2) * pixel
    middle = float(azimuth.mean())
    return IsarImage(place, place, np.asarray(image), *cells, *extents, middle, window)


def _principal(angle: FloatArray) -> FloatArray:
    """Return angles in [-pi, pi)."""
    return np.asarray(np.mod(angle + np.pi, 2.0 * np.pi) - np.pi)


def _axis(name: str, values: ArrayLike, n: int) -> FloatArray:
    axis = np.asarray(values, dtype=np.float64)
    if axis.shape != (n,):
        raise InputError(f"{name}: {n} values are needed, as many as amplitudes, got shape {axis.shape}")
    if not equally_spaced(axis):
        raise InputError(f"{name}: two or more values that ascend in equal steps are needed")
    return axis
