"""What a radar sends, and the elements it sends and listens with."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from ._base import ConfigModel, Vector3

__all__ = ["Array", "Positive", "Waveform"]

Positive = Annotated[float, Field(gt=0)]


class Waveform(ConfigModel):
    """A frame of linear up-chirps.

    ``bandwidth_hz`` is swept during the sampled window ``samples / sample_rate_hz``; ``chirps`` counts loops, that is
    chirps per transmitter; ``chirp_period_s`` is the interval between the starts of consecutive chirps, one number or
    several: with ``stagger: chirp`` a pattern that repeats chirp by chirp, with ``stagger: burst`` one interval for
    each of as many bursts of equal length, one after the other (dual-PRF).
    """

    carrier_hz: Annotated[float, Field(gt=1e9, lt=1e12)]
    bandwidth_hz: Positive
    samples: Annotated[int, Field(ge=2)]
    sample_rate_hz: Positive
    chirps: Annotated[int, Field(ge=1)]
    chirp_period_s: Positive | tuple[Positive, ...]
    adc_start_s: Annotated[float, Field(ge=0)] = 0.0
    adc: Literal["complex", "real"] = "complex"
    stagger: Literal["chirp", "burst"] = "chirp"

    @model_validator(mode="after")
    def _bursts_are_equally_long(self) -> Self:
        if self.chirps % self.n_bursts:
            raise ValueError(
                f"stagger burst: {self.chirps} chirps cannot be shared equally by {self.n_bursts} bursts, one for each "
                "chirp_period_s"
            )
        return self

    @model_validator(mode="after")
    def _chirps_do_not_overlap(self) -> Self:
        needed = self.adc_start_s + self.sampled_time_s
        if not self.periods_s or min(self.periods_s) < needed * (1 - 1e-9):
            raise ValueError(
                f"chirp_period_s {self.chirp_period_s} is shorter than adc_start_s + samples / sample_rate_hz, "
                f"{needed:.6g} s"
            )
        return self

    @property
    def periods_s(self) -> tuple[float, ...]:
        """The repeating pattern of chirp intervals [s]."""
        return self.chirp_period_s if isinstance(self.chirp_period_s, tuple) else (self.chirp_period_s,)

    @property
    def n_bursts(self) -> int:
        """Bursts of chirps at one interval each; 1 without ``stagger: burst``."""
        return len(self.periods_s) if self.stagger == "burst" else 1

    @property
    def sampled_time_s(self) -> float:
        """Length of the sampled window of a chirp [s]."""
        return self.samples / self.sample_rate_hz

    @property
    def slope_hz_per_s(self) -> float:
        """Chirp slope k [Hz/s]."""
        return self.bandwidth_hz / self.sampled_time_s

    @property
    def center_hz(self) -> float:
        """f_c = f0 + k t_mid, t_mid the middle of the sampled window [Hz]."""
        return self.carrier_hz + self.slope_hz_per_s * (self.adc_start_s + self.sampled_time_s / 2)


class Array(ConfigModel):
    """Transmitters and receivers, in half wavelengths (``tx``, ``rx``, or ``line: n``) or metres (``tx_m``, ``rx_m``).

    Axes are those of the radar frame (x out, y left, z up): azimuth column c stands at y = -c, elevation row r at
    z = r. ``design_frequency_hz`` fixes the half wavelength of the board; without it the profile's f_c does.
    ``empty_subbands`` of the Doppler spectrum carry no transmitter under DDM, 1 unless it says otherwise.
    """

    multiplex: Literal["simultaneous", "tdm", "bpm", "ddm"] = "simultaneous"
    line: Annotated[int, Field(ge=1)] | None = None
    tx: tuple[Vector3, ...] | None = None
    rx: tuple[Vector3, ...] | None = None
    tx_m: tuple[Vector3, ...] | None = None
    rx_m: tuple[Vector3, ...] | None = None
    design_frequency_hz: Positive | None = None
    empty_subbands: Annotated[int, Field(ge=1)] | None = None

    @model_validator(mode="after")
    def _one_way_to_say_it(self) -> Self:
        ways = [self.line is not None, self.tx is not None or self.rx is not None]
        ways.append(self.tx_m is not None or self.rx_m is not None)
        if sum(ways) != 1:
            raise ValueError("give exactly one of: line, tx and rx (half wavelengths), tx_m and rx_m (metres)")
        if ways[1] and not (self.tx and self.rx):
            raise ValueError("tx and rx are needed together, each with at least one [x, y, z]")
        if ways[2] and not (self.tx_m and self.rx_m):
            raise ValueError("tx_m and rx_m are needed together, each with at least one [x, y, z]")
        if self.empty_subbands is not None and self.multiplex != "ddm":
            raise ValueError(f"empty_subbands belongs to multiplex ddm, not to {self.multiplex}")
        if self.line is not None and self.multiplex != "simultaneous":
            raise ValueError(f"multiplex {self.multiplex} needs tx and rx positions; line has one transmitter")
        return self
