"""Fast synthesis: a type-3 nonuniform FFT per element pair, with the corrections that make it as exact as asked.

Around the middle of a block of chirps, with s the time from the middle of the sampled window, T the time from the
middle of the block and fc the frequency at s = 0, the phase in cycles is (fc + k s) tau - k tau^2 / 2. A delay linear
in time, tau = d0 + d1 T, gives

    fc d0 - k d0^2 / 2  +  k d0 s  +  (fc - k d0) d1 (1 + k s / fc) T

plus small terms: the targets s and (1 + k s / fc) T of the transform hold the chirp-sample cross term, and the Doppler
shift within a chirp, exactly. Every element pair has its own d0 and d1, so the near-field bend of the array and the
change of angle during the frame are exact too. What bends tau within the block (Chebyshev orders 2 to 4 of T) and what
is left of the quadratic delay term are residual phases of low rank; see ``expansion``. Where they are too large, the
block is cut; see ``blocks``.
"""

from __future__ import annotations

import itertools
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from .._typing import ComplexArray, FloatArray, IntArray
from ..constants import SPEED_OF_LIGHT
from .blocks import Block, Group, cut, group_points
from .direct import direct_field
from .expansion import LowRank
from .signal import Clock, Field, Points

__all__ = ["nufft_field", "worker_count"]

TAU = 2 * np.pi
#: Shares of the accuracy: the transform, the expansion, what is neglected.
TRANSFORM_SHARE, EXPANSION_SHARE, NEGLECTED_SHARE = 0.3, 0.4, 0.2
#: Coarsest rounding of a single-precision coordinate, relative, and the least accuracy single precision is used for.
SINGLE_ULP, SINGLE_ACCURACY = 6e-8, 5e-5
#: Echoes whose residual phases choose the low-rank form.
SAMPLED_ECHOES = 192


def worker_count() -> int:
    """Return OMP_NUM_THREADS where it is set, else the number of cores this process may use."""
    asked = os.environ.get("OMP_NUM_THREADS", "")
    return int(asked) if asked.isdigit() and int(asked) > 0 else len(os.sched_getaffinity(0))


def nufft_field(accuracy: float, workers: int | None = None) -> Field:
    """Return a :data:`~shenron_rt.synthesis.signal.Field` that reaches ``accuracy`` relative to the RMS.

    Parameters
    ----------
    accuracy : float
        Relative to sqrt(sum of abs(amplitude)^2), the RMS of echoes of unrelated phase.
    workers : int, optional
        Threads; default :func:`worker_count`. The bytes of the result do not depend on it.
    """
    return partial(_field, accuracy, workers or worker_count())


def _field(
    accuracy: float,
    workers: int,
    clock: Clock,
    points: Points,
    tx_m: FloatArray,
    rx_m: FloatArray,
    chirp_start_s: FloatArray,
) -> ComplexArray:
    out = np.zeros((len(chirp_start_s), len(rx_m), len(clock.sample_s)), dtype=np.complex128)
    radius = float(max(np.linalg.norm(tx_m), np.linalg.norm(rx_m, axis=1).max()))
    groups = group_points(clock, points, chirp_start_s, radius, NEGLECTED_SHARE * accuracy)
    jobs = _jobs(accuracy, clock, points, groups, tx_m, rx_m, chirp_start_s)
    for (chirps, receiver), part in _in_order(jobs, workers):
        out[chirps, receiver] += part
    return out


Job = tuple[tuple[slice, int], Callable[[], ComplexArray]]


def _jobs(
    accuracy: float,
    clock: Clock,
    points: Points,
    groups: list[Group],
    tx_m: FloatArray,
    rx_m: FloatArray,
    chirp_start_s: FloatArray,
) -> Iterator[Job]:
    """Yield the transforms of a field in a fixed order, with the place of each in the result."""
    cuts = {g.blocks: cut(clock, chirp_start_s, g.blocks) for g in groups if g.blocks}
    for group in groups:
        part = Points(points.amplitude[group.rows], points.position[group.rows], points.velocity[group.rows])
        if group.blocks == 0:
            for j in range(len(rx_m)):
                exact = partial(direct_field, clock, part, tx_m, rx_m[j : j + 1], chirp_start_s)
                yield (slice(None), j), lambda exact=exact: exact()[:, 0]
            continue
        for block in cuts[group.blocks]:
            moved = _Moved.to(part, block.mid_s)
            for j, rx in enumerate(rx_m):
                yield (block.chirps, j), partial(_transform, accuracy, block, moved, tx_m, rx)


