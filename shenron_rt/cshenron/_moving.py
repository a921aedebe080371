"""Many chirps of moving points: channel by channel, one type-3 nonuniform FFT over chirp and sample.

With h the change of the delay from chirp to chirp, d the channel's delay and tau_d = tau + i d, the phase in cycles is

    tau_d (f - k tau_d / 2)  +  k tau_d t  +  n h (f - k tau_d) (1 + k t / f)
                             +  (k^2 / f) tau_d h n t  -  k n^2 h^2 / 2.

The targets t and n (1 + k t / f) of the transform hold the range migration exactly. The last two terms are thousandths
of a radian for cars; their phasor is a short Taylor series in two products.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from .._parallel import pool
from .._typing import ComplexArray, FloatArray
from .radar import ReleasedRadar

__all__ = ["channel_sums"]

TAU = 2 * math.pi
#: Residual phases above this are cut by splitting the chirps in halves [rad].
LARGEST_RESIDUAL = 0.3


def channel_sums(
    radar: ReleasedRadar,
    strength: FloatArray,
    delay: FloatArray,
    hop: FloatArray,
    step: FloatArray,
    accuracy: float,
) -> ComplexArray:
    """Sum points over all chirps, channels and samples.

    Parameters
    ----------
    radar : ReleasedRadar
    strength : (n,) float
    delay, hop, step : (n,) float
        Two-way delay at chirp 0, its change per chirp, delay per channel [s].
    accuracy : float
        Relative to sqrt(sum of abs(strength)^2).

    Returns
    -------
    (chirps, channels, samples) complex128
    """
    out = np.zeros(radar.shape, dtype=np.complex128)
    for first, last in _blocks(radar, delay, hop, step):
        start, chirps = delay + first * hop, last - first

        def one(channel: int, start: FloatArray = start, chirps: int = chirps) -> ComplexArray:
            return _channel(radar, strength, start + channel * step, hop, chirps, accuracy)

        for channel, part in enumerate(pool().map(one, range(radar.channels))):
            out[first:last, channel] = part
    return out


def _blocks(radar: ReleasedRadar, delay: FloatArray, hop: FloatArray, step: FloatArray) -> list[tuple[int, int]]:
    """Cut the chirps into equal runs over which the residual phases stay small."""
    furthest = float(np.abs(delay).max() + radar.channels * np.abs(step).max())
    fastest = float(np.abs(hop).max())
    count = radar.chirps
    while count > 1 and _residual(radar, furthest, fastest, count) > LARGEST_RESIDUAL:
        count = -(-count // 2)
    return [(a, min(a + count, radar.chirps)) for a in range(0, radar.chirps, count)]


def _residual(radar: ReleasedRadar, furthest: float, fastest: float, chirps: int) -> float:
    window = radar.samples / radar.sample_rate_hz
    cross = radar.slope**2 / radar.start_hz * furthest * fastest * chirps * window
    return TAU * (cross + radar.slope * (chirps * fastest) ** 2 / 2)


def _channel(
    radar: ReleasedRadar,
    strength: FloatArray,
    delay: FloatArray,
    hop: FloatArray,
    chirps: int,
    accuracy: float,
) -> ComplexArray:
    """Sum one channel over a run of chirps: (chirps, samples)."""
    import finufft

    f, k = radar.start_hz, radar.slope
    t, n = np.arange(radar.samples) / radar.sample_rate_hz, np.arange(chirps)
    fast_targets = np.broadcast_to(t - t[-1] / 2, (chirps, radar.samples)).ravel()
    bent = n[:, None] * (1 + k * t / f)
    middle = float(bent.max()) / 2
    slow_targets = (bent - middle).ravel()
    fast, slow = TAU * k * delay, TAU * hop * (f - k * delay)
    cycles = delay * (f - k * delay / 2) + k * delay * t[-1] / 2
    source = strength * np.exp(1j * (TAU * (cycles - np.rint(cycles)) + slow * middle))
    cross = (TAU * k * k / f * delay * hop, np.multiply.outer(n, t).ravel())
    square = (-TAU * k / 2 * hop**2, np.broadcast_to((n * n)[:, None], (chirps, radar.samples)).ravel().astype(float))
    total = np.zeros(chirps * radar.samples, dtype=np.complex128)
    for weight, parameter, wave in _taylor(cross, square, accuracy / 4):
        eps = float(np.clip(accuracy / (6 * weight), 1e-13, 1e-3))
        sums = finufft.nufft2d3(
            fast, slow, source * parameter, fast_targets, slow_targets, isign=1, eps=eps, nthreads=1
        )
        total += wave * sums
    return total.reshape(chirps, radar.samples)


def _taylor(
    cross: tuple[FloatArray, FloatArray], square: tuple[FloatArray, FloatArray], tolerance: float
) -> list[tuple[float, FloatArray, ComplexArray]]:
    """Return the terms of exp(j (a b + c d)) above the tolerance: largest value, factor per point, factor per target.

    Both factors are scaled so that the first is at most 1.
    """
    scaled: list[tuple[FloatArray, FloatArray, float]] = []
    for point, target in (cross, square):
        top = max(float(np.abs(point).max()), 1e-300)
        scaled.append((point / top, top * target, top * float(np.abs(target).max())))
    (x, u, big_x), (y, w, big_y) = scaled
    terms = []
    for p, q in itertools.product(range(16), repeat=2):
        largest = big_x**p / math.factorial(p) * big_y**q / math.factorial(q)
        if largest > tolerance or p == q == 0:
            wave = np.asarray(1j ** (p + q) * (u**p * w**q), dtype=np.complex128)
            wave /= math.factorial(p) * math.factorial(q)
            terms.append((largest, x**p * y**q, wave))
    return terms
