"""Directions of the targets of a cell: where to start the fit, and whether a second target hides in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .._typing import ComplexArray, FloatArray, IntArray
from . import angle
from .refine import PeakFit

if TYPE_CHECKING:
    from .cube import RadarCube

__all__ = ["beam_sine", "coarse_direction", "distinct", "second_direction"]

#: Elevation beams tried before the fit, across the visible sines.
_ELEVATION_BEAMS = 33
#: A second target in one range-Doppler cell: weakest power relative to the first, channels it takes to tell two.
_SECOND_PART, _CHANNELS_FOR_TWO = 10**-1.2, 4


def coarse_direction(cube: RadarCube, snapshots: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Return the direction cosines of the strongest beam: azimuth by the widest row, then elevation by all channels."""
    p = cube.profile
    vectors = angle.steering(p.positions_m[cube.azimuth_channels], p.wavelength_m, cube.azimuth_sine)
    sine = cube.azimuth_sine[np.argmax(angle.bartlett(snapshots[:, cube.azimuth_channels], vectors), axis=1)]
    elevation = np.zeros(len(sine))
    if angle.has_elevation(p.positions_m, p.wavelength_m) and len(sine):
        tried = np.linspace(-1, 1, _ELEVATION_BEAMS) * np.sqrt(1 - sine**2)[:, None]
        steered = angle.steering(p.positions_m, p.wavelength_m, sine[:, None], tried)
        beams = np.abs(np.einsum("pkc,pc->pk", steered.conj(), snapshots))
        elevation = tried[np.arange(len(sine)), np.argmax(beams, axis=1)]
    return sine, elevation


def second_direction(
    cube: RadarCube, rest: ComplexArray, fit: PeakFit, threshold: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return peaks whose cell holds another direction when the fitted target is taken out, and that direction.

    It must stand a beam away, above the threshold, and no more than 12 dB below the first: what a line of six leaves
    of an extended or mismodelled target is weaker.
    """
    empty = np.zeros(0)
    if len(cube.azimuth_channels) < _CHANNELS_FOR_TWO or not len(rest):
        return np.zeros(0, dtype=np.int64), empty, empty
    sine, elevation = coarse_direction(cube, rest)
    vectors = angle.steering(cube.profile.positions_m, cube.profile.wavelength_m, sine, elevation)
    power = np.abs(np.einsum("pc,pc->p", vectors.conj(), rest) / rest.shape[1]) ** 2
    clear = power > np.maximum(threshold, _SECOND_PART * np.abs(fit.amplitude) ** 2)
    clear &= np.abs(sine - fit.sine) > beam_sine(cube)
    which = np.flatnonzero(clear)
    return which, sine[which], elevation[which]


def beam_sine(cube: RadarCube) -> float:
    """Return the resolution of the azimuth aperture in sine: 2/M of a half-wavelength line of M columns."""
    aperture = float(np.ptp(cube.profile.positions_m[cube.azimuth_channels, 1]))
    return 2 / (2 * aperture / cube.profile.wavelength_m + 1)


def distinct(cube: RadarCube, first: PeakFit, second: PeakFit) -> IntArray:
    """Return the pairs that stayed a beam apart and did not blow up against each other."""
    strong, weak = np.abs(first.amplitude) ** 2, np.abs(second.amplitude) ** 2
    apart = np.abs(first.sine - second.sine) > 0.8 * beam_sine(cube)
    return np.flatnonzero(apart & (weak > _SECOND_PART * strong) & (weak < 2 * strong))
