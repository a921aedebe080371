"""Statistics of an RCS over aspect, in a window that slides along the angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._typing import ArrayLike, FloatArray, IntArray
from ..errors import InputError

__all__ = ["AngularStatistics", "angular_statistics"]

#: Rows gathered at once: bounds memory where a window holds thousands of aspects.
_BLOCK = 512
#: Share of a step by which a window's edge may miss a sample and still hold it: angles come from text and sums.
_SLACK = 1e-6


@dataclass(frozen=True, eq=False)
class AngularStatistics:
    """Statistics of the aspects within half a window to either side of each angle.

    Parameters
    ----------
    angle_deg : (n,) float
        Ascending; where the window stands.
    median_m2, p10_m2, p90_m2 : (n,) float
        Half, a tenth and nine tenths of the aspects lie below [m^2].
    mean_m2 : (n,) float
        Of the linear power [m^2].
    count : (n,) int
        Aspects in the window.
    window_deg : float
        Its full width.
    circular : bool
        Whether the sweep closes, so that windows reach across its ends.
    """

    angle_deg: FloatArray
    median_m2: FloatArray
    p10_m2: FloatArray
    p90_m2: FloatArray
    mean_m2: FloatArray
    count: IntArray
    window_deg: float
    circular: bool


def angular_statistics(angle_deg: ArrayLike, rcs_m2: ArrayLike, window_deg: float = 5.0) -> AngularStatistics:
    """Return the median, the 10 to 90 % band and the mean of an RCS in a sliding angular window.

    Parameters
    ----------
    angle_deg : (n,) array_like
        Aspect angles, in any order; equal directions (-180 and 180) count once.
    rcs_m2 : (n,) array_like
        Linear RCS there [m^2].
    window_deg : float
        Full width of the window, > 0; its edges belong to it. 360 or more is the whole sweep.

    Returns
    -------
    AngularStatistics

    Raises
    ------
    InputError
        Arrays of other shapes, without samples, or a window that is not positive.

    Notes
    -----
    At the ends of a sweep that does not close, windows hold what there is of them. A sweep closes where the gap
    between its last and its first angle is at most 1.5 times its largest step. Percentiles interpolate linearly
    between the sorted powers, as :func:`numpy.percentile` does.

    Examples
    --------
    >>> found = angular_statistics([0.0, 1.0, 2.0], [1.0, 2.0, 6.0], window_deg=2.0)
    >>> found.median_m2.tolist(), found.mean_m2.tolist()
    ([1.5, 2.0, 4.0], [1.5, 3.0, 4.0])
    """
    angle, power = np.asarray(angle_deg, dtype=np.float64), np.asarray(rcs_m2, dtype=np.float64)
    if angle.ndim != 1 or angle.shape != power.shape or not len(angle):
        raise InputError(f"angular_statistics: two lines of one length are needed, got {angle.shape} and {power.shape}")
    if not window_deg > 0.0:
        raise InputError(f"window_deg: {window_deg}; allowed: > 0")
    order = np.argsort(angle, kind="stable")
    angle, power = angle[order], power[order]
    turned = np.mod(angle - angle[0], 360.0)
    kept = np.sort(np.unique(np.round(turned, 9), return_index=True)[1])
    angle, power = angle[kept], power[kept]
    circular = _closes(angle)
    # a full circle is continued to either side by as much as a window can need
    wide, wide_power = angle, power
    if circular:
        wide = np.concatenate([angle - 360.0, angle, angle + 360.0])
        wide_power = np.tile(power, 3)
    half = 0.5 * min(window_deg, 360.0)
    slack = _SLACK * (float(np.diff(angle).min()) if len(angle) > 1 else 1.0)
    first = np.searchsorted(wide, angle - half - slack)
    last = np.searchsorted(wide, angle + half + slack, side="right")
    if circular:
        last = np.minimum(last, first + len(angle))  # a window of 360 degrees holds every aspect once
    rows = [_window(wide_power, first[i : i + _BLOCK], last[i : i + _BLOCK]) for i in range(0, len(angle), _BLOCK)]
    median, low, high, mean = np.concatenate(rows, axis=1)
    return AngularStatistics(angle, median, low, high, mean, last - first, float(window_deg), circular)


def _closes(angle: FloatArray) -> bool:
    if len(angle) < 3:
        return False
    return bool(angle[0] + 360.0 - angle[-1] <= 1.5 * np.diff(angle).max())


def _window(power: FloatArray, first: IntArray, last: IntArray) -> FloatArray:
    """Return (4, n): median, 10 %, 90 %, mean of ``power[first:last]`` for every pair."""
    count = last - first
    index = first[:, None] + np.arange(int(count.max()))
    inside = index < last[:, None]
    values = np.where(inside, power[np.minimum(index, len(power) - 1)], np.inf)
    mean = np.sum(values, axis=1, where=inside) / count
    values.sort(axis=1)
    row = np.arange(len(count))
    out = []
    for share in (0.5, 0.1, 0.9):
        place = share * (count - 1)
        below = np.floor(place).astype(np.int64)
        above = np.minimum(below + 1, count - 1)
        part = place - below
        out.append((1.0 - part) * values[row, below] + part * values[row, above])
    return np.stack([*out, mean])
