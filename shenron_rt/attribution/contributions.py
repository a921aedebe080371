"""What each object leaves in the samples and in the cube: the chain is linear, so the parts add up to the whole."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from .._typing import BoolArray, FloatArray, IntArray
from ..dsp import RadarCube, noise_threshold, process
from ..dsp.spectra import range_spectrum
from ..returns import Returns
from ..synthesis import AdcCube, synthesize

__all__ = ["GHOST", "Contributions", "some_returns"]

#: Cubes of objects that are kept rather than made again [bytes].
_KEEP_BYTES = 512 << 20
#: RMS error of an object's samples relative to their own RMS.
ACCURACY = 1e-6
#: Added to an object's id: its echoes that show it where it is not. They are a part of their own.
GHOST = 1 << 32
#: Echoes whose amplitudes, all in phase, stay this far below the noise of a beamformed cell leave nothing to tell.
_NOTHING = 1e-4


def some_returns(returns: Returns, rows: BoolArray | IntArray) -> Returns:
    """Return some of the echoes."""
    columns = {f.name: getattr(returns, f.name) for f in fields(returns)}
    picked: dict[str, Any] = {name: v[rows] for name, v in columns.items() if isinstance(v, np.ndarray)}
    if returns.chains is not None:
        picked["chains"] = replace(returns.chains, row=returns.chains.row[rows], ghost=returns.chains.ghost[rows])
    return replace(returns, **picked)


@dataclass
class Contributions:
    """The noise-free samples and cubes of each part alone: an object, or, at its id + ``GHOST``, its ghosts.

    Parameters
    ----------
    returns : Returns
        All echoes.
    cube : RadarCube
        Whose profile, windows and transform lengths are used.
    accuracy : float
        Of the synthesis, relative to the RMS of each object's own samples.
    """

    returns: Returns
    cube: RadarCube
    accuracy: float = ACCURACY
    _kept: OrderedDict[int, RadarCube] = field(default_factory=OrderedDict, repr=False)
    _kept_bytes: int = field(default=0, repr=False)
    _levels: dict[int, tuple[float, FloatArray]] = field(default_factory=dict, repr=False)
    _thresholds: dict[int, FloatArray] = field(default_factory=dict, repr=False)

    @cached_property
    def part(self) -> IntArray:
        """(n,) int64, the part that each echo belongs to."""
        return self.returns.object_id.astype(np.int64) + GHOST * self.returns.ghost

    @cached_property
    def ids(self) -> list[int]:
        """Parts with echoes, ascending."""
        return [int(i) for i in np.unique(self.part)]

    @cached_property
    def whole(self) -> RadarCube:
        """The noise-free cube of all parts together."""
        return self.processed(self._synthesized(self.returns))

    def returns_of(self, object_id: int) -> Returns:
        """Return the echoes of one object."""
        return some_returns(self.returns, self.part == object_id)

    def negligible(self, object_id: int) -> bool:
        """Tell whether the object's echoes could never be told from nothing, even all in phase."""
        most = float(np.abs(self.returns.amplitude[self.part == object_id]).sum()) ** 2
        return most <= _NOTHING * self.cube.noise_power_w / self.cube.profile.n_virtual

    def samples(self, object_id: int) -> AdcCube:
        """Return the noise-free samples of one object; an ideal receiver, without the steps of its ADC."""
        return self._synthesized(self.returns_of(object_id))

    def _synthesized(self, returns: Returns) -> AdcCube:
        receiver = self.cube.profile.receiver.model_copy(update={"adc_bits": None, "full_scale_dbm": None})
        profile = self.cube.profile.model_copy(update={"receiver": receiver})
        return synthesize(returns, profile, noise=None, accuracy=self.accuracy)

    def processed(self, samples: AdcCube) -> RadarCube:
        """Return the cube of some samples, transformed as the frame's own was."""
        made = process(
            samples,
            range_window=self.cube.range_window,
            doppler_window=self.cube.doppler_window,
            n_fft=self.cube.n_fft,
        )
        return replace(made, profile=self.cube.profile)

    def of(self, object_id: int) -> RadarCube:
        """Return the noise-free cube of one object."""
        if object_id in self._kept:
            self._kept.move_to_end(object_id)
            return self._kept[object_id]
        samples = self.samples(object_id)
        self._levels[object_id] = self._measured(samples)
        made = self.processed(samples)
        self._kept[object_id] = made
        self._kept_bytes += made.data.nbytes
        while self._kept_bytes > _KEEP_BYTES and len(self._kept) > 1:
            _, oldest = self._kept.popitem(last=False)
            self._kept_bytes -= oldest.data.nbytes
        return made

    def _measured(self, samples: AdcCube) -> tuple[float, FloatArray]:
        real = self.cube.profile.waveform.adc == "real"
        ranges = range_spectrum(samples.data, name=self.cube.range_window, n_fft=self.cube.n_fft[0], real=real)
        profile = np.mean(ranges.real**2 + ranges.imag**2, axis=(0, 1))
        return float(np.mean(np.abs(samples.data) ** 2)), np.asarray(profile, dtype=np.float64)

    def levels(self, object_id: int) -> tuple[float, FloatArray]:
        """Return mean power of an object's samples, and of its range bins (n_range,) before the Doppler transform [W].

        Means over loops and channels.
        """
        if object_id not in self._levels:
            self.of(object_id)
        return self._levels[object_id]

    def alone(self, object_id: int) -> RadarCube:
        """Return the frame's own cube, noise included, with all parts taken out but one."""
        data = self.cube.data - self.whole.data + self.of(object_id).data
        return replace(self.cube, data=data, returns=self.returns_of(object_id))

    def without(self, object_ids: list[int]) -> RadarCube:
        """Return the frame's own cube, noise included, with some objects taken out."""
        data = self.cube.data.copy()
        for number in object_ids:
            data -= self.of(number).data
        left = some_returns(self.returns, ~np.isin(self.part, object_ids))
        return replace(self.cube, data=data, returns=left)

    def map_of(self, object_id: int) -> FloatArray:
        """Return (n_range, n_velocity) the object's power, mean over the channels [W]."""
        return self.of(object_id).range_doppler

    def threshold_of(self, object_id: int) -> FloatArray:
        """Return (n_range, n_velocity) the CFAR threshold that the object alone would set [W]."""
        if object_id not in self._thresholds:
            pfa = self.cube.profile.processing.pfa
            self._thresholds[object_id] = noise_threshold(self.cube, pfa=pfa, power=self.map_of(object_id))
        return self._thresholds[object_id]
