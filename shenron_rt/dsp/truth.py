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
#: Echoes are first gathered in parts of a bin, and of the azimuth grid; the response is taken at the part's middle.
_PARTS = 2
#: Steps of the sine of elevation in which echoes are gathered for an array with rows.
_ELEVATION_STEPS = 32
#: Points per bin, and per wavelength of aperture, of the response tables.
_TABLE_STEP = 32
#: Largest dense key space of the gathering; above it keys are sorted.
_DENSE_KEYS = 1 << 23
#: Pairs of peak and cluster looked at together; bounds the memory at about 100 MB.
_PAIRS_AT_ONCE = 1 << 21


@dataclass(frozen=True)
class Attribution:
    """Truth of every detection: object, tag, power in the cell [W], velocity [m/s]; -1, 0, 0, NaN where none."""

    object_id: IntArray
    tag: IntArray
    power: FloatArray
    velocity: FloatArray


@dataclass(frozen=True)
class _Clusters:
    """Echoes of one object and tag that share a part of a cell and a beam.

    ``part`` (n, 2) integer position in parts of a bin, ``cosines`` (n, 2) direction along y and z, ``object_id``,
    ``tag``, ``phasor`` the sum of the coherent echoes about the middle of the array, ``speckle`` the power of the
    others, ``power`` of all, ``velocity`` of one of them [m/s].
    """

    part: IntArray
    cosines: FloatArray
    object_id: IntArray
    tag: IntArray
    phasor: ComplexArray
    speckle: FloatArray
    power: FloatArray
    velocity: FloatArray


