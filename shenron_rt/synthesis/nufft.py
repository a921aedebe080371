"""Fast synthesis: a type-3 nonuniform FFT per element pair, with the corrections that make it as exact as asked.

Around the middle of a block of chirps, with s the time from the middle of the sampled window, T the time from the
middle of the block and fc the frequency at s = 0, the phase in cycles is (fc + k s) tau - k tau^2 / 2. A delay linear
in time, tau = d0 + d1 T, gives

    fc d0 - k d0^2 / 2  +  k d0 s  +  (fc - k d0) d1 (1 + k s / fc) T

plus small terms: the targets s and (1 + k s / fc) T of the transform hold the chirp-sample cross term, and the Doppler
shift within a chirp, exactly. Every element pair has its own d0 and d1, so the near-field bend of the array and the
change of angle during the frame are exact too. What bends tau within the block (Chebyshev orders 2 to 4 of T) and what
is left of the quadratic delay term are residual phases of low rank; see ``expansion``. Where they are too large, the
block is cut; see ``blocks``. The transform itself is in ``gridding``.
"""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial

import numpy as np

from .._typing import ComplexArray, FloatArray
from .blocks import Group, cut, group_points
from .delays import MovedPoints
from .direct import direct_field
from .signal import Clock, Field, Points
from .transform import NEGLECTED_SHARE, Prepared

__all__ = ["nufft_field", "worker_count"]


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
    # echoes of first surfaces are summed as if no others were there
    for legs in points.by_legs():
        groups = group_points(clock, legs, chirp_start_s, radius, NEGLECTED_SHARE * accuracy)
        jobs = _jobs(accuracy, clock, legs, groups, tx_m, rx_m, chirp_start_s)
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
        if group.blocks == 0:
            part = points[group.rows]
            for j in range(len(rx_m)):
                yield (slice(None), j), partial(_exact, clock, part, tx_m, rx_m[j], chirp_start_s)
            continue
        for block in cuts[group.blocks]:
            ready = Prepared.of(accuracy, block, MovedPoints.at(points, group.rows, block.mid_s), tx_m, rx_m)
            for j, rx in enumerate(rx_m):
                yield (block.chirps, j), partial(ready.transform, rx)


def _exact(clock: Clock, points: Points, tx_m: FloatArray, rx_m: FloatArray, chirp_start_s: FloatArray) -> ComplexArray:
    return direct_field(clock, points, tx_m, rx_m[None], chirp_start_s)[:, 0]


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
