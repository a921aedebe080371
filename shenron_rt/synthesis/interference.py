"""FMCW interference: what the chirps of another radar leave behind the mixer of this one.

The mixer turns a wave of frequency f_i into the beat f_v - f_i with this radar's own chirp. Of two chirps of different
slope the beat sweeps through the receiver's band in a burst of duration B_if / abs(k_v - k_i); of two equal ones it
stays, and looks like a target.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._typing import BoolArray, ComplexArray, FloatArray
from ..config.profile import RadarProfile
from ..constants import SPEED_OF_LIGHT
from .signal import Clock

__all__ = ["HeardRadar", "add_interference", "if_band_hz"]


@dataclass(frozen=True)
class HeardRadar:
    """One frame of another radar, as this one's receivers hear it.

    Parameters
    ----------
    profile : RadarProfile
        The other radar's waveform.
    position, velocity : (3,) float
        Of its antenna, in this radar's frame at mid-frame [m], [m/s].
    power_w : float
        At one receiver's input while it sends [W].
    start_s : float
        Start of its first chirp after that of this radar's first [s].
    phase : float
        Of its oscillator against this radar's [rad].
    """

    profile: RadarProfile
    position: FloatArray
    velocity: FloatArray
    power_w: float
    start_s: float = 0.0
    phase: float = 0.0


def if_band_hz(profile: RadarProfile) -> tuple[float, float]:
    """Return the beat frequencies that the receiver passes: [0, f_s), of a real ADC [-f_s/2, f_s/2) [Hz]."""
    rate = profile.waveform.sample_rate_hz
    return (0.0, rate) if profile.waveform.adc == "complex" else (-rate / 2, rate / 2)


def add_interference(profile: RadarProfile, raw: ComplexArray, heard: Sequence[HeardRadar]) -> None:
    """Add other radars to de-chirped samples, in place.

    Parameters
    ----------
    profile : RadarProfile
        This radar.
    raw : (n_loops, n_blocks, n_rx, n_samples) complex
        As from ``transmitted``; blocks that share a chirp hear the same.
    heard : sequence of HeardRadar

    Notes
    -----
    A wave of phase phi_i(t - d/c), d the one-way distance of antenna and receiver at time t, gives
    sqrt(P) e^{j (phi_v(t) - phi_i(t - d/c))} while its beat frequency is in the receiver's band, whose edges are sharp.
    """
    starts = profile.raw_chirp_start_s
    per_loop = starts.shape[1]
    for radar in heard:
        for loop, of_loop in enumerate(starts):
            for chirp, start in enumerate(of_loop):
                blocks = slice(chirp, chirp + 1) if per_loop > 1 else slice(None)
                raw[loop, blocks] += _beat(profile, radar, float(start))


def _beat(profile: RadarProfile, radar: HeardRadar, start_s: float) -> ComplexArray:
    """Return what one chirp of this radar makes of another one, (n_rx, n_samples)."""
    clock = Clock.of(profile)
    own = clock.sample_s
    time = start_s + own
    place = radar.position + radar.velocity * (time - clock.frame_mid_s)[:, None]
    delay = np.linalg.norm(place - profile.rx_m[:, None], axis=-1) / SPEED_OF_LIGHT
    sent, sending = _chirp_time(radar.profile, time - delay - radar.start_s)
    f0, k = radar.profile.waveform.carrier_hz, radar.profile.slope_hz_per_s
    beat_hz = (clock.carrier_hz + clock.slope_hz_per_s * own) - (f0 + k * sent)
    low, high = if_band_hz(profile)
    passed = sending & (beat_hz >= low) & (beat_hz < high)
    cycles = (clock.carrier_hz + clock.slope_hz_per_s * own / 2) * own - (f0 + k * sent / 2) * sent
    wave = np.exp(2j * np.pi * cycles + 1j * radar.phase) * np.sqrt(radar.power_w)
    return np.asarray(np.where(passed, wave, 0.0), dtype=np.complex128)


def _chirp_time(profile: RadarProfile, time_s: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the time since the start of the chirp that runs at a time of a radar's frame [s], and whether one does."""
    starts = profile.raw_chirp_start_s.ravel()
    number = np.searchsorted(starts, time_s, side="right") - 1
    since = time_s - starts[np.maximum(number, 0)]
    sweep = profile.waveform.adc_start_s + profile.waveform.sampled_time_s
    return since, (number >= 0) & (since < sweep)
