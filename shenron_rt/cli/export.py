"""``shenron-rt export``: a run folder in the formats of other tools."""

from __future__ import annotations

import time as clock
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from ..errors import InputError
from .common import Json, Overwrite, frame_range, print_json, progress, say

if TYPE_CHECKING:
    from ..run_source import RunSource

__all__ = ["export"]

Format = Literal["mcap", "ros2", "pcd", "ply", "csv", "zarr"]

#: What the default name of an export ends in.
_ENDINGS = {"mcap": ".mcap", "ros2": "-ros2", "pcd": "-pcd", "ply": "-ply", "csv": "-csv", "zarr": ".zarr"}
#: Options that only some formats have.
_ONLY = {
    "lidar": ("mcap", "ros2"), "epoch": ("mcap", "ros2"), "backend": ("mcap", "ros2"), "recorded": ("mcap",),
    "recorded-mount": ("mcap",), "no-pictures": ("mcap",), "text": ("pcd", "ply"),
}  # fmt: skip


def export(
    run: Path,
    /,
    *,
    to: Format,
    output: Annotated[
        Path | None, Parameter(name=["-o", "--output"], help="File or folder. Default: beside the run, RUN.mcap ...")
    ] = None,
    overwrite: Overwrite = False,
    radar: Annotated[list[str] | None, Parameter(negative=())] = None,
    frames: str | None = None,
    lidar: bool | None = None,
    recorded: Annotated[list[Path] | None, Parameter(negative=())] = None,
    recorded_mount: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    epoch: int | None = None,
    pictures: bool = True,
    text: Annotated[bool, Parameter(negative=())] = False,
    backend: Literal["auto", "cuda", "llvm", "scalar"] | None = None,
    json_: Json = False,
) -> int:
    """Export a run: MCAP for Foxglove, a ROS 2 bag, PCD, PLY or CSV clouds, a Zarr store for training.

    Parameters
    ----------
    run
        A run folder.
    to
        mcap, ros2, pcd, ply, csv or zarr.
    radar
        Radar of the run; may be repeated. Default: all.
    frames
        Frames A:B of the run, B not included. Default: all.
    lidar
        mcap, ros2: LiDAR points; --lidar casts a roof LiDAR where the scene has none. Default: where there are some.
    recorded
        mcap: a recorded radar beside ours: a log of TI's demo, or CARLA's radar (.npy), a folder or one file a frame.
    recorded_mount
        mcap: its pose in the ego frame, x,y,z[,yaw,pitch,roll]. Default: 2,0,1.
    epoch
        mcap, ros2: seconds since 1970 that scene second 0 is stamped with. Default: 1000000000.
    pictures
        mcap: maps as pictures; drawing those that the run did not draw takes most of the time.
    text
        pcd, ply: text rather than binary records.
    backend
        mcap, ros2: what casts LiDAR rays. Default: auto.
    """
    from ..export import layout_path, open_run

    given: dict[str, Any] = {
        "lidar": lidar, "epoch": epoch, "backend": backend, "recorded": recorded, "recorded-mount": recorded_mount,
        "no-pictures": None if pictures else True, "text": text or None,
    }  # fmt: skip
    options = _options(to, {name: value for name, value in given.items() if value is not None})
    numbers = None if frames is None else frame_range(frames)
    source = open_run(run, radars=radar, frames=numbers)
    root = run.absolute()
    target = output or root.with_name(f"{root.name}{_ENDINGS[to]}")
    started = clock.perf_counter()
    with progress(source.n_frames, f"export to {to}", quiet=json_) as step:
        _write(to, source, target, {"overwrite": overwrite, **options, "step": lambda what: step(what, advance=1)})
    if json_:
        print_json({"to": to, "path": target, "frames": source.n_frames, "radars": [r.name for r in source.radars]})
        return 0
    say(f"{target}: {source.n_frames} frames in {clock.perf_counter() - started:.1f} s")
    if to == "mcap":
        say(f"{layout_path(target)}: import it in Foxglove, Layouts > Import from file")
    return 0


def _options(to: str, given: dict[str, Any]) -> dict[str, Any]:
    """Return the options as the export functions take them, or refuse those that the format has not."""
    from ._lidar_input import pose_of

    for name in given:
        if to not in _ONLY[name]:
            raise InputError(f"--{name}: --to {to} has no such option; it is for {' and '.join(_ONLY[name])}")
    names = {"epoch": "epoch_s", "recorded-mount": "recorded_mount", "text": "binary"}
    values = {names.get(name, name): value for name, value in given.items()}
    if "recorded-mount" in given:
        values["recorded_mount"] = pose_of("recorded-mount", given["recorded-mount"])
        if "recorded" not in given:
            raise InputError("--recorded-mount: give the recording too, --recorded FILE")
    if "text" in given:
        values["binary"] = False
    if values.pop("no-pictures", False):
        values["pictures"] = False
    return values


def _write(to: Format, source: RunSource, target: Path, options: dict[str, Any]) -> None:
    from .. import export as formats

    if to == "mcap":
        formats.export_mcap(source, target, **options)
    elif to == "ros2":
        formats.export_ros2(source, target, **options)
    elif to == "zarr":
        formats.export_zarr(source, target, **options)
    else:
        formats.export_clouds(source, target, to, **options)
