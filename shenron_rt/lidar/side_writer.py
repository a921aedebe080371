"""The side file of a frame cast over a scene: what a LiDAR frame does not carry, in either of the layouts read."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Literal

import numpy as np

from .._typing import FloatArray
from ..config.scene import Actor, LidarMount, Scene
from ..errors import InputError
from ..frames import Pose, to_carla, to_carla_pose
from ..scene.motion_of import ego_state, state_of
from ..scene.world import source_mesh
from .side_file import ActorState, SideFile

__all__ = ["scene_side_file", "write_side_file"]


def scene_side_file(scene: Scene, lidar: LidarMount, time: float = 0.0) -> SideFile:
    """Return where the actors, the ego vehicle and a LiDAR are at one instant, and how they move.

    Parameters
    ----------
    scene : Scene
    lidar : LidarMount
    time : float
        Scene seconds of the tick [s].

    Returns
    -------
    SideFile
    """
    ego = ego_state(scene, time)
    ego_pose = Pose.from_matrix(ego.rotation, ego.origin)
    actors = (_actor(actor, scene.folder, ego_pose, time) for actor in scene.actors)
    return SideFile(
        path=scene.name,
        actors={a.object_id: a for a in actors},
        ego_velocity=ego.rotation.T @ ego.velocity,
        ego_yaw_rate=ego.yaw_rate,
        sensor_pose=lidar.pose,
        sensor_world=ego_pose.compose(lidar.pose),
    )


def _actor(actor: Actor, folder: Path, ego: Pose, time: float) -> ActorState:
    state = state_of(actor, folder, time)
    pose = ego.inverse().compose(Pose.from_matrix(state.rotation, state.origin))
    vertices = source_mesh(actor, folder).vertices
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    x, y, z = (float(v) for v in (low + high) / 2)
    return ActorState(
        object_id=actor.id,
        velocity=ego.rotation.T @ state.velocity,
        origin=pose.translation,
        yaw_rate=state.yaw_rate,
        box=(pose.compose(Pose((x, y, z))), (high - low) / 2),
        name=actor.name,
    )


def write_side_file(path: str | os.PathLike[str], side: SideFile, *, layout: Literal["own", "carla"] = "own") -> None:
    """Write a side file that :func:`~shenron_rt.lidar.read_side_file` reads back.

    Parameters
    ----------
    path : path
    side : SideFile
    layout : {"own", "carla"}
        ``"own"``: ``version: 1``, ROS axes, the ego frame. ``"carla"``: world transforms and boxes as CARLA's client
        gives them, y right; velocities in ego axes.

    Raises
    ------
    InputError
        Another layout; ``"carla"`` without the poses of the sensor in the ego frame and in the world.
    """
    import yaml

    if layout not in ("own", "carla"):
        raise InputError(f"side file layout {layout!r}: 'own' or 'carla'")
    data = _own(side) if layout == "own" else _carla(side)
    Path(path).write_text(yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=120), encoding="utf-8")


def _numbers(values: FloatArray | tuple[float, ...]) -> list[float]:
    return [float(v) + 0.0 for v in values]  # + 0.0 turns -0.0 into 0.0


def _own(side: SideFile) -> dict[str, Any]:
    ego = np.zeros(3) if side.ego_velocity is None else side.ego_velocity
    data: dict[str, Any] = {
        "version": 1,
        "axes": "ros",
        "ego": {"velocity_mps": _numbers(ego), "yaw_rate_deg_s": float(np.degrees(side.ego_yaw_rate))},
    }
    if side.sensor_pose is not None:
        data["sensor"] = {"xyz_m": _numbers(side.sensor_pose.xyz), "ypr_deg": _numbers(side.sensor_pose.ypr_deg)}
    data["actors"] = [
        {
            "id": a.object_id,
            "name": a.name,
            **({} if a.origin is None else {"xyz_m": _numbers(a.origin)}),
            "velocity_mps": _numbers(a.velocity),
            "yaw_rate_deg_s": float(np.degrees(a.yaw_rate)),
        }
        for a in side.actors.values()
    ]
    return data


def _carla(side: SideFile) -> dict[str, Any]:
    if side.sensor_pose is None or side.sensor_world is None:
        raise InputError("a side file with CARLA's transforms needs sensor_pose and sensor_world")
    ego = side.sensor_world.compose(side.sensor_pose.inverse())
    speed = np.zeros(3) if side.ego_velocity is None else side.ego_velocity
    return {
        "frame": "CARLA left-handed: x forward, y right, z up, metres, degrees; yaw clockwise seen from above",
        "carla_tag_table": "0.9.14-0.9.16",
        "sensor_transform": _transform(side.sensor_world),
        "ego_transform": _transform(ego),
        "ego_velocity_in_ego_axes_m_s": _numbers(to_carla(speed)),
        "ego_yaw_rate_deg_s": -float(np.degrees(side.ego_yaw_rate)),
        "actors": [_carla_actor(actor, ego) for actor in side.actors.values()],
    }


def _transform(pose: Pose) -> dict[str, Any]:
    location, (pitch, yaw, roll) = to_carla_pose(pose)
    return {"location": _numbers(location), "rotation_deg": {"pitch": pitch, "yaw": yaw, "roll": roll}}


def _carla_actor(actor: ActorState, ego: Pose) -> dict[str, Any]:
    record: dict[str, Any] = {"id": actor.object_id, "type_id": actor.name}
    if actor.origin is not None:
        turn = np.eye(3) if actor.box is None else actor.box[0].rotation
        pose = Pose.from_matrix(turn, actor.origin)
        record |= _transform(ego.compose(pose))
        if actor.box is not None:
            center = pose.apply_inverse(actor.box[0].translation[None])[0]
            record["bbox"] = {"center_local": _numbers(to_carla(center)), "extent": _numbers(actor.box[1])}
    record["velocity_in_ego_axes_m_s"] = _numbers(to_carla(actor.velocity))
    record["yaw_rate_deg_s"] = -float(np.degrees(actor.yaw_rate))
    return record
