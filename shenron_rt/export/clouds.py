"""PCD, PLY and CSV files of detections: one a frame, and an index of when and from where."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any, Literal

from ..errors import InputError
from ..run_source import RunFrame, RunSource, open_run
from ..runs import Run, write_json
from .pcd import write_pcd
from .ply import write_ply
from .points import detection_points
from .poses import mount_transforms, radar_frame
from .target import whole_folder
from .timeline import Moment, timeline

__all__ = ["INDEX", "CloudFormat", "export_clouds"]

CloudFormat = Literal["pcd", "ply", "csv"]
#: Lists the files of the folder; an export without it is none of ours.
INDEX = "export.json"


def export_clouds(
    run: RunSource | Run | str | os.PathLike[str],
    path: str | os.PathLike[str],
    form: CloudFormat,
    *,
    radars: Sequence[str] | None = None,
    frames: Collection[int] | None = None,
    overwrite: bool = False,
    binary: bool = True,
    step: Callable[[str], None] | None = None,
) -> Path:
    """Write the detections of every frame as ``<radar>/frame_000000.<form>``, radar frame, and ``export.json``.

    Parameters
    ----------
    run : RunSource, Run or path
        A run folder, or one that :func:`~shenron_rt.export.open_run` has opened.
    path : path
        The folder to make.
    form : ``"pcd"``, ``"ply"`` or ``"csv"``
        CSV is the run's ``detections.csv``, all columns; the others have x, y, z, velocity, snr_db, rcs_dbsm,
        object_id, tag, ghost.
    radars, frames : optional
        Which of the run's. Default: all.
    overwrite : bool
        Replace an export that is there.
    binary : bool
        Records rather than text, PCD and PLY.
    step : callable, optional
        Told of each frame.

    Returns
    -------
    Path

    Raises
    ------
    NotFoundError, InputError
        No such run, radar or frame; the place is taken; the disk refuses.
    """
    if form not in ("pcd", "ply", "csv"):
        raise InputError(f"export to {form!r}: one of pcd, ply, csv is needed")
    source, target = open_run(run, radars=radars, frames=frames), Path(path)
    with whole_folder(target, overwrite=overwrite, marker=INDEX) as folder:
        records = []
        for moment in timeline(source, step):
            radar, frame = moment.radar, moment.frame
            name = f"{radar.name}/frame_{frame.index:06d}.{form}"
            (folder / radar.name).mkdir(parents=True, exist_ok=True)
            count = _write(folder / name, frame, form, binary, radar_frame(radar.name))
            records.append({"file": name, "radar": radar.name, "frame": frame.index, "points": count})
            records[-1] |= {"time_s": frame.mid_s, "sensor_in_world": _pose(source, moment)}
        write_json(folder / INDEX, {"format": form, "run": source.name, "version": source.version, "frames": records})
    return target


def _write(file: Path, frame: RunFrame, form: CloudFormat, binary: bool, sensor: str) -> int:
    found = frame.detections()
    if form == "csv":
        shutil.copyfile(frame.folder / "detections.csv", file)
        if frame.has("detections.chains.csv"):
            shutil.copyfile(frame.folder / "detections.chains.csv", file.with_name(f"{file.stem}.chains.csv"))
    elif form == "pcd":
        write_pcd(file, detection_points(found), binary=binary)
    else:
        notes = (f"frame {sensor}: x forward, y left, z up, metres", f"time_s {frame.mid_s!r}")
        write_ply(file, detection_points(found), binary=binary, comments=notes)
    return len(found)


def _pose(source: RunSource, moment: Moment) -> dict[str, Any] | None:
    """Return where the radar stands in the world; None for runs without a scene."""
    if not moment.knows_world:
        return None
    mount = next(t for t in mount_transforms(source) if t.child == radar_frame(moment.radar.name))
    placed = moment.ego().then(mount)
    return {"xyz_m": placed.origin, "quaternion_xyzw": placed.quaternion}
