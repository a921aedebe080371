"""Where something of a scene is at an instant: steady motion, keyframes or a recording."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..config.scene import Actor, Ego, Moving, PointTarget, Scene
from ..errors import ConfigError, InputError
from ..frames import Pose, from_carla_pose
from .motion import BodyState, body_state
from .recordings import KeyPose, read_recording
from .trajectory import Trajectory

if TYPE_CHECKING:
    from ..config._base import Placed

__all__ = ["check_times", "ego_state", "point_state", "state_of", "trajectory_of"]


def state_of(item: Placed, folder: Path, time: float) -> BodyState:
    """Return the state of an ego vehicle, an actor or a static part in the world.

    Parameters
    ----------
    item : Placed
    folder : path
        Of the scene, where relative recordings are looked for.
    time : float
        Scene seconds.

    Raises
    ------
    InputError
        The time is outside the item's trajectory.
    ConfigError, NotFoundError
        A recording cannot be read.
    """
    if not isinstance(item, Moving):
        return BodyState(item.pose.rotation, item.pose.translation, np.zeros(3), np.zeros(3))
    if not item.has_trajectory:
        return body_state(item.pose, item.velocity_mps, item.yaw_rate_deg_s, time)
    return trajectory_of(item, folder).at(time)


def ego_state(scene: Scene, time: float) -> BodyState:
    """Return the ego vehicle's state in the world."""
    return state_of(scene.ego, scene.folder, time)


def point_state(scene: Scene, target: PointTarget, time: float) -> BodyState:
    """Return the state of a point target in the world, its own motion in the frame of the actor it is fixed to."""
    x, y, z = target.xyz_m
    own = body_state(Pose((x, y, z)), target.velocity_mps, 0.0, time)
    if target.actor is None:
        return own
    carrier = next(a for a in scene.actors if a.id == target.actor)
    return state_of(carrier, scene.folder, time).carrying(own)


def check_times(scene: Scene, times: Iterable[float]) -> None:
    """Raise for the first of the instants at which something of the scene has no pose, before any work is done."""
    movers = [m for m in (scene.ego, *scene.actors) if m.has_trajectory]
    for time in times:
        for item in movers:
            state_of(item, scene.folder, time)


def trajectory_of(item: Moving, folder: Path) -> Trajectory:
    """Return the trajectory of an item that has one, in the world."""
    name = _name(item)
    first = tuple(item.velocity_mps) if any(item.velocity_mps) else None
    base = item.pose
    if item.trajectory is not None:
        poses = tuple((k.t_s, k.xyz_m, k.ypr_deg) for k in item.trajectory)
        return _built(poses, item.trajectory_frame or "ros", base, first, item.trajectory_outside, name)
    file = _recording(str(item.trajectory_file), folder, name)
    number = item.trajectory_id if item.trajectory_id is not None else getattr(item, "id", None)
    stamp = file.stat().st_mtime_ns
    poses = _recorded(file, number, item.trajectory_frame or "", isinstance(item, Actor) and bool(item.shape), stamp)
    return _built(poses, item.trajectory_frame or "", base, first, item.trajectory_outside, name)


def _name(item: Moving) -> str:
    if isinstance(item, Ego):
        return "trajectory of the ego vehicle"
    return f"trajectory of {getattr(item, 'name', '') or 'actor'} (id {getattr(item, 'id', '?')})"


def _recording(text: str, folder: Path, name: str) -> Path:
    from ..config.loader import resolve_path

    given = Path(text)
    place = given if given.is_absolute() else folder / given
    return place if place.is_dir() else resolve_path(text, folder, name)


@functools.lru_cache(maxsize=1024)
def _recorded(file: Path, number: int | None, frame: str, on_ground: bool, stamp: int) -> tuple[KeyPose, ...]:
    return read_recording(file, number, frame=frame, on_ground=on_ground)


@functools.lru_cache(maxsize=16384)
def _built(
    poses: tuple[KeyPose, ...], frame: str, base: Pose, first: tuple[float, ...] | None, outside: Any, name: str
) -> Trajectory:
    placed = [base.compose(_pose(xyz, ypr, frame)) for _, xyz, ypr in poses]
    velocity = None if first is None else np.array(first)
    try:
        return Trajectory.from_poses(
            [t for t, _, _ in poses], placed, first_velocity=velocity, outside=outside, name=name
        )
    except InputError as error:
        raise ConfigError(str(error)) from None


def _pose(xyz: tuple[float, ...], ypr_deg: tuple[float, ...], frame: str) -> Pose:
    yaw, pitch, roll = ypr_deg
    if frame == "carla":
        return from_carla_pose(xyz, (pitch, yaw, roll))
    x, y, z = xyz
    return Pose((x, y, z), (yaw, pitch, roll))
