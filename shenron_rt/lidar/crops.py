"""Named ways to leave points out, each off until asked for and written into the frame's notes."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .._typing import BoolArray, FloatArray
from ..errors import InputError

if TYPE_CHECKING:
    from .frame import LidarFrame

__all__ = ["OLD_PIPELINE", "crop_ego", "crop_old_pipeline", "thin"]

#: What the LiDAR-driven pipeline before this one left out without saying so, at the sensor [m].
OLD_PIPELINE = "x > 0.5, x < 120, |y| < 30, z > -2.2 (m, at the sensor)"


def crop_ego(frame: LidarFrame, size_m: tuple[float, float, float], center_x_m: float = 0.0) -> tuple[BoolArray, str]:
    """Return the mask of points outside the ego vehicle, and a note.

    Parameters
    ----------
    frame : LidarFrame
        With its sensor pose: the box stands in the ego frame, on the ground.
    size_m : (3,) float
        Length, width, height [m].
    center_x_m : float
        Of the box, ahead of the ego's reference point [m].

    Raises
    ------
    InputError
        No sensor pose, or sizes that are not positive.
    """
    if frame.sensor_pose is None:
        raise InputError("crop_ego: the ego's box stands in the ego frame; read the LiDAR frame with sensor_pose")
    size = np.asarray(size_m, dtype=np.float64)
    if size.shape != (3,) or not np.all(size > 0):
        raise InputError(f"crop_ego: length, width, height > 0 in metres are needed, got {size_m}")
    p = frame.sensor_pose.apply(frame.position)
    inside = (np.abs(p[:, 0] - center_x_m) < size[0] / 2) & (np.abs(p[:, 1]) < size[1] / 2) & (p[:, 2] < size[2])
    return ~inside, f"ego box {size[0]:g} x {size[1]:g} x {size[2]:g} m left out: {int(inside.sum())} points"


def crop_old_pipeline(frame: LidarFrame) -> tuple[BoolArray, str]:
    """Return the mask of points that the earlier pipeline kept, and a note."""
    x, y, z = frame.position.T
    keep = (x > 0.5) & (x < 120.0) & (np.abs(y) < 30.0) & (z > -2.2)
    return keep, f"crop of the old pipeline, {OLD_PIPELINE}: {int(np.sum(~keep))} points left out"


def thin(frame: LidarFrame, voxel_m: float) -> LidarFrame:
    """Return one point for each object and tag in a voxel; it carries the area of all, so brightness stays.

    Parameters
    ----------
    frame : LidarFrame
    voxel_m : float
        Edge [m].

    Raises
    ------
    InputError
        An edge that is not positive.
    """
    if not voxel_m > 0:
        raise InputError(f"thin: a voxel edge > 0 m is needed, got {voxel_m:g}")
    cell = np.floor(frame.position / voxel_m).astype(np.int64)
    key = np.column_stack([cell, frame.object_id.astype(np.int64), frame.tag.astype(np.int64)])
    _, first, group = np.unique(key, axis=0, return_index=True, return_inverse=True)
    group = group.reshape(-1)
    area: FloatArray = np.bincount(group, weights=frame.area).astype(np.float64)
    cos: FloatArray = np.bincount(group, frame.area * frame.cos_incidence) / np.maximum(area, 1e-30)
    note = f"thinned to one point a {voxel_m:g} m voxel and object: {len(first)} of {len(frame)} points, area kept"
    return replace(frame.select(first, note), area=area, cos_incidence=np.minimum(cos, 1.0))