def _stride(cube: RadarCube) -> tuple[int, int]:
    """Return the bins of the transforms per bin without zero padding."""
    w = cube.profile.waveform
    return -(-cube.n_fft[0] // w.samples), -(-cube.n_fft[1] // w.chirps)


def _parts(cube: RadarCube, returns: Returns) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Return where the echoes show in the cube, in parts of a bin, with their distance [m] and range rate [m/s]."""
    p = cube.profile
    x, v = returns.position, returns.velocity
    distance = np.maximum(np.sqrt(np.einsum("ni,ni->n", x, x)), 1e-9)
    radial = np.einsum("ni,ni->n", x, v) / distance
    doppler_hz = radial * (2 * p.center_hz / SPEED_OF_LIGHT)
    # the beat frequency of a moving echo is k tau + Doppler
    apparent = distance + doppler_hz * (SPEED_OF_LIGHT / (2 * p.slope_hz_per_s))
    n_range, n_velocity, _ = cube.data.shape
    row = np.rint(apparent * (_PARTS / cube.range_step_m)).astype(np.int32) % (_PARTS * n_range)
    bins = doppler_hz * (_PARTS * cube.n_fft[1] * p.loop_period_s)
    column = (np.rint(bins).astype(np.int32) + _PARTS * (n_velocity // 2)) % (_PARTS * n_velocity)
    return row, column, distance, radial


def _near(cube: RadarCube, row: IntArray, column: IntArray) -> IntArray:
    """Return a map of the parts of cells: a running number for those within reach of a peak, -1 elsewhere."""
    n_range, n_velocity, _ = cube.data.shape
    reach = [_REACH_BINS * _PARTS * k for k in _stride(cube)]
    di, dj = (a.ravel() for a in np.meshgrid(*(np.arange(-r, r + 1) for r in reach), indexing="ij"))
    number = np.full((_PARTS * n_range, _PARTS * n_velocity), -1, dtype=np.int32)
    i = (_PARTS * row[:, None] + di) % (_PARTS * n_range)
    j = (_PARTS * column[:, None] + dj) % (_PARTS * n_velocity)
    number[i, j] = 0
    inside = np.nonzero(number == 0)
    number[inside] = np.arange(len(inside[0]))
    return number


def _compact(keys: list[IntArray], sizes: list[int]) -> tuple[IntArray, int]:
    """Return a running number of each row's combination of keys, and how many combinations occur."""
    total = int(np.prod([float(s) for s in sizes]))
    packed = np.zeros(len(keys[0]), dtype=np.int64)
    for key, size in zip(keys, sizes, strict=True):
        packed = packed * size + key
    if total > _DENSE_KEYS:
        found, number = np.unique(packed, return_inverse=True)
        return number.ravel(), len(found)
    seen = np.zeros(total, dtype=bool)
    seen[packed] = True
    found = np.flatnonzero(seen)
    lookup = np.zeros(total, dtype=np.int32)
    lookup[found] = np.arange(len(found))
    return lookup[packed], len(found)


def _gather(cube: RadarCube, returns: Returns, row: IntArray, column: IntArray) -> _Clusters:
    """Gather the echoes near the peaks."""
    p = cube.profile
    i, j, distance, radial = _parts(cube, returns)
    number = _near(cube, row, column)
    cell = number.ravel().take(i * np.int32(number.shape[1]) + j)
    close = np.flatnonzero(cell >= 0)
    away = distance.take(close)
    keys, sizes = [cell.take(close)], [int(number.max()) + 1]
    ids, tags = returns.object_id.take(close).astype(np.int64), returns.tag.take(close)
    label, labels = _compact([ids, tags], [int(ids.max(initial=0)) + 1, 256])
    keys, sizes = [*keys, label], [*sizes, labels]
    beams = {1: max(64, len(cube.azimuth_sine))}
    if angle.has_elevation(p.positions_m, p.wavelength_m):
        beams[2] = _ELEVATION_STEPS
    for axis, n in beams.items():
        cosine = returns.position[:, axis].take(close) / away
        keys, sizes = [*keys, np.minimum((cosine * (n / 2) + n / 2).astype(np.int32), n - 1)], [*sizes, n]
    cluster, count = _compact(keys, sizes)
    amplitude, coherent = returns.amplitude.take(close), returns.coherent.take(close)
    power = amplitude.real**2 + amplitude.imag**2
    some = np.zeros(count, dtype=np.int64)
    some[cluster] = close
    return _Clusters(
        part=np.stack([i[some], j[some]], axis=1),
        cosines=returns.position[some, 1:] / distance[some, None],
        object_id=returns.object_id[some].astype(np.int64),
        tag=returns.tag[some],
        phasor=_phasor_sum(cube, returns, close[coherent], distance, cluster[coherent], count),
        speckle=np.bincount(cluster, np.where(coherent, 0.0, power), count).astype(np.float64),
        power=np.bincount(cluster, power, count).astype(np.float64),
        velocity=radial[some],
    )


def _phasor_sum(
    cube: RadarCube, returns: Returns, rows: IntArray, distance: FloatArray, cluster: IntArray, count: int
) -> ComplexArray:
    """Sum a e^{j 2 pi f_c tau} of coherent echoes per cluster, at the middle of the array."""
    p = cube.profile
    middle = p.positions_m.mean(axis=0)
    path = 2 * distance[rows] - returns.position[rows] @ middle / distance[rows]
    phasor = returns.amplitude[rows] * np.exp(2j * np.pi / p.wavelength_m * path)
    return np.bincount(cluster, phasor.real, count) + 1j * np.bincount(cluster, phasor.imag, count)


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
        Direction cosines of the beams (y, z).

    Notes
    -----
    Echoes are gathered in half bins; each part is weighted with the response of both windows and of the array. An
    object's coherent echoes add as phasors, its incoherent ones as powers. Where noise was added an object below its
    expected level in the beamformed cell does not count.
    """
    n = len(row)
    none = Attribution(np.full(n, -1), np.zeros(n, dtype=np.uint8), np.zeros(n), np.full(n, np.nan))
    if n == 0 or len(returns) == 0:
        return none
    clusters = _gather(cube, returns, row, column)
    if not len(clusters.tag):
        return none
    peak, cluster, off_r, off_d = _pairs(cube, clusters.part, row, column)
    w = cube.profile.waveform
    weight = _response(cube.range_window, w.samples, cube.n_fft[0], off_r)
    weight = weight * _response(cube.doppler_window, w.chirps, cube.n_fft[1], off_d)
    ds, de = clusters.cosines[cluster, 0] - sine[peak], clusters.cosines[cluster, 1] - elevation[peak]
    return _strongest(cube, clusters, peak, cluster, weight * _array_response(cube, ds, de), n)


def _pairs(
    cube: RadarCube, part: IntArray, row: IntArray, column: IntArray
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Return peaks and clusters within reach of each other, and their distance in range and Doppler [bins]."""
    reach = [_REACH_BINS * k for k in _stride(cube)]
    found = []
    peaks = max(1, _PAIRS_AT_ONCE // max(1, len(part)))
    for first in range(0, len(row), peaks):
        some = slice(first, first + peaks)
        off = [_offset(part[:, k], at[some], cube.data.shape[k]) for k, at in enumerate((row, column))]
        peak, cluster = np.nonzero((np.abs(off[0]) <= reach[0]) & (np.abs(off[1]) <= reach[1]))
        found.append((peak + first, cluster, off[0][peak, cluster], off[1][peak, cluster]))
    peak, cluster, off_r, off_d = (np.concatenate(columns) for columns in zip(*found, strict=True))
    return peak, cluster, off_r, off_d


def _offset(part: IntArray, at: IntArray, size: int) -> FloatArray:
    """Return the distance (n_peak, n_cluster) of parts from peak cells [bins], the short way round."""
    off = part[None, :] / _PARTS - at[:, None]
    return np.asarray((off + size / 2) % size - size / 2, dtype=np.float64)


def _response(name: str, n: int, n_fft: int, offset: FloatArray) -> FloatArray:
    """Return the real response of a window at offsets of whole parts of a bin."""
    w = window(name, n)
    centre = np.sum(w * np.arange(n)) / w.sum()
    index = np.rint(np.abs(offset) * _PARTS).astype(np.int64)
    x = np.arange(int(index.max(initial=0)) + 1) / _PARTS
    table = np.cos(2 * np.pi / n_fft * x[:, None] * (np.arange(n) - centre)) @ w / w.sum()
    return np.asarray(table[index], dtype=np.float64)


def _array_response(cube: RadarCube, ds: FloatArray, de: FloatArray) -> FloatArray:
    """Return the real part of the array factor about its middle; it depends on differences of cosines only."""
    p = cube.profile
    centred = p.positions_m - p.positions_m.mean(axis=0)
    if not angle.has_elevation(p.positions_m, p.wavelength_m):
        points = int(4 * _TABLE_STEP * (1 + np.ptp(centred[:, 1]) / p.wavelength_m))
        x = np.linspace(0.0, 2.0, points)
        table = np.cos(2 * np.pi / p.wavelength_m * x[:, None] * centred[:, 1]).mean(axis=1)
        return np.asarray(np.interp(np.abs(ds), x, table), dtype=np.float64)
    out = np.zeros(len(ds))
    for y, z in centred[:, 1:]:
        out += np.cos(2 * np.pi / p.wavelength_m * (y * ds + z * de))
    return out / len(centred)


def _strongest(
    cube: RadarCube, clusters: _Clusters, peak: IntArray, cluster: IntArray, weight: FloatArray, n: int
) -> Attribution:
    ids, of_id = np.unique(clusters.object_id, return_inverse=True)
    key = peak * len(ids) + of_id.ravel()[cluster]
    seen = clusters.phasor[cluster] * weight
    parts = (seen.real, seen.imag, clusters.speckle[cluster] * weight**2)
    re, im, speckle = (np.bincount(key, part, n * len(ids)).reshape(n, len(ids)) for part in parts)
    power = re**2 + im**2 + speckle
    best = np.argmax(power, axis=1)
    most = power[np.arange(n), best]
    found = most > (cube.noise_power_w / cube.profile.n_virtual if cube.noise_added else 0.0)
    # tag and velocity: those of the object's strongest cluster in the cell
    own = clusters.power[cluster] * weight**2
    mine = np.flatnonzero(best[peak] == of_id.ravel()[cluster])
    mine = mine[np.lexsort((own[mine], peak[mine]))]
    last = np.flatnonzero(np.diff(peak[mine], append=-1))
    top = np.zeros(n, dtype=np.int64)
    top[peak[mine[last]]] = cluster[mine[last]]
    return Attribution(
        np.where(found, ids[best], -1),
        np.where(found, clusters.tag[top], 0).astype(np.uint8),
        np.where(found, most, 0.0),
        np.where(found, clusters.velocity[top], np.nan),
    )
