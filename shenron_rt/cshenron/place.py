"""C-Shenron's points as scatterers of a mounted radar: the other tag table, the mount, the surface of each point."""

from __future__ import annotations

import numpy as np

from .._typing import ArrayLike
from ..errors import InputError
from ..frames import Pose
from ..lidar.grid import LidarGrid, surface_area
from ..scatterers import Scatterers
from ..tags import tag_table
from .layout import NEAR_M, check_points

__all__ = ["DEFAULT_GRID", "DEFAULT_LIDAR", "DEFAULT_MOUNTS", "place_points"]

#: Front bumper, right side, rear bumper, left side of a car in the ego frame (x forward, y left), by view [deg].
DEFAULT_MOUNTS = {
    0: Pose((2.0, 0.0, 1.0)),
    90: Pose((0.0, -0.9, 1.0), (-90.0, 0.0, 0.0)),
    180: Pose((-2.0, 0.0, 1.0), (180.0, 0.0, 0.0)),
    270: Pose((0.0, 0.9, 1.0), (90.0, 0.0, 0.0)),
}
#: The own car, centred on its reference point: length and width [m]. Points in it are dropped.
OWN_CAR_M = (5.0, 2.2)
#: C-Shenron's LiDAR: 64 channels from 10 to -30 degrees, 600 000 points a second at 10 turns a second.
DEFAULT_GRID = LidarGrid(64, 10.0, -30.0, 360.0 * 64 * 10 / 600_000)
#: Where it is in the ego frame [m].
DEFAULT_LIDAR = Pose((0.0, 0.0, 2.5))


def place_points(
    points: ArrayLike,
    mount: Pose,
    *,
    tags: str = "0.9.13",
    grid: LidarGrid = DEFAULT_GRID,
    lidar: Pose = DEFAULT_LIDAR,
    own_car: bool = True,
) -> Scatterers:
    """Bring C-Shenron's points before a mounted radar.

    Parameters
    ----------
    points : (n, 6) or (n, 7) array_like
        ``[x, y, z, cos, id, tag]``, or with the radial speed last; x forward, y right, z up from the ground under the
        vehicle [m].
    mount : Pose
        The radar in the ego frame (x forward, y left, z up).
    tags : str
        Numbering of the tags, as for :func:`shenron_rt.tags.tag_table`.
    grid : LidarGrid
        Of the LiDAR behind the points, which gives each its surface; of merged sweeps the grid of one.
    lidar : Pose
        That LiDAR in the ego frame.
    own_car : bool
        Drop the points on the own vehicle.

    Returns
    -------
    scatterers : Scatterers
        Of all heights, those ahead of the radar and further than 0.8 m.

    Raises
    ------
    InputError
        Points of the wrong form, tags the numbering does not list, ids that are no whole numbers.
    """
    rows = check_points(points)
    if np.any((rows[:, 4] != np.round(rows[:, 4])) | (rows[:, 4] < 0) | (rows[:, 4] > 2**32 - 1)):
        raise InputError("column 4 is the object id, a whole number from 0 to 4294967295; were its bits cast to float?")
    ego = rows[:, :3] * [1.0, -1.0, 1.0]
    position, cosine = mount.apply_inverse(ego), np.abs(rows[:, 3])
    area = surface_area(grid, lidar.apply_inverse(ego), cosine)
    keep = position[:, 0] > NEAR_M
    if own_car:
        keep &= np.any(np.abs(ego[:, :2]) > np.array(OWN_CAR_M) / 2, axis=1)
    return Scatterers(
        position=position[keep],
        range_rate=rows[keep, 6],
        cos_incidence=cosine[keep],
        object_id=rows[keep, 4].astype(np.uint32),
        tag=tag_table(tags).translate(rows[keep, 5].astype(np.int64)),
        area=area[keep],
        door="lidar",
    )
