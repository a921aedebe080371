"""Read a semantic LiDAR frame: columns of a file to points at the sensor, checked."""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from .._typing import ArrayLike, FloatArray
from ..errors import InputError
from ..frames import Pose, from_carla_points
from ..tags import TagTable
from ..tags import tag_table as find_table
from .evidence import check_table, suggest_from_points
from .frame import LidarFrame
from .grid import LidarGrid, estimate_grid, surface_area
from .readers import RawPoints, read_points
from .side_file import SideFile, read_side_file

__all__ = ["check_points", "read_semantic_lidar", "scan_frame"]

_log = logging.getLogger("shenron_rt.lidar")

FrameName = Literal["carla", "ros"]
OriginName = Literal["sensor", "ego", "world"]
#: Cosines outside [-1, 1] by no more than this come from rounding: four decimals, or float32 arithmetic.
_ROUNDING = 1e-3
#: Poses that differ by less are one [m, deg].
_SAME_POSE = 0.01
#: Slack of an actor's box [m]; mirrors and wheels stick out.
_BOX_SLACK_M = 0.5


def read_semantic_lidar(
    path: str | os.PathLike[str],
    *,
    tag_table: str | os.PathLike[str] | TagTable,
    frame: FrameName,
    origin: OriginName = "sensor",
    sensor_pose: Pose | None = None,
    side_file: str | os.PathLike[str] | None = None,
    ego_velocity: ArrayLike | None = None,
    grid: Sequence[float] | LidarGrid | None = None,
) -> LidarFrame:
    """Read one frame of a semantic LiDAR.

    Parameters
    ----------
    path : path
        CARLA's PLY, raw 24-byte records, ``.npy``, ``.npz`` (SimBEV), LAZ (C-Shenron) or a table of six or seven
        columns. The layout is told by the content.
    tag_table : str, path or TagTable
        ``"0.9.13"``, ``"0.9.14"``, ``"ue5"`` or a YAML table. ``"auto"`` is refused, with what the points suggest.
    frame : {"carla", "ros"}
        Whether y points right or left in the file, which no layout says.
    origin : {"sensor", "ego", "world"}
        What the coordinates are relative to. ``"ego"`` needs the sensor's pose, ``"world"`` a side file with it.
    sensor_pose : Pose, optional
        Sensor in the ego frame. Default: that of the side file. Needed to place a radar elsewhere.
    side_file : path, optional
        Velocities of actors and poses, see ``docs/lidar.md``.
    ego_velocity : (3,) array_like, optional
        Of the ego vehicle over ground, ego axes, x forward, y left [m/s]; goes before the side file's.
    grid : (channels, upper_deg, lower_deg, azimuth_step_deg), optional
        Of the sensor; estimated from the points without it.

    Returns
    -------
    LidarFrame

    Raises
    ------
    InputError
        Points that cannot be semantic LiDAR, or cannot be what the arguments say: all tags 0, fractional or unknown
        tags, cosines beyond [-1, 1], NaN, an empty or shortened file, a table or a frame that the points contradict.
    NotFoundError
        No such file.

    Examples
    --------
    >>> import shenron_rt as srt
    >>> frame = srt.read_semantic_lidar("frame.ply", tag_table="0.9.14", frame="carla")  # doctest: +SKIP
    """
    _check_choices(frame, origin)
    raw = read_points(path)
    raw, clipped = check_points(raw, str(path))
    side = None if side_file is None else read_side_file(side_file)
    pose = sensor_pose or (None if side is None else side.sensor_pose)
    flipped = replace(raw, xyz=from_carla_points(raw.xyz)) if frame == "carla" else raw
    at_sensor = replace(flipped, xyz=_to_sensor(flipped.xyz, origin, pose, side, str(path)))
    table = _table(tag_table, at_sensor, str(path))
    tag = table.translate(at_sensor.tag)
    check_table(str(path), table, at_sensor, tag)
    notes = [*raw.notes, *_frame_notes(raw, frame), *_pose_notes(sensor_pose, side), *_velocity_notes(raw, side)]
    if side is not None:
        _check_boxes(at_sensor, pose, side, str(path), frame)
    for note in notes[len(raw.notes) :]:
        _log.warning("%s: %s", path, note)
    used = _grid(grid) or estimate_grid(at_sensor.xyz, str(path))
    speed = _ego_velocity(ego_velocity, side)
    velocity = _velocity(at_sensor, pose, side, speed)
    return LidarFrame(
        position=at_sensor.xyz,
        cos_incidence=at_sensor.cos,
        object_id=at_sensor.object_id,
        tag=tag,
        area=surface_area(used, at_sensor.xyz, at_sensor.cos),
        grid=used,
        sensor_pose=pose,
        velocity=velocity,
        ego_velocity=speed,
        ego_yaw_rate=0.0 if side is None else side.ego_yaw_rate,
        range_rate=raw.range_rate,
        path=str(path),
        layout=raw.layout,
        tag_table=table.name,
        names={} if side is None else side.names,
        notes=tuple(notes),
        n_read=len(raw),
        n_clipped=clipped,
    )


