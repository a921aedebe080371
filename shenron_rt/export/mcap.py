"""MCAP for Foxglove: clouds, transforms, maps, meshes and link budgets of a run, and a layout that opens the file."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from ..constants import DEFAULT_MOUNT_XYZ
from ..frames import Pose
from ..run_source import RunFrame, RunRadar, RunSource, open_run
from ..runs import Run
from . import mcap_messages as messages
from .budget import budget_text, object_budgets
from .layout import layout_json
from .mcap_recorder import Recorder
from .others import LidarClouds, RecordedClouds, lidar_clouds, recorded_clouds
from .pictures import map_pictures
from .points import detection_points
from .poses import mount_transforms, radar_frame
from .scene_bodies import drawable
from .target import require, whole_file
from .timeline import EPOCH_S, timeline

__all__ = ["export_mcap", "layout_path"]

_NUMBER: dict[str, Any] = {"type": "number"}
_STRONGEST: dict[str, Any] = {
    "title": "shenron_rt.Strongest",
    "type": "object",
    "properties": {
        "frame": {"type": "integer"}, "range_m": _NUMBER, "azimuth_deg": _NUMBER, "velocity_mps": _NUMBER,
        "snr_db": _NUMBER, "object_id": {"type": "integer"}, "chain": {"type": "string"}, "ghost": {"type": "boolean"},
    },
}  # fmt: skip
_OBJECTS: dict[str, Any] = {
    "title": "shenron_rt.Objects",
    "type": "object",
    "properties": {
        "frame": {"type": "integer"},
        "objects": {"type": "array", "items": {"type": "object", "properties": {
            "id": {"type": "integer"}, "name": {"type": "string"}, "tag": {"type": "string"},
            "range_m": _NUMBER, "azimuth_deg": _NUMBER, "elevation_deg": _NUMBER, "velocity_mps": _NUMBER,
            "tx_power_dbm": _NUMBER, "gain_db": _NUMBER, "pattern_db": _NUMBER, "spreading_db": _NUMBER,
            "loss_db": _NUMBER, "rcs_dbsm": _NUMBER, "power_dbm": _NUMBER, "snr_db": {"type": ["number", "null"]},
            "detected": {"type": "boolean"},
        }}},
    },
}  # fmt: skip


def layout_path(path: Path) -> Path:
    """Return where the Foxglove layout of an MCAP file is written: ``drive.mcap`` has ``drive.layout.json``."""
    return path.with_name(f"{path.stem}.layout.json")


def export_mcap(
    run: RunSource | Run | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    radars: Sequence[str] | None = None,
    frames: Collection[int] | None = None,
    overwrite: bool = False,
    epoch_s: int = EPOCH_S,
    lidar: bool | None = None,
    recorded: Sequence[str | os.PathLike[str]] | str | os.PathLike[str] | None = None,
    recorded_mount: Pose | None = None,
    pictures: bool = True,
    backend: str = "auto",
    step: Callable[[str], None] | None = None,
) -> Path:
    """Write a run as one MCAP file with Foxglove's own schemas, and a layout beside it (:func:`layout_path`).

    Parameters
    ----------
    run : RunSource, Run or path
        A run folder, or one that :func:`~shenron_rt.export.open_run` has opened.
    path : path
        The file to make, ``.mcap``.
    radars, frames : optional
        Which of the run's. Default: all.
    overwrite : bool
        Replace files that are there.
    epoch_s : int
        Seconds since 1970 that scene second 0 is stamped with.
    lidar : bool, optional
        None: LiDAR points where the scene or the run has them; True: of a scene without a LiDAR a roof LiDAR at
        (0, 0, 2.5) m is cast; False: none.
    recorded : path or sequence of paths, optional
        A recorded radar beside ours: a log of TI's demo, or CARLA's radar, one file or a folder of one a frame.
    recorded_mount : Pose, optional
        Where it was mounted in the ego frame. Default: (2, 0, 1) m.
    pictures : bool
        Maps as pictures; those that the run did not draw take most of the time.
    backend : str
        What casts LiDAR rays.
    step : callable, optional
        Told of each frame.

    Returns
    -------
    Path

    Raises
    ------
    NotFoundError, InputError
        No such run, radar, frame or recording; foxglove-sdk is not installed; a place is taken; the disk refuses.
    """
    require("export to mcap", "foxglove", "mcap", "foxglove-sdk")
    source, target = open_run(run, radars=radars, frames=frames), Path(path)
    lidars = lidar_clouds(source, lidar, backend)
    beside = recorded_clouds(source, recorded, recorded_mount or Pose(DEFAULT_MOUNT_XYZ))
    with ExitStack() as stack:
        staged = stack.enter_context(whole_file(target, overwrite=overwrite))
        staged_layout = stack.enter_context(whole_file(layout_path(target), overwrite=overwrite))
        with staged.open("xb") as file, Recorder(file, epoch_s) as recorder:
            _write(recorder, source, lidars, beside, pictures, step)
            recorder.describe(source)
        staged_layout.write_text(layout_json(source, recorder.topics), encoding="utf-8")
    return target


def _write(
    recorder: Recorder,
    source: RunSource,
    lidars: Sequence[LidarClouds],
    beside: RecordedClouds | None,
    pictures: bool,
    step: Callable[[str], None] | None,
) -> None:
    extra = [(other.frame, other.mount) for other in lidars if other.mount is not None]
    if beside is not None:
        extra.append((beside.frame, beside.mount))
    mounts = mount_transforms(source, extra)
    for moment in timeline(source, step):
        radar, frame = moment.radar, moment.frame
        stamp = recorder.stamp(frame.mid_s)
        moving = moment.bodies(moving=True)
        placed = [moment.ego(), *mounts, *(b.pose for b in moving)]
        recorder.log("/tf", "FrameTransforms", messages.transforms(placed, stamp), stamp)
        if moment.first and moment.knows_world:  # geometry once: bodies that move do so by the transform of their frame
            bodies = drawable([*moment.bodies(moving=False), *moving])
            recorder.log("/scene", "SceneUpdate", messages.scene_update(bodies, stamp), stamp)
        if pictures:
            _write_maps(recorder, source, radar, frame, stamp)
        _write_radar(recorder, radar, frame, stamp)
        if moment.leading:
            _write_others(recorder, source, frame, lidars, beside, stamp)


def _write_others(
    recorder: Recorder,
    source: RunSource,
    frame: RunFrame,
    lidars: Sequence[LidarClouds],
    beside: RecordedClouds | None,
    stamp: int,
) -> None:
    """Log the clouds that are not our radars'."""
    found = [(f"/lidar/{other.name}/points", other.frame, other.points(frame)) for other in lidars]
    if beside is not None:
        position = [f.index for f in source.radars[0].frames].index(frame.index)
        cloud = beside.points(position, source.numbers.get(frame.index))
        found.append((f"/recorded/{beside.name}/points", beside.frame, cloud))
    for topic, sensor, points in found:
        if points is not None:
            recorder.log(topic, "PointCloud", messages.cloud(points, sensor, stamp), stamp)


