"""The radar cube: range, velocity, channel; its axes and maps."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from .._typing import ComplexArray, FloatArray, IntArray
from ..constants import SPEED_OF_LIGHT
from ..errors import InputError
from ..io.npz import load_npz, save_npz
from ..scatterers import Weather
from . import angle
from .multiplex import LoopCode, strongest_alias
from .spectra import doppler_spectrum, range_spectrum
from .windows import window

if TYPE_CHECKING:
    from ..config.profile import RadarProfile
    from ..returns import Returns
    from ..synthesis.adc import AdcCube

__all__ = ["RadarCube", "process"]

#: Cells beamformed at once for the range-azimuth map; bounds its memory at about 64 MB.
_BEAM_CELLS = 1 << 22


@dataclass(frozen=True)
class RadarCube:
    """Range-Doppler spectrum of every virtual channel; its axes derive from the profile that made the data.

    Parameters
    ----------
    data : (n_range, n_velocity, n_virtual) complex
        sqrt(W); a bin-centred tone of power P reads abs(data)**2 = P. Channels refer to one time (TDM compensated, BPM
        decoded with the velocity of the bin).
    profile : RadarProfile
        The radar.
    range_window, doppler_window : str
        Windows behind the data.
    n_fft : (int, int)
        Lengths of the range and the Doppler transform.
    noise_added : bool
        Whether the samples carry thermal noise; without it detection takes the nominal level for its floor.
    weather : Weather or None
        Whose attenuation the echoes had.
    returns : Returns or None
        The echoes behind it, for truth attribution; not saved.
    mid_offset_s : float
        Middle of the chirps behind it after mid-frame; 0 but for a burst of a frame [s].
    bursts : tuple of RadarCube
        Of a profile with ``stagger: burst``: the cube of each burst, with Doppler bins of its own chirp interval. Those
        are detected on; the cube itself sums the whole frame, with half the level at the folds of either interval.
    """

    data: ComplexArray
    profile: RadarProfile
    range_window: str = "hann"
    doppler_window: str = "hann"
    n_fft: tuple[int, int] = (0, 0)
    noise_added: bool = True
    weather: Weather | None = None
    returns: Returns | None = field(default=None, repr=False)
    mid_offset_s: float = 0.0
    bursts: tuple[RadarCube, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        if not all(self.n_fft):
            n_range = self.data.shape[0] * (2 if self.profile.waveform.adc == "real" else 1)
            object.__setattr__(self, "n_fft", (n_range, self.data.shape[1]))
        shape = (self.n_fft[0] // (2 if self.profile.waveform.adc == "real" else 1), self.n_fft[1])
        if np.shape(self.data) != (*shape, self.profile.n_virtual):
            raise InputError(
                f"RadarCube.data: n_fft {self.n_fft} of profile {self.profile.name!r} needs shape "
                f"{(*shape, self.profile.n_virtual)} (range, velocity, virtual), got {np.shape(self.data)}"
            )

    def __repr__(self) -> str:
        windows = f"{self.range_window} x {self.doppler_window}"
        return f"RadarCube({self.data.shape} (range, velocity, virtual), {windows}, profile {self.profile.name!r})"

    # ---- axes
    @property
    def range_step_m(self) -> float:
        """Range of one bin [m]."""
        return self.profile.range_resolution_m * self.profile.waveform.samples / self.n_fft[0]

    @property
    def range_m(self) -> FloatArray:
        """(n_range,) bin r is r c / 2B of a still target [m]."""
        return np.asarray(np.arange(self.data.shape[0]) * self.range_step_m, dtype=np.float64)

    @property
    def velocity_step_mps(self) -> float:
        """Range rate of one Doppler bin, lambda / (2 N T) with the mean loop period T [m/s]."""
        return SPEED_OF_LIGHT / self.profile.center_hz / (2 * self.n_fft[1] * self.profile.loop_period_s)

    @property
    def velocity_mps(self) -> FloatArray:
        """(n_velocity,) ascending range rate, positive = receding [m/s]."""
        bins = np.arange(self.n_fft[1]) - self.n_fft[1] // 2
        return np.asarray(bins * self.velocity_step_mps, dtype=np.float64)

    @cached_property
    def azimuth_channels(self) -> IntArray:
        """Channels of the azimuth aperture: the row of the array with the most columns."""
        return angle.azimuth_channels(self.profile.positions_m, self.profile.wavelength_m)

    @cached_property
    def azimuth_sine(self) -> FloatArray:
        """(n_azimuth,) sine of azimuth, uniform and ascending."""
        return angle.sine_grid(self.profile.positions_m[self.azimuth_channels], self.profile.wavelength_m)

    @property
    def azimuth_rad(self) -> FloatArray:
        """(n_azimuth,) ascending azimuth, uniform in its sine, positive = left [rad]."""
        return np.arcsin(self.azimuth_sine)

    @cached_property
    def loop_code(self) -> LoopCode | None:
        """Signs and times of the chirps of a loop under BPM, else None."""
        return _loop_code(self.profile, self.n_fft[1])

    # ---- levels and maps
    @cached_property
    def noise_power_w(self) -> float:
        """Expected noise in a cell of one channel: k T0 F f_s ENBW / (n_samples n_loops) [W].

        Nominal: also where no noise was added. A real ADC has half the noise per sample and half the bins: the same.
        BPM decoding averages the n_tx chirps of a loop, and divides it by n_tx.
        """
        w = self.profile.waveform
        taper_r, taper_d = window(self.range_window, w.samples), window(self.doppler_window, w.chirps)
        gain = np.sum(taper_r**2) / taper_r.sum() ** 2 * np.sum(taper_d**2) / taper_d.sum() ** 2
        decoded = self.profile.n_tx if self.profile.array.multiplex == "bpm" else 1
        return float(self.profile.noise_power_w * gain / decoded)

    @cached_property
    def range_doppler(self) -> FloatArray:
        """(n_range, n_velocity) power, mean over the channels [W]."""
        x = self.data
        power = np.einsum("rvc,rvc->rv", x.real, x.real) + np.einsum("rvc,rvc->rv", x.imag, x.imag)
        return np.asarray(power / x.shape[2], dtype=np.float64)

    @cached_property
    def range_azimuth(self) -> FloatArray:
        """(n_range, n_azimuth) beamformed power of the azimuth aperture, the maximum over Doppler [W].

        A target of power P a channel on bin centres reads P; the strongest cell is the strongest target, and noise
        reads a few times ``noise_power_w`` over the number of channels.
        """
        vectors = angle.steering(
            self.profile.positions_m[self.azimuth_channels], self.profile.wavelength_m, self.azimuth_sine
        )
        n_range, n_velocity, _ = self.data.shape
        snapshots = self.data[:, :, self.azimuth_channels]
        if self.profile.n_subbands > 1:  # one target would show several times, in other directions
            snapshots = snapshots * strongest_alias(self.range_doppler, self.profile.n_subbands)[:, :, None]
        rows = max(1, _BEAM_CELLS // (n_velocity * len(vectors)))
        parts = [bartlett_max(snapshots[i : i + rows], vectors) for i in range(0, n_range, rows)]
        return np.concatenate(parts)

    # ---- files
    def save(self, path: str | os.PathLike[str]) -> None:
        """Save data, axes, maps and the whole profile to an ``.npz`` file; keys are the attribute names."""
        names = ["data", "range_m", "velocity_mps", "azimuth_rad", "range_doppler", "range_azimuth"]
        names += ["range_window", "doppler_window", "n_fft", "noise_added", "noise_power_w"]
        arrays: dict[str, Any] = {name: getattr(self, name) for name in names}
        if self.bursts:
            arrays["bursts"] = np.stack([cube.data for cube in self.bursts])
            arrays["burst_mid_offset_s"] = [cube.mid_offset_s for cube in self.bursts]
        weather = None if self.weather is None else self.weather.to_array()
        save_npz(path, arrays | {"profile": self.profile.model_dump_json(), "weather": weather})

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Load what :meth:`save` wrote.

        Raises
        ------
        NotFoundError, InputError
        """
        from ..config.profile import RadarProfile

        arrays = load_npz(path, ("data", "profile", "range_window", "doppler_window", "n_fft"))
        whole = cls(
            data=arrays["data"].astype(np.complex128),
            profile=RadarProfile.model_validate(json.loads(str(arrays["profile"]))),
            range_window=str(arrays["range_window"]),
            doppler_window=str(arrays["doppler_window"]),
            n_fft=(int(arrays["n_fft"][0]), int(arrays["n_fft"][1])),
            noise_added=bool(arrays.get("noise_added", True)),
            weather=Weather.from_array(arrays["weather"]) if "weather" in arrays else None,
        )
        if "bursts" not in arrays:
            return whole
        parts = zip(arrays["bursts"], whole.profile.bursts, arrays["burst_mid_offset_s"], strict=True)
        n_fft = (whole.n_fft[0], arrays["bursts"].shape[2])
        cubes = (
            replace(whole, data=data.astype(np.complex128), profile=profile, n_fft=n_fft, mid_offset_s=float(offset))
            for data, profile, offset in parts
        )
        return replace(whole, bursts=tuple(cubes))


