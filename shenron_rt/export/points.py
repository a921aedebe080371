"""Point clouds as packed records: what MCAP, ROS 2, PCD and PLY files hold, field by field."""

from __future__ import annotations

import numpy as np

from .._typing import FloatArray, IntArray, NDArray
from ..dsp import Detections
from ..errors import InputError
from ..frames import Pose
from ..io.recorded import PointCloud
from ..lidar.frame import LidarFrame
from ..scatterers import Scatterers

__all__ = [
    "DETECTION_POINT", "LIDAR_POINT", "RECORDED_POINT", "Points", "detection_points", "lidar_points", "recorded_points",
    "scatterer_points",
]  # fmt: skip

#: A cloud: one record a point.
Points = NDArray[np.void]

_XYZ = [("x", "<f4"), ("y", "<f4"), ("z", "<f4")]
#: Sensor frame [m], range rate positive = receding [m/s], dB, dBsm; object -1 is noise or a side lobe; ghost 1 shows
#: its object where it is not.
DETECTION_POINT = np.dtype(
    [
        *_XYZ,
        ("velocity", "<f4"),
        ("snr_db", "<f4"),
        ("rcs_dbsm", "<f4"),
        ("object_id", "<i4"),
        ("tag", "u1"),
        ("ghost", "u1"),
    ]
)
LIDAR_POINT = np.dtype([*_XYZ, ("cos_incidence", "<f4"), ("object_id", "<i4"), ("tag", "u1")])
#: What a recorded radar gives; NaN where it gives no SNR.
RECORDED_POINT = np.dtype([*_XYZ, ("velocity", "<f4"), ("snr_db", "<f4")])


def detection_points(detections: Detections) -> Points:
    """Return (n,) records of :data:`DETECTION_POINT`, in the radar frame.

    Raises
    ------
    InputError
        An object id of 2^31 and more.
    """
    points = np.zeros(len(detections), dtype=DETECTION_POINT)
    for name in ("x", "y", "z", "velocity", "snr_db", "rcs_dbsm", "tag"):
        points[name] = detections.table[name]
    points["object_id"], points["ghost"] = _ids(detections.object_id), detections.ghost
    return points


def lidar_points(frame: LidarFrame) -> Points:
    """Return (n,) records of :data:`LIDAR_POINT`, in the LiDAR's frame."""
    return _lidar(frame.position, frame.cos_incidence, frame.object_id, frame.tag)


def scatterer_points(scatterers: Scatterers, mount: Pose) -> Points:
    """Return the LiDAR points that a radar was made of, in the ego frame, of :data:`LIDAR_POINT`."""
    s = scatterers
    return _lidar(mount.apply(s.position), s.cos_incidence, s.object_id, s.tag)


def recorded_points(cloud: PointCloud) -> Points:
    """Return (n,) records of :data:`RECORDED_POINT`, in the recorded radar's frame."""
    points = np.zeros(len(cloud), dtype=RECORDED_POINT)
    _place(points, cloud.position)
    points["velocity"], points["snr_db"] = cloud.velocity, cloud.snr_db
    return points


def _lidar(position: FloatArray, cosine: FloatArray, object_id: IntArray, tag: IntArray) -> Points:
    points = np.zeros(len(position), dtype=LIDAR_POINT)
    _place(points, position)
    points["cos_incidence"], points["object_id"], points["tag"] = cosine, _ids(object_id), tag
    return points


def _place(points: Points, position: FloatArray) -> None:
    points["x"], points["y"], points["z"] = position.T


def _ids(object_id: IntArray) -> IntArray:
    """Refuse ids that the four signed bytes of the files would turn into others."""
    largest = int(object_id.max(initial=0))
    if largest > np.iinfo(np.int32).max:
        raise InputError(
            f"object id {largest}: point files hold ids up to {np.iinfo(np.int32).max}; give a smaller one"
        )
    return object_id
