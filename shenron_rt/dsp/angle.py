"""Directions from the virtual array: steering, Bartlett, Capon, MUSIC."""

from __future__ import annotations

import numpy as np

from .._typing import ArrayLike, ComplexArray, FloatArray, IntArray
from ..errors import InputError

__all__ = [
    "azimuth_channels",
    "bartlett",
    "bartlett_2d",
    "capon",
    "covariance",
    "has_elevation",
    "music",
    "refine_peak",
    "sine_grid",
    "steering",
]

#: Two positions closer than this part of a wavelength are one column or one row.
_SAME_POSITION = 1e-3


def steering(
    positions_m: ArrayLike, wavelength_m: float, sine: ArrayLike, sine_elevation: ArrayLike = 0.0
) -> ComplexArray:
    """Return the phasors that a far target leaves on the channels.

    Parameters
    ----------
    positions_m : (n_virtual, 3) array_like
        tx + rx positions (two-way sum), radar frame [m].
    wavelength_m : float
        At f_c [m].
    sine, sine_elevation : (...) array_like
        Direction cosines along y (sin(az) cos(el)) and z (sin(el)).

    Returns
    -------
    (..., n_virtual) complex
        exp(-j 2 pi / lambda u.(tx + rx)): +pi sin(az) a column, since column c stands at y = -c lambda/2.
    """
    p = np.asarray(positions_m, dtype=np.float64)
    s, e = np.broadcast_arrays(np.asarray(sine, dtype=np.float64), np.asarray(sine_elevation, dtype=np.float64))
    forward = np.sqrt(np.maximum(1.0 - s**2 - e**2, 0.0))
    path = np.stack([forward, s, e], axis=-1) @ p.T
    return np.asarray(np.exp(-2j * np.pi / wavelength_m * path), dtype=np.complex128)


def azimuth_channels(positions_m: ArrayLike, wavelength_m: float) -> IntArray:
    """Return the indices of the channels of the azimuth aperture: the row with the most columns, ascending."""
    p = np.asarray(positions_m, dtype=np.float64)
    grid = np.round(p[:, 1:] / (_SAME_POSITION * wavelength_m)).astype(np.int64)
    rows, row_of = np.unique(grid[:, 1], return_inverse=True)
    columns = [len(np.unique(grid[row_of == i, 0])) for i in range(len(rows))]
    return np.flatnonzero(row_of == int(np.argmax(columns)))


def has_elevation(positions_m: ArrayLike, wavelength_m: float) -> bool:
    """Tell whether the array has more than one row."""
    return bool(np.ptp(np.asarray(positions_m, dtype=np.float64)[:, 2]) > _SAME_POSITION * wavelength_m)


