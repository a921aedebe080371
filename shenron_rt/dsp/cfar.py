"""CFAR detection on a range-Doppler map: CA, GO, SO and OS with a two-dimensional training ring."""

from __future__ import annotations

import numpy as np

from .._typing import FloatArray, IntArray
from ..errors import InputError
from .cfar_constants import check_kind, os_rank
from .cfar_design import CfarWindow, bin_correlation, cfar_multiplier, correlation_reach, training_rows

__all__ = ["cfar_statistic", "cfar_threshold", "default_window"]

#: Cells gathered at once by the ordered-statistic detector; bounds its memory at about 64 MB.
_GATHER_CELLS = 1 << 23


def default_window(
    map_shape: tuple[int, int], windows: tuple[str, str], lengths: tuple[int, int], n_fft: tuple[int, int]
) -> CfarWindow:
    """Return a training ring that fits the map and whose guard keeps the windows' own correlation away from the cell.

    Parameters
    ----------
    map_shape : (int, int)
        (n_range, n_velocity).
    windows, lengths, n_fft : pairs
        Range and Doppler window names, samples, and transform lengths.
    """
    guard, train = [], []
    for size, name, n, padded, wanted in zip(map_shape, windows, lengths, n_fft, (8, 4), strict=True):
        stride = -(-padded // n)
        room = (size - 1) // 2
        guard.append(min(max(2 * stride, correlation_reach(name, n, padded)), room))
        train.append(min(wanted * stride, room - guard[-1]))
    return CfarWindow((train[0], train[1]), (guard[0], guard[1]))


def _sliding_sum(x: FloatArray, width: int, axis: int) -> FloatArray:
    """Return sums of ``width`` consecutive elements, by doubling: sums of positive terms only, so nothing cancels."""
    moved = np.moveaxis(x, axis, 0)
    n_out = len(moved) - width + 1
    total = np.zeros((n_out, *moved.shape[1:]))
    piece, size, start, left = moved, 1, 0, width
    while left:
        if left & 1:
            total += piece[start : start + n_out]
            start += size
        left >>= 1
        if left:
            piece = piece[:-size] + piece[size:]
            size *= 2
    return np.moveaxis(total, 0, axis)


def _strips(power: FloatArray, shape: CfarWindow) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the sums over the training rows before, after and beside every cell; range is zero beyond its ends."""
    (train_r, train_d), (guard_r, _) = shape.train, shape.guard
    reach_r, reach_d = shape.reach
    n_range, n_velocity = power.shape
    wrapped = np.take(power, np.arange(-reach_d, n_velocity + reach_d), axis=1, mode="wrap")
    wide = np.pad(_sliding_sum(wrapped, 2 * reach_d + 1, 1), ((reach_r, reach_r), (0, 0)))
    side = _sliding_sum(wrapped, train_d, 1)
    both = np.pad(side[:, :n_velocity] + side[:, -n_velocity:], ((guard_r, guard_r), (0, 0)))
    rows = _sliding_sum(wide, train_r, 0)
    before, after = rows[:n_range], rows[reach_r + guard_r + 1 :]
    return before, after, _sliding_sum(both, 2 * guard_r + 1, 0)


def _counts(n_range: int, shape: CfarWindow) -> tuple[IntArray, IntArray, IntArray]:
    """Return the number of training cells before, after and beside the cells of every range bin."""
    low, high = training_rows(n_range, shape.reach[0])
    guard = shape.guard[0]
    width = 2 * shape.reach[1] + 1
    beside = (np.minimum(low, guard) + np.minimum(high, guard) + 1) * 2 * shape.train[1]
    return np.maximum(low - guard, 0) * width, np.maximum(high - guard, 0) * width, beside


def _ordered(power: FloatArray, shape: CfarWindow) -> FloatArray:
    reach_r, reach_d = shape.reach
    n_range, n_velocity = power.shape
    box = np.take(power, np.arange(-reach_d, n_velocity + reach_d), axis=1, mode="wrap")
    # cells beyond the ends of range sort last, so the rank of those that exist is not touched
    box = np.pad(box, ((reach_r, reach_r), (0, 0)), constant_values=np.inf)
    views = np.lib.stride_tricks.sliding_window_view(box, (2 * reach_r + 1, 2 * reach_d + 1))
    ring = shape.mask(reach_r, reach_r) > 0
    ranks = np.array([os_rank(int(n)) - 1 for n in np.sum(_counts(n_range, shape), axis=0)])
    statistic = np.zeros_like(power)
    for k in np.unique(ranks):
        rows = np.flatnonzero(ranks == k)
        step = max(1, _GATHER_CELLS // (n_velocity * int(ring.sum())))
        for part in np.array_split(rows, -(-len(rows) // step)):
            statistic[part] = np.partition(views[part][..., ring], k, axis=-1)[..., k]
    return statistic


def cfar_statistic(power: FloatArray, kind: str, shape: CfarWindow) -> FloatArray:
    """Return the training statistic of every cell.

    Parameters
    ----------
    power : (n_range, n_velocity) ndarray
        Doppler wraps, range ends: the ring is cut there.
    kind : {"ca", "go", "so", "os"}
        Mean of the ring; larger or smaller mean of the rows before and after in range; 0.75 quantile of the ring.
    shape : CfarWindow

    Returns
    -------
    (n_range, n_velocity) ndarray
    """
    check_kind(kind)
    n_range, n_velocity = power.shape
    if 2 * shape.reach[1] + 1 > n_velocity or shape.reach[0] >= n_range:
        raise InputError(f"cfar: a ring of half size {shape.reach} does not fit a map of {power.shape} cells")
    if kind in ("go", "so") and shape.train[0] == 0:
        raise InputError(f"cfar {kind!r}: training cells in range are needed, got {shape.train}")
    if kind == "os":
        return _ordered(power, shape)
    before, after, beside = _strips(power, shape)
    n_before, n_after, n_beside = (n[:, None] for n in _counts(n_range, shape))
    if kind == "ca":
        return np.asarray((before + after + beside) / (n_before + n_after + n_beside), dtype=np.float64)
    empty = np.inf if kind == "so" else 0.0
    halves = [
        np.divide(s, n, out=np.full_like(s, empty), where=n > 0) for s, n in ((before, n_before), (after, n_after))
    ]
    return np.asarray(np.minimum(*halves) if kind == "so" else np.maximum(*halves), dtype=np.float64)


def cfar_threshold(
    power: FloatArray,
    *,
    pfa: float,
    kind: str,
    shape: CfarWindow,
    windows: tuple[str, str],
    lengths: tuple[int, int],
    n_fft: tuple[int, int],
    channels: int,
    floor: float = 0.0,
) -> FloatArray:
    """Return the threshold of every cell so that noise alone crosses it with probability ``pfa``.

    Parameters
    ----------
    power : (n_range, n_velocity) ndarray
        Mean over the channels.
    pfa, kind, shape
        As in :func:`~shenron_rt.dsp.cfar_design.cfar_multiplier`.
    windows, lengths, n_fft : pairs
        Range and Doppler window names, samples, and transform lengths.
    channels : int
        Channels behind the mean.
    floor : float
        The statistic is not taken below this: the nominal noise of a cube that carries none. [W]
    """
    if not 0 < pfa < 1:
        raise InputError(f"cfar: pfa must be between 0 and 1, got {pfa}")
    statistic = np.maximum(cfar_statistic(power, kind, shape), floor)
    rho = [
        bin_correlation(name, n, padded, 2 * reach + 1)
        for name, n, padded, reach in zip(windows, lengths, n_fft, shape.reach, strict=True)
    ]
    low, high = training_rows(len(power), shape.reach[0])
    pairs, which = np.unique(np.sort(np.stack([low, high], axis=1), axis=1), axis=0, return_inverse=True)
    alphas = [cfar_multiplier(kind, shape, int(a), int(b), rho[0], rho[1], channels, float(pfa)) for a, b in pairs]
    return np.asarray(statistic * np.asarray(alphas)[which.ravel()][:, None], dtype=np.float64)
