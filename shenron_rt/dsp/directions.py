"""Directions of the targets of a cell: where to start the fit, and whether a second target hides in it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from .._typing import BoolArray, ComplexArray, FloatArray, IntArray
from . import angle
from .refine import PeakFit

if TYPE_CHECKING:
    from .cube import RadarCube

__all__ = ["beam_sine", "coarse_direction", "distinct", "second_direction"]

#: Elevation beams tried before the fit, across the visible sines: at least, and a beam of the array's height.
_ELEVATION_BEAMS, _PER_BEAM = 33, 4
#: Beams this near the strongest are its grating lobes, and the antenna's pattern decides (power).
_GRATING = 0.9
#: A second target in one range-Doppler cell: weakest power relative to the first, channels it takes to tell two.
_SECOND_PART, _CHANNELS_FOR_TWO = 10**-1.2, 4


def coarse_direction(cube: RadarCube, snapshots: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Return the direction cosines of the strongest beam: azimuth by the widest row, then elevation by all channels.

    Rows farther apart than half a wavelength repeat a target in elevation; of equal beams the one with more antenna
    gain is taken.
    """
    p = cube.profile
    vectors = angle.steering(p.positions_m[cube.azimuth_channels], p.wavelength_m, cube.azimuth_sine)
    sine = cube.azimuth_sine[np.argmax(angle.bartlett(snapshots[:, cube.azimuth_channels], vectors), axis=1)]
    elevation = np.zeros(len(sine))
    if angle.has_elevation(p.positions_m, p.wavelength_m) and len(sine):
        tried = np.linspace(-1, 1, _elevation_beams(cube)) * np.sqrt(1 - sine**2)[:, None]
        steered = angle.steering(p.positions_m, p.wavelength_m, sine[:, None], tried)
        beams = np.abs(np.einsum("pkc,pc->pk", steered.conj(), snapshots)) ** 2
        best = np.argmax(np.where(_equal_peaks(beams), _gain(cube, sine, tried), -1.0), axis=1)
        elevation = tried[np.arange(len(sine)), best]
    return sine, elevation


def _elevation_beams(cube: RadarCube) -> int:
    height = float(np.ptp(cube.profile.positions_m[:, 2])) / cube.profile.wavelength_m
    return max(_ELEVATION_BEAMS, 2 * math.ceil(_PER_BEAM * (2 * height + 1) / 2) + 1)


def _equal_peaks(beams: FloatArray) -> BoolArray:
    """Mark the local maxima of each row of (n, k) powers that equal its largest, up to how finely it is sampled."""
    wide = np.pad(beams, ((0, 0), (1, 1)), constant_values=-1.0)
    peak = (beams >= wide[:, :-2]) & (beams >= wide[:, 2:])
    return np.asarray(peak & (beams >= _GRATING * beams.max(axis=1, keepdims=True)), dtype=bool)


def _gain(cube: RadarCube, sine: FloatArray, elevation: FloatArray) -> FloatArray:
    """Return the one-way pattern of directions (n,) and (n, k); the nearest to the horizon where it is the same."""
    tilt = np.arcsin(np.clip(elevation, -1, 1))
    azimuth = np.arcsin(np.clip(sine[:, None] / np.maximum(np.cos(tilt), 1e-9), -1, 1))
    pattern = np.asarray(cube.profile.pattern(azimuth, tilt), dtype=np.float64)
    return np.asarray(pattern * (1 - 1e-6 * np.abs(elevation)), dtype=np.float64)


def second_direction(
    cube: RadarCube, rest: ComplexArray, fit: PeakFit, threshold: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return peaks whose cell holds another direction when the fitted target is taken out, and that direction.

    It must stand a beam away, in azimuth or, where the array has rows enough, in elevation, above the threshold, and no
    more than 12 dB below the first: what a line of six leaves of an extended or mismodelled target is weaker.
    """
    empty = np.zeros(0)
    if not any(_tells_two(cube)) or not len(rest):
        return np.zeros(0, dtype=np.int64), empty, empty
    sine, elevation = coarse_direction(cube, rest)
    vectors = angle.steering(cube.profile.positions_m, cube.profile.wavelength_m, sine, elevation)
    power = np.abs(np.einsum("pc,pc->p", vectors.conj(), rest) / rest.shape[1]) ** 2
    clear = power > np.maximum(threshold, _SECOND_PART * np.abs(fit.amplitude) ** 2)
    clear &= _apart(cube, sine - fit.sine, elevation - fit.sine_elevation, 1.0)
    which = np.flatnonzero(clear)
    return which, sine[which], elevation[which]


def _tells_two(cube: RadarCube) -> tuple[bool, bool]:
    """Tell whether the array has channels enough for two targets in azimuth, and rows enough in elevation."""
    p = cube.profile
    rows = len(np.unique(np.round(p.positions_m[:, 2] / (1e-3 * p.wavelength_m))))
    return len(cube.azimuth_channels) >= _CHANNELS_FOR_TWO, rows >= _CHANNELS_FOR_TWO


def _apart(cube: RadarCube, sine: FloatArray, elevation: FloatArray, beams: float) -> BoolArray:
    """Tell which differences of direction cosines exceed so many beams in azimuth or elevation."""
    azimuth_tells, elevation_tells = _tells_two(cube)
    apart = np.zeros(len(sine), dtype=bool)
    if azimuth_tells:
        apart |= np.abs(sine) > beams * beam_sine(cube)
    if elevation_tells:
        height = float(np.ptp(cube.profile.positions_m[:, 2]))
        apart |= np.abs(elevation) > beams * _beam(height, cube.profile.wavelength_m)
    return apart


def beam_sine(cube: RadarCube) -> float:
    """Return the resolution of the azimuth aperture in sine: 2/M of a half-wavelength line of M columns."""
    aperture = float(np.ptp(cube.profile.positions_m[cube.azimuth_channels, 1]))
    return _beam(aperture, cube.profile.wavelength_m)


def _beam(aperture_m: float, wavelength_m: float) -> float:
    return 2 / (2 * aperture_m / wavelength_m + 1)


def distinct(cube: RadarCube, first: PeakFit, second: PeakFit) -> IntArray:
    """Return the pairs that stayed a beam apart and did not blow up against each other."""
    strong, weak = np.abs(first.amplitude) ** 2, np.abs(second.amplitude) ** 2
    apart = _apart(cube, first.sine - second.sine, first.sine_elevation - second.sine_elevation, 0.8)
    return np.flatnonzero(apart & (weak > _SECOND_PART * strong) & (weak < 2 * strong))
