"""The ADC cube."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Self

import numpy as np

from .._typing import ComplexArray, FloatArray
from ..config.profile import RadarProfile
from ..errors import InputError
from ..io.npz import load_npz, save_npz
from ..returns import Returns
from ..scatterers import Weather

__all__ = ["AdcCube"]


@dataclass(frozen=True)
class AdcCube:
    """One frame of ADC samples per virtual channel.

    Parameters
    ----------
    data : (n_loops, n_virtual, n_samples) complex128
        sqrt(W) RMS at the receiver input; virtual = tx * n_rx + rx. A real ADC leaves the imaginary part zero, but for
        DDM: there every channel is its receiver, turned back by the ramp of its transmitter.
    profile : RadarProfile
        The radar that made it; all axes derive from it.
    noise_power_w : float
        Thermal noise per sample that was added [W]; 0 where none was.
    seed, frame : int
        What the noise derives from.
    weather : Weather or None
        Whose attenuation the samples have, for the RCS of detections.
    returns : Returns or None
        The echoes behind it, for truth attribution; not saved with the cube.
    mid_offset_s : float
        Middle of its chirps after mid-frame; 0 but for one burst of a frame [s].
    """

    dims: ClassVar[tuple[str, str, str]] = ("chirp", "antenna", "sample")

    data: ComplexArray
    profile: RadarProfile
    noise_power_w: float = 0.0
    seed: int = 0
    frame: int = 0
    weather: Weather | None = None
    returns: Returns | None = field(default=None, repr=False)
    mid_offset_s: float = 0.0

    def __post_init__(self) -> None:
        w = self.profile.waveform
        shape = (w.chirps, self.profile.n_virtual, w.samples)
        if np.shape(self.data) != shape:
            raise InputError(
                f"AdcCube.data: profile {self.profile.name!r} needs shape {shape} {self.dims}, "
                f"got {np.shape(self.data)}"
            )

    def __repr__(self) -> str:
        return f"AdcCube({self.data.shape} {self.dims}, profile {self.profile.name!r}, seed {self.seed})"

    @property
    def chirp_start_s(self) -> FloatArray:
        """(n_loops, n_virtual) chirp starts [s]."""
        return self.profile.chirp_start_s

    @property
    def positions_m(self) -> FloatArray:
        """(n_virtual, 3) tx + rx positions (two-way sum) from the mount origin [m]."""
        return self.profile.positions_m

    @property
    def bursts(self) -> tuple[AdcCube, ...]:
        """The bursts of the frame as cubes of their own, each with the one interval of its chirps."""
        if len(self.profile.bursts) == 1:
            return (self,)
        loops, parts = self.profile.bursts[0].waveform.chirps, []
        for i, profile in enumerate(self.profile.bursts):
            rows = slice(i * loops, (i + 1) * loops)
            begin = float(self.chirp_start_s[rows].min())
            offset = begin + profile.frame_mid_s - self.profile.frame_mid_s
            parts.append(replace(self, data=self.data[rows], profile=profile, mid_offset_s=offset))
        return tuple(parts)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Save data, axes and the whole profile to an ``.npz`` file."""
        arrays: dict[str, Any] = {
            "data": self.data,
            "dims": np.asarray(self.dims),
            "chirp_start_s": self.chirp_start_s,
            "positions_m": self.positions_m,
            "profile": self.profile.model_dump_json(),
            "noise_power_w": self.noise_power_w,
            "seed": self.seed,
            "frame": self.frame,
            "weather": None if self.weather is None else self.weather.to_array(),
        }
        save_npz(path, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Load what :meth:`save` wrote.

        Raises
        ------
        NotFoundError, InputError
        """
        arrays = load_npz(path, ("data", "profile"))
        profile = RadarProfile.model_validate(json.loads(str(arrays["profile"])))
        return cls(
            data=arrays["data"].astype(np.complex128),
            profile=profile,
            noise_power_w=float(arrays.get("noise_power_w", 0.0)),
            seed=int(arrays.get("seed", 0)),
            frame=int(arrays.get("frame", 0)),
            weather=Weather.from_array(arrays["weather"]) if "weather" in arrays else None,
        )
