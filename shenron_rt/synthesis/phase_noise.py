"""Phase noise of the oscillator behind transmitter and mixer, range correlation included.

With phi(t) the oscillator's phase noise, an echo of delay tau is de-chirped to itself times
exp(j (phi(t) - phi(t - tau))): near echoes cancel it, far ones do not. The delay of what a chirp holds is read off its
beat frequency, f = k tau: every bin of a chirp's spectrum gets the difference of its own delay. To keep the ends of the
sampled window out of this, chirps are synthesised with a margin on both sides and tapered there.

Offsets below half of 1/T_chirp belong to one process that runs through the frame, and so to Doppler; those above are
drawn chirp by chirp, as noise whose memory is shorter than a chirp is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .._typing import ComplexArray, FloatArray
from ..config.profile import RadarProfile
from ..constants import SPEED_OF_LIGHT
from ..physics.phase_noise import single_sideband_level
from .signal import Clock, Points

__all__ = ["PhaseNoise", "add_phase_noise", "margin_samples"]

#: Samples of the margin that are kept at full level, beyond those that a delay can reach over, and of the taper.
_FLAT, _TAPER = 8, 64


def margin_samples(profile: RadarProfile) -> int:
    """Return the samples to synthesise on both sides of the window.

    A component at offset f moves a beat signal by f / k against itself.
    """
    w = profile.waveform
    return int(np.ceil(w.sample_rate_hz**2 / (2 * w.slope_hz_per_s))) + _FLAT + _TAPER


@dataclass(frozen=True)
class PhaseNoise:
    """One realisation of phi(t) - phi(t - tau) over a frame.

    Parameters
    ----------
    sample_s : (n,) float
        Times of the samples from a chirp's start [s].
    start_s : (n_chirps,) float
        Starts of the chirps [s].
    fast_hz, fast : (q,), (n_chirps, q) complex
        Offsets, and phasors of each chirp, of phi = Re sum c e^{j 2 pi f t} [rad].
    slow_hz, slow : (p,), (p,) complex
        The same of the process that runs through the frame.
    """

    sample_s: FloatArray
    start_s: FloatArray
    fast_hz: FloatArray
    fast: ComplexArray
    slow_hz: FloatArray
    slow: ComplexArray

    @classmethod
    def draw(cls, profile: RadarProfile, delay_span_s: float, generator: np.random.Generator) -> PhaseNoise:
        """Draw one.

        Parameters
        ----------
        profile : RadarProfile
            With ``receiver.phase_noise_dbc_hz``.
        delay_span_s : float
            Delays that will be asked for lie within so much of each other, 0 among them or near [s].
        generator : numpy.random.Generator
        """
        w, table = profile.waveform, profile.receiver.phase_noise_dbc_hz or ()
        clock, starts = Clock.of(profile), profile.raw_chirp_start_s.ravel()
        step = 1 / (float(np.ptp(clock.sample_s)) + 2 / w.sample_rate_hz + 2 * delay_span_s)
        fast_hz = np.asarray(step * np.arange(1, int(w.sample_rate_hz / 2 / step) + 1), dtype=np.float64)
        slow_step = 1 / (float(np.ptp(starts)) + 1 / step)
        slow_hz = np.asarray(slow_step * (np.arange(max(1, round(step / 2 / slow_step))) + 0.5), dtype=np.float64)

        def phasors(offset_hz: FloatArray, width_hz: float, *shape: int) -> ComplexArray:
            # one-sided power density 2 L(f) of a phase; E|c|^2 is twice the power of Re c e^{j...}
            white = generator.standard_normal((*shape, len(offset_hz), 2)).view(np.complex128)[..., 0]
            return np.asarray(white * np.sqrt(2 * single_sideband_level(offset_hz, table) * width_hz))

        fast = phasors(fast_hz, step, len(starts))
        return cls(clock.sample_s, starts, fast_hz, fast, slow_hz, phasors(slow_hz, slow_step))

    @cached_property
    def slow_rate(self) -> FloatArray:
        """(n_chirps, n) derivative of the process that runs through the frame [rad/s]."""
        turn = 2j * np.pi * self.slow_hz
        at_chirp = np.exp(self.start_s[:, None] * turn) * (self.slow * turn)
        return np.asarray((at_chirp @ np.exp(turn[:, None] * self.sample_s)).real)

    def difference(self, chirp: int, delay_s: FloatArray) -> FloatArray:
        """Return phi(t) - phi(t - tau) of a chirp, (n_delays, n) [rad].

        The slow process changes over a delay by its rate: to (2 pi f tau)^2 / 24, 4e-4 at 22 kHz and 0.7 us.
        """
        turn = 2j * np.pi * self.fast_hz
        early = 1 - np.exp(-delay_s[:, None] * turn)
        at = self.fast[chirp, :, None] * np.exp(turn[:, None] * self.sample_s)
        # the real part of a product, in two real ones
        fast = early.real @ at.real - early.imag @ at.imag
        return np.asarray(fast + delay_s[:, None] * self.slow_rate[chirp], dtype=np.float64)


def _beat_bins(profile: RadarProfile, points: Points) -> tuple[float, float]:
    """Return the lowest and highest beat frequency of the echoes, k tau + Doppler [Hz]."""
    if not len(points):
        return 0.0, 0.0
    distance = np.linalg.norm(points.position, axis=1)
    rate = np.einsum("qi,qi->q", points.position, points.velocity) / np.maximum(distance, 1e-9)
    beat = 2 / SPEED_OF_LIGHT * (profile.slope_hz_per_s * distance + profile.center_hz * rate)
    return float(beat.min()), float(beat.max())


def add_phase_noise(
    profile: RadarProfile, points: Points, raw: ComplexArray, margin: int, generator: np.random.Generator
) -> ComplexArray:
    """Return chirps with phase noise, their margins taken off.

    Parameters
    ----------
    profile : RadarProfile
    points : Points
        Whose echoes the chirps hold: where their beat frequencies are, and where none are.
    raw : (n_loops, n_blocks, n_rx, n_samples + 2 margin) complex
        As from ``transmitted``; with one chirp a loop its blocks share that chirp's noise. Tapered in place.
    margin : int
    generator : numpy.random.Generator

    Returns
    -------
    (n_loops, n_blocks, n_rx, n_samples) complex
    """
    total = raw.shape[-1]
    rate = profile.waveform.sample_rate_hz
    rise = np.sin(np.pi / 2 * (np.arange(_TAPER) + 0.5) / _TAPER) ** 2
    raw[..., :_TAPER] *= rise
    raw[..., -_TAPER:] *= rise[::-1]
    low, high = (f * total / rate for f in _beat_bins(profile, points))
    # bins are known modulo their number: cut where they are emptiest
    first = int(np.floor((low + high - total) / 2))
    bins = first + np.arange(total)
    delay = bins * (rate / total / profile.slope_hz_per_s)
    noise = PhaseNoise.draw(profile, float(np.abs(delay).max()), generator)
    spectrum = np.fft.fft(raw, axis=-1)[..., bins % total] / total
    back = np.exp(2j * np.pi / total * bins[:, None] * np.arange(margin, total - margin))
    per_loop = profile.n_chirps_per_loop
    out = np.empty((*raw.shape[:-1], total - 2 * margin), dtype=np.complex128)
    for chirp in range(len(noise.start_s)):
        loop, block = divmod(chirp, per_loop)
        blocks = slice(block, block + 1) if per_loop > 1 else slice(None)
        out[loop, blocks] = spectrum[loop, blocks] @ (back * np.exp(1j * noise.difference(chirp, delay)))
    return out
