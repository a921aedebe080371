"""Which object stands behind a detection: the echoes seen through the response of the detection's own cell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .._typing import ComplexArray, FloatArray, IntArray
from ..constants import SPEED_OF_LIGHT
from . import angle
from .windows import window

if TYPE_CHECKING:
    from ..returns import Returns
    from .cube import RadarCube

__all__ = ["Attribution", "attribute"]

#: Echoes farther than this from the detection's cell [unpadded bins] do not count for it.
_REACH_BINS = 1
#: Points per bin, and per half wavelength aperture, of the response tables.
_TABLE_STEP = 32


@dataclass(frozen=True)
class Attribution:
    """Truth of every detection: object, tag, power in the cell [W], velocity [m/s]; -1, 0, 0, NaN where none."""

    object_id: IntArray
    tag: IntArray
    power: FloatArray
    velocity: FloatArray


@dataclass(frozen=True)
class _Echoes:
    """Echoes in measured coordinates: range bin, unfolded Doppler bin, direction cosines, range rate."""

    range_bin: FloatArray
    doppler_bin: FloatArray
    velocity: FloatArray

    @classmethod
    def of(cls, returns: Returns, cube: RadarCube) -> _Echoes:
        p = cube.profile
        distance = np.sqrt(np.einsum("ni,ni->n", returns.position, returns.position))
        radial = np.einsum("ni,ni->n", returns.position, returns.velocity) / np.maximum(distance, 1e-9)
        doppler_hz = 2 * radial / SPEED_OF_LIGHT * p.center_hz
        # the beat frequency of a moving echo is k tau + Doppler
        apparent = distance + doppler_hz * SPEED_OF_LIGHT / (2 * p.slope_hz_per_s)
        bin_hz = 1 / (cube.n_fft[1] * p.loop_period_s)
        return cls(apparent / cube.range_step_m, doppler_hz / bin_hz + cube.n_fft[1] // 2, radial)


def _response(name: str, n: int, n_fft: int, offset: FloatArray) -> FloatArray:
    """Return the real response of a window at offsets [bins], from a table."""
    w = window(name, n)
    centre = np.sum(w * np.arange(n)) / w.sum()
    reach = float(np.max(np.abs(offset), initial=1.0)) + 1
    x = np.linspace(-reach, reach, int(2 * reach * _TABLE_STEP) + 1)
    table = np.cos(2 * np.pi / n_fft * x[:, None] * (np.arange(n) - centre)) @ w / w.sum()
    return np.asarray(np.interp(offset, x, table))


def _pairs(cube: RadarCube, echoes: _Echoes, row: IntArray, column: IntArray) -> tuple[IntArray, IntArray]:
    """Return (echo, peak cell) index pairs that lie within reach of each other; peaks are the unique cells."""
    n_range, n_velocity, _ = cube.data.shape
    stride = [-(-cube.n_fft[0] // cube.profile.waveform.samples), -(-cube.n_fft[1] // cube.profile.waveform.chirps)]
    owner = np.full((n_range, n_velocity), -1, dtype=np.int64)
    owner[row, column] = np.arange(len(row))
    near = np.zeros((n_range, n_velocity), dtype=bool)
    shifts = [np.arange(-_REACH_BINS * k, _REACH_BINS * k + 1) for k in stride]
    di, dj = (a.ravel() for a in np.meshgrid(*shifts, indexing="ij"))
    near[(row[:, None] + di) % n_range, (column[:, None] + dj) % n_velocity] = True
    i = np.rint(echoes.range_bin).astype(np.int64) % n_range
    j = np.rint(echoes.doppler_bin).astype(np.int64) % n_velocity
    close = np.flatnonzero(near[i, j])
    cell = owner[(i[close, None] + di) % n_range, (j[close, None] + dj) % n_velocity]
    which, shift = np.nonzero(cell >= 0)
    return close[which], cell[which, shift]


def attribute(
    cube: RadarCube, returns: Returns, row: IntArray, column: IntArray, sine: FloatArray, elevation: FloatArray
) -> Attribution:
    """Find the object that puts the most power into each detection's cell of range, velocity and direction.

    Parameters
    ----------
    cube : RadarCube
    returns : Returns
        The echoes behind the cube.
    row, column : (n,) int
        Peak cells.
    sine, elevation : (n,) float
        Direction cosines of the beams (y, z); NaN elevation counts as 0.

    Notes
    -----
    Each echo is weighted with the response of both windows and of the array; an object's coherent echoes add as
    phasors, its incoherent ones as powers. An object below the expected noise of the beamformed cell does not count.
    """
    n = len(row)
    none = Attribution(np.full(n, -1), np.zeros(n, dtype=np.uint8), np.zeros(n), np.full(n, np.nan))
    if n == 0 or len(returns) == 0:
        return none
    cells, of_cell = np.unique(np.stack([row, column], axis=1), axis=0, return_inverse=True)
    echoes = _Echoes.of(returns, cube)
    echo, cell = _pairs(cube, echoes, cells[:, 0], cells[:, 1])
    # several beams may look at one cell: repeat its echoes for each of them
    order = np.argsort(of_cell.ravel(), kind="stable")
    counts = np.bincount(of_cell.ravel(), minlength=len(cells))
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    times = counts[cell]
    echo_pair = np.repeat(echo, times)
    within = np.arange(len(echo_pair)) - np.repeat(np.cumsum(times) - times, times)
    peak = order[np.repeat(first[cell], times) + within]
    if not len(echo_pair):
        return none
    weight, phasor = _weights(cube, returns, echoes, echo_pair, peak, row, column, sine, np.nan_to_num(elevation))
    return _strongest(cube, returns, echoes, echo_pair, peak, weight, phasor, none)


def _weights(
    cube: RadarCube,
    returns: Returns,
    echoes: _Echoes,
    echo: IntArray,
    peak: IntArray,
    row: IntArray,
    column: IntArray,
    sine: FloatArray,
    elevation: FloatArray,
) -> tuple[FloatArray, ComplexArray]:
    """Return the real response of each (echo, peak) pair and the echo's phasor about the middle of the array."""
    p = cube.profile
    n_range, n_velocity, _ = cube.data.shape
    off_r = (echoes.range_bin[echo] - row[peak] + n_range / 2) % n_range - n_range / 2
    off_d = (echoes.doppler_bin[echo] - column[peak] + n_velocity / 2) % n_velocity - n_velocity / 2
    weight = _response(cube.range_window, p.waveform.samples, cube.n_fft[0], off_r)
    weight = weight * _response(cube.doppler_window, p.waveform.chirps, cube.n_fft[1], off_d)
    used, of_used = np.unique(echo, return_inverse=True)
    position = returns.position[used]
    distance = np.maximum(np.linalg.norm(position, axis=1), 1e-9)
    cosines = position / distance[:, None]
    centred = p.positions_m - p.positions_m.mean(axis=0)
    array_phase = -2 * np.pi / p.wavelength_m * (cosines @ p.positions_m.mean(axis=0))
    phasor = returns.amplitude[used] * np.exp(1j * (4 * np.pi / p.wavelength_m * distance + array_phase))
    # the array's response depends on the difference of direction cosines only
    ds = cosines[of_used, 1] - sine[peak]
    de = (
        cosines[of_used, 2] - elevation[peak]
        if angle.has_elevation(p.positions_m, p.wavelength_m)
        else np.zeros_like(ds)
    )
    return weight * _array_response(centred, p.wavelength_m, ds, de), phasor[of_used]


