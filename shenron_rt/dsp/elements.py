"""What the elements of the array add to the phase and the range of a target, wave front curvature included."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .._typing import ComplexArray, FloatArray

__all__ = ["Elements"]


@dataclass(frozen=True)
class Elements:
    """The array and the scales that tie it to the cells.

    ``tx_m``, ``rx_m`` (n, 3) elements [m]; ``wavelength_m`` at f_c; ``range_step_m`` of a bin.
    """

    tx_m: FloatArray
    rx_m: FloatArray
    wavelength_m: float
    range_step_m: float

    @cached_property
    def positions(self) -> FloatArray:
        """(n_virtual, 3) tx + rx positions [m]."""
        return np.asarray((self.tx_m[:, None] + self.rx_m[None]).reshape(-1, 3))

    @cached_property
    def free(self) -> tuple[bool, bool]:
        """Whether the array has an aperture in azimuth and in elevation."""
        spans = np.ptp(self.positions, axis=0)
        return bool(spans[1] > 1e-3 * self.wavelength_m), bool(spans[2] > 1e-3 * self.wavelength_m)

    def phasor(self, distance: FloatArray, sine: FloatArray, elevation: FloatArray) -> tuple[ComplexArray, FloatArray]:
        """Return (n_peak, n_virtual) phasors and range shifts [bins] of a target at a distance [m] and direction.

        |p - a| - |p| = (a.a - 2 p.a) / (|p - a| + |p|) element by element: exact, without a difference of ranges.
        """
        forward = np.sqrt(np.maximum(1 - sine**2 - elevation**2, 0.0))
        away = np.maximum(distance, 1e-3)[:, None]
        target = away * np.stack([forward, sine, elevation], axis=1)
        legs = []
        for element in (self.tx_m, self.rx_m):
            excess = np.sum(element**2, axis=1) - 2 * target @ element.T  # |p - a|^2 - |p|^2
            legs.append(excess / (np.sqrt(np.maximum(away**2 + excess, 0.0)) + away))
        pairs = len(self.tx_m) * len(self.rx_m)  # -1 could not be told where there is no peak at all
        path = (legs[0][:, :, None] + legs[1][:, None, :]).reshape(len(target), pairs)
        phasor = np.exp(2j * np.pi / self.wavelength_m * path)
        return np.asarray(phasor, dtype=np.complex128), path / (2 * self.range_step_m)

    def slopes(self, sine: FloatArray, elevation: FloatArray) -> list[FloatArray]:
        """Return d phase / d cosine of a far target, one (n_peak, n_virtual) array per free direction cosine."""
        positions = self.positions
        forward = np.sqrt(np.maximum(1 - sine**2 - elevation**2, 1e-4))
        out = []
        for axis, cosine, free in ((1, sine, self.free[0]), (2, elevation, self.free[1])):
            if free:
                lever = positions[:, axis] - (cosine / forward)[:, None] * positions[:, 0]
                out.append(-2 * np.pi / self.wavelength_m * lever)
        return out