def bartlett_max(snapshots: ComplexArray, vectors: ComplexArray) -> FloatArray:
    """Return the beamformed power of (n_range, n_velocity, n) snapshots, maximum over velocity."""
    return np.asarray(angle.bartlett(snapshots, vectors).max(axis=1), dtype=np.float64)


def _loop_code(profile: RadarProfile, n_fft: int) -> LoopCode | None:
    if profile.array.multiplex != "bpm":
        return None
    from ..synthesis.signal import hadamard

    starts = profile.raw_chirp_start_s
    offset = (starts - starts.mean(axis=1, keepdims=True)).mean(axis=0)
    return LoopCode(hadamard(profile.n_tx), offset, 1 / (n_fft * profile.loop_period_s))


def process(
    adc: AdcCube,
    *,
    range_window: str = "hann",
    doppler_window: str = "hann",
    n_fft: tuple[int, int] | None = None,
) -> RadarCube:
    """Transform ADC samples to the radar cube.

    Parameters
    ----------
    adc : AdcCube
        Samples and the profile that made them.
    range_window, doppler_window : str
        ``rect``, ``hann``, ``hamming``, ``blackmanharris``, ``taylor`` or ``chebyshev``.
    n_fft : (int, int), optional
        Lengths of the range and Doppler transforms; by default those of the data, without zero padding. Of a real ADC
        the positive half of the range transform is kept.

    Returns
    -------
    RadarCube
        Of a profile with ``stagger: burst`` that of the whole frame, with one of each burst in ``bursts``.

    Raises
    ------
    InputError
        Unknown window, a transform shorter than the data, or under DDM one that sub-bands do not divide.
    """
    profile = adc.profile
    w = profile.waveform
    lengths = (w.samples, w.chirps) if n_fft is None else (int(n_fft[0]), int(n_fft[1]))
    if lengths[0] < w.samples or lengths[1] < w.chirps:
        raise InputError(
            f"process: n_fft {lengths} is shorter than the data; at least ({w.samples}, {w.chirps}) = (samples, loops)"
        )
    if lengths[1] % profile.n_subbands:
        raise InputError(
            f"process: n_fft {lengths}: multiplex ddm needs a Doppler transform of a multiple of the "
            f"{profile.n_subbands} sub-bands"
        )
    ranges = range_spectrum(adc.data, name=range_window, n_fft=lengths[0], real=w.adc == "real")
    data = doppler_spectrum(
        ranges,
        name=doppler_window,
        n_fft=lengths[1],
        chirp_start_s=adc.chirp_start_s,
        loop_period_s=profile.loop_period_s,
    )
    code = _loop_code(profile, lengths[1])
    if code is not None:
        data = code.decode_anew(data, (np.arange(lengths[1]) - lengths[1] // 2).astype(np.float64))
    return RadarCube(
        data=data,
        profile=profile,
        range_window=range_window,
        doppler_window=doppler_window,
        n_fft=lengths,
        noise_added=adc.noise_power_w > 0,
        weather=adc.weather,
        returns=adc.returns,
        mid_offset_s=adc.mid_offset_s,
        bursts=_bursts(adc, range_window, doppler_window, lengths),
    )


def _bursts(adc: AdcCube, range_window: str, doppler_window: str, n_fft: tuple[int, int]) -> tuple[RadarCube, ...]:
    """Return the cubes of the bursts of a frame that has several, each with its share of the Doppler bins."""
    if len(adc.bursts) == 1:
        return ()
    lengths = (n_fft[0], -(-n_fft[1] // len(adc.bursts)))
    return tuple(
        process(burst, range_window=range_window, doppler_window=doppler_window, n_fft=lengths) for burst in adc.bursts
    )
