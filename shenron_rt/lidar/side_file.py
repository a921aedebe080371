"""What a LiDAR frame does not carry: how its actors and the ego vehicle move, and where the sensor was.

Two layouts, told apart by their keys; both are described in ``docs/lidar.md``. All results are in the ego frame, ROS
axes.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .._typing import FloatArray, IntArray
from ..errors import ConfigError
from ..frames import Pose, from_carla_points, from_carla_pose

__all__ = ["ActorState", "SideFile", "read_side_file"]

_CARLA_KEYS = {"sensor_transform", "ego_transform"}


@dataclass(frozen=True)
class ActorState:
    """An actor at the instant of the frame, in the ego frame.

    Parameters
    ----------
    object_id : int
    velocity : (3,) float
        Of its origin over ground [m/s].
    origin : (3,) float or None
        Needed for the turn [m].
    yaw_rate : float
        + left [rad/s].
    box : (Pose, (3,) float) or None
        Centre of its bounding box in the ego frame and half edges [m].
    name : str
    """

    object_id: int
    velocity: FloatArray
    origin: FloatArray | None = None
    yaw_rate: float = 0.0
    box: tuple[Pose, FloatArray] | None = None
    name: str = ""

    def velocity_at(self, points: FloatArray) -> FloatArray:
        """Return the velocity over ground of (n, 3) points of the actor, ego frame [m/s]."""
        velocity = np.broadcast_to(self.velocity, points.shape).copy()
        if self.yaw_rate and self.origin is not None:
            arm = points - self.origin
            velocity[:, 0] -= self.yaw_rate * arm[:, 1]
            velocity[:, 1] += self.yaw_rate * arm[:, 0]
        return velocity


@dataclass(frozen=True)
class SideFile:
    """A side file that was read.

    Parameters
    ----------
    path : str
    actors : dict of int to ActorState
    ego_velocity : (3,) float or None
        Over ground, ego axes [m/s].
    ego_yaw_rate : float
        + left [rad/s].
    sensor_pose : Pose or None
        Sensor in the ego frame.
    sensor_world : Pose or None
        Sensor in the world, for clouds in world coordinates.
    """

    path: str
    actors: Mapping[int, ActorState] = field(default_factory=dict)
    ego_velocity: FloatArray | None = None
    ego_yaw_rate: float = 0.0
    sensor_pose: Pose | None = None
    sensor_world: Pose | None = None

    @property
    def names(self) -> dict[int, str]:
        """Names of the actors by id."""
        return {i: a.name for i, a in self.actors.items() if a.name}

    def velocity(self, points: FloatArray, object_id: IntArray) -> FloatArray:
        """Return (n, 3) velocities over ground of points in the ego frame [m/s]; 0 for ids the file does not list."""
        out = np.zeros(points.shape)
        for number, actor in self.actors.items():  # one pass an actor, of which a frame has a few dozen
            rows = np.flatnonzero(object_id == number)
            out[rows] = actor.velocity_at(points[rows])
        return out


def read_side_file(path: str | os.PathLike[str]) -> SideFile:
    """Read either layout.

    Parameters
    ----------
    path : path
        YAML with ``sensor_transform``, ``ego_transform`` and CARLA axes, or with ``version: 1`` and named axes.

    Raises
    ------
    ConfigError, NotFoundError
    """
    from ..config.loader import read_yaml

    data, _ = read_yaml(path)
    file = Path(path)
    try:
        if _CARLA_KEYS & set(data):
            return _carla_layout(file, data)
        return _own_layout(file, data)
    except ConfigError:
        raise
    except (TypeError, ValueError, KeyError, AttributeError) as error:
        raise ConfigError(f"{file}: not a side file that can be read: {type(error).__name__} {error}") from None


def _vector(value: Any, where: str) -> FloatArray:
    """Return three finite numbers; maps with x, y, z are taken too."""
    if isinstance(value, Mapping):
        value = [value.get(axis) for axis in "xyz"]
    try:
        vector = np.array([float(v) for v in value])
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if vector.shape != (3,) or not np.all(np.isfinite(vector)):
        raise ConfigError(f"{where}: three finite numbers are needed, got {value!r}")
    return vector


# ---- the layout with CARLA's transforms
def _carla_pose(record: Mapping[str, Any], where: str) -> Pose:
    turn = record.get("rotation_deg") or {}
    angles = [float(turn.get(k, 0.0)) for k in ("pitch", "yaw", "roll")]
    return from_carla_pose([float(v) for v in _vector(record.get("location"), f"{where}.location")], angles)


def _carla_layout(file: Path, data: Mapping[str, Any]) -> SideFile:
    sensor = _carla_pose(data["sensor_transform"], f"{file}: sensor_transform") if "sensor_transform" in data else None
    ego = _carla_pose(data["ego_transform"], f"{file}: ego_transform") if "ego_transform" in data else None
    actors = [_carla_actor(record, ego, f"{file}: actors.{k}") for k, record in enumerate(data.get("actors") or ())]
    speed = data.get("ego_velocity_in_ego_axes_m_s")
    return SideFile(
        path=str(file),
        actors={a.object_id: a for a in actors},
        ego_velocity=None
        if speed is None
        else from_carla_points(_vector(speed, f"{file}: ego_velocity_in_ego_axes_m_s")),
        ego_yaw_rate=-float(np.radians(float(data.get("ego_yaw_rate_deg_s", 0.0)))),
        sensor_pose=None if sensor is None or ego is None else ego.inverse().compose(sensor),
        sensor_world=sensor,
    )


def _carla_actor(record: Mapping[str, Any], ego: Pose | None, where: str) -> ActorState:
    speed = record.get("velocity_in_ego_axes_m_s", (0.0, 0.0, 0.0))
    pose = None
    if ego is not None and record.get("location") is not None:
        pose = ego.inverse().compose(_carla_pose(record, where))
    box = None
    if pose is not None and isinstance(shape := record.get("bbox"), Mapping):
        center = from_carla_points(_vector(shape.get("center_local", (0, 0, 0)), f"{where}.bbox.center_local"))
        x, y, z = (float(v) for v in center)
        box = (pose.compose(Pose((x, y, z))), np.abs(_vector(shape.get("extent"), f"{where}.bbox.extent")))
    return ActorState(
        object_id=int(record["id"]),
        velocity=from_carla_points(_vector(speed, f"{where}.velocity_in_ego_axes_m_s")),
        origin=None if pose is None else pose.translation,
        # CARLA's yaw grows to the right
        yaw_rate=-float(np.radians(float(record.get("yaw_rate_deg_s", 0.0)))),
        box=box,
        name=str(record.get("type_id") or record.get("label") or ""),
    )


# ---- the layout of this project
def _own_layout(file: Path, data: Mapping[str, Any]) -> SideFile:
    unknown = sorted(set(data) - {"version", "axes", "ego", "sensor", "actors"})
    if unknown or data.get("version") != 1:
        key = "version" if data.get("version") != 1 else unknown[0]
        raise ConfigError(
            f"{file}: {key}: a side file has version: 1 with axes, ego, "
            "sensor, actors, or the keys sensor_transform, ego_transform, actors with CARLA's transforms"
        )
    axes = data.get("axes")
    if axes not in ("ros", "carla"):
        raise ConfigError(f"{file}: axes: ros (y left) or carla (y right), got {axes!r}")
    flip = from_carla_points if axes == "carla" else (lambda v: v)
    left = -1.0 if axes == "carla" else 1.0
    ego, sensor = data.get("ego") or {}, data.get("sensor")
    actors = []
    for k, record in enumerate(data.get("actors") or ()):
        where = f"{file}: actors.{k}"
        origin = record.get("xyz_m")
        actors.append(
            ActorState(
                object_id=int(record["id"]),
                velocity=flip(_vector(record.get("velocity_mps", (0, 0, 0)), f"{where}.velocity_mps")),
                origin=None if origin is None else flip(_vector(origin, f"{where}.xyz_m")),
                yaw_rate=left * float(np.radians(float(record.get("yaw_rate_deg_s", 0.0)))),
                name=str(record.get("name", "")),
            )
        )
    speed = ego.get("velocity_mps")
    return SideFile(
        path=str(file),
        actors={a.object_id: a for a in actors},
        ego_velocity=None if speed is None else flip(_vector(speed, f"{file}: ego.velocity_mps")),
        ego_yaw_rate=left * float(np.radians(float(ego.get("yaw_rate_deg_s", 0.0)))),
        sensor_pose=None if sensor is None else _own_pose(sensor, axes, f"{file}: sensor"),
    )


def _own_pose(record: Mapping[str, Any], axes: str, where: str) -> Pose:
    xyz = _vector(record.get("xyz_m", (0, 0, 0)), f"{where}.xyz_m")
    ypr = _vector(record.get("ypr_deg", (0, 0, 0)), f"{where}.ypr_deg")
    if axes == "carla":
        return from_carla_pose([float(v) for v in xyz], [float(ypr[1]), float(ypr[0]), float(ypr[2])])
    x, y, z = (float(v) for v in xyz)
    yaw, pitch, roll = (float(v) for v in ypr)
    return Pose((x, y, z), (yaw, pitch, roll))