def _array_response(centred: FloatArray, wavelength_m: float, ds: FloatArray, de: FloatArray) -> FloatArray:
    """Return the real part of the array factor at differences of direction cosines, summed in parts over channels."""
    out = np.zeros(len(ds))
    columns, count = np.unique(np.round(centred[:, 1:], 9), axis=0, return_counts=True)
    if not np.any(columns[:, 1]) or not np.any(de):
        reach = float(np.max(np.abs(ds), initial=0.0)) + 1e-3
        points = int(2 * reach * _TABLE_STEP * (1 + np.ptp(columns[:, 0]) / wavelength_m)) + 3
        x = np.linspace(-reach, reach, points)
        table = np.cos(2 * np.pi / wavelength_m * x[:, None] * columns[:, 0]) @ count / count.sum()
        return np.asarray(np.interp(ds, x, table))
    for (y, z), times in zip(columns, count, strict=True):
        out += times * np.cos(2 * np.pi / wavelength_m * (y * ds + z * de))
    return np.asarray(out / count.sum(), dtype=np.float64)


def _strongest(
    cube: RadarCube,
    returns: Returns,
    echoes: _Echoes,
    echo: IntArray,
    peak: IntArray,
    weight: FloatArray,
    phasor: ComplexArray,
    none: Attribution,
) -> Attribution:
    n = len(none.power)
    ids, of_id = np.unique(returns.object_id[echo], return_inverse=True)
    key = peak * len(ids) + of_id.ravel()
    coherent = returns.coherent[echo]
    seen = phasor * weight
    shape = (n, len(ids))
    own = seen.real**2 + seen.imag**2
    parts = [np.where(coherent, seen.real, 0.0), np.where(coherent, seen.imag, 0.0), np.where(coherent, 0.0, own)]
    re, im, speckle = (np.bincount(key, part, n * len(ids)).reshape(shape) for part in parts)
    power = re**2 + im**2 + speckle
    best = np.argmax(power, axis=1)
    most = power[np.arange(n), best]
    found = most > cube.noise_power_w / cube.profile.n_virtual
    # tag and velocity: those of the object's strongest echo in the cell
    mine = np.flatnonzero(best[peak] == of_id.ravel())
    mine = mine[np.lexsort((own[mine], peak[mine]))]
    last = np.flatnonzero(np.diff(peak[mine], append=-1))
    top = np.zeros(n, dtype=np.int64)
    top[peak[mine[last]]] = echo[mine[last]]
    return Attribution(
        np.where(found, ids[best].astype(np.int64), -1),
        np.where(found, returns.tag[top], 0).astype(np.uint8),
        np.where(found, most, 0.0),
        np.where(found, echoes.velocity[top], np.nan),
    )
