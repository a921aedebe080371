"""Normals of a LiDAR frame: planes through neighbouring points, held against the cosine the sensor recorded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .._typing import FloatArray
from ..errors import InputError
from ..frames import spherical

if TYPE_CHECKING:
    from .frame import LidarFrame

__all__ = ["estimate_normals"]

#: Neighbours further off than this many cells of the sensor's grid belong to other surfaces.
_REACH_CELLS = 3.5
_FEWEST = 5
#: RMS distance from the plane over the RMS width of the neighbourhood.
_FLATNESS = 0.1
#: Neighbourhoods narrower than this are lines: LAZ rounds to 1 mm [m].
_WIDTH_M = 0.01


def estimate_normals(frame: LidarFrame, *, neighbours: int = 12, max_error: float = 0.1) -> FloatArray:
    """Fit a plane to the neighbours of every point that have its object id and tag.

    Parameters
    ----------
    frame : LidarFrame
    neighbours : int
        Nearest points, by cells of the sensor's grid and not by metres: on a road 20 m away two channels lie metres
        apart and two azimuths centimetres, and the nearest in metres are a line.
    max_error : float
        Largest difference between -u.n and the recorded cosine at which a normal is kept.

    Returns
    -------
    (n, 3) float
        Unit normals facing the sensor, in the frame's axes; 0 0 0 where the neighbours are too few, lie on a line, are
        not flat, or contradict the recorded cosine.

    Raises
    ------
    InputError
        Fewer than five neighbours asked for.
    """
    if neighbours < _FEWEST:
        raise InputError(f"estimate_normals: neighbours >= {_FEWEST} are needed for a plane, got {neighbours}")
    if len(frame) <= neighbours:
        return np.zeros((len(frame), 3))
    from scipy.spatial import cKDTree

    cells = _cells(frame)
    reach, index = cKDTree(cells).query(cells, k=neighbours + 1)
    same = (frame.object_id[index] == frame.object_id[:, None]) & (frame.tag[index] == frame.tag[:, None])
    weight = np.where(same & (reach < _REACH_CELLS), 1.0, 0.0)
    count = weight.sum(axis=1)
    points = frame.position[index]
    mean = np.einsum("nk,nki->ni", weight, points) / count[:, None]
    off = (points - mean[:, None]) * weight[..., None]
    covariance = np.einsum("nki,nkj->nij", off, off) / count[:, None, None]
    variance, axes = np.linalg.eigh(covariance)
    normal: FloatArray = axes[:, :, 0]
    u = frame.position / np.maximum(np.linalg.norm(frame.position, axis=1), 1e-9)[:, None]
    along = np.einsum("ij,ij->i", normal, u)
    normal = normal * np.where(along > 0, -1.0, 1.0)[:, None]
    width = np.sqrt(np.maximum(variance[:, 1], 0.0))
    flat = np.sqrt(np.maximum(variance[:, 0], 0.0)) < _FLATNESS * width
    agrees = np.abs(np.abs(along) - frame.cos_incidence) <= max_error
    kept = (count >= _FEWEST) & (width > _WIDTH_M) & flat & agrees
    return np.where(kept[:, None], normal, 0.0)


def _cells(frame: LidarFrame) -> FloatArray:
    """Return (n, 3) places on the sensor's grid, one unit a cell; azimuth runs around a cylinder, so it has no seam."""
    _, azimuth, elevation = spherical(frame.position)
    radius = 1.0 / np.radians(frame.grid.azimuth_step_deg)
    height = elevation / np.radians(frame.grid.elevation_step_deg)
    return np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), height])
