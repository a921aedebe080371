"""Where in the cube an object is looked for: its cell of range and velocity, and the beam towards it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .._typing import ComplexArray, FloatArray
from ..constants import SPEED_OF_LIGHT
from ..dsp import RadarCube
from ..dsp.angle import bartlett, has_elevation, refine_peak, steering
from ..dsp.elements import Elements
from .records import Cell

__all__ = ["Look", "look_at_detection", "look_at_peak", "strongest_beam"]

#: Elevation beams tried, across the visible sines.
_ELEVATION_BEAMS = 65
#: Cells beamformed together in the search for the strongest.
_CELLS_AT_ONCE = 1024
#: Passes over azimuth and elevation in turn.
_PASSES = 2


@dataclass(frozen=True, eq=False)
class Look:
    """A cell and a beam.

    Parameters
    ----------
    cube : RadarCube
        Whose axes they are.
    row, column : int
    distance_m : float
        Range of the cell without its range-Doppler coupling; sets the curvature of the wave front [m].
    velocity_mps : float
        Range rate, folded as the radar sees it [m/s].
    sine, sine_elevation : float
        Direction cosines of the beam (y, z).
    """

    cube: RadarCube
    row: int
    column: int
    distance_m: float
    velocity_mps: float
    sine: float
    sine_elevation: float

    @cached_property
    def phasor(self) -> ComplexArray:
        """(n_virtual,) what a target there leaves on the channels, wave front curvature included."""
        where = np.array([self.sine]), np.array([self.sine_elevation])
        return np.asarray(_phasors(self.cube, self.distance_m, *where)[0], dtype=np.complex128)

    def beamformed(self, cube: RadarCube) -> complex:
        """Return the amplitude in the beam [sqrt(W)]; a target there of power P a channel reads abs()**2 = P."""
        return complex(self.phasor.conj() @ cube.data[self.row, self.column] / len(self.phasor))

    def record(self) -> Cell:
        """Return the plain record."""
        elevation = float(np.arcsin(np.clip(self.sine_elevation, -1, 1)))
        azimuth = float(np.arcsin(np.clip(self.sine / max(np.cos(elevation), 1e-9), -1, 1)))
        p = self.cube.profile
        valid = has_elevation(p.positions_m, p.wavelength_m)
        return Cell(
            self.row, self.column, self.distance_m, self.velocity_mps, float(np.degrees(azimuth)),
            float(np.degrees(elevation)) if valid else None,
        )  # fmt: skip


def _phasors(cube: RadarCube, distance_m: float, sine: FloatArray, elevation: FloatArray) -> ComplexArray:
    p = cube.profile
    elements = Elements(p.tx_m, p.rx_m, p.wavelength_m, cube.range_step_m)
    return elements.phasor(np.full(len(sine), distance_m), sine, elevation)[0]


def _coupling_m(cube: RadarCube, doppler_hz: float) -> float:
    """Return the apparent range that a Doppler frequency adds, c f_D / 2k [m]."""
    return doppler_hz * SPEED_OF_LIGHT / (2 * cube.profile.slope_hz_per_s)


def look_at_detection(
    cube: RadarCube, distance_m: float, velocity_mps: float, azimuth: float, elevation: float
) -> Look:
    """Return the cell of a detection, the local maximum beside its estimate, and the beam it was measured with.

    Parameters
    ----------
    cube : RadarCube
    distance_m, velocity_mps : float
        As detected [m], [m/s].
    azimuth, elevation : float
        [rad]; NaN elevation is 0.
    """
    p = cube.profile
    delay = 2 * distance_m / SPEED_OF_LIGHT
    doppler_hz = velocity_mps * 2 * (p.center_hz - p.slope_hz_per_s * delay) / SPEED_OF_LIGHT
    n_range, n_velocity, _ = cube.data.shape
    at = (distance_m + _coupling_m(cube, doppler_hz)) / cube.range_step_m
    bins = doppler_hz * cube.n_fft[1] * p.loop_period_s + cube.n_fft[1] // 2
    rows = (round(at) + np.arange(-1, 2)) % n_range
    columns = (round(bins) + np.arange(-1, 2)) % n_velocity
    near = cube.range_doppler[np.ix_(rows, columns)]
    i, j = np.unravel_index(int(near.argmax()), near.shape)
    tilt = 0.0 if np.isnan(elevation) else elevation
    sine = float(np.sin(azimuth) * np.cos(tilt))
    return Look(cube, int(rows[i]), int(columns[j]), distance_m, velocity_mps, sine, float(np.sin(tilt)))


def look_at_peak(own: RadarCube, first_row: int = 0) -> Look | None:
    """Return the strongest cell of an object's own noise-free cube and the beam with most of it.

    Parameters
    ----------
    own : RadarCube
    first_row : int
        Rows before are blanked.

    Returns
    -------
    Look or None
        ``None`` where there is nothing in the cube.
    """
    power = own.range_doppler.copy()
    power[:first_row] = 0.0
    if not power.max(initial=0.0) > 0:
        return None
    row, column = (int(v) for v in np.unravel_index(int(power.argmax()), power.shape))
    p = own.profile
    doppler_hz = (column - own.n_fft[1] // 2) / (own.n_fft[1] * p.loop_period_s)
    distance = row * own.range_step_m - _coupling_m(own, doppler_hz)
    if p.waveform.adc == "complex" and distance <= 0:
        distance += own.range_step_m * own.n_fft[0]
    distance = max(distance, 1e-3)
    velocity = doppler_hz * SPEED_OF_LIGHT / (2 * p.center_hz)
    sine, elevation = _direction(own, own.data[row, column], distance)
    return Look(own, row, column, distance, float(velocity), sine, elevation)


def _direction(cube: RadarCube, snapshot: ComplexArray, distance_m: float) -> tuple[float, float]:
    """Return the direction cosines of the strongest beam, azimuth and elevation in turn."""
    p = cube.profile
    sine, elevation = 0.0, 0.0
    rows = has_elevation(p.positions_m, p.wavelength_m)
    grid = cube.azimuth_sine
    for _ in range(_PASSES if rows else 1):
        if rows:
            tried = np.linspace(-1, 1, _ELEVATION_BEAMS) * np.sqrt(1 - sine**2)
            elevation = _best(snapshot, _phasors(cube, distance_m, np.full(len(tried), sine), tried), tried)
        visible = grid[np.abs(grid) <= np.sqrt(1 - elevation**2) + 1e-12]
        sine = _best(snapshot, _phasors(cube, distance_m, visible, np.full(len(visible), elevation)), visible)
    return sine, elevation


def _best(snapshot: ComplexArray, vectors: ComplexArray, tried: FloatArray) -> float:
    power = np.maximum(bartlett(snapshot, vectors), np.finfo(float).tiny)
    index = np.asarray(int(power.argmax()))
    step = float(tried[1] - tried[0]) if len(tried) > 1 else 0.0
    return float(np.clip(tried[index] + step * float(refine_peak(power, index)), -1.0, 1.0))


def strongest_beam(cube: RadarCube, first_row: int = 0) -> tuple[Look, float, float] | None:
    """Return cell, azimuth [deg] and power [W] of the maximum of ``cube.range_azimuth`` from a row on.

    The mean power of the channels bounds that of any beam, so that cells in falling order of it are beamformed only
    until no cell left can be stronger.
    """
    p, channels = cube.profile, cube.azimuth_channels
    data = cube.data[first_row:][:, :, channels].reshape(-1, len(channels))
    bound = np.mean(data.real**2 + data.imag**2, axis=1)
    if not bound.max(initial=0.0) > 0:
        return None
    vectors = steering(p.positions_m[channels], p.wavelength_m, cube.azimuth_sine)
    order = np.argsort(-bound, kind="stable")
    best, cell, beam = 0.0, 0, 0
    for start in range(0, len(order), _CELLS_AT_ONCE):
        some = order[start : start + _CELLS_AT_ONCE]
        if bound[some[0]] <= best:
            break
        power = bartlett(data[some], vectors)
        i, j = np.unravel_index(int(power.argmax()), power.shape)
        if power[i, j] > best:
            best, cell, beam = float(power[i, j]), int(some[i]), int(j)
    row, column = divmod(cell, cube.data.shape[1])
    row += first_row
    look = Look(cube, row, column, row * cube.range_step_m, 0.0, float(cube.azimuth_sine[beam]), 0.0)
    return look, float(np.degrees(cube.azimuth_rad[beam])), best
