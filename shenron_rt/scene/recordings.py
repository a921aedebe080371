"""Recorded poses: CSV and JSON tables, and the side files that the CARLA recorder writes."""

from __future__ import annotations

import csv
import functools
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from ..errors import ConfigError

__all__ = ["KeyPose", "read_recording"]

#: Seconds, position [m], yaw pitch roll [deg], in the axes of the file.
KeyPose: TypeAlias = tuple[float, tuple[float, ...], tuple[float, ...]]

_COLUMNS = ("t_s", "x_m", "y_m", "z_m", "yaw_deg", "pitch_deg", "roll_deg")
_SIDE = "*.meta.yaml"


def read_recording(
    path: Path, number: int | None = None, *, frame: str = "ros", on_ground: bool = False
) -> tuple[KeyPose, ...]:
    """Read the poses of one vehicle.

    Parameters
    ----------
    path : path
        CSV with the columns ``t_s x_m y_m z_m yaw_deg pitch_deg roll_deg`` and, with several vehicles, ``id``; JSON
        with a list of ``{t_s, xyz_m, ypr_deg}`` or a mapping of id to such lists; a folder of side files
        (``*.meta.yaml``) of ``examples/carla_recorder.py``, whose first tick is 0 s.
    number : int, optional
        Which vehicle; of a folder of side files, ``None`` is the ego vehicle.
    frame : {"ros", "carla"}
        The axes the user says the file has; side files have CARLA's.
    on_ground : bool
        Of side files: move the origin down to the bottom of the recorded bounding box, where ready-made shapes stand. A
        walker's own origin is at its hip.

    Returns
    -------
    tuple of (t_s, xyz_m, ypr_deg)
        In the file's own axes, sorted by time if it is a folder.

    Raises
    ------
    ConfigError
        A file that cannot be read, lacks columns, or does not have that vehicle; says which it has.
    """
    if path.is_dir():
        if frame != "carla":
            raise ConfigError(f"{path}: side files of a CARLA recording are in CARLA's axes; trajectory_frame: carla")
        return _of_vehicle(_side_files(path, on_ground), number, path)
    if path.suffix.lower() == ".csv":
        tracks = _csv(path)
    elif path.suffix.lower() == ".json":
        tracks = _json(path)
    else:
        raise ConfigError(f"{path}: a trajectory file is .csv, .json or a folder of {_SIDE}, got {path.suffix!r}")
    if list(tracks) == [None]:
        return tuple(tracks[None])
    return _of_vehicle(tracks, number, path)


def _of_vehicle(tracks: Mapping[int | None, list[KeyPose]], number: int | None, path: Path) -> tuple[KeyPose, ...]:
    if number not in tracks:
        known = ", ".join(str(n) for n in sorted(n for n in tracks if n is not None)) or "none"
        asked = "no id was given" if number is None else f"it has no vehicle {number}"
        raise ConfigError(f"{path}: {asked}; ids in it: {known}; say which by trajectory_id")
    return tuple(tracks[number])


def _row(values: Mapping[str, Any], where: str) -> KeyPose:
    try:
        t, *rest = (float(values[c]) for c in _COLUMNS)
    except (TypeError, ValueError):
        bad = next(c for c in _COLUMNS if not _is_number(values[c]))
        raise ConfigError(f"{where}: {bad}: a number is needed, got {values[bad]!r}") from None
    if not np.isfinite([t, *rest]).all():
        raise ConfigError(f"{where}: times and poses must be finite numbers")
    return t, tuple(rest[:3]), tuple(rest[3:])


def _is_number(value: Any) -> bool:
    try:
        float(value)
    except (TypeError, ValueError):
        return False
    return True


def _csv(path: Path) -> dict[int | None, list[KeyPose]]:
    tracks: dict[int | None, list[KeyPose]] = {}
    with path.open(newline="", encoding="utf-8-sig") as file:
        reader = csv.DictReader(file, skipinitialspace=True)
        missing = [c for c in _COLUMNS if c not in (reader.fieldnames or ())]
        if missing:
            raise ConfigError(
                f"{path}:1: columns {missing} are missing; needed: {' '.join(_COLUMNS)}, and id if several"
            )
        for row in reader:
            where = f"{path}:{reader.line_num}"
            number = row.get("id")
            if number is not None and not number.strip().isdigit():
                raise ConfigError(f"{where}: id: a whole number is needed, got {number!r}")
            tracks.setdefault(None if number is None else int(number), []).append(_row(row, where))
    if not tracks:
        raise ConfigError(f"{path}: no rows below the header")
    return tracks


