"""Processing of the public C-Shenron code: windows, transforms, images, masks, four-view composite, CFAR, axes."""

from __future__ import annotations

import numpy as np

from .._typing import ArrayLike, BoolArray, ComplexArray, FloatArray
from ..constants import SPEED_OF_LIGHT
from ..errors import InputError

__all__ = [
    "N_ANGLE", "N_DOPPLER", "N_RANGE", "cartesian_image", "cfar", "doppler_slice", "fblr", "range_angle",
    "range_angle_axes", "range_profile", "released_axes", "view_mask",
]  # fmt: skip

#: Points of the range, the angle and the Doppler transform.
N_RANGE, N_ANGLE, N_DOPPLER = 256, 256, 128
#: Pixels along a side of an image, and its side [m].
IMAGE_PIXELS, IMAGE_SPAN_M = 256, 75.0
#: Metres a range bin in the released images, whatever the radar.
IMAGE_RANGE_BIN_M = 150.0 / 256
#: The radar the released axes describe, whatever the profile: start, stop [Hz] and chirp interval [s].
AXES_START_HZ, AXES_STOP_HZ, AXES_CHIRP_S = 24.0e9, 24.25e9, 1.0e-3


def range_profile(adc: ArrayLike) -> ComplexArray:
    """Window and transform samples to range.

    Parameters
    ----------
    adc : (chirps, channels, samples) complex array_like

    Returns
    -------
    (256, chirps, channels) complex
        Symmetric Hann over the samples times symmetric Hann over the chirps; three chirps have the weights 0, 1, 0.
        No amplitude correction.

    Raises
    ------
    InputError
        Not three dimensions; two chirps, whose window is 0, 0; more than 256 samples or antennas.
    """
    data = np.asarray(adc, dtype=np.complex128)
    if data.ndim != 3:
        raise InputError(f"an ADC cube has dimensions (chirp, antenna, sample), got shape {data.shape}")
    if data.shape[0] == 2:
        raise InputError("the released window over two chirps is 0, 0; an image needs one chirp, or three and more")
    if data.shape[1] > N_ANGLE or data.shape[2] > N_RANGE:
        raise InputError(
            f"the released transforms have {N_RANGE} points for samples and {N_ANGLE} for antennas, got a cube of "
            f"shape {data.shape}; shenron_rt.process takes any"
        )
    over_samples, over_chirps = np.hanning(data.shape[2]), np.hanning(data.shape[0])
    windowed = data * over_chirps[:, None, None] * over_samples
    profile: ComplexArray = np.fft.fft(windowed, N_RANGE, axis=2).transpose(2, 0, 1)
    return profile


def range_angle(adc: ArrayLike) -> FloatArray:
    """Return the range-angle map, the sum of magnitudes over the chirps.

    Parameters
    ----------
    adc : (chirps, channels, samples) complex array_like

    Returns
    -------
    (256, 256) float
        Row = range bin, column = 128 + 128 sin(azimuth), growing to the right.
    """
    spectrum = np.fft.fftshift(np.fft.fft(range_profile(adc), N_ANGLE, axis=2), axes=2)
    summed: FloatArray = np.abs(spectrum).sum(axis=1)
    return summed


def doppler_slice(adc: ArrayLike, channel: int = 0) -> ComplexArray:
    """Return the range-Doppler spectrum of one channel: (256, 128), zero velocity at column 64.

    The released image does not use it. Receding is positive.
    """
    profile = range_profile(np.asarray(adc)[:, channel : channel + 1])
    spectrum: ComplexArray = np.fft.fftshift(np.fft.fft(profile[:, :, 0], N_DOPPLER, axis=1), axes=1)
    return spectrum


def _pixel_grid(half_side: float) -> tuple[FloatArray, FloatArray]:
    """Return how far ahead and to the right the pixels are, to ``half_side``: row 0 ahead, last column right."""
    line = np.linspace(-half_side, half_side, IMAGE_PIXELS)
    ahead, right = np.meshgrid(line[::-1], line, indexing="ij")
    return ahead, right


