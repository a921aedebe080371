"""The radar as the public C-Shenron code describes it: a handful of numbers, c = 3e8."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..echo._shenron_loss import GAIN, LIGHT_SPEED

if TYPE_CHECKING:
    from ..config.profile import RadarProfile

__all__ = ["ReleasedRadar"]


@dataclass(frozen=True)
class ReleasedRadar:
    """Waveform and line array of the released synthesis.

    Parameters
    ----------
    name : str
    start_hz, bandwidth_hz : float
        Start of the sweep and what it sweeps during the samples [Hz].
    samples : int
    sample_rate_hz : float
    chirps : int
    repetition_s : float
        From chirp to chirp [s].
    channels : int
        Virtual receivers, half a wavelength of ``start_hz`` apart.
    gain : float
        Linear.
    """

    name: str
    start_hz: float
    bandwidth_hz: float
    samples: int
    sample_rate_hz: float
    chirps: int
    repetition_s: float
    channels: int
    gain: float = GAIN

    @property
    def slope(self) -> float:
        """Chirp slope k [Hz/s]."""
        return self.bandwidth_hz * self.sample_rate_hz / self.samples

    @property
    def scale(self) -> float:
        """sqrt(gain lambda^2 / (4 pi)^3), lambda = c / ``start_hz``."""
        return math.sqrt(self.gain / (4 * math.pi) ** 3) * LIGHT_SPEED / self.start_hz

    @property
    def shape(self) -> tuple[int, int, int]:
        """Chirps, channels, samples."""
        return self.chirps, self.channels, self.samples

    @classmethod
    def of(cls, profile: RadarProfile, channels: int | None = None) -> ReleasedRadar:
        """Take the numbers of a profile; a pattern of chirp intervals counts with its mean.

        Parameters
        ----------
        profile : RadarProfile
        channels : int, optional
            Default: the profile's virtual channels, as one line.
        """
        w = profile.waveform
        return cls(
            name=profile.name,
            start_hz=w.carrier_hz,
            bandwidth_hz=w.bandwidth_hz,
            samples=w.samples,
            sample_rate_hz=w.sample_rate_hz,
            chirps=w.chirps,
            repetition_s=profile.loop_period_s,
            channels=channels or profile.n_virtual,
        )
