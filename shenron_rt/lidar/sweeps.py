"""Two sweeps in one frame: at 20 Hz ticks and 10 Hz rotation a tick holds half of the circle."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from .._typing import FloatArray
from ..errors import InputError
from ..frames import Pose
from .frame import LidarFrame

__all__ = ["merge_sweeps", "sweep_motion"]


def merge_sweeps(now: LidarFrame, earlier: LidarFrame, motion: Pose, *, elapsed_s: float = 0.0) -> LidarFrame:
    """Join two sweeps of one sensor in the frame, and at the instant, of the first.

    Parameters
    ----------
    now : LidarFrame
    earlier : LidarFrame
        The other sweep; each point keeps the area and the cosine its own sweep saw.
    motion : Pose
        Ego frame at the time of ``earlier`` in the ego frame at the time of ``now``; where the ego drove 1 m ahead,
        ``Pose((-1, 0, 0))``. Without sensor poses: the same of the sensor.
    elapsed_s : float
        Time from ``earlier`` to ``now`` [s]. With velocities, points of moving actors are carried on by it; without,
        they trail by one sweep.

    Raises
    ------
    InputError
        Sensor poses that differ; velocity, recorded column, normals or materials in one sweep only.
    """
    if now.sensor_pose != earlier.sensor_pose:
        raise InputError(f"merge_sweeps: sensor poses differ: {now.sensor_pose} and {earlier.sensor_pose}")
    for name in ("velocity", "range_rate", "normal", "slope", "material"):
        if (getattr(now, name) is None) != (getattr(earlier, name) is None):
            raise InputError(f"merge_sweeps: only one of the sweeps has {name}; read both the same way")
    mount = now.sensor_pose or Pose()
    turn = mount.rotation.T @ motion.rotation @ mount.rotation
    points = mount.apply_inverse(motion.apply(mount.apply(earlier.position)))
    velocity = None if earlier.velocity is None else earlier.velocity @ turn.T
    if velocity is not None:
        points = points + elapsed_s * velocity
    joined: dict[str, Any] = {"position": np.concatenate([now.position, points])}
    if now.velocity is not None and velocity is not None:
        joined["velocity"] = np.concatenate([now.velocity, velocity])
    if now.normal is not None and earlier.normal is not None:
        joined["normal"] = np.concatenate([now.normal, _turned(earlier.normal, turn)])
    for name in ("cos_incidence", "object_id", "tag", "area", "range_rate", "slope", "material"):
        if getattr(now, name) is not None:
            joined[name] = np.concatenate([getattr(now, name), getattr(earlier, name)])
    shift = float(np.linalg.norm(motion.translation))
    moved = f"{shift:.2f} m and {abs(motion.ypr_deg[0]):.2f} deg"
    note = f"merged with {earlier.path} ({len(earlier)} points), moved by {moved}"
    return replace(
        now,
        **joined,
        names={**earlier.names, **now.names},
        notes=(*now.notes, note),
        n_read=now.n_read + earlier.n_read,
        n_clipped=now.n_clipped + earlier.n_clipped,
    )


def sweep_motion(
    now: LidarFrame, elapsed_s: float, world_now: Pose | None = None, world_earlier: Pose | None = None
) -> Pose:
    """Return how the ego vehicle moved between two sweeps: the ``motion`` of :func:`merge_sweeps`.

    Parameters
    ----------
    now : LidarFrame
        Its ego velocity and yaw rate count where the poses are not known.
    elapsed_s : float
        Time from the earlier sweep to this one [s].
    world_now, world_earlier : Pose, optional
        Sensor in the world at either sweep, as side files with CARLA's transforms have it.

    Returns
    -------
    Pose
        Earlier ego frame in the present one; that of the sensor where it has no pose.

    Raises
    ------
    InputError
        Neither poses nor an ego velocity.
    """
    mount = now.sensor_pose or Pose()
    if world_now is not None and world_earlier is not None:
        return mount.compose(world_now.inverse()).compose(world_earlier).compose(mount.inverse())
    if now.ego_velocity is None:
        raise InputError(
            f"{now.path}: sweeps are joined by how the ego vehicle moved; give side files with sensor_transform of "
            "each tick, or the ego velocity"
        )
    # a constant velocity in ego axes and a constant turn: the mean of R(w t) v over the time
    turn = now.ego_yaw_rate * elapsed_s
    along, across = np.sinc(turn / np.pi), np.sinc(turn / (2 * np.pi)) ** 2 * turn / 2
    x, y, z = (float(v) for v in now.ego_velocity * elapsed_s)
    ahead = Pose((along * x - across * y, across * x + along * y, z), (float(np.degrees(turn)), 0.0, 0.0))
    return ahead.inverse()


def _turned(normal: FloatArray, turn: FloatArray) -> FloatArray:
    turned: FloatArray = normal @ turn.T
    return turned
