"""One block of chirps, one group of echoes: what all element pairs share, and the transform of each."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike

from .._parallel import BLOCK, map_blocks
from .._typing import ComplexArray, FloatArray, IntArray
from .blocks import Block
from .delays import N_RESIDUALS, TAU, MovedPoints, Phases
from .expansion import LowRank
from .gridding import SPACING, Kernel, series

__all__ = ["EXPANSION_SHARE", "NEGLECTED_SHARE", "TRANSFORM_SHARE", "Prepared"]

#: Shares of the accuracy: the transforms, the expansion, what is neglected. The first two are independent errors, the
#: second a bound for the worst echo; they add to 0.62 at most on the roads of the benchmark.
TRANSFORM_SHARE, EXPANSION_SHARE, NEGLECTED_SHARE = 0.45, 0.55, 0.1
#: RMS error of sources one radian from the centre where points are spread, and where the series is summed, in single
#: precision (measured: 4e-8 to 6e-8, 1.0e-7 to 2.5e-7), and the finest accuracy single precision reaches.
SPREAD_ROUNDING, SERIES_ROUNDING, SINGLE_ACCURACY = 5e-8, 1.5e-7, 2.5e-5
#: Echoes of a block of rows whose residual phases choose the low-rank form, at each element pair probed.
SAMPLED_ECHOES = 160
#: Residual phases between the element pairs probed may exceed those found by this factor of their spread.
PROBE_MARGIN = 1.1


@dataclass(frozen=True)
class Prepared:
    """A group of echoes in one block, ready to be summed for any receiver of one transmitter.

    Parameters
    ----------
    accuracy : float
    block : Block
    points : MovedPoints
    to_tx : order + 1 arrays (n,) float
        Distance to the transmitter and its derivatives, these in single precision where that is enough.
    used : tuple of int
        The residual phases that matter.
    middle, half : (len(used),) float
        Centre and half spread of each [rad].
    form : LowRank
    centre : (2,) float
        Of the fast and slow angular frequencies [rad/s].
    kernels : list of Kernel
        For every row of the form.
    coarse : list of bool
        Whether the series of a row is summed in single precision.
    waves : (R, n_samples) complex
        The form at the samples of the block, with the phase of the centres and the correction for the kernel.
    """

    accuracy: float
    block: Block
    points: MovedPoints
    to_tx: list[FloatArray]
    used: tuple[int, ...]
    middle: list[float]
    half: list[float]
    form: LowRank
    centre: FloatArray
    kernels: list[Kernel]
    coarse: list[bool]
    waves: ComplexArray

    @classmethod
    def of(cls, accuracy: float, block: Block, moved: MovedPoints, tx_m: FloatArray, rx_m: FloatArray) -> Prepared:
        """Choose the low-rank form from the echoes, seen from the elements that differ most."""
        every = tuple(range(N_RESIDUALS))
        probes = _probes(rx_m)
        dtype = _precision(accuracy)
        to_tx = [np.empty(len(moved)), *np.empty((4, len(moved)), dtype=dtype)]

        def look(part: slice) -> tuple[FloatArray, IntArray]:
            points = moved.part(part)
            for kept, found in zip(to_tx, points.outward.range_derivatives(tx_m, 4, dtype), strict=True):
                kept[part] = found
            phases = _phases(block, points, [d[part] for d in to_tx], probes[0], every, dtype)
            ends = np.array([(x.min(), x.max()) for x in (phases.fast, phases.slow, *phases.residuals)])
            return ends, part.start + _sample_rows(phases.residuals)

        seen = map_blocks(look, len(moved))
        first, last = np.min([e[:, 0] for e, _ in seen], axis=0), np.max([e[:, 1] for e, _ in seen], axis=0)
        rows = np.concatenate([rows for _, rows in seen])
        few, ways = moved.part(rows), [d[rows] for d in to_tx]
        sampled = np.concatenate([_phases(block, few, ways, rx, every).residuals for rx in probes], axis=1)
        low, high = np.minimum(first[2:], sampled.min(axis=1)), np.maximum(last[2:], sampled.max(axis=1))
        floor = EXPANSION_SHARE / 50 * accuracy
        used = tuple(i for i in every if max(-low[i], high[i]) > floor)
        middle = [float(low[i] + high[i]) / 2 for i in used]
        half = [float(high[i] - low[i]) / 2 * PROBE_MARGIN + floor for i in used]
        parameters = [(sampled[i] - m) / h for i, m, h in zip(used, middle, half, strict=True)]
        shapes = [block.shapes[i] for i in used]
        form = LowRank.fit(half, parameters, [b[block.sample_rows] for b in shapes], EXPANSION_SHARE * accuracy)
        centre = (first + last)[:2] / 2
        extent = _extent(block, *map(float, (last - first)[:2]))
        asked = TRANSFORM_SHARE * accuracy / form.weights
        kernels = [Kernel.reaching(float(eps), _single(eps, SPREAD_ROUNDING * extent)) for eps in asked]
        coarse = [_single(eps, SERIES_ROUNDING * extent) for eps in asked]
        angle = centre[0] * block.targets[0] + centre[1] * block.targets[1]
        for m, b in zip(middle, shapes, strict=True):
            angle += m * b
        waves = form.waves(shapes, block.time.size) * _phasor(angle)
        fast, slow = (SPACING * unit for unit in block.unit_targets)
        for wave, kernel in zip(waves, kernels, strict=True):
            wave *= kernel.correction(fast) * kernel.correction(slow)
        order = 4 if 2 in used else 3 if 1 in used else 2
        return cls(accuracy, block, moved, to_tx[: order + 1], used, middle, half, form, centre, kernels, coarse, waves)

    def transform(self, rx_m: FloatArray) -> ComplexArray:
        """Sum the echoes at one receiver: (n_chirps, n_samples)."""
        n, dtype = len(self.points), _precision(self.accuracy)
        fast, slow, constant = np.empty(n), np.empty(n, dtype=dtype), np.empty(n)
        parameters: list[FloatArray] = [np.empty(n, dtype=dtype) for _ in self.used]
        for first in range(0, n, BLOCK):
            part = slice(first, first + BLOCK)
            points, to_tx = self.points.part(part), [d[part] for d in self.to_tx]
            phases = _phases(self.block, points, to_tx, rx_m, self.used, dtype)
            fast[part], slow[part], constant[part] = phases.fast, phases.slow, phases.constant
            for x, r, m, h in zip(parameters, phases.residuals, self.middle, self.half, strict=True):
                x[part] = (r - m) / h
        axes = _Axes.of(self.block, fast, slow, self.centre)
        amplitude = _times_phasor(self.points.amplitude, constant, axes.flips, dtype)
        return self._sum(axes, self.form.strengths(amplitude, parameters)).reshape(self.block.time.shape)

    def _sum(self, axes: _Axes, rows: ComplexArray) -> ComplexArray:
        """Transform every row no finer than its weight in the result asks for, and add them up."""
        total = np.zeros(self.block.time.size, dtype=np.complex128)
        shape = axes.shape(max(kernel.width for kernel in self.kernels))
        x, y = axes.angles(shape)
        for single in (True, False):
            chosen = [r for r, coarse in enumerate(self.coarse) if coarse is single]
            if not chosen:
                continue
            tolerance = min(self.kernels[r].tolerance for r in chosen)
            at_samples = series(tolerance, single, shape, *self.block.unit_targets)
            for r in chosen:
                grid = np.empty(shape, dtype=self.kernels[r].dtype)
                self.kernels[r].spread(x, y, rows[r], grid)
                total += at_samples(grid) * self.waves[r]
        return total


def _probes(rx_m: FloatArray) -> FloatArray:
    """Return receivers whose views stand for all: the middle one, then the extremes."""
    directions = np.array([[0, 1, 0], [0, 0, 1], [0, 1, 1], [0, 1, -1], [1, 0, 0]], dtype=np.float64)
    along = rx_m @ directions.T
    middle = int(np.linalg.norm(rx_m - rx_m.mean(axis=0), axis=1).argmin())
    extremes = np.unique(np.concatenate([along.argmin(axis=0), along.argmax(axis=0)]))
    return rx_m[[middle, *(i for i in extremes if i != middle)]]


def _phases(
    block: Block,
    points: MovedPoints,
    to_tx: list[FloatArray],
    rx_m: FloatArray,
    used: tuple[int, ...],
    dtype: DTypeLike = np.float64,
) -> Phases:
    """Return the phases at one receiver, small ones in the precision asked for."""
    back = points.range_derivatives(rx_m, len(to_tx) - 1, dtype)
    return Phases.of(block, [a + b for a, b in zip(to_tx, back, strict=True)], used)


def _sample_rows(residuals: list[FloatArray]) -> IntArray:
    """Choose echoes that stand for all: evenly spread rows, and the extremes of every residual and of pair sums."""
    n = len(residuals[0])
    rows = [np.linspace(0, n - 1, min(n, SAMPLED_ECHOES)).astype(int)]
    if n > SAMPLED_ECHOES:
        a, b = (x / (float(np.ptp(x)) or 1.0) for x in residuals[:2])
        rows += [np.array([x.argmin(), x.argmax()]) for x in (*residuals, a + b, a - b)]
    found: IntArray = np.unique(np.concatenate(rows))
    return found


def _ends(values: FloatArray) -> tuple[float, float]:
    return float(values.min()), float(values.max())


@dataclass(frozen=True)
class _Axes:
    """Sources of the transform for targets within [-1, 1], in radians from the centre.

    A fast frequency is only known modulo the sampling rate; where multiples of it were taken off, ``flips`` holds the
    phase this changes, half a cycle for an odd multiple and an even number of samples.
    """

    fast: FloatArray
    slow: FloatArray
    flips: FloatArray | None
    fast_half: float
    slow_half: float

    @classmethod
    def of(cls, block: Block, fast: FloatArray, slow: FloatArray, centre: FloatArray) -> _Axes:
        """Shift and scale angular frequencies [rad/s], in place."""
        fast -= centre[0]
        rate = TAU * block.sample_rate_hz
        flips = None
        if float(np.ptp(fast)) > rate:
            folds = np.rint(fast / rate)
            fast -= rate * folds
            flips = folds * (len(block.fast_s) - 1) / 2
        fast *= block.fast_half_s
        slow -= centre[1]
        slow *= block.slow_half_s
        fast_half, slow_half = (max(high, -low) for low, high in map(_ends, (fast, slow)))
        return cls(fast, slow, flips, fast_half, slow_half)

    def shape(self, width: int) -> tuple[int, int]:
        """Return the even sizes of a grid that holds all sources, spread over ``width`` cells, without wrapping."""
        fast, slow = (2 * math.ceil(half / SPACING + width) for half in (self.fast_half, self.slow_half))
        return fast, slow

    def angles(self, shape: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
        """Return the sources as angles, a grid of ``shape`` being the whole turn."""
        fast, slow = (TAU / (SPACING * cells) * x for cells, x in zip(shape, (self.fast, self.slow), strict=True))
        return fast, slow


def _precision(accuracy: float) -> DTypeLike:
    """Return what is enough for small phases, and for phasors."""
    return np.float32 if accuracy * TRANSFORM_SHARE >= SINGLE_ACCURACY else np.float64


def _times_phasor(
    amplitude: ComplexArray, cycles: FloatArray, flips: FloatArray | None, dtype: DTypeLike
) -> ComplexArray:
    """Return amplitude exp(j 2 pi cycles), in the precision asked for."""
    turn = cycles if flips is None else cycles + flips
    turn = turn - np.rint(turn)
    phasor = _phasor(TAU * turn.astype(dtype, copy=False))
    phasor *= amplitude.astype(phasor.dtype, copy=False)
    return phasor


def _phasor(angle: FloatArray) -> ComplexArray:
    """Return exp(j angle), in the precision of ``angle``."""
    phasor: ComplexArray = np.empty(angle.shape, dtype=np.result_type(angle, np.complex64))
    np.cos(angle, out=phasor.real)
    np.sin(angle, out=phasor.imag)
    return phasor


def _extent(block: Block, fast: float, slow: float) -> float:
    """Return the largest distance of a source from the centre [rad], from the spread of the frequencies [rad/s]."""
    return math.hypot(min(fast, TAU * block.sample_rate_hz) * block.fast_half_s, slow * block.slow_half_s) / 2


def _single(eps: float, rounding: float) -> bool:
    return bool(eps >= SINGLE_ACCURACY and rounding <= eps)
