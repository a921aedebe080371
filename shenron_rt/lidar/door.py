"""LiDAR points to scatterers in the frame of a radar."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

import numpy as np

from .._typing import FloatArray
from ..errors import InputError
from ..frames import Pose
from ..scatterers import Scatterers
from .frame import LidarFrame

if TYPE_CHECKING:
    from ..config.profile import RadarProfile

__all__ = ["DEFAULT_MOUNT", "door_counts", "lidar_scatterers", "radar_mount"]

_log = logging.getLogger("shenron_rt.lidar")

#: Where a radar sits on the ego vehicle unless told otherwise.
DEFAULT_MOUNT = Pose((2.0, 0.0, 1.0))
#: Points this near to the radar are on it: no direction, no far side of an antenna [m].
_NEAREST_M = 0.05


def radar_mount(frame: LidarFrame, mount: Pose | None) -> Pose:
    """Return the radar's pose in the LiDAR's frame.

    Parameters
    ----------
    frame : LidarFrame
    mount : Pose or None
        Radar in the ego frame; ``None`` is (2, 0, 1) where the sensor's pose is known, else the LiDAR's own place.

    Raises
    ------
    InputError
        A mount, but no sensor pose to relate it to.
    """
    if frame.sensor_pose is None:
        if mount is not None:
            raise InputError(
                f"{frame.path or 'LiDAR frame'}: a radar mount needs sensor_pose, the LiDAR in the ego frame (x,y,z "
                "from the ground under the vehicle's reference point); give it to read_semantic_lidar"
            )
        _log.warning("%s: no sensor_pose, the radar is placed at the LiDAR", frame.path)
        return Pose()
    return frame.sensor_pose.inverse().compose(mount or DEFAULT_MOUNT)


def lidar_scatterers(
    frame: LidarFrame,
    profile: RadarProfile | None = None,
    mount: Pose | None = None,
    *,
    radar: str = "",
    seed: int = 0,
    index: int = 0,
) -> Scatterers:
    """Return the points as scatterers of a radar, at the instant of the LiDAR's tick, which is mid-frame.

    Parameters
    ----------
    frame : LidarFrame
        With normals (:meth:`LidarFrame.with_normals`) the cosine of a point is -u.n as the radar sees it, where a
        normal was found; else the one the LiDAR recorded from its own place.
    profile : RadarProfile, optional
        Only its name is used, where ``radar`` gives none.
    mount : Pose, optional
        Radar in the ego frame; see :func:`radar_mount`.
    radar : str
        Name of the radar.
    seed, index : int
        What the random numbers derive from: seed of the run, index of the frame.

    Returns
    -------
    Scatterers
        ``door="lidar"``, without footprints.

    Raises
    ------
    InputError
        A mount, but no sensor pose.

    Notes
    -----
    Range rate: of the actor's point over ground minus that of the radar (ego velocity and turn) along the line of
    sight. Where neither is known the recorded column is taken as it is.
    """
    eye = radar_mount(frame, mount)
    position = eye.apply_inverse(frame.position)
    distance = np.linalg.norm(position, axis=1)
    keep = np.flatnonzero(distance > _NEAREST_M)
    if len(keep) < len(frame):
        _log.warning("%s: %d points at the radar itself are left out", frame.path, len(frame) - len(keep))
    frame, position, distance = frame.select(keep), position[keep], distance[keep]
    u = position / distance[:, None]
    velocity = _relative_velocity(frame, eye, position)
    if velocity is not None:
        rate = np.einsum("ij,ij->i", velocity, u)
    else:
        rate = np.zeros(len(frame)) if frame.range_rate is None else frame.range_rate
    normal = None if frame.normal is None else frame.normal @ eye.rotation
    seen_from = eye.apply_inverse(np.zeros(3))
    return Scatterers(
        position=position,
        range_rate=rate,
        cos_incidence=_cosine(frame, normal, u),
        object_id=frame.object_id,
        tag=frame.tag,
        area=frame.area,
        velocity=velocity,
        normal=normal,
        slope=frame.slope,
        material=frame.material,
        material_names=frame.material_names,
        radar=radar or ("" if profile is None else profile.name),
        seed=seed,
        frame=index,
        door="lidar",
        origin=(float(seen_from[0]), float(seen_from[1]), float(seen_from[2])),
    )


def _cosine(frame: LidarFrame, normal: FloatArray | None, u: FloatArray) -> FloatArray:
    """Return the cosine at the radar where a normal is known, else the recorded one."""
    if normal is None:
        return frame.cos_incidence
    known = np.any(normal != 0, axis=1)
    seen = np.clip(-np.einsum("ij,ij->i", normal, u), 0.0, 1.0)
    return np.where(known, seen, frame.cos_incidence)


def _relative_velocity(frame: LidarFrame, eye: Pose, position: FloatArray) -> FloatArray | None:
    """Return (n, 3) velocities relative to the radar in its turning frame; None where only the column is known."""
    if frame.velocity is None:
        if frame.range_rate is not None:
            return None
        over_ground = np.zeros((len(frame), 3))
    else:
        over_ground = frame.velocity @ eye.rotation
    ego = np.zeros(3) if frame.ego_velocity is None else frame.ego_velocity
    sensor = frame.sensor_pose or Pose()
    place = sensor.compose(eye)  # the radar in the ego frame
    spin = np.array([0.0, 0.0, frame.ego_yaw_rate])
    drift = (ego + np.cross(spin, place.translation)) @ place.rotation
    relative: FloatArray = over_ground - drift - np.cross(spin @ place.rotation, position)
    return relative


def door_counts(frame: LidarFrame, scatterers: Scatterers) -> dict[str, Any]:
    """Return which cosine the rows use: the radar's by an estimated normal, or the recorded one."""
    known = np.zeros(len(scatterers), bool) if scatterers.normal is None else np.any(scatterers.normal != 0, axis=1)
    return {
        "scatterers": len(scatterers),
        "left_out_at_the_radar": len(frame) - len(scatterers),
        "cosine_from_normal": int(known.sum()),
        "cosine_recorded": int(np.sum(~known)),
        "facing_away_from_the_radar": int(np.sum(known & (scatterers.cos_incidence == 0))),
        "coherent": False,
    }
