"""Which points of a LiDAR the radar cannot see: other points' surfaces stand before them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .._typing import BoolArray, FloatArray, IntArray
from ..frames import Pose
from .door import radar_mount

if TYPE_CHECKING:
    from .frame import LidarFrame

__all__ = ["hidden_from_radar"]

#: Points near a line of sight that are asked whether they stand before it.
_CANDIDATES = 16
#: Surfaces nearer to each other along the ray are one [m], [share of the range].
_SAME_M, _SAME_SHARE = 0.3, 0.02
#: Half the side of a point's patch times this covers the gaps between patches.
_COVER = 1.2


def hidden_from_radar(frame: LidarFrame, mount: Pose | None = None) -> BoolArray:
    """Return the mask of points that something nearer hides from the radar.

    Parameters
    ----------
    frame : LidarFrame
        Normals are estimated where it has none.
    mount : Pose, optional
        Radar in the ego frame; see :func:`shenron_rt.lidar.door.radar_mount`.

    Returns
    -------
    (n,) bool

    Raises
    ------
    InputError
        A mount, but no sensor pose.

    Notes
    -----
    Each point with a normal is a patch of its tangent plane, as large across the line of sight as its area says. A
    point is hidden where its line of sight crosses such a patch 0.3 m or 2 % before it. On one plane, a road at
    grazing incidence, no point hides another.
    """
    from scipy.spatial import cKDTree

    eye = radar_mount(frame, mount)
    known = frame if frame.normal is not None else frame.with_normals()
    assert known.normal is not None
    position, normal = eye.apply_inverse(known.position), known.normal @ eye.rotation
    distance = np.maximum(np.linalg.norm(position, axis=1), 1e-9)
    u = position / distance[:, None]
    cosine = np.abs(np.einsum("ij,ij->i", normal, u))
    half = 0.5 * _COVER * np.sqrt(known.area * cosine) / distance
    patches = np.flatnonzero(cosine > 0)
    hidden = np.zeros(len(known), dtype=bool)
    if not len(patches):
        return hidden
    count = min(_CANDIDATES, len(patches))
    found = cKDTree(u[patches]).query(u, k=count, workers=2)
    apart, index = (np.reshape(np.asarray(v), (len(known), count)) for v in found)
    near: IntArray = patches[index]
    reach = _crossing(position[near], normal[near], u)
    clear = distance - np.maximum(_SAME_M, _SAME_SHARE * distance)
    before = (reach < clear[:, None]) & (distance[near] < clear[:, None]) & (reach > 0)
    hidden[:] = np.any(before & (apart < half[near]), axis=1)
    return hidden


def _crossing(point: FloatArray, normal: FloatArray, u: FloatArray) -> FloatArray:
    """Return (n, k) how far along each direction the tangent planes of its candidates are [m]; infinite along them."""
    height = np.einsum("nki,nki->nk", point, normal)
    slope = np.einsum("nki,ni->nk", normal, u)
    reach: FloatArray = np.divide(height, slope, out=np.full_like(height, np.inf), where=slope != 0)
    return reach