def sine_grid(positions_m: ArrayLike, wavelength_m: float) -> FloatArray:
    """Return a grid uniform in the sine of azimuth, ascending from -1: 64 points, or four a beam if that is more.

    An array without azimuth aperture gets the single point 0.
    """
    aperture = float(np.ptp(np.asarray(positions_m, dtype=np.float64)[:, 1]))
    if aperture <= _SAME_POSITION * wavelength_m:
        return np.zeros(1)
    beams = 2 * aperture / wavelength_m + 1
    n = max(64, int(2 ** np.ceil(np.log2(4 * beams))))
    return np.asarray((np.arange(n) - n // 2) * (2.0 / n), dtype=np.float64)


def bartlett(snapshots: ComplexArray, vectors: ComplexArray) -> FloatArray:
    """Return beamformed power; a target of power P a channel reads P.

    Parameters
    ----------
    snapshots : (..., n_virtual) complex
    vectors : (n_direction, n_virtual) complex
        Unit-modulus steering vectors; of a uniform line this is its zero-padded FFT.

    Returns
    -------
    (..., n_direction) ndarray
    """
    beams = snapshots @ (vectors.conj().T / vectors.shape[-1])
    return np.asarray(beams.real**2 + beams.imag**2, dtype=np.float64)


def bartlett_2d(
    snapshots: ComplexArray, positions_m: ArrayLike, wavelength_m: float, sine: ArrayLike, sine_elevation: ArrayLike
) -> FloatArray:
    """Return beamformed power over azimuth and elevation, (..., n_sine, n_sine_elevation); invisible ones 0."""
    s, e = np.meshgrid(np.asarray(sine), np.asarray(sine_elevation), indexing="ij")
    vectors = steering(positions_m, wavelength_m, s, e)
    power = bartlett(snapshots, vectors.reshape(-1, vectors.shape[-1]))
    return np.asarray(power.reshape(*power.shape[:-1], *s.shape) * (s**2 + e**2 <= 1.0), dtype=np.float64)


def covariance(snapshots: ComplexArray) -> ComplexArray:
    """Return the sample covariance of (n_snapshot, n_virtual) snapshots."""
    x = np.atleast_2d(snapshots)
    return np.asarray(x.T @ x.conj() / len(x), dtype=np.complex128)


def capon(covariances: ComplexArray, vectors: ComplexArray, loading: float = 1e-3) -> FloatArray:
    """Return the Capon (minimum variance) spectrum.

    Parameters
    ----------
    covariances : (..., n, n) complex
        Channel covariance.
    vectors : (n_direction, n) complex
        Steering vectors.
    loading : float
        Diagonal loading, relative to the mean channel power; keeps few snapshots invertible.

    Returns
    -------
    (..., n_direction) ndarray
        1 / (a^H R^-1 a) [W], power a channel.

    References
    ----------
    .. [1] J. Capon, Proc. IEEE 57, 1408-1418 (1969), doi:10.1109/PROC.1969.7278.
    """
    n = covariances.shape[-1]
    level = np.trace(covariances, axis1=-2, axis2=-1).real / n
    # an empty covariance stays invertible and reads (almost) nothing
    loaded = covariances + (np.maximum(level, np.finfo(float).tiny ** 0.5) * loading)[..., None, None] * np.eye(n)
    solved = np.linalg.solve(loaded, np.broadcast_to(vectors.T, (*covariances.shape[:-2], n, len(vectors))))
    return np.asarray(1.0 / np.einsum("dn,...nd->...d", vectors.conj(), solved).real, dtype=np.float64)


def music(covariances: ComplexArray, vectors: ComplexArray, sources: int) -> FloatArray:
    """Return the MUSIC pseudo-spectrum n / (a^H E E^H a), E the noise subspace.

    Parameters
    ----------
    covariances : (..., n, n) complex
    vectors : (n_direction, n) complex
    sources : int
        Dimension of the signal subspace, 1 to n - 1. Fully coherent echoes count as one.

    Returns
    -------
    (..., n_direction) ndarray
        Dimensionless; peaks mark directions, their height is no power.

    References
    ----------
    .. [1] R. O. Schmidt, IEEE Trans. Antennas Propag. 34, 276-280 (1986), doi:10.1109/TAP.1986.1143830.
    """
    n = covariances.shape[-1]
    if not 1 <= sources < n:
        raise InputError(f"music: sources must be 1 to {n - 1} for {n} channels, got {sources}")
    _, axes = np.linalg.eigh(covariances)
    leak = np.einsum("dn,...nk->...dk", vectors.conj(), axes[..., : n - sources])
    left = np.sum(leak.real**2 + leak.imag**2, axis=-1)
    return np.asarray(n / np.maximum(left, n * np.finfo(float).eps), dtype=np.float64)


def refine_peak(spectrum: FloatArray, index: IntArray) -> FloatArray:
    """Return the sub-bin offset (-0.5 to 0.5) of peaks by a parabola through the logarithm of three points.

    Parameters
    ----------
    spectrum : (..., n) ndarray
        Positive.
    index : (...) int
        Position of the maximum; at the ends the offset is 0.
    """
    n = spectrum.shape[-1]
    inner = np.clip(index, 1, max(n - 2, 1))
    if n < 3:
        return np.zeros(np.shape(index))
    neighbours = inner[..., None] + np.arange(-1, 2)
    left, mid, right = np.moveaxis(np.log(np.take_along_axis(spectrum, neighbours, axis=-1)), -1, 0)
    curvature = left - 2 * mid + right
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = np.where(curvature < 0, 0.5 * (left - right) / curvature, 0.0)
    return np.where(inner == index, np.clip(offset, -0.5, 0.5), 0.0)
