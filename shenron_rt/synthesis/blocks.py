"""How a frame is cut for the NUFFT: blocks of chirps short enough that an echo's delay is nearly linear in each.

Echoes are sorted into groups that share a cut and a small spread of range curvature. The choice depends on the echoes
alone, never on the number of threads, so the order of every sum is fixed.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from .._parallel import map_blocks
from .._typing import BoolArray, FloatArray, IntArray
from ..constants import SPEED_OF_LIGHT
from .expansion import MAX_AMPLITUDE, ranks
from .signal import Clock, Points, dot

__all__ = ["Block", "Group", "cut", "group_points"]

#: Costs in nanoseconds, of one core, to choose by: of a transform; per point of it, and per point and term; per term,
#: per term and cell of its grid, and per term and sample; of the exact sum per point and sample.
COST_TRANSFORM, COST_POINT, COST_SPREAD = 0.8e6, 60.0, 40.0
COST_TERM, COST_CELL, COST_SAMPLE, COST_EXACT = 0.2e6, 20.0, 15.0, 55.0
#: Most points of one transform; bounds the memory.
CHUNK = 1 << 17


@dataclass(frozen=True)
class Block:
    """Consecutive chirps of a frame, and the functions of a sample that the NUFFT and its corrections use.

    Parameters
    ----------
    clock : Clock
    chirps : slice
        Of the chirps handed in.
    time : (n_chirps, n_samples) float
        Of the samples, from the middle of the frame [s].
    """

    clock: Clock
    chirps: slice
    time: FloatArray

    @cached_property
    def mid_s(self) -> float:
        """Middle of the block from the middle of the frame [s]."""
        return float(self.time[0, 0] + self.time[-1, -1]) / 2

    @cached_property
    def half_s(self) -> float:
        """Half of its length [s]."""
        return float(self.time[-1, -1] - self.time[0, 0]) / 2

    @cached_property
    def fast_s(self) -> FloatArray:
        """(n_samples,) time from the middle of the sampled window [s]."""
        values: FloatArray = self.clock.sample_s - self.clock.window_mid_s
        return values

    @cached_property
    def stretch(self) -> FloatArray:
        """(n_samples,) instantaneous frequency over that at the middle of the window."""
        values: FloatArray = 1 + self.clock.slope_hz_per_s / self.clock.window_mid_hz * self.fast_s
        return values

    @cached_property
    def targets(self) -> tuple[FloatArray, FloatArray]:
        """Samples flattened: fast time [s], and stretched time from the middle of the block [s]."""
        slow = self.stretch * (self.time - self.mid_s)
        return np.tile(self.fast_s, len(self.time)), slow.ravel()

    @cached_property
    def shapes(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Functions b of the residual phases, flattened: Chebyshev orders 2, 3, 4 of time, and fast time times time."""
        x = (self.time - self.mid_s) / self.half_s
        square = x * x
        powers = (2 * square - 1, (4 * square - 3) * x, 8 * square * (square - 1) + 1)
        second, third, fourth = ((self.stretch * p).ravel() for p in powers)
        return second, third, fourth, (self.fast_s * x / self.fast_half_s).ravel()

    @cached_property
    def unit_targets(self) -> tuple[FloatArray, FloatArray]:
        """The targets scaled to [-1, 1]."""
        fast, slow = self.targets
        return fast / self.fast_half_s, slow / self.slow_half_s

    @cached_property
    def slow_half_s(self) -> float:
        """Largest stretched time from the middle of the block [s]."""
        return float(np.abs(self.targets[1]).max())

    @cached_property
    def sample_rows(self) -> IntArray:
        """Flat indices of samples that represent all: ends included, denser there, in both directions."""
        chirps, samples = self.time.shape
        slow, fast = (np.unique(np.rint((n - 1) * _toward_ends(k))) for n, k in ((chirps, 15), (samples, 7)))
        rows: IntArray = (slow[:, None] * samples + fast).ravel().astype(int)
        return rows

    @property
    def sample_rate_hz(self) -> float:
        """Sampling rate of the ADC [Hz]."""
        return (len(self.fast_s) - 1) / (2 * self.fast_half_s)

    @property
    def fast_half_s(self) -> float:
        """Half of the sampled window, first to last sample [s]."""
        return float(self.fast_s[-1])


def _toward_ends(count: int) -> FloatArray:
    """Return Chebyshev extrema on [0, 1]."""
    values: FloatArray = (1 - np.cos(np.pi * np.arange(count) / (count - 1))) / 2
    return values


