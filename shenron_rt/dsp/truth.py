"""Which object stands behind a detection: the echoes seen through the response of the detection's own cell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .._typing import BoolArray, ComplexArray, FloatArray, IntArray, NDArray
from . import angle
from .clusters import PARTS, REACH_BINS, Clusters, bin_stride
from .windows import window

if TYPE_CHECKING:
    from ..returns import Returns
    from .cube import RadarCube

__all__ = ["Attribution", "attribute"]

#: Points per bin, and per wavelength of aperture, of the response tables.
_TABLE_STEP = 32
#: Pairs of peak and cluster looked at together; bounds the memory at about 100 MB.
_PAIRS_AT_ONCE = 1 << 21


@dataclass(frozen=True)
class Attribution:
    """Truth of every detection.

    Parameters
    ----------
    object_id, tag : (n,) int
        -1 and 0 where there is none.
    power : (n,) float
        In the cell [W].
    velocity : (n,) float
        [m/s], NaN where there is none.
    chain : (n,) str
        The strongest of the object's chains, ``"40>101"``; ``""`` where there is none.
    ghost : (n,) bool
        Whether the echoes of that chain show the object where it is not.
    """

    object_id: IntArray
    tag: IntArray
    power: FloatArray
    velocity: FloatArray
    chain: NDArray[Any]
    ghost: BoolArray


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
    expected level in the beamformed cell does not count. Of its chains the one with the most power is named.
    """
    n = len(row)
    chain, ghost = np.full(n, ""), np.zeros(n, dtype=bool)
    none = Attribution(np.full(n, -1), np.zeros(n, dtype=np.uint8), np.zeros(n), np.full(n, np.nan), chain, ghost)
    if n == 0 or len(returns) == 0:
        return none
    clusters = Clusters.near(cube, returns, row, column)
    if not len(clusters):
        return none
    peak, cluster, off_r, off_d = _pairs(cube, clusters.part, row, column)
    w = cube.profile.waveform
    cell = _response(cube.range_window, w.samples, cube.n_fft[0], off_r)
    cell = cell * _response(cube.doppler_window, w.chirps, cube.n_fft[1], off_d)
    beam = np.stack([sine, elevation], axis=1)[peak]
    heard = clusters.cosines[cluster] - beam
    if clusters.sent is None:
        array: FloatArray | ComplexArray = _same_legs(cube, heard[:, 0], heard[:, 1])
    else:
        array = _array_response(cube, heard, clusters.sent[cluster] - beam)
    return _strongest(cube, clusters, returns, peak, cluster, cell * array, n)


def _pairs(
    cube: RadarCube, part: IntArray, row: IntArray, column: IntArray
) -> tuple[IntArray, IntArray, FloatArray, FloatArray]:
    """Return peaks and clusters within reach of each other, and their distance in range and Doppler [bins]."""
    reach = [REACH_BINS * k for k in bin_stride(cube)]
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
    off = part[None, :] / PARTS - at[:, None]
    return np.asarray((off + size / 2) % size - size / 2, dtype=np.float64)


def _response(name: str, n: int, n_fft: int, offset: FloatArray) -> FloatArray:
    """Return the real response of a window at offsets of whole parts of a bin."""
    w = window(name, n)
    centre = np.sum(w * np.arange(n)) / w.sum()
    index = np.rint(np.abs(offset) * PARTS).astype(np.int64)
    x = np.arange(int(index.max(initial=0)) + 1) / PARTS
    table = np.cos(2 * np.pi / n_fft * x[:, None] * (np.arange(n) - centre)) @ w / w.sum()
    return np.asarray(table[index], dtype=np.float64)


def _array_response(cube: RadarCube, heard: FloatArray, sent: FloatArray) -> ComplexArray:
    """Return the array factor about its middle, by differences of cosines at receivers and transmitters, (n, 2) each.

    Of echoes that arrive from where they left to, its real part.
    """
    legs = np.flatnonzero(np.any(heard != sent, axis=1))
    wavenumber = 2 * np.pi / cube.profile.wavelength_m
    factor = _same_legs(cube, heard[:, 0], heard[:, 1]).astype(np.complex128)
    factor[legs] = 1.0
    for elements, off in ((cube.profile.rx_m, heard[legs]), (cube.profile.tx_m, sent[legs])):
        centred = (elements - elements.mean(axis=0))[:, 1:]
        # phases of the cube are those of the way, which grows as an element stands behind
        factor[legs] *= np.exp(-1j * wavenumber * off @ centred.T).mean(axis=1)
    return factor


def _same_legs(cube: RadarCube, ds: FloatArray, de: FloatArray) -> FloatArray:
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
    cube: RadarCube,
    clusters: Clusters,
    returns: Returns,
    peak: IntArray,
    cluster: IntArray,
    weight: FloatArray | ComplexArray,
    n: int,
) -> Attribution:
    ids, of_id = np.unique(clusters.object_id, return_inverse=True)
    power = _powers(clusters, peak, cluster, weight, of_id.ravel(), n)
    best = np.argmax(power, axis=1)
    most = power[np.arange(n), best]
    found = most > (cube.noise_power_w / cube.profile.n_virtual if cube.noise_added else 0.0)
    # tag and velocity: those of the object's strongest cluster in the cell
    own = clusters.power[cluster] * np.abs(weight) ** 2
    mine = np.flatnonzero(best[peak] == of_id.ravel()[cluster])
    mine = mine[np.lexsort((own[mine], peak[mine]))]
    last = np.flatnonzero(np.diff(peak[mine], append=-1))
    top = np.zeros(n, dtype=np.int64)
    top[peak[mine[last]]] = cluster[mine[last]]
    chain, ghost = _chain(clusters, returns, peak[mine], cluster[mine], weight[mine], ids[best])
    return Attribution(
        np.where(found, ids[best], -1),
        np.where(found, clusters.tag[top], 0).astype(np.uint8),
        np.where(found, most, 0.0),
        np.where(found, clusters.velocity[top], np.nan),
        np.where(found, chain, ""),
        found & ghost,
    )


def _powers(
    clusters: Clusters,
    peak: IntArray,
    cluster: IntArray,
    weight: FloatArray | ComplexArray,
    label: IntArray,
    n: int,
) -> FloatArray:
    """Return (n, labels) power in each cell of the clusters of each label [W]."""
    labels = int(label.max(initial=-1)) + 1
    key = peak * labels + label[cluster]
    seen = clusters.phasor[cluster] * weight
    parts = (seen.real, seen.imag, clusters.speckle[cluster] * np.abs(weight) ** 2)
    re, im, speckle = (np.bincount(key, part, n * labels).reshape(n, labels) for part in parts)
    return np.asarray(re**2 + im**2 + speckle)


def _chain(
    clusters: Clusters,
    returns: Returns,
    peak: IntArray,
    cluster: IntArray,
    weight: FloatArray | ComplexArray,
    object_id: IntArray,
) -> tuple[NDArray[Any], BoolArray]:
    """Return the strongest chain in each cell, of the pairs of its object, and whether that is a ghost."""
    if returns.chains is None:
        return object_id.astype(np.str_), np.zeros(len(object_id), dtype=bool)
    number, of = np.unique(clusters.chain, return_inverse=True)
    best = number[np.argmax(_powers(clusters, peak, cluster, weight, of.ravel(), len(object_id)), axis=1)]
    return returns.chains.names[best // 2], best % 2 == 1