def _in_order(jobs: Iterable[Job], workers: int) -> Iterator[tuple[tuple[slice, int], ComplexArray]]:
    """Run jobs on threads and hand their results back in the order of the jobs, a bounded number ahead."""
    if workers == 1:
        for place, work in jobs:
            yield place, work()
        return
    waiting: deque[tuple[tuple[slice, int], Future[ComplexArray]]] = deque()
    with ThreadPoolExecutor(workers) as pool:
        for place, work in jobs:
            waiting.append((place, pool.submit(work)))
            while len(waiting) > 2 * workers:
                first, done = waiting.popleft()
                yield first, done.result()
        for first, done in waiting:
            yield first, done.result()


@dataclass(frozen=True)
class _Moved:
    """Points at the middle of a block, with the products that every element needs."""

    amplitude: ComplexArray
    position: FloatArray
    velocity: FloatArray
    range_square: FloatArray
    along: FloatArray
    speed_square: FloatArray

    @classmethod
    def to(cls, points: Points, time_s: float) -> _Moved:
        p = np.ascontiguousarray((points.position + time_s * points.velocity).T)
        v = np.ascontiguousarray(points.velocity.T)
        return cls(points.amplitude, p, v, (p * p).sum(axis=0), (p * v).sum(axis=0), (v * v).sum(axis=0))

    def range_derivatives(self, element_m: FloatArray) -> list[FloatArray]:
        """Return the distance to an element and its first four time derivatives, at the middle of the block.

        From differentiating r^2 = abs(p + v t - e)^2: r r' = (p - e).v, r'^2 + r r'' = v^2, 3 r' r'' + r r''' = 0.
        """
        square = self.range_square - element_m @ (2 * self.position) + element_m @ element_m
        r = np.sqrt(square)
        inverse = 1 / r
        first = (self.along - element_m @ self.velocity) * inverse
        second = (self.speed_square - first * first) * inverse
        third = -3 * first * second * inverse
        fourth = -(4 * first * third + 3 * second * second) * inverse
        return [r, first, second, third, fourth]


def _transform(accuracy: float, block: Block, points: _Moved, tx_m: FloatArray, rx_m: FloatArray) -> ComplexArray:
    """Sum the echoes of one element pair over one block: (n_chirps, n_samples)."""
    phase = _Phase.of(block, points, tx_m, rx_m)
    middle, half = _centre(phase.residuals)
    used = [i for i, a in enumerate(half) if a > EXPANSION_SHARE / 100 * accuracy]
    amplitudes = [half[i] for i in used]
    parameters = [(phase.residuals[i] - middle[i]) / half[i] for i in used]
    shapes = [block.shapes[i] for i in used]
    rows = _sample_rows(parameters, len(phase.constant))
    form = LowRank.fit(
        amplitudes,
        [x[rows] for x in parameters],
        [b[block.sample_rows] for b in shapes],
        EXPANSION_SHARE * accuracy,
    )
    axes = _Axes.of(block, phase)
    single = accuracy >= SINGLE_ACCURACY and axes.extent * SINGLE_ULP <= TRANSFORM_SHARE * accuracy
    amplitude = _times_phasor(points.amplitude, phase.constant + axes.folds / 2, single)
    sums = _type3(TRANSFORM_SHARE * accuracy, axes, form.strengths(amplitude, parameters))
    total = (sums * form.waves(shapes)).sum(axis=0) if used else sums[0].astype(np.complex128)
    angle = axes.fast_mid * block.targets[0] + axes.slow_mid * block.targets[1]
    for a, b in zip(middle, block.shapes, strict=True):
        angle += a * b
    total *= np.exp(1j * angle)
    return total.reshape(block.time.shape)


def _centre(values: Iterable[FloatArray]) -> tuple[list[float], list[float]]:
    """Return the middle of every array's values, and half of their spread."""
    spans = [(float(x.min()), float(x.max())) for x in values]
    return [(low + high) / 2 for low, high in spans], [(high - low) / 2 for low, high in spans]


