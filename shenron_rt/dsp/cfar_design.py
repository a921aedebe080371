"""Threshold multipliers for what really stands in the cells: correlated bins, several channels, cut windows.

Windowing correlates neighbouring bins, and the detector looks at the power summed over n channels. The cell under test
is then gamma distributed, the training statistic T a quadratic form of correlated Gaussians, and the classical
constants give more false alarms than they promise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .._typing import FloatArray, IntArray
from ..errors import InputError
from .cfar_constants import check_kind, os_rank, solve_alpha
from .windows import window

__all__ = ["CfarWindow", "bin_correlation", "cfar_multiplier", "correlation_reach", "quadratic_pfa", "training_rows"]

#: Simulated training sets behind the multipliers of go, so and os, and the seed they come from.
_TRIALS, _SEED = 6000, 77
#: Correlation below which the cell under test counts as independent of a training cell.
_INDEPENDENT = 0.04


@dataclass(frozen=True)
class CfarWindow:
    """Training ring around the cell under test, (range, Doppler) half sizes in bins.

    ``train`` cells follow after ``guard`` cells on each side; (8, 0), (2, 0) is the classical 16-cell range CFAR.
    """

    train: tuple[int, int] = (8, 4)
    guard: tuple[int, int] = (2, 2)

    def __post_init__(self) -> None:
        if min(*self.train, *self.guard) < 0 or not any(self.train):
            raise InputError(f"CfarWindow: sizes must be >= 0 and some train > 0, got {self.train}, {self.guard}")

    @property
    def reach(self) -> tuple[int, int]:
        """Half sizes of the whole ring."""
        return self.train[0] + self.guard[0], self.train[1] + self.guard[1]

    def mask(self, low: int, high: int) -> FloatArray:
        """Return the training cells, 1 inside: rows -low..high, columns -reach..reach; range rows beyond are cut."""
        rows = np.arange(-low, high + 1)[:, None]
        columns = np.arange(-self.reach[1], self.reach[1] + 1)[None]
        ring = (np.abs(rows) > self.guard[0]) | (np.abs(columns) > self.guard[1])
        return np.asarray(ring, dtype=np.float64)


def training_rows(n_range: int, reach: int) -> tuple[IntArray, IntArray]:
    """Return how many rows lie below and above each range bin, at most ``reach``."""
    r = np.arange(n_range)
    return np.minimum(r, reach), np.minimum(n_range - 1 - r, reach)


@lru_cache(maxsize=64)
def bin_correlation(name: str, n: int, n_fft: int, count: int) -> tuple[float, ...]:
    """Return the correlation of white noise in bins 0, 1, ... count - 1 apart under a window of n samples.

    rho_k = sum w^2 cos(2 pi k (i - c) / n_fft) / sum w^2, about the middle c of the window.
    """
    w2 = window(name, n) ** 2
    centre = float(np.sum(w2 * np.arange(n)) / np.sum(w2))
    phase = 2 * np.pi / n_fft * np.outer(np.arange(count), np.arange(n) - centre)
    return tuple(float(v) for v in np.cos(phase) @ w2 / np.sum(w2))


def correlation_reach(name: str, n: int, n_fft: int) -> int:
    """Return how many bins away noise is still correlated (4 %), at most four bins of the unpadded transform."""
    limit = min(n_fft // 2, 4 * -(-n_fft // n))
    rho = np.abs(bin_correlation(name, n, n_fft, limit + 1))
    far = np.flatnonzero(rho > _INDEPENDENT)
    return int(far[-1])


def quadratic_pfa(alpha: float, eigenvalues: FloatArray, channels: int) -> float:
    """Return P(C > alpha T), C ~ Gamma(n)/n, T = sum_i lambda_i Gamma_i(n)/n, all independent, n channels.

    Notes
    -----
    With s = alpha n the tail of C gives Pfa = sum_{k<n} s^k/k! E[T^k e^{-sT}], the first n Taylor coefficients of
    g(z) = prod_i (1 + alpha lambda_i (1 - z))^-n. They follow from the logarithmic derivative of g,
    g_k = (1/k) sum_{j<k} p_j g_{k-1-j} with p_j = n sum_i q_i^{j+1}, q_i = alpha lambda_i/(1 + alpha lambda_i): every
    term is positive, so nothing cancels. One channel leaves prod 1/(1 + alpha lambda_i).
    """
    scaled = alpha * np.maximum(eigenvalues, 0.0)
    log_g0 = -channels * float(np.sum(np.log1p(scaled)))
    q = scaled / (1 + scaled)
    p = channels * np.sum(q ** np.arange(1, channels)[:, None], axis=1)
    g = np.ones(channels)
    for k in range(1, channels):
        g[k] = np.dot(p[:k], g[:k][::-1]) / k
    # the coefficients stay below exp(-log_g0), far from overflow for any window that fits a map
    return float(math.exp(log_g0 + math.log(float(np.sum(g)))))


def _toeplitz(correlation: tuple[float, ...], index: IntArray) -> FloatArray:
    return np.asarray(np.asarray(correlation)[np.abs(index[:, None] - index[None])], dtype=np.float64)


@lru_cache(maxsize=256)
def _eigenvalues(
    shape: CfarWindow, low: int, high: int, rho_range: tuple[float, ...], rho_doppler: tuple[float, ...]
) -> FloatArray:
    """Return the eigenvalues of the covariance of the training cells over their number (unit power; they sum to 1)."""
    mask = shape.mask(low, high)
    row, column = np.nonzero(mask)
    matrix = _toeplitz(rho_range, row) * _toeplitz(rho_doppler, column)
    return np.asarray(np.linalg.eigvalsh(matrix / len(row)), dtype=np.float64)


@lru_cache(maxsize=8)
def _simulated_ring(
    shape: CfarWindow, rho_range: tuple[float, ...], rho_doppler: tuple[float, ...], channels: int
) -> FloatArray:
    """Return simulated noise power in the box around the cell, (trials, rows, columns), unit mean."""
    rng = np.random.default_rng(_SEED)
    rows, columns = 2 * shape.reach[0] + 1, 2 * shape.reach[1] + 1
    colour_r = _root(_toeplitz(rho_range, np.arange(rows)))
    colour_d = _root(_toeplitz(rho_doppler, np.arange(columns)))
    power = np.zeros((_TRIALS, rows, columns))
    for _ in range(channels):
        white = rng.standard_normal((2, _TRIALS, rows, columns))
        power += np.sum((colour_r @ white @ colour_d) ** 2, axis=0)
    return np.asarray(power / (2 * channels), dtype=np.float64)


def _root(matrix: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T, dtype=np.float64)


def _simulated_statistic(kind: str, shape: CfarWindow, low: int, high: int, box: FloatArray) -> FloatArray:
    """Return the training statistic of every simulated box, its range rows cut to -low..high."""
    centre, guard = shape.reach[0], shape.guard[0]
    if kind == "os":
        cells = box[:, centre - low : centre + high + 1][:, shape.mask(low, high) > 0]
        k = os_rank(cells.shape[1]) - 1
        return np.asarray(np.partition(cells, k, axis=1)[:, k], dtype=np.float64)
    halves = [box[:, centre - low : centre - guard], box[:, centre + guard + 1 : centre + high + 1]]
    means = [half.mean(axis=(1, 2)) for half in halves if half.shape[1] > 0]
    return np.asarray(np.max(means, axis=0) if kind == "go" else np.min(means, axis=0), dtype=np.float64)


@lru_cache(maxsize=512)
def cfar_multiplier(
    kind: str,
    shape: CfarWindow,
    low: int,
    high: int,
    rho_range: tuple[float, ...],
    rho_doppler: tuple[float, ...],
    channels: int,
    pfa: float,
) -> float:
    """Return the multiplier that gives ``pfa`` on noise.

    Parameters
    ----------
    kind : {"ca", "go", "so", "os"}
    shape : CfarWindow
    low, high : int
        Range rows that exist below and above the cell.
    rho_range, rho_doppler : tuple of float
        Correlation between bins, from :func:`bin_correlation`.
    channels : int
        Channels whose power is averaged.
    pfa : float

    Notes
    -----
    CA is exact: eigenvalues of the training covariance, see :func:`quadratic_pfa`. The other statistics are simulated
    (fixed seed) and the false-alarm probability averaged over them with the exact tail of the cell under test, which
    leaves a relative error below 1 % where the ring holds some dozens of cells.
    """
    check_kind(kind)
    if kind == "ca":
        eigenvalues = _eigenvalues(shape, low, high, rho_range, rho_doppler)
        return solve_alpha(lambda alpha: quadratic_pfa(alpha, eigenvalues, channels), pfa)
    from scipy.special import gammaincc

    box = _simulated_ring(shape, rho_range, rho_doppler, channels)
    statistic = _simulated_statistic(kind, shape, low, high, box)
    return solve_alpha(lambda alpha: float(np.mean(gammaincc(channels, channels * alpha * statistic))), pfa)
