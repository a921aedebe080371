"""The receiver after the mixer: thermal noise, the ADC's real or complex form, quantisation and saturation."""

from __future__ import annotations

import logging

import numpy as np

from .._typing import ComplexArray
from ..config.profile import RadarProfile

__all__ = ["add_noise", "cube_noise_power", "quantise", "sample_noise_power", "to_adc"]

logger = logging.getLogger(__name__)


def sample_noise_power(profile: RadarProfile) -> float:
    """Noise of one raw ADC sample: k T0 F f_s, half of it from a real ADC, whose band is half as wide [W]."""
    return profile.noise_power_w / (2 if profile.waveform.adc == "real" else 1)


def cube_noise_power(profile: RadarProfile) -> float:
    """Noise of one sample of the cube: BPM decoding averages n_tx chirps [W]."""
    return sample_noise_power(profile) / (profile.n_tx if profile.array.multiplex == "bpm" else 1)


def to_adc(profile: RadarProfile, raw: ComplexArray) -> ComplexArray:
    """Return sqrt(2) Re(x) for a real ADC, which keeps the power of a tone, x itself for a complex one."""
    if profile.waveform.adc == "complex":
        return raw
    real: ComplexArray = (np.sqrt(2.0) * raw.real).astype(np.complex128)
    return real


def add_noise(profile: RadarProfile, raw: ComplexArray, generator: np.random.Generator) -> None:
    """Add white Gaussian noise in place, independent from sample to sample, chirp to chirp and channel to channel.

    Circular complex of power k T0 F f_s, or real of half that power.
    """
    power = sample_noise_power(profile)
    if profile.waveform.adc == "real":
        raw.real += np.sqrt(power) * generator.standard_normal(raw.shape)
    else:
        scale = np.sqrt(power / 2)
        for row in raw:  # a chirp at a time: the draw needs no second cube
            row += scale * generator.standard_normal((*row.shape, 2)).view(np.complex128)[..., 0]


def quantise(profile: RadarProfile, raw: ComplexArray) -> ComplexArray:
    """Round I and Q to ``adc_bits`` and clip them at full scale; log how many samples were clipped.

    A tone of ``full_scale_dbm`` just fills the converter: codes -2^(b-1) .. 2^(b-1) - 1 over +-sqrt(P) for I and Q,
    +-sqrt(2 P) for a real ADC, sqrt(W).
    """
    bits, level = profile.receiver.adc_bits, profile.receiver.full_scale_dbm
    if bits is None or level is None:
        return raw
    real = profile.waveform.adc == "real"
    peak = float(np.sqrt(10 ** ((level - 30) / 10) * (2 if real else 1)))
    half = 2 ** (bits - 1)
    step = peak / half
    codes = np.rint(raw.view(np.float64) / step)
    clipped = (codes < -half) | (codes > half - 1)
    count = int(clipped.reshape(*raw.shape, 2).any(axis=-1).sum())
    if count:
        logger.warning(
            "ADC saturation: %d of %d samples (%.3g %%) beyond full scale %g dBm of profile %r",
            count, raw.size, 100 * count / raw.size, level, profile.name,
        )  # fmt: skip
    rounded: ComplexArray = (np.clip(codes, -half, half - 1) * step).view(np.complex128)
    return rounded