def _sample_rows(parameters: list[FloatArray], n: int) -> IntArray:
    """Choose echoes that stand for all: evenly spread rows, and the extremes of every parameter and of their sums."""
    rows = [np.unique(np.linspace(0, n - 1, SAMPLED_ECHOES).astype(int))]
    sums = [*parameters, *(a + s * b for a, b in itertools.combinations(parameters[:3], 2) for s in (1, -1))]
    rows += [np.array([x.argmin(), x.argmax()]) for x in sums]
    return np.unique(np.concatenate(rows))


@dataclass(frozen=True)
class _Phase:
    """Phases of the echoes at one element pair in one block: constant [cycles], linear [rad/s], residual [rad]."""

    constant: FloatArray
    fast: FloatArray
    slow: FloatArray
    residuals: tuple[FloatArray, ...]

    @classmethod
    def of(cls, block: Block, points: _Moved, tx_m: FloatArray, rx_m: FloatArray) -> _Phase:
        there, back = points.range_derivatives(tx_m), points.range_derivatives(rx_m)
        t0, t1, t2, t3, t4 = ((a + b) / SPEED_OF_LIGHT for a, b in zip(there, back, strict=True))
        h, fc, k = block.half_s, block.clock.window_mid_hz, block.clock.slope_hz_per_s
        # Taylor to Chebyshev on [-h, h]:
        # T^2 = h^2 (1 + C2) / 2, T^3 = h^3 (3 C1 + C3) / 4, T^4 = h^4 (3 + 4 C2 + C4) / 8
        d0 = t0 + h**2 / 4 * t2 + h**4 / 64 * t4
        d1 = t1 + h**2 / 8 * t3
        seen = fc - k * d0
        swept = k * h**2 / 4 * d1 * d1
        second = TAU * (seen * (h**2 / 4 * t2 + h**4 / 48 * t4) - swept)
        third = TAU * h**3 / 24 * fc * t3
        fourth = TAU * h**4 / 192 * fc * t4
        cross = TAU * k**2 / fc * block.fast_half_s * h * d0 * d1
        constant = (fc - k / 2 * d0) * d0 - swept
        return cls(constant, TAU * k * d0, TAU * seen * d1, (second, third, fourth, cross))


@dataclass(frozen=True)
class _Axes:
    """Sources and targets of the transform, shifted and scaled: targets within [-1, 1], sources in radians.

    A fast frequency is only known modulo the sampling rate: ``folds`` multiples of it were taken off, each of which
    changes the sign of every other echo where the number of samples is even.
    """

    fast: FloatArray
    slow: FloatArray
    targets: tuple[FloatArray, FloatArray]
    fast_mid: float
    slow_mid: float
    folds: FloatArray
    extent: float

    @classmethod
    def of(cls, block: Block, phase: _Phase) -> _Axes:
        (fast_mid, slow_mid), (fast_half, _) = _centre((phase.fast, phase.slow))
        fast, slow = phase.fast - fast_mid, (phase.slow - slow_mid) * block.slow_half_s
        rate = TAU * block.sample_rate_hz
        folds = np.rint(fast / rate) if fast_half > rate / 2 else np.zeros(1)
        fast = (fast - rate * folds) * block.fast_half_s
        extent = float(np.abs(fast).max() + np.abs(slow).max())
        odd = folds * (len(block.fast_s) - 1)
        return cls(fast, slow, block.unit_targets, fast_mid, slow_mid, odd, extent)


def _times_phasor(amplitude: ComplexArray, cycles: FloatArray, single: bool) -> ComplexArray:
    """Return amplitude exp(j 2 pi cycles), in single precision where that is enough."""
    turn = cycles - np.rint(cycles)
    angle = TAU * turn.astype(np.float32 if single else np.float64)
    phasor = np.empty(len(angle), dtype=np.complex64 if single else np.complex128)
    np.cos(angle, out=phasor.real)
    np.sin(angle, out=phasor.imag)
    phasor *= amplitude.astype(phasor.dtype)
    return phasor


def _type3(accuracy: float, axes: _Axes, rows: ComplexArray) -> ComplexArray:
    """Sum rows[r, q] exp(j (fast_q s + slow_q T')) at the targets: (n_rows, n_targets), in the precision of the rows."""
    import finufft

    real = rows.real.dtype
    sources = axes.fast.astype(real, copy=False), axes.slow.astype(real, copy=False)
    s, slow = (t.astype(real, copy=False) for t in axes.targets)
    sums = finufft.nufft2d3(*sources, rows, s, slow, eps=accuracy, isign=1, nthreads=1, upsampfac=1.25)
    return np.asarray(sums).reshape(len(rows), -1)
