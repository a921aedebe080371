"""ADC samples by the formula of the public C-Shenron code, exact to the accuracy asked for, at NUFFT speed.

With tau the delay of a point (constant within a chirp, stop and hop) and delta = i d the single-trip extra delay
of virtual channel i, d = sin(azimuth) / (2 f), the phase of a point in cycles is the standard de-chirp phase of their
sum

    f (tau + i d) + k (tau + i d) t - k (tau + i d)^2 / 2.

It is linear in the channel i and the sample m but for k i d t and k i^2 d^2 / 2. About the middle of both grids these
two are small (under 0.3 rad for the released profiles), and depend on the point through x = d / d_max alone: their
phasor is expanded in Chebyshev polynomials T_p(x), with coefficients on the (i, m) grid, and the rest is one type-1
nonuniform FFT per p. The number of terms follows from the accuracy.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from .._parallel import pool
from .._typing import ArrayLike, ComplexArray, FloatArray
from ..echo._shenron_loss import LIGHT_SPEED
from ..errors import InputError
from .radar import ReleasedRadar

__all__ = ["direct_sum", "synthesize_released"]

TAU = 2 * math.pi
#: Terms the direct sum holds at once.
DIRECT_TERMS = 1 << 20
#: A transform is asked to be this much finer than the sum; its error may exceed what it is asked by some.
TRANSFORM_MARGIN = 6.0
#: What single precision can do for modes up to 128: half an ulp of pi, 1.2e-7, times 128, with a margin.
SINGLE_ACCURACY = 3e-5


@dataclass(frozen=True)
class _Points:
    """n points: strength, two-way delay [s], its change from chirp to chirp [s], channel delay d [s]."""

    strength: FloatArray
    delay: FloatArray
    hop: FloatArray
    step: FloatArray


def _points(radar: ReleasedRadar, rho: ArrayLike, theta: ArrayLike, loss: ArrayLike, speed: ArrayLike) -> _Points:
    r, angle = np.asarray(rho, dtype=np.float64), np.asarray(theta, dtype=np.float64)
    power, v = np.asarray(loss, dtype=np.float64), np.broadcast_to(np.asarray(speed, dtype=np.float64), np.shape(r))
    if r.ndim != 1 or angle.shape != r.shape or power.shape != r.shape:
        raise InputError(
            f"rho, theta and loss need one value a point; got shapes {r.shape} {angle.shape} {power.shape}"
        )
    if np.any(r <= 0) or np.any(power < 0):
        raise InputError("rho must be above 0 m and loss at least 0")
    strength = radar.scale * np.sqrt(power) / r
    step = np.sin(np.pi / 2 - angle) / (2 * radar.start_hz)
    return _Points(strength, 2 * r / LIGHT_SPEED, 2 * radar.repetition_s * v / LIGHT_SPEED, step)


def direct_sum(
    radar: ReleasedRadar,
    rho: ArrayLike,
    theta: ArrayLike,
    loss: ArrayLike,
    speed: ArrayLike = 0.0,
    *,
    chirps: slice = slice(None),
) -> ComplexArray:
    """Evaluate the released formula element by element: the reference of :func:`synthesize_released`.

    Parameters
    ----------
    radar, rho, theta, loss, speed
        As for :func:`synthesize_released`.
    chirps : slice
        Which chirps; the others are left out of the result.

    Returns
    -------
    (chirps, channels, samples) complex
    """
    p = _points(radar, rho, theta, loss, speed)
    t = np.arange(radar.samples) / radar.sample_rate_hz
    channel = np.arange(radar.channels)
    numbers = np.arange(radar.chirps)[chirps]
    out = np.zeros((len(numbers), radar.channels, radar.samples), dtype=np.complex128)
    block = max(1, DIRECT_TERMS // (radar.channels * radar.samples))
    for row, n in enumerate(numbers):
        for first in range(0, len(p.delay), block):
            part = slice(first, first + block)
            delay = (p.delay[part] + n * p.hop[part])[:, None] + channel * p.step[part, None]
            cycles = delay[..., None] * (radar.start_hz + radar.slope * (t - delay[..., None] / 2))
            out[row] += np.einsum("q,qim->im", p.strength[part], np.exp(1j * (TAU * cycles)))
    return out


def synthesize_released(
    radar: ReleasedRadar,
    rho: ArrayLike,
    theta: ArrayLike,
    loss: ArrayLike,
    speed: ArrayLike = 0.0,
    *,
    accuracy: float = 1e-7,
) -> ComplexArray:
    """Synthesise the noise-free ADC cube of the released formula.

    Parameters
    ----------
    radar : ReleasedRadar
    rho : (n,) array_like
        Distance [m], > 0.
    theta : (n,) array_like
        pi/2 at boresight, smaller to the right [rad].
    loss : (n,) array_like
        Power factor before the 1/rho^2 of the way back.
    speed : (n,) array_like or float
        Radial, positive = receding [m/s].
    accuracy : float
        Relative to the RMS of unrelated phases, sqrt(sum of strength^2).

    Returns
    -------
    (chirps, channels, samples) complex128

    Raises
    ------
    InputError
        Arrays that do not fit together, an accuracy outside 1e-12 to 1e-2.
    """
    if not 1e-12 <= accuracy <= 1e-2:
        raise InputError(f"accuracy {accuracy:g}: allowed are 1e-12 to 1e-2")
    p = _points(radar, rho, theta, loss, speed)
    if not len(p.delay):
        return np.zeros(radar.shape, dtype=np.complex128)
    if not np.any(p.hop):  # every chirp is the same
        return np.repeat(_ChirpSum.of(radar, p, accuracy)(p.delay)[None], radar.chirps, axis=0)
    if radar.chirps <= radar.channels:
        chirp = _ChirpSum.of(radar, p, accuracy)
        return np.stack([chirp(p.delay + n * p.hop) for n in range(radar.chirps)])
    from ._moving import channel_sums

    return channel_sums(radar, p.strength, p.delay, p.hop, p.step, accuracy)


@dataclass(frozen=True)
class _ChirpSum:
    """What the chirps of a frame share: the expansion over x and its polynomials at the points."""

    radar: ReleasedRadar
    points: _Points
    form: ComplexArray
    weights: FloatArray
    polynomials: FloatArray
    accuracy: float

    @classmethod
    def of(cls, radar: ReleasedRadar, points: _Points, accuracy: float) -> _ChirpSum:
        largest = max(float(np.abs(points.step).max()), 1e-30)
        form = _expansion(radar, largest, accuracy / 4)
        weights = np.abs(form).max(axis=(1, 2))
        needed = np.cumsum(weights[::-1])[::-1] > accuracy / 4
        form, weights = form[: needed.sum()], weights[: needed.sum()]
        x = points.step / largest
        polynomials = np.ones((len(form), len(x)))
        for p in range(1, len(form)):  # Chebyshev recurrence
            polynomials[p] = x if p == 1 else 2 * x * polynomials[p - 1] - polynomials[p - 2]
        return cls(radar, points, form, weights, polynomials, accuracy)

    def __call__(self, delay: FloatArray) -> ComplexArray:
        """Sum one chirp: (channels, samples)."""
        import finufft

        radar, p = self.radar, self.points
        i_mid, m_mid = radar.channels // 2, radar.samples // 2  # the zero mode of the transform
        dt = 1 / radar.sample_rate_hz
        # gradient of the phase at the middle of the cross term, and the phase there, in cycles
        channel_rate = p.step * (radar.start_hz - radar.slope * delay + radar.slope * dt * m_mid)
        sample_rate = radar.slope * dt * (delay + p.step * i_mid)
        constant = delay * (radar.start_hz - radar.slope * delay / 2)
        constant -= radar.slope * dt * i_mid * m_mid * p.step
        constant += channel_rate * i_mid + sample_rate * m_mid
        source = _phasor(constant) * p.strength
        first, second = (TAU * (rate - np.rint(rate)) for rate in (channel_rate, sample_rate))
        narrow = first.astype(np.float32), second.astype(np.float32)

        def term(p: int) -> ComplexArray:
            eps = float(np.clip(self.accuracy / (TRANSFORM_MARGIN * self.weights[p]), 1e-13, 1e-3))
            coarse = eps > SINGLE_ACCURACY  # a small term: single precision is enough of it
            x, y = narrow if coarse else (first, second)
            strength = (source * self.polynomials[p]).astype(np.complex64 if coarse else np.complex128)
            modes = finufft.nufft2d1(x, y, strength, self.form.shape[1:], isign=1, eps=eps, nthreads=1)
            product: ComplexArray = modes * self.form[p]
            return product

        terms = pool().map(term, range(len(self.form)))
        return functools.reduce(np.add, terms)


def _phasor(cycles: FloatArray) -> ComplexArray:
    phasor: ComplexArray = np.exp(1j * (TAU * (cycles - np.rint(cycles))))
    return phasor


def _expansion(radar: ReleasedRadar, largest: float, tolerance: float) -> ComplexArray:
    """Return Chebyshev coefficients in x of what is not linear in channel and sample, (terms, channels, samples).

    exp(j 2 pi [k x d (i - i0)(m - m0) dt - k (x d i)^2 / 2]), d the largest channel delay.
    """
    i, m = np.arange(radar.channels)[:, None], np.arange(radar.samples)[None, :]
    bend = radar.slope * largest * (i - radar.channels // 2) * (m - radar.samples // 2) / radar.sample_rate_hz
    square = radar.slope * (largest * i) ** 2 / 2
    n = _term_count(TAU * float(np.abs(bend).max()) + TAU * float(square.max()), tolerance)
    x = np.cos(np.pi * (np.arange(n) + 0.5) / n)[:, None, None]
    waves = np.exp(1j * TAU * (bend * x - square * x**2))
    transform = np.cos(np.pi * np.arange(n)[:, None] * (np.arange(n) + 0.5) / n) * (2 / n)
    transform[0] /= 2
    form: ComplexArray = np.tensordot(transform, waves, axes=1)
    return form


def _term_count(phase: float, tolerance: float) -> int:
    """Return how many Chebyshev terms an e^{j phase x} needs: 2 (phase/2)^n / n! bounds the first one left out."""
    n, left = 1, phase
    while left > tolerance and n < 400:
        n += 1
        left *= phase / (2 * n)
    return n + 1