def _json(path: Path) -> dict[int | None, list[KeyPose]]:
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ConfigError(f"{path}: not valid JSON ({error})") from None
    if isinstance(data, list):
        return {None: _keyframes(data, str(path))}
    if isinstance(data, dict) and data and all(k.isdigit() for k in data):
        return {int(k): _keyframes(v, f"{path}: {k}") for k, v in data.items()}
    raise ConfigError(f"{path}: a list of {{t_s, xyz_m, ypr_deg}} or a mapping of id to such lists is needed")


def _keyframes(items: Any, where: str) -> list[KeyPose]:
    if not isinstance(items, list):
        raise ConfigError(f"{where}: a list of keyframes is needed, got {type(items).__name__}")
    return [_keyframe(item, f"{where}: keyframe {k}") for k, item in enumerate(items)]


def _keyframe(item: Any, where: str) -> KeyPose:
    if not isinstance(item, dict) or not {"t_s", "xyz_m"} <= set(item) <= {"t_s", "xyz_m", "ypr_deg"}:
        raise ConfigError(f"{where}: keys t_s, xyz_m and ypr_deg are needed, got {item!r}")
    xyz, ypr = item["xyz_m"], item.get("ypr_deg", (0.0, 0.0, 0.0))
    for name, triple in (("xyz_m", xyz), ("ypr_deg", ypr)):
        if not isinstance(triple, Sequence) or len(triple) != 3:
            raise ConfigError(f"{where}: {name}: three numbers are needed, got {triple!r}")
    return _row(dict(zip(_COLUMNS, (item["t_s"], *xyz, *ypr), strict=True)), where)


# ---- the CARLA recorder's side files
def _side_files(folder: Path, on_ground: bool) -> dict[int | None, list[KeyPose]]:
    """Return the poses of every vehicle of a folder of side files; ``None`` is the ego vehicle."""
    files = sorted(folder.glob(_SIDE))
    if not files:
        raise ConfigError(f"{folder}: no side files ({_SIDE}) in it")
    ticks = sorted((_tick(str(f), f.stat().st_mtime_ns) for f in files), key=lambda tick: tick[0])
    tracks: dict[int | None, list[KeyPose]] = {}
    for time, poses in ticks:
        for number, (xyz, ypr, bottom) in poses.items():
            if tracks.get(number) and tracks[number][-1][0] == time - ticks[0][0]:
                continue  # several sensors write one side file each a tick
            lowered = tuple(np.add(xyz, bottom)) if on_ground else xyz
            tracks.setdefault(number, []).append((time - ticks[0][0], lowered, ypr))
    return tracks


Placement: TypeAlias = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]


@functools.lru_cache(maxsize=4096)
def _tick(file: str, stamp: int) -> tuple[float, dict[int | None, Placement]]:
    """Return the time of one side file, and position, yaw pitch roll and the box's bottom (all CARLA) by id."""
    from ..config.loader import read_yaml

    data, _ = read_yaml(file)
    try:
        poses = {int(a["id"]): _placement(a) for a in data.get("actors") or ()}
        ego: dict[int | None, Placement] = {None: _placement(data["ego_transform"])}
        return float(data["timestamp_s"]), ego | poses
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ConfigError(
            f"{file}: not a side file of the CARLA recorder: {type(error).__name__} {error}; it has timestamp_s, "
            "ego_transform and actors with location and rotation_deg"
        ) from None


def _placement(record: Mapping[str, Any]) -> Placement:
    turn = record["rotation_deg"]
    xyz = tuple(float(v) for v in record["location"])
    ypr = tuple(float(turn[k]) for k in ("yaw", "pitch", "roll"))
    box = record.get("bbox")
    # straight down: vehicles and walkers tilt by a few degrees at most
    bottom = 0.0 if box is None else float(box["center_local"][2]) - abs(float(box["extent"][2]))
    return xyz, ypr, (0.0, 0.0, bottom)