def cartesian_image(polar: ArrayLike, *, range_bin_m: float = IMAGE_RANGE_BIN_M) -> FloatArray:
    """Sample a range-angle map on the released Cartesian grid, at the next lower bins, without interpolation.

    Parameters
    ----------
    polar : (256, 256) array_like
        Map of :func:`range_angle`.
    range_bin_m : float
        Of the map [m]; the released code has 150/256 for every radar.

    Returns
    -------
    (256, 256) float
        75 m a side; row 0 is 37.5 m ahead, column 255 is 37.5 m to the right, the rows behind are 0.
    """
    values = np.asarray(polar, dtype=np.float64)
    if values.ndim != 2:
        raise InputError(f"a range-angle map has two dimensions, got shape {values.shape}")
    ahead, right = _pixel_grid(IMAGE_SPAN_M / 2)
    distance = np.hypot(ahead, right)
    row = np.clip(np.floor(distance / range_bin_m), 0, values.shape[0] - 1).astype(int)
    half = values.shape[1] / 2
    column = np.clip(np.floor(half * np.sin(np.arctan2(right, ahead)) + half), 0, values.shape[1] - 1).astype(int)
    image: FloatArray = values[row, column]
    image[IMAGE_PIXELS // 2 :] = 0.0
    return image


def range_angle_axes(range_resolution_m: float) -> tuple[FloatArray, FloatArray]:
    """Return the axes of a range-angle map of *this* radar.

    Parameters
    ----------
    range_resolution_m : float
        c / 2B.

    Returns
    -------
    range_m : (256,) float
        [m]
    angle_rad : (256,) float
        Positive to the right [rad].
    """
    sine = np.arange(-N_ANGLE // 2, N_ANGLE // 2) / (N_ANGLE / 2)
    return np.arange(N_RANGE, dtype=np.float64) * range_resolution_m, np.arcsin(sine, dtype=np.float64)


def released_axes() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the axes the released code carries: range (255,) [m], angle (256,) [rad], velocity (128,) [m/s].

    They describe a radar of 24.0 to 24.25 GHz with a chirp every millisecond, whatever the profile; for the axes of the
    radar at hand see :func:`range_angle_axes`.
    """
    distance, angle = range_angle_axes(SPEED_OF_LIGHT / (2 * (AXES_STOP_HZ - AXES_START_HZ)))
    center = (AXES_START_HZ + AXES_STOP_HZ) / 2
    bins = np.arange(-N_DOPPLER // 2, N_DOPPLER // 2) / N_DOPPLER
    return distance[:-1], angle, bins / AXES_CHIRP_S * SPEED_OF_LIGHT / (2 * center)


def view_mask(flat_deg: float = 35.0, end_deg: float = 55.0) -> FloatArray:
    """Return the weight of a view's image, for the overlap of four.

    Parameters
    ----------
    flat_deg, end_deg : float
        1 out to the first angle, 0 from the second, linear between [deg].

    Returns
    -------
    (256, 256) float
        On the grid of :func:`cartesian_image`. Built over 256 columns of angle, 180 deg / 128 each.
    """
    half = N_ANGLE // 2
    inner_low, inner_high, low, high = (
        int(angle / 180 * half + half) for angle in (-flat_deg, flat_deg, -end_deg, end_deg)
    )
    weights = np.zeros(N_ANGLE)
    weights[low:inner_low] = np.linspace(0.0, 1.0, inner_low - low)
    weights[inner_low:inner_high] = 1.0
    weights[inner_high:high] = np.linspace(1.0, 0.0, high - inner_high)
    # On a unit square, and in this order: where a pixel lies on the border of two columns, rounding decides.
    ahead, right = _pixel_grid(1.0)
    degrees = np.arctan2(right, ahead) * 180 / np.pi
    mask: FloatArray = weights[np.clip(np.floor(degrees / 180 * half + half), 0, N_ANGLE - 1).astype(int)]
    mask[IMAGE_PIXELS // 2 :] = 0.0
    return mask


def fblr(front: ArrayLike, right: ArrayLike, rear: ArrayLike, left: ArrayLike) -> FloatArray:
    """Return the composite of four views around the vehicle: masked, turned and added.

    Parameters
    ----------
    front, right, rear, left : (256, 256) array_like
        Images of :func:`cartesian_image`.

    Returns
    -------
    (256, 256) float
        Row 0 ahead, last column right, the vehicle in the middle. Linear; the released code feeds it as it is.
    """
    mask = view_mask()
    turned = [np.rot90(np.asarray(v) * mask, k) for v, k in ((front, 0), (left, 1), (rear, 2), (right, 3))]
    composite: FloatArray = sum(turned[1:], turned[0])
    return composite


def cfar(
    cells: ArrayLike,
    *,
    window: tuple[int, int] = (9, 9),
    guard: tuple[int, int] = (3, 3),
    threshold_db: float = 20.0,
    square: bool = True,
) -> BoolArray:
    """Return the hits of the released two-dimensional cell-averaging CFAR.

    Parameters
    ----------
    cells : (rows, columns) array_like, complex or real
    window, guard : (int, int)
        Cells on either side along the columns and along the rows: 9 and 3 are 19 x 19 cells without 7 x 7.
    threshold_db : float
        Ratio to the mean of the training cells, 10^(dB / 10).
    square : bool
        True is the released detector, which squares the magnitude of what it is given, and so takes the fourth power
        of an amplitude where it is fed power, as the released point-cloud routine does. With False, ``cells`` is power
        and is compared as it is: what that routine meant.

    Returns
    -------
    (rows, columns) bool

    Notes
    -----
    At the edges the mean is over the training cells that exist.
    """
    given = np.asarray(cells)
    if given.ndim != 2:
        raise InputError(f"CFAR works on two dimensions, got shape {given.shape}")
    power = np.abs(given) ** 2 if square else given.astype(np.float64)
    training, count = np.zeros(power.shape), np.zeros(power.shape)
    for (columns, rows), sign in ((window, 1.0), (guard, -1.0)):
        training += sign * _box_sum(power, rows, columns)
        count += sign * _box_sum(np.ones(power.shape), rows, columns)
    hits: BoolArray = power * count > 10 ** (threshold_db / 10) * training
    return hits


def _box_sum(values: FloatArray, rows: int, columns: int) -> FloatArray:
    """Return the sum over the cells within ``rows`` and ``columns`` of each, those outside the array being 0."""
    for axis, reach in ((0, rows), (1, columns)):
        n = values.shape[axis]
        running = np.insert(np.cumsum(values, axis=axis), 0, 0.0, axis=axis)
        last, first = np.minimum(np.arange(n) + reach + 1, n), np.maximum(np.arange(n) - reach, 0)
        values = np.take(running, last, axis=axis) - np.take(running, first, axis=axis)
    return values
