"""Radar profiles: waveform, array, antenna, receiver. Derived numbers are properties, never keys."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from .._typing import FloatArray
from ..constants import BOLTZMANN, SPEED_OF_LIGHT
from ..physics.antenna import AntennaPattern, CosinePattern, GaussianPattern, IsotropicPattern, TabulatedPattern
from ..resources import find
from ._base import ConfigModel
from .loader import apply_overrides, read_yaml, validate_model
from .waveform import Array, Positive, Waveform

__all__ = ["Antenna", "Array", "Processing", "RadarProfile", "Receiver", "Waveform", "load_profile"]

WindowName = Literal["rect", "hann", "hamming", "blackmanharris", "taylor", "chebyshev"]


class Antenna(ConfigModel):
    """One-way element pattern, the same for transmit and receive, with half-power full widths.

    ``radome_loss_db`` is the two-way loss of radome and front end together.
    """

    pattern: Literal["gaussian", "cosn", "table", "isotropic"] = "gaussian"
    beamwidth_az_deg: Annotated[float, Field(gt=0, le=360)] | None = None
    beamwidth_el_deg: Annotated[float, Field(gt=0, le=360)] | None = None
    table_az: tuple[tuple[float, float], ...] | None = None
    table_el: tuple[tuple[float, float], ...] | None = None
    gain_tx_dbi: float = 0.0
    gain_rx_dbi: float = 0.0
    polarization: Literal["VV", "HH", "HV", "VH"] = "VV"
    radome_loss_db: Annotated[float, Field(ge=0)] = 0.0

    @model_validator(mode="after")
    def _pattern_has_its_numbers(self) -> Self:
        if self.pattern in ("gaussian", "cosn") and None in (self.beamwidth_az_deg, self.beamwidth_el_deg):
            raise ValueError(f"pattern {self.pattern} needs beamwidth_az_deg and beamwidth_el_deg")
        if self.pattern == "table" and not (self.table_az and self.table_el):
            raise ValueError("pattern table needs table_az and table_el, lists of [angle_deg, level_db]")
        return self


class Receiver(ConfigModel):
    """Levels and the receiver chain.

    ``phase_noise_dbc_hz`` lists [offset_hz, dbc_hz] of the oscillator that transmitter and mixer share.
    """

    tx_power_dbm: float
    noise_figure_db: Annotated[float, Field(ge=0)]
    temperature_k: Positive = 290.0
    adc_bits: Annotated[int, Field(ge=2, le=24)] | None = None
    full_scale_dbm: float | None = None
    phase_noise_dbc_hz: tuple[tuple[Positive, float], ...] | None = None

    @model_validator(mode="after")
    def _offsets_ascend(self) -> Self:
        offsets = [offset for offset, _ in self.phase_noise_dbc_hz or ()]
        if self.phase_noise_dbc_hz is not None and (not offsets or sorted(set(offsets)) != offsets):
            raise ValueError(
                "phase_noise_dbc_hz: a list of [offset_hz, dbc_hz] with ascending offsets is needed, "
                f"got offsets {offsets}"
            )
        return self

    @model_validator(mode="after")
    def _bits_need_a_scale(self) -> Self:
        if (self.adc_bits is None) != (self.full_scale_dbm is None):
            raise ValueError("adc_bits and full_scale_dbm are needed together")
        return self


class Processing(ConfigModel):
    """Defaults of the processing chain for this radar."""

    range_window: WindowName = "hann"
    doppler_window: WindowName = "hann"
    pfa: Annotated[float, Field(gt=0, lt=1)] = 1e-3
    blanking_m: Annotated[float, Field(ge=0)] = 0.0
    ambiguity: Literal["staggered", "two_frame", "tdm_phase"] | None = None


class RadarProfile(ConfigModel):
    """A radar: everything that fixes its data and their axes."""

    name: str
    description: str = ""
    waveform: Waveform
    array: Array
    antenna: Antenna
    receiver: Receiver
    processing: Processing = Processing()
    sources: Mapping[str, str] = {}

    @model_validator(mode="after")
    def _sub_bands_hold_whole_bins(self) -> Self:
        if self.array.multiplex != "ddm":
            return self
        w, loops = self.waveform, self.waveform.chirps // self.waveform.n_bursts
        if loops % self.n_subbands:
            raise ValueError(
                f"multiplex ddm: {loops} chirps do not fill {self.n_subbands} sub-bands ({self.n_tx} transmitters and "
                f"the empty ones) evenly; take a multiple of {self.n_subbands}"
            )
        if len(w.periods_s) > w.n_bursts:
            raise ValueError("multiplex ddm: one chirp_period_s is needed, or one for each burst (stagger: burst)")
        return self

    # ---- waveform
    @property
    def slope_hz_per_s(self) -> float:
        """Chirp slope k [Hz/s]."""
        return self.waveform.slope_hz_per_s

    @property
    def center_hz(self) -> float:
        """f_c = f0 + k t_mid of the sampled window [Hz]."""
        return self.waveform.center_hz

    @property
    def wavelength_m(self) -> float:
        """Wavelength at f_c [m]."""
        return SPEED_OF_LIGHT / self.center_hz

    @property
    def range_resolution_m(self) -> float:
        """C / 2B [m]."""
        return SPEED_OF_LIGHT / (2 * self.waveform.bandwidth_hz)

    @property
    def n_range(self) -> int:
        """Range bins without zero padding: all samples of a complex ADC, half of them of a real one."""
        return self.waveform.samples // (2 if self.waveform.adc == "real" else 1)

    @property
    def max_range_m(self) -> float:
        """Unambiguous range: n_range bins [m]."""
        return self.n_range * self.range_resolution_m

    @property
    def n_chirps_per_loop(self) -> int:
        """Chirps in one loop: n_tx under TDM and BPM, else 1."""
        return self.n_tx if self.array.multiplex in ("tdm", "bpm") else 1

    @property
    def n_subbands(self) -> int:
        """Parts of the Doppler spectrum between which DDM shifts the transmitters, empty ones included; else 1."""
        return self.n_tx + (self.array.empty_subbands or 1) if self.array.multiplex == "ddm" else 1

    @cached_property
    def raw_chirp_start_s(self) -> FloatArray:
        """(n_loops, n_chirps_per_loop) start of every transmitted chirp from the frame's start [s]."""
        count = self.waveform.chirps * self.n_chirps_per_loop
        periods = np.asarray(self.waveform.periods_s, dtype=np.float64)
        if self.waveform.n_bursts > 1:
            periods = np.repeat(periods, count // len(periods))
        steps = np.resize(periods, max(count - 1, 0))
        starts = np.concatenate([[0.0], np.cumsum(steps)])
        return starts.reshape(self.waveform.chirps, self.n_chirps_per_loop)

    @property
    def loop_period_s(self) -> float:
        """Mean interval between loops, the slow-time sampling of one virtual channel [s]."""
        return float(np.mean(self.waveform.periods_s)) * self.n_chirps_per_loop

    @property
    def max_velocity_mps(self) -> float:
        """v_max = lambda / (4 T_loop) [m/s]; velocities are seen in [-v_max, v_max)."""
        return self.wavelength_m / (4 * self.loop_period_s)

    @property
    def velocity_resolution_mps(self) -> float:
        """Lambda / (2 N T_loop) [m/s]."""
        return self.wavelength_m / (2 * self.waveform.chirps * self.loop_period_s)

    @cached_property
    def bursts(self) -> tuple[Self, ...]:
        """The radar as it works in each burst: the same with the loops and the one interval of that burst."""
        w = self.waveform
        if w.n_bursts == 1:
            return (self,)
        parts = [{"chirps": w.chirps // w.n_bursts, "chirp_period_s": t, "stagger": "chirp"} for t in w.periods_s]
        # validated anew: a copy would keep the cached axes of the whole frame
        data = self.model_dump()
        return tuple(self.model_validate(data | {"waveform": data["waveform"] | part}) for part in parts)

    @property
    def frame_mid_s(self) -> float:
        """Middle of the frame from its start: mean of first and last chirp start, plus t_mid of the window [s]."""
        starts = self.raw_chirp_start_s
        t_mid = self.waveform.adc_start_s + self.waveform.sampled_time_s / 2
        return float(starts[0, 0] + starts[-1, -1]) / 2 + t_mid

    # ---- array
    @property
    def half_wavelength_m(self) -> float:
        """The unit of ``array.tx`` and ``array.rx`` [m]."""
        return SPEED_OF_LIGHT / (2 * (self.array.design_frequency_hz or self.center_hz))

    @cached_property
    def tx_m(self) -> FloatArray:
        """(n_tx, 3) transmitters, radar frame [m]."""
        if self.array.tx_m is not None:
            return np.asarray(self.array.tx_m, dtype=np.float64)
        if self.array.tx is not None:
            return np.asarray(self.array.tx, dtype=np.float64) * self.half_wavelength_m
        return np.zeros((1, 3))

    @cached_property
    def rx_m(self) -> FloatArray:
        """(n_rx, 3) receivers, radar frame [m]."""
        if self.array.rx_m is not None:
            return np.asarray(self.array.rx_m, dtype=np.float64)
        if self.array.rx is not None:
            return np.asarray(self.array.rx, dtype=np.float64) * self.half_wavelength_m
        line = np.zeros((self.array.line or 1, 3))
        line[:, 1] = -np.arange(len(line)) * self.half_wavelength_m
        return line

    @property
    def n_tx(self) -> int:
        """Transmitters."""
        return len(self.array.tx_m or self.array.tx or (0,))

    @property
    def n_rx(self) -> int:
        """Receivers."""
        return len(self.rx_m)

    @property
    def n_virtual(self) -> int:
        """Virtual channels, index tx * n_rx + rx."""
        return self.n_tx * self.n_rx

    @cached_property
    def positions_m(self) -> FloatArray:
        """(n_virtual, 3) tx + rx position (two-way sum) from the mount origin [m]."""
        return (self.tx_m[:, None] + self.rx_m[None]).reshape(-1, 3)

    @cached_property
    def chirp_start_s(self) -> FloatArray:
        """(n_loops, n_virtual) start of the chirp behind each row of the cube; BPM: mean of the block [s]."""
        raw = self.raw_chirp_start_s
        if self.array.multiplex == "tdm":
            return np.repeat(raw, self.n_rx, axis=1)
        return np.repeat(raw.mean(axis=1, keepdims=True), self.n_virtual, axis=1)

    # ---- levels
    @cached_property
    def pattern(self) -> AntennaPattern:
        """One-way element pattern relative to its peak."""
        a = self.antenna
        az, el = np.radians(a.beamwidth_az_deg or 0.0), np.radians(a.beamwidth_el_deg or 0.0)
        if a.pattern == "gaussian":
            return GaussianPattern(float(az), float(el))
        if a.pattern == "cosn":
            return CosinePattern(float(az), float(el))
        if a.pattern == "table":
            return TabulatedPattern.from_deg(a.table_az or (), a.table_el or ())
        return IsotropicPattern()

    @property
    def tx_power_w(self) -> float:
        """Transmit power of one transmitter [W]."""
        return float(10 ** ((self.receiver.tx_power_dbm - 30) / 10))

    @property
    def noise_power_w(self) -> float:
        """Noise per complex sample of one receiver, k T0 F f_s [W]; a real ADC has half of it per real sample."""
        noise_figure = 10 ** (self.receiver.noise_figure_db / 10)
        return BOLTZMANN * self.receiver.temperature_k * float(noise_figure) * self.waveform.sample_rate_hz

    @property
    def unconfirmed(self) -> dict[str, str]:
        """Keys whose source is not a retrievable document, with what is said of them."""
        return {k: v for k, v in self.sources.items() if v.lower().startswith(("unconfirmed", "assumption"))}

    def derived(self) -> dict[str, float]:
        """Return the derived numbers by name, unit in the name."""
        return {
            "center_frequency_hz": self.center_hz,
            "wavelength_m": self.wavelength_m,
            "slope_hz_per_s": self.slope_hz_per_s,
            "range_resolution_m": self.range_resolution_m,
            "max_range_m": self.max_range_m,
            "loop_period_s": self.loop_period_s,
            "max_velocity_mps": self.max_velocity_mps,
            "velocity_resolution_mps": self.velocity_resolution_mps,
            "n_virtual": float(self.n_virtual),
            "noise_power_dbm": 10 * float(np.log10(self.noise_power_w)) + 30,
        }

    def __repr__(self) -> str:
        w = self.waveform
        return (
            f"RadarProfile({self.name!r}, {w.carrier_hz / 1e9:g} GHz + {w.bandwidth_hz / 1e6:g} MHz, "
            f"{w.chirps} loops x {self.n_virtual} channels x {w.samples} samples, "
            f"{self.range_resolution_m:.3f} m to {self.max_range_m:.1f} m, +-{self.max_velocity_mps:.2f} m/s)"
        )

    __str__ = __repr__


def load_profile(name_or_path: str | os.PathLike[str], overrides: Mapping[str, Any] | None = None) -> RadarProfile:
    """Load a radar profile.

    Parameters
    ----------
    name_or_path : str or path
        ``"awrl1432"``, or a YAML file.
    overrides : mapping, optional
        Dotted keys, for example ``{"receiver.noise_figure_db": 12}``.

    Returns
    -------
    RadarProfile

    Raises
    ------
    NotFoundError
        No such profile; the message lists those that exist.
    ConfigError
        The file has problems; one line each, with file, line and key.

    Examples
    --------
    >>> load_profile("awrl1432").range_resolution_m.__round__(4)
    0.3747
    """
    file: Path = find("profiles", name_or_path)
    data, node = read_yaml(file)
    data = {"name": file.stem, **apply_overrides(data, overrides or {})}
    return validate_model(RadarProfile, data, str(file), node)