def cut(clock: Clock, chirp_start_s: FloatArray, count: int) -> list[Block]:
    """Cut the chirps into ``count`` blocks of nearly equal size."""
    edges = np.linspace(0, len(chirp_start_s), count + 1).round().astype(int)
    time = chirp_start_s[:, None] + clock.sample_s - clock.frame_mid_s
    return [Block(clock, slice(int(a), int(b)), time[a:b]) for a, b in itertools.pairwise(edges) if b > a]


@dataclass(frozen=True)
class Group:
    """Rows of the points that share a cut into ``blocks`` blocks; 0 blocks stands for the exact sum."""

    blocks: int
    rows: IntArray


def group_points(
    clock: Clock, points: Points, chirp_start_s: FloatArray, array_radius_m: float, tolerance: float
) -> list[Group]:
    """Sort echoes into groups by the number of blocks they need and by range curvature.

    Parameters
    ----------
    clock : Clock
    points : Points
    chirp_start_s : (n_chirps,) float
    array_radius_m : float
        Largest distance of an element from the origin; bounds hold for all elements.
    tolerance : float
        Largest phase that may be neglected [rad].

    Returns
    -------
    list of Group
        Each of at most ``CHUNK`` rows.
    """
    todo = np.arange(len(points))
    bound = _Bounds.of(clock, points, chirp_start_s, array_radius_m)
    order = bound.delay_rate_cells()
    groups: list[Group] = []
    samples = len(chirp_start_s) * len(clock.sample_s)
    count = 1
    while len(todo) and count <= len(chirp_start_s):
        half = max(block.half_s for block in cut(clock, chirp_start_s, count))
        curvature, neglected = bound.phases(clock, half)
        fits = (curvature <= 2 * MAX_AMPLITUDE) & (neglected <= tolerance)
        term = COST_TERM + COST_CELL * bound.cells(clock, half) + COST_SAMPLE * samples / count
        for rows, cost in _by_curvature(curvature[fits], 4 * tolerance, term):
            exact = COST_EXACT * samples * len(rows)
            groups.append(Group(count if count * cost < exact else 0, todo[fits][rows]))
        todo, bound = todo[~fits], bound.part(~fits)
        count = min(2 * count, len(chirp_start_s)) if count < len(chirp_start_s) else count + 1
    if len(todo):
        groups.append(Group(0, todo))
    return [
        Group(g.blocks, rows)
        for g in groups
        for rows in np.array_split(_in_order(g.rows, order), -(-len(g.rows) // CHUNK))
    ]


def _in_order(rows: IntArray, order: IntArray) -> IntArray:
    # a stable sort of 16-bit numbers is a radix sort
    found: IntArray = rows[np.argsort(order[rows], kind="stable")]
    return found


@dataclass(frozen=True)
class _Bounds:
    """What bounds the derivatives of the range along a straight path, for every element of the array.

    With d the distance of the path's line from the origin and r the least range of the path, r'' = V^2 d^2 / r^3 is at
    most ``curvature``; the n-th derivative over n! falls like (V / r)^n, the series of a hyperbola.
    """

    curvature: FloatArray
    speed: FloatArray
    least: FloatArray
    farthest: FloatArray
    range: FloatArray
    rate: FloatArray

    @classmethod
    def of(cls, clock: Clock, points: Points, chirp_start_s: FloatArray, radius: float) -> _Bounds:
        """Bound one leg; of two that differ, what is worse for either."""
        if points.sent is not None:
            legs = [cls.of(clock, p, chirp_start_s, radius) for p in (replace(points, sent=None), points.sent)]
            merge = {"least": np.minimum}
            return cls(*(merge.get(f.name, np.maximum)(*(getattr(b, f.name) for b in legs)) for f in fields(cls)))
        first = float(chirp_start_s.min() + clock.sample_s[0]) - clock.frame_mid_s
        last = float(chirp_start_s.max() + clock.sample_s[-1]) - clock.frame_mid_s
        found = np.empty((6, len(points)))

        def fill(part: slice) -> None:
            p, v = points.position[part].T, points.velocity[part].T
            square, along, range_square = dot(v, v), dot(p, v), dot(p, p)
            r, speed = np.sqrt(range_square), np.sqrt(square)
            safe = np.where(square > 0, square, 1.0)
            line = np.sqrt(np.maximum(range_square - along**2 / safe, 0.0))
            closest = np.clip(-along / safe, first, last)
            least = np.sqrt(np.maximum(range_square + (2 * along + square * closest) * closest, 0.0)) - radius
            farthest = r + speed * max(abs(first), abs(last)) + radius
            with np.errstate(divide="ignore"):
                inverse = np.where(least > 0, 1 / np.maximum(least, 1e-300), np.inf)
            lever = np.minimum((line + radius) * inverse, 1.0)
            curvature = np.where(square > 0, square * lever**2 * np.minimum(inverse, 1e9), 0.0)
            rate = along / np.maximum(r, 1e-9)
            found[:, part] = curvature, speed, np.maximum(least, 1e-9), farthest, r, rate

        map_blocks(fill, len(points))
        return cls(*found)

    def delay_rate_cells(self) -> IntArray:
        """Return (n,) cell numbers by range rate, then range: points in this order are near each other on the grid."""
        if not len(self.range):
            return np.zeros(0, dtype=np.int16)
        cells = [
            np.minimum((x - x.min()) * (n / max(float(np.ptp(x)), 1e-9)), n - 1).astype(np.int16)
            for x, n in ((self.rate, 64), (self.range, 256))
        ]
        found: IntArray = cells[0] * np.int16(256) + cells[1]
        return found

    def part(self, rows: BoolArray) -> _Bounds:
        """Return those of some echoes."""
        return _Bounds(*(getattr(self, f.name)[rows] for f in fields(self)))

    def cells(self, clock: Clock, half: float) -> float:
        """Estimate the cells of a grid, twice oversampled, from the spread of delay and rate."""
        if not len(self.speed):
            return 0.0
        swept = 2 * clock.slope_hz_per_s / SPEED_OF_LIGHT * float(np.ptp(clock.sample_s))
        fast = 2 * min(swept * float(np.ptp(self.farthest)), len(clock.sample_s))
        slow = 16 * clock.window_mid_hz / SPEED_OF_LIGHT * float(self.speed.max()) * half
        return (fast + 16) * (slow + 16)

    def phases(self, clock: Clock, half: float) -> tuple[FloatArray, FloatArray]:
        """Return the amplitude of the curvature phase, and a bound of what is neglected, in blocks of +-half [rad]."""
        chirpiness = clock.slope_hz_per_s / clock.window_mid_hz
        fast = chirpiness * float(np.ptp(clock.sample_s)) / 2
        found = np.empty((2, len(self.rate)))

        def fill(part: slice) -> None:
            curvature = (np.pi * clock.window_mid_hz / SPEED_OF_LIGHT * half**2) * self.curvature[part]
            travel = half * self.speed[part]
            ratio = travel / self.least[part]
            # fifth order and beyond: the leading Chebyshev coefficient of x^5 is 1/16
            series = np.where(ratio < 0.5, curvature * (ratio * ratio * ratio) / 8, np.inf)
            # the quadratic delay term -k tau^2 / 2 beyond what moves into frequency, curvature and the fast x slow term
            moved = 2 / SPEED_OF_LIGHT * travel
            cross = chirpiness * (2 * fast / SPEED_OF_LIGHT * self.farthest[part] + moved) * curvature
            late = (np.pi / 2 * clock.slope_hz_per_s * fast) * (moved * moved)
            found[:, part] = curvature, series + cross + late

        map_blocks(fill, len(self.rate))
        return found[0], found[1]


def _by_curvature(phase: FloatArray, tolerance: float, term_cost: float) -> list[tuple[IntArray, float]]:
    """Cut curvature phases into groups of small spread where that saves transforms.

    Dynamic programming over fixed edges with the costs above; ``tolerance`` is that of the expansion, ``term_cost``
    that of one term without its points. Returns rows, and cost, of every group.
    """
    if not len(phase):
        return []
    edges = np.unique(np.concatenate([np.geomspace(tolerance, 2 * MAX_AMPLITUDE, 24), np.linspace(0, 6, 13)]))
    cell = np.concatenate(map_blocks(lambda part: np.searchsorted(edges, phase[part]), len(phase)))
    counts = np.bincount(cell, minlength=len(edges) + 1)
    at = np.concatenate([[0], np.flatnonzero(counts) + 1])
    before = np.concatenate([[0], np.cumsum(counts)])
    lower = np.concatenate([[0.0], edges])[at[:-1]]
    terms = ranks((edges[np.minimum(at[1:] - 1, len(edges) - 1)] - lower[:, None]) / 2, tolerance)
    size = before[at[1:]] - before[at[:-1], None]
    costs = COST_TRANSFORM + term_cost * terms + size * (COST_POINT + COST_SPREAD * terms)
    best, back = np.zeros(len(at)), [0]
    for j in range(1, len(at)):
        through = best[:j] + costs[:j, j - 1]
        back.append(int(np.argmin(through)))
        best[j] = through[back[j]]
    groups, j = [], len(at) - 1
    while j > 0:
        rows = np.flatnonzero((cell >= at[back[j]]) & (cell < at[j]))
        groups.append((rows, float(best[j] - best[back[j]])))
        j = back[j]
    return groups[::-1]