def _check_choices(frame: str, origin: str) -> None:
    if frame not in ("carla", "ros"):
        raise InputError(f"frame {frame!r}: 'carla' (y right) or 'ros' (y left); no file says which it is")
    if origin not in ("sensor", "ego", "world"):
        raise InputError(f"origin {origin!r}: 'sensor', 'ego' or 'world'")


def check_points(raw: RawPoints, path: str) -> tuple[RawPoints, int]:
    """Return the points with cosines in [0, 1], and how many had to be changed.

    Raises
    ------
    InputError
        No points, NaN, all tags 0, cosines beyond rounding.
    """
    if len(raw) == 0:
        raise InputError(f"{path}: no points (N = 0)")
    for name, values in (("position", raw.xyz), ("CosAngle", raw.cos), ("velocity", raw.range_rate)):
        if values is not None and not np.all(np.isfinite(values)):
            rows = int(np.sum(~np.all(np.isfinite(values.reshape(len(raw), -1)), axis=1)))
            raise InputError(f"{path}: {name} is NaN or infinite in {rows} of {len(raw)} points; drop them first")
    if not np.any(raw.tag):
        raise InputError(
            f"{path}: all {len(raw)} tags are 0; bits of the tags flushed to zero (float arithmetic on a raw view), "
            "or a UE5 build before November 2024. Save the raw_data bytes or the PLY again"
        )
    top = float(np.abs(raw.cos).max())
    if top > 1 + _ROUNDING:
        beyond = int(np.sum(np.abs(raw.cos) > 1 + _ROUNDING))
        hint = " Is it an angle? CARLA's column is the cosine itself." if top <= np.pi + _ROUNDING else ""
        raise InputError(f"{path}: CosAngle reaches {top:g} ({beyond} of {len(raw)} points beyond [-1, 1]).{hint}")
    clipped = int(np.sum((raw.cos < 0) | (raw.cos > 1)))
    return replace(raw, cos=np.minimum(np.abs(raw.cos), 1.0)), clipped


def _table(name: str | os.PathLike[str] | TagTable, raw: RawPoints, path: str) -> TagTable:
    if not isinstance(name, TagTable) and os.fspath(name).lower() == "auto":
        found = suggest_from_points(raw)
        advice = f"the points suggest {found.table!r}" if found.table else "the points do not tell"
        raise InputError(
            f"{path}: tag_table 'auto' only suggests: {advice} ({found.evidence}). "
            "Name it: '0.9.13', '0.9.14', 'ue5' or a .yaml table"
        )
    return find_table(name)


def _to_sensor(xyz: FloatArray, origin: str, pose: Pose | None, side: SideFile | None, path: str) -> FloatArray:
    """Return points at the sensor; areas and cosines belong to it, so its place must be known."""
    if origin == "sensor":
        return xyz
    if origin == "ego":
        if pose is None:
            raise InputError(
                f"{path}: origin 'ego' needs sensor_pose (the sensor in the ego frame), or a side file with it"
            )
        return pose.apply_inverse(xyz)
    if side is None or side.sensor_world is None:
        raise InputError(f"{path}: origin 'world' needs a side_file with the sensor_transform of this frame's own tick")
    return side.sensor_world.apply_inverse(xyz)


def scan_frame(raw: RawPoints) -> FrameName | None:
    """Return the axes that the file's scan order speaks for: CARLA's sensor turns to the right. None: it does not."""
    if len(raw) < 64:
        return None
    step = np.diff(np.unwrap(np.arctan2(raw.xyz[:, 1], raw.xyz[:, 0])))
    small = step[(np.abs(step) < np.radians(5)) & (np.abs(step) > 1e-6)]
    if len(small) < len(raw) // 2:
        return None
    rising = float(np.mean(small > 0))
    return "carla" if rising > 0.9 else "ros" if rising < 0.1 else None


