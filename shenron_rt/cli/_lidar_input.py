"""What ``shenron-rt lidar`` reads: options, side files, sweeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ..errors import InputError
from ..frames import Pose

if TYPE_CHECKING:
    from ..lidar.frame import LidarFrame

__all__ = ["LidarOptions", "numbers_of", "pose_of", "read_frame", "side_files"]


@dataclass(frozen=True)
class LidarOptions:
    """What the caller says of the files, as it is written into config.yaml."""

    tag_table: str
    frame: Literal["carla", "ros"]
    origin: Literal["sensor", "ego", "world"]
    sensor_pose: str | None
    mount: str
    side_file: list[str]
    ego_velocity: str | None
    grid: str | None
    crop_ego: str | None
    crop_old_pipeline: bool
    merge_sweeps: float | None
    hide_occluded: bool
    thin: float | None
    normals: bool
    model: str
    accuracy: float


def read_frame(files: Sequence[Path], index: int, options: LidarOptions) -> LidarFrame:
    """Return frame ``index`` of the files as the radar's scatterers are made of it."""
    o = options
    frame = _read(files[index], _side(o, index), o)
    if o.merge_sweeps is not None:
        frame = _merged(frame, files, index, o)
    if o.hide_occluded:
        frame = frame.hide_occluded(pose_of("mount", o.mount))
    if o.thin is not None:
        frame = frame.thin(o.thin)
    return frame if o.normals else frame.without_normals()


def _side(options: LidarOptions, index: int) -> str | None:
    if not options.side_file:
        return None
    return options.side_file[index if len(options.side_file) > 1 else 0]


def _merged(frame: LidarFrame, files: Sequence[Path], index: int, options: LidarOptions) -> LidarFrame:
    """Return the frame with the sweep of the file before it."""
    from ..lidar.side_file import read_side_file
    from ..lidar.sweeps import merge_sweeps, sweep_motion

    elapsed = options.merge_sweeps or 0.0
    sides = [_side(options, k) for k in (index, index - 1)]
    world = [None if side is None else read_side_file(side).sensor_world for side in sides]
    if sides[0] == sides[1]:
        world = [None, None]  # one side file for all frames has the pose of one tick
    motion = sweep_motion(frame, elapsed, world[0], world[1])
    return merge_sweeps(frame, _read(files[index - 1], sides[1], options), motion, elapsed_s=elapsed)


def _read(file: Path, side: str | None, options: LidarOptions) -> LidarFrame:
    """Read one file, with the crops and normals asked for."""
    from ..lidar.read import read_semantic_lidar

    o = options
    frame = read_semantic_lidar(
        file,
        tag_table=o.tag_table,
        frame=o.frame,
        origin=o.origin,
        sensor_pose=None if o.sensor_pose is None else pose_of("sensor-pose", o.sensor_pose),
        side_file=side,
        ego_velocity=None if o.ego_velocity is None else numbers_of("ego-velocity", o.ego_velocity, (3,)),
        grid=None if o.grid is None else numbers_of("grid", o.grid, (4,)),
    )
    if o.crop_ego is not None:
        frame = frame.crop_ego(*numbers_of("crop-ego", o.crop_ego, (3,)))
    if o.crop_old_pipeline:
        frame = frame.crop_old_pipeline()
    if o.normals and frame.normal is None and o.model == "physical":
        frame = frame.with_normals()  # before thinning: neighbours on the sensor's grid are what a plane is fitted to
    return frame


def side_files(given: Sequence[Path], files: Sequence[Path]) -> list[str]:
    """Return the side files: none, one for all, or one each."""
    if len(given) == 1 and given[0].is_dir():
        return [_side_of(file, given[0]) for file in files]
    if len(given) not in (0, 1, len(files)):
        raise InputError(
            f"--side-file: one for all frames or one each, or their folder; {len(given)} are given for {len(files)}"
        )
    return [str(path) for path in given]


def _side_of(file: Path, folder: Path) -> str:
    names = [f"{file.stem}.meta.yaml", f"{file.stem}.yaml"]
    for name in names:
        if (folder / name).is_file():
            return str(folder / name)
    raise InputError(f"--side-file {folder}: no {' or '.join(names)} for {file}")


def numbers_of(option: str, text: str, counts: tuple[int, ...]) -> list[float]:
    """Return the numbers of ``a,b,c``."""
    try:
        values = [float(word) for word in text.split(",")]
    except ValueError:
        values = []
    if len(values) not in counts:
        needed = " or ".join(str(c) for c in counts)
        raise InputError(f"--{option} {text}: {needed} numbers separated by commas are needed")
    return values


def pose_of(option: str, text: str) -> Pose:
    values = [*numbers_of(option, text, (3, 6)), 0.0, 0.0, 0.0]
    return Pose((values[0], values[1], values[2]), (values[3], values[4], values[5]))