def _write_maps(recorder: Recorder, source: RunSource, radar: RunRadar, frame: RunFrame, stamp: int) -> None:
    """Log the maps of one frame as pictures."""
    for name, png in map_pictures(source, radar, frame).items():
        message = messages.image(png, radar_frame(radar.name), stamp)
        recorder.log(f"/radar/{radar.name}/{name}", "CompressedImage", message, stamp)


def _write_radar(recorder: Recorder, radar: RunRadar, frame: RunFrame, stamp: int) -> None:
    """Log what one radar detected in one frame, and why."""
    topic, sensor = f"/radar/{radar.name}", radar_frame(radar.name)
    points = detection_points(frame.detections())
    recorder.log(f"{topic}/points", "PointCloud", messages.cloud(points, sensor, stamp), stamp)
    budgets = object_budgets(radar, frame, frame.returns())
    text = budget_text(radar, frame, budgets)
    recorder.log("/link_budget", "Log", messages.log_text(text, radar.name, stamp), stamp)
    objects = {"frame": frame.index, "objects": [b.to_dict() for b in budgets]}
    recorder.log_json(f"{topic}/objects", _OBJECTS, objects, stamp)
    top = frame.record.get("strongest")
    if top is not None:
        named = {"frame": frame.index, "chain": "" if top["object_id"] < 0 else str(top["object_id"]), "ghost": False}
        known = {name: value for name, value in top.items() if name in _STRONGEST["properties"]}
        recorder.log_json(f"{topic}/strongest", _STRONGEST, named | known, stamp)