def _frame_notes(raw: RawPoints, frame: str) -> list[str]:
    """Compare the file's scan order with what the caller says."""
    guess = scan_frame(raw)
    if guess in (None, frame):
        return []
    return [
        f"frame {frame!r}, but azimuths run as if y pointed {'right' if guess == 'carla' else 'left'}: is it {guess!r}?"
    ]


def _pose_notes(given: Pose | None, side: SideFile | None) -> list[str]:
    """Say where an explicit pose overrules the side file's."""
    if given is None or side is None or side.sensor_pose is None:
        return []
    off = np.abs(np.subtract([*given.xyz, *given.ypr_deg], [*side.sensor_pose.xyz, *side.sensor_pose.ypr_deg]))
    if off.max() < _SAME_POSE:
        return []
    return [
        f"sensor_pose {given.xyz} is used, not that of {side.path}, {tuple(round(v, 4) for v in side.sensor_pose.xyz)}"
    ]


def _velocity_notes(raw: RawPoints, side: SideFile | None) -> list[str]:
    if raw.range_rate is None or side is None or not side.actors:
        return []
    return [f"velocities are those of {side.path}; the recorded column is kept, not used"]


def _check_boxes(raw: RawPoints, pose: Pose | None, side: SideFile, path: str, frame: str) -> None:
    """Refuse points that lie in their actors' boxes only after another flip of y."""
    if pose is None:
        return
    inside = mirrored = total = 0
    for actor in side.actors.values():
        rows = np.flatnonzero(raw.object_id == actor.object_id)
        if actor.box is None or not len(rows):
            continue
        center, half = actor.box
        total += len(rows)
        for sign in (1.0, -1.0):
            points = center.apply_inverse(pose.apply(raw.xyz[rows] * np.array([1.0, sign, 1.0])))
            hits = int(np.sum(np.all(np.abs(points) < half + _BOX_SLACK_M, axis=1)))
            inside, mirrored = (inside + hits, mirrored) if sign > 0 else (inside, mirrored + hits)
    if total and mirrored > 0.5 * total and inside < 0.5 * mirrored:
        other = "ros" if frame == "carla" else "carla"
        raise InputError(
            f"{path}: frame {frame!r} puts {inside} of {total} actor points into the boxes of {side.path}, frame "
            f"{other!r} {mirrored}: y is mirrored"
        )
    if total and inside < 0.5 * total:
        _log.warning(
            "%s: only %d of %d actor points lie in the boxes of %s; is it of the same tick?",
            path,
            inside,
            total,
            side.path,
        )


def _grid(grid: Sequence[float] | LidarGrid | None) -> LidarGrid | None:
    if grid is None or isinstance(grid, LidarGrid):
        return grid
    try:
        channels, upper, lower, step = (float(v) for v in grid)
    except (TypeError, ValueError):
        raise InputError(f"grid: (channels, upper_deg, lower_deg, azimuth_step_deg) is needed, got {grid!r}") from None
    if channels != round(channels):
        raise InputError(f"grid: a whole number of channels is needed, got {channels:g}")
    return LidarGrid(int(channels), upper, lower, step)


def _ego_velocity(given: ArrayLike | None, side: SideFile | None) -> FloatArray | None:
    if given is None:
        return None if side is None else side.ego_velocity
    value = np.asarray(given, dtype=np.float64)
    if value.shape != (3,) or not np.all(np.isfinite(value)):
        raise InputError(f"ego_velocity: three finite numbers, ego axes, m/s; got {given!r}")
    return value


def _velocity(
    raw: RawPoints, pose: Pose | None, side: SideFile | None, ego_velocity: FloatArray | None
) -> FloatArray | None:
    """Return velocities over ground in the sensor's axes; None leaves it to the recorded column, or to standing."""
    if side is None or not side.actors:
        return np.zeros((len(raw), 3)) if ego_velocity is not None and raw.range_rate is None else None
    known = pose or Pose()  # without a pose the sensor's axes are taken for the ego's
    return side.velocity(known.apply(raw.xyz), raw.object_id) @ known.rotation
