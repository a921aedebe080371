"""Normals of a LiDAR frame: planes through neighbouring points, tilted as the sensor recorded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .._typing import FloatArray, IntArray
from ..errors import InputError
from ..frames import spherical

if TYPE_CHECKING:
    from .frame import LidarFrame

__all__ = ["estimate_normals"]

#: Neighbours further off than this many cells of the sensor's grid say nothing of the surface here.
_REACH_CELLS = 3.0
#: Neighbours whose recorded cosine differs by this much count 1/e: they lie on another facet.
_COSINE_WIDTH = 0.15
_FEWEST = 3
#: A neighbour further than this to a side is of the next column or row [cells].
_APART_CELLS = 0.5
#: Of the slope of a row without a normal that has neighbours all around [rad].
_LEAST_SLOPE = 1e-3
#: Neighbourhoods narrower than this are lines: LAZ rounds to 1 mm [m].
_WIDTH_M = 0.005
#: Directions around the line of sight that are tried; a parabola through the best three refines it.
_TURNS = 48


def estimate_normals(frame: LidarFrame, *, neighbours: int = 8, flatness: float = 0.2) -> tuple[FloatArray, FloatArray]:
    """Fit a plane to the neighbours of every point, at the angle of incidence that the sensor recorded.

    Parameters
    ----------
    frame : LidarFrame
    neighbours : int
        Nearest points, by cells of the sensor's grid and not by metres: on a road 20 m away two channels lie metres
        apart and two azimuths centimetres, and the nearest in metres are a line. Only those with the same object id
        and tag count.
    flatness : float
        Largest RMS distance of the neighbours from the plane, over the width of the neighbourhood.

    Returns
    -------
    normal : (n, 3) float
        Unit normals facing the sensor, in the frame's axes; 0 0 0 where the neighbours are fewer than three, lie on a
        line, or are not flat.
    slope : (n,) float
        Half the RMS turn of the normal to the neighbouring points: the slopes that lie between the samples. Without a
        normal it is half the RMS difference of the recorded angles, of which no turn is less, where the object goes on
        to both sides and above or below; elsewhere 0: it may bend by any angle within the cell, as a pole does.

    Raises
    ------
    InputError
        Fewer than three neighbours asked for.

    Notes
    -----
    With c the recorded cosine and u the line of sight, n = -c u + sqrt(1 - c^2) (e1 cos phi + e2 sin phi): only phi is
    free, and is where sum w (n . d)^2 over the offsets d to the neighbours is least.
    """
    if neighbours < _FEWEST:
        raise InputError(f"estimate_normals: neighbours >= {_FEWEST} are needed for a plane, got {neighbours}")
    if len(frame) <= neighbours:
        return np.zeros((len(frame), 3)), np.zeros(len(frame))
    from .._parallel import map_blocks

    cells = _cells(frame)
    index, nearness = _neighbours(frame, cells, neighbours)
    change = (frame.cos_incidence[index] - frame.cos_incidence[:, None]) / _COSINE_WIDTH
    weight = nearness * np.exp(-(change**2))
    blocks = map_blocks(lambda rows: _fit(frame, rows, index[rows], weight[rows], flatness), len(frame))
    normal = np.concatenate(blocks)
    known = np.any(normal != 0, axis=1)
    return normal, np.where(known, _slope(normal, index, weight), _least_slope(frame, cells, index, nearness))


def _slope(normal: FloatArray, index: IntArray, weight: FloatArray) -> FloatArray:
    known = np.any(normal != 0, axis=1)
    w = np.where(known[:, None] & known[index], weight, 0.0)
    turn = np.sum((normal[index] - normal[:, None]) ** 2, axis=2)
    mean = (w * turn).sum(axis=1) / np.maximum(w.sum(axis=1), 1e-12)
    slope: FloatArray = 0.5 * np.sqrt(mean)
    return slope


def _least_slope(frame: LidarFrame, cells: FloatArray, index: IntArray, nearness: FloatArray) -> FloatArray:
    """Return half the RMS difference of the recorded angles; 0 where the object is no wider or higher than a cell."""
    near = nearness > 0
    x, y, z = (cells[index, k] for k in range(3))
    beside = (cells[:, :1] * y - cells[:, 1:2] * x) / np.maximum(np.hypot(cells[:, :1], cells[:, 1:2]), 1e-9)
    goes_on = np.any(near & (beside > _APART_CELLS), axis=1) & np.any(near & (beside < -_APART_CELLS), axis=1)
    goes_on &= np.any(near & (np.abs(z - cells[:, 2:]) > _APART_CELLS), axis=1)
    angle = np.arccos(np.clip(frame.cos_incidence, 0.0, 1.0))
    mean = (nearness * (angle[index] - angle[:, None]) ** 2).sum(axis=1) / np.maximum(nearness.sum(axis=1), 1e-12)
    return np.where(goes_on, np.maximum(0.5 * np.sqrt(mean), _LEAST_SLOPE), 0.0)


def _neighbours(frame: LidarFrame, cells: FloatArray, count: int) -> tuple[IntArray, FloatArray]:
    """Return (n, count) indices of neighbours and their weights by distance; 0 is not of this object."""
    from scipy.spatial import cKDTree

    found = cKDTree(cells).query(cells, k=count + 1, workers=2)
    reach, index = np.asarray(found[0])[:, 1:], np.asarray(found[1])[:, 1:]
    same = (frame.object_id[index] == frame.object_id[:, None]) & (frame.tag[index] == frame.tag[:, None])
    return index, np.where(same & (reach < _REACH_CELLS), 1.0 / (1.0 + reach**2), 0.0)


def _fit(frame: LidarFrame, rows: slice, index: IntArray, weight: FloatArray, flatness: float) -> FloatArray:
    point = frame.position[rows]
    u = point / np.maximum(np.linalg.norm(point, axis=1), 1e-9)[:, None]
    e1 = np.cross(u, np.where(np.abs(u[:, 2:]) < 0.9, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
    e1 /= np.linalg.norm(e1, axis=1)[:, None]
    e2 = np.cross(u, e1)
    offset = frame.position[index] - point[:, None]
    # near and far neighbours say the same of a direction: scaled by length, else the longest alone decides
    size = np.maximum(np.linalg.norm(offset, axis=2), 1e-9)
    total = np.maximum(weight.sum(axis=1), 1e-9)
    tangent = offset / size[..., None] * np.sqrt(weight / total[:, None])[..., None]
    spread = np.einsum("nki,nkj->nij", tangent, tangent)
    c = frame.cos_incidence[rows]
    s = np.sqrt(np.maximum(1.0 - c**2, 0.0))
    # n.S.n as a function of phi is a trigonometric polynomial of the second degree
    su, s1, s2 = (np.einsum("nij,nj->ni", spread, v) for v in (u, e1, e2))
    fixed, lone1, lone2 = c**2 * _dot(u, su), -2.0 * c * s * _dot(u, s1), -2.0 * c * s * _dot(u, s2)
    square1, square2, mixed = s**2 * _dot(e1, s1), s**2 * _dot(e2, s2), 2.0 * s**2 * _dot(e1, s2)
    angles = np.linspace(0.0, 2.0 * np.pi, _TURNS, endpoint=False)
    cos, sin = np.cos(angles), np.sin(angles)
    terms = np.stack([lone1, lone2, square1, square2, mixed], axis=1)
    cost = fixed[:, None] + terms @ np.stack([cos, sin, cos**2, sin**2, cos * sin])
    phi = _refined(cost, angles)
    normal = -c[:, None] * u + s[:, None] * (e1 * np.cos(phi)[:, None] + e2 * np.sin(phi)[:, None])
    misfit = _dot(normal, np.einsum("nij,nj->ni", spread, normal))
    width = np.sqrt(np.maximum(np.linalg.eigvalsh(spread)[:, 1], 0.0))
    wide = width * (size * weight).sum(axis=1) / total > _WIDTH_M
    kept = (np.count_nonzero(weight > 1e-3, axis=1) >= _FEWEST) & wide & (width > 0.05)
    kept &= np.sqrt(np.maximum(misfit, 0.0)) < flatness
    fitted: FloatArray = np.where(kept[:, None], normal, 0.0)
    return fitted


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    product: FloatArray = np.einsum("ni,ni->n", a, b)
    return product


def _refined(cost: FloatArray, angles: FloatArray) -> FloatArray:
    """Return the angle of the least cost, by a parabola through the best three."""
    row, best = np.arange(len(cost)), np.argmin(cost, axis=1)
    before, here, after = (cost[row, (best + k) % cost.shape[1]] for k in (-1, 0, 1))
    curve = before - 2.0 * here + after
    shift = np.divide(0.5 * (before - after), curve, out=np.zeros_like(curve), where=curve > 1e-15)
    angle: FloatArray = angles[best] + np.clip(shift, -0.5, 0.5) * (angles[1] - angles[0])
    return angle


def _cells(frame: LidarFrame) -> FloatArray:
    """Return (n, 3) places on the sensor's grid, one unit a cell; azimuth runs around a cylinder, so it has no seam."""
    _, azimuth, elevation = spherical(frame.position)
    radius = 1.0 / np.radians(frame.grid.azimuth_step_deg)
    height = elevation / np.radians(frame.grid.elevation_step_deg)
    return np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height])
