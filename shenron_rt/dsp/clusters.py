"""Echoes gathered in parts of cells and beams, so that each detection looks at few of them."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Self, TypeAlias

import numpy as np

from .._typing import ComplexArray, FloatArray, IntArray
from ..constants import SPEED_OF_LIGHT
from . import angle

if TYPE_CHECKING:
    from ..returns import Returns
    from .cube import RadarCube

__all__ = ["PARTS", "REACH_BINS", "Clusters", "bin_stride"]

#: Echoes farther than this from the detection's cell [unpadded bins] do not count for it.
REACH_BINS = 1
#: Echoes are first gathered in parts of a bin, and of the azimuth grid; the response is taken at the part's middle.
PARTS = 2
#: Steps of the sine of elevation in which echoes are gathered for an array with rows.
_ELEVATION_STEPS = 32
#: Largest dense key space of the gathering; above it keys are sorted.
_DENSE_KEYS = 1 << 23


#: Per echo: cell along range and Doppler in parts of a bin, distance [m], range rate [m/s], number of the cell.
_Columns: TypeAlias = tuple[IntArray, IntArray, FloatArray, FloatArray, IntArray]


@dataclass(frozen=True)
class Clusters:
    """Echoes of one object, tag and chain that share a part of a cell and a beam.

    Parameters
    ----------
    part : (n, 2) int
        Position in parts of a bin.
    cosines, sent : (n, 2) float
        Directions along y and z in which receivers and transmitters see it; ``sent``: ``None`` if all are the same.
    object_id, tag, chain : (n,) int
        ``chain`` is twice the row into ``Returns.chains``, plus one for ghosts; 0 where there are no chains.
    phasor : (n,) complex
        Sum of the coherent echoes about the middle of the array.
    speckle, power : (n,) float
        Power of the others, and of all [W].
    velocity : (n,) float
        Of one of them [m/s].
    """

    part: IntArray
    cosines: FloatArray
    sent: FloatArray | None
    object_id: IntArray
    tag: IntArray
    chain: IntArray
    phasor: ComplexArray
    speckle: FloatArray
    power: FloatArray
    velocity: FloatArray

    def __len__(self) -> int:
        return len(self.tag)

    @classmethod
    def near(cls, cube: RadarCube, returns: Returns, row: IntArray, column: IntArray) -> Self:
        """Gather the echoes near some peaks: those of first surfaces, then those over several."""
        i, j, distance, radial = _parts(cube, returns)
        number = _near(cube, row, column)
        cell = number.ravel().take(i * np.int32(number.shape[1]) + j)
        close = np.flatnonzero(cell >= 0)
        cells = int(number.max()) + 1
        columns = (i, j, distance, radial, cell)
        if returns.departure is None:
            return cls._of(cube, returns, close, cells, columns, legs=False)
        apart = np.any(returns.departure[close] != returns.position[close], axis=1)
        parts = [cls._of(cube, returns, close[apart == own], cells, columns, legs=own) for own in (False, True)]
        return cls(*(np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)))

    @classmethod
    def _of(
        cls, cube: RadarCube, returns: Returns, rows: IntArray, cells: int, columns: _Columns, *, legs: bool
    ) -> Self:
        """Gather some echoes, all with ``legs`` of their own or all without."""
        i, j, distance, radial, cell = columns
        ids, tags = returns.object_id.take(rows).astype(np.int64), returns.tag.take(rows)
        chain = np.zeros(len(rows), dtype=np.int64)
        if returns.chains is not None:
            chain = 2 * returns.chains.row.take(rows).astype(np.int64) + returns.chains.ghost.take(rows)
        label, labels = _compact([ids, tags, chain], [int(ids.max(initial=0)) + 1, 256, int(chain.max(initial=0)) + 1])
        keys, sizes = [cell.take(rows), label], [cells, labels]
        seen = [(returns.position, distance)]
        if legs and returns.departure is not None:
            seen.append((returns.departure, np.maximum(np.linalg.norm(returns.departure, axis=1), 1e-9)))
        for place, away in seen:
            for axis, n in _beams(cube).items():
                cosine = place[:, axis].take(rows) / away.take(rows)
                keys.append(np.minimum((cosine * (n / 2) + n / 2).astype(np.int32), n - 1))
                sizes.append(n)
        cluster, count = _compact(keys, sizes)
        amplitude, coherent = returns.amplitude.take(rows), returns.coherent.take(rows)
        power = amplitude.real**2 + amplitude.imag**2
        some = np.zeros(count, dtype=np.int64)
        some[cluster] = np.arange(len(rows))
        at = rows[some]
        return cls(
            part=np.stack([i[at], j[at]], axis=1),
            cosines=returns.position[at, 1:] / distance[at, None],
            sent=None if returns.departure is None else seen[-1][0][at, 1:] / seen[-1][1][at, None],
            object_id=returns.object_id[at].astype(np.int64),
            tag=returns.tag[at],
            chain=chain[some],
            phasor=_phasor_sum(cube, returns, rows[coherent], distance, cluster[coherent], count, legs=legs),
            speckle=np.bincount(cluster, np.where(coherent, 0.0, power), count).astype(np.float64),
            power=np.bincount(cluster, power, count).astype(np.float64),
            velocity=radial[at],
        )


def _beams(cube: RadarCube) -> dict[int, int]:
    """Return the steps of direction cosines in which echoes are gathered, by axis: 1 along y, 2 along z."""
    p = cube.profile
    beams = {1: max(64, len(cube.azimuth_sine))}
    if angle.has_elevation(p.positions_m, p.wavelength_m):
        beams[2] = _ELEVATION_STEPS
    return beams


def bin_stride(cube: RadarCube) -> tuple[int, int]:
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
    apparent = distance + radial * cube.mid_offset_s + doppler_hz * (SPEED_OF_LIGHT / (2 * p.slope_hz_per_s))
    n_range, n_velocity, _ = cube.data.shape
    row = np.rint(apparent * (PARTS / cube.range_step_m)).astype(np.int32) % (PARTS * n_range)
    bins = doppler_hz * (PARTS * cube.n_fft[1] * p.loop_period_s)
    column = (np.rint(bins).astype(np.int32) + PARTS * (n_velocity // 2)) % (PARTS * n_velocity)
    return row, column, distance, radial


def _near(cube: RadarCube, row: IntArray, column: IntArray) -> IntArray:
    """Return a map of the parts of cells: a running number for those within reach of a peak, -1 elsewhere."""
    n_range, n_velocity, _ = cube.data.shape
    reach = [REACH_BINS * PARTS * k for k in bin_stride(cube)]
    di, dj = (a.ravel() for a in np.meshgrid(*(np.arange(-r, r + 1) for r in reach), indexing="ij"))
    number = np.full((PARTS * n_range, PARTS * n_velocity), -1, dtype=np.int32)
    i = (PARTS * row[:, None] + di) % (PARTS * n_range)
    j = (PARTS * column[:, None] + dj) % (PARTS * n_velocity)
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


def _phasor_sum(
    cube: RadarCube,
    returns: Returns,
    rows: IntArray,
    distance: FloatArray,
    cluster: IntArray,
    count: int,
    *,
    legs: bool,
) -> ComplexArray:
    """Sum a e^{j 2 pi f_c tau} of coherent echoes per cluster, at the middle of the array."""
    p = cube.profile
    if legs and returns.departure is not None:
        sent, heard = _unit(returns.departure[rows]), returns.position[rows] / distance[rows, None]
        path = 2 * distance[rows] - sent @ p.tx_m.mean(axis=0) - heard @ p.rx_m.mean(axis=0)
    else:
        path = 2 * distance[rows] - returns.position[rows] @ p.positions_m.mean(axis=0) / distance[rows]
    phasor = returns.amplitude[rows] * np.exp(2j * np.pi / p.wavelength_m * path)
    return np.bincount(cluster, phasor.real, count) + 1j * np.bincount(cluster, phasor.imag, count)


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), 1e-9))
