"""``shenron-rt lidar``: frames of a semantic LiDAR in, a run folder out."""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from ..errors import InputError
from ..run_setup import refuse_repeated
from ._lidar_input import LidarOptions, pose_of, read_frame, side_files
from .common import (
    Json,
    Output,
    Overrides,
    Overwrite,
    ProfileNames,
    SetOptions,
    check_seed,
    chosen_frames,
    override_profile,
    print_json,
    progress,
    say,
    show_table,
)

if TYPE_CHECKING:
    from ..config.profile import RadarProfile
    from ..lidar.frame import LidarFrame
    from ..pipeline import Frame

__all__ = ["lidar"]

_MOUNT = "2,0,1"
#: Of ``sensor.lidar.ray_cast_semantic``; a frame that ends there was seldom meant to [m].
_DEFAULT_RANGE_M = 10.0


def lidar(
    *files: Path,
    tag_table: str,
    frame: Literal["carla", "ros"],
    origin: Literal["sensor", "ego", "world"] = "sensor",
    sensor_pose: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    mount: Annotated[str, Parameter(allow_leading_hyphen=True)] = _MOUNT,
    side_file: Annotated[list[Path] | None, Parameter(negative=())] = None,
    ego_velocity: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None,
    grid: str | None = None,
    crop_ego: str | None = None,
    crop_old_pipeline: Annotated[bool, Parameter(negative=())] = False,
    merge_sweeps: float | None = None,
    hide_occluded: Annotated[bool, Parameter(negative=())] = False,
    thin: float | None = None,
    normals: bool = True,
    output: Output = None,
    overwrite: Overwrite = False,
    profile: ProfileNames = None,
    set_: SetOptions = None,
    seed: int = 0,
    frames: str | None = None,
    model: str = "physical",
    accuracy: float = 1e-5,
    pictures: Annotated[bool, Parameter(help="Draw the pictures of every frame.")] = True,
    json_: Json = False,
) -> int:
    """Simulate a radar from frames of a semantic LiDAR: scatterers, ADC cube, maps, detections and pictures.

    Parameters
    ----------
    files
        One or more frames: CARLA's PLY, raw .bin, .npy, .npz, LAZ or seven columns; told by content.
    tag_table
        0.9.13 (CARLA 0.9.10 to 0.9.13), 0.9.14 (to 0.9.16), ue5, or a YAML file; auto only suggests.
    frame
        Axes of the file: carla (y right) or ros (y left).
    origin
        What the coordinates are relative to.
    sensor_pose
        LiDAR in the ego frame, x,y,z[,yaw,pitch,roll] in m and deg. Default: from the side file.
    mount
        Radar in the ego frame, x,y,z[,yaw,pitch,roll].
    side_file
        Velocities of actors and poses: one for all frames, one each, or a folder: of a frame roof_7.bin it has
        roof_7.meta.yaml or roof_7.yaml.
    ego_velocity
        Of the ego vehicle over ground, x,y,z in ego axes, y left, m/s.
    grid
        channels,upper_deg,lower_deg,azimuth_step_deg of the LiDAR. Default: estimated from the points.
    crop_ego
        length,width,height of the ego vehicle: points inside are left out.
    crop_old_pipeline
        Leave out what the LiDAR pipeline before this one did: keep x 0.5 to 120, abs(y) < 30, z > -2.2 m.
    merge_sweeps
        Seconds between two files that each hold a part of a turn: every file is joined with the one before it.
    hide_occluded
        Leave out points that nearer ones hide from the radar: a LiDAR on the roof looks over cars, a radar does not.
    thin
        One point a voxel of this edge in m; area is kept.
    normals
        Estimate normals: incidence as the radar sees it, and mirror-like echoes.
    seed
        Seed of the run.
    frames
        Use the files A:B of those given, B not included. Default: all.
    model
        Echo model.
    accuracy
        Of the ADC synthesis, relative to the RMS of the cube.
    """
    from .. import runs

    if not files:
        raise InputError("lidar: give at least one file")
    check_seed(seed)
    sides = side_files(side_file or [], files)
    options = LidarOptions(
        tag_table, frame, origin, sensor_pose, mount, sides, ego_velocity, grid, crop_ego, crop_old_pipeline,
        merge_sweeps, hide_occluded, thin, normals, model, accuracy,
    )  # fmt: skip
    overrides = Overrides(set_)
    overrides.only_profile("lidar")
    chosen = _profiles(profile or ["awrl1432"], overrides.profile)
    wanted = chosen_frames(frames, len(files), f"{len(files)} files are given")
    if merge_sweeps is not None:
        wanted = _with_an_earlier(wanted, merge_sweeps)
    default = partial(runs.default_folder, files[wanted.start].stem, "+".join(p.name for p in chosen))
    started = clock.perf_counter()
    with runs.write_run(output or default(), overwrite=overwrite, another=None if output else default) as place:
        summary = _render(files, wanted, chosen, options, seed, place.partial, pictures=pictures, quiet=json_)
        runs.write_json(place.partial / "summary.json", summary)
        _write_config(place.partial / "config.yaml", files, options, seed, chosen)
    if json_:
        print_json(summary)
    else:
        _show(summary["lidar"][-1])
        from .report import show_run

        show_run(summary)
        say(f"{place.folder}: written in {clock.perf_counter() - started:.1f} s")
    return 0


def _with_an_earlier(wanted: range, seconds: float) -> range:
    """Return the frames that have a sweep before them."""
    if not 0 < seconds <= 1:
        raise InputError(f"--merge-sweeps {seconds:g}: the time between two files in seconds, up to 1, is needed")
    kept = range(max(wanted.start, 1), wanted.stop)
    if not kept:
        raise InputError("--merge-sweeps: every file is joined with the one before it; give at least two")
    return kept


def _profiles(names: Sequence[str], overrides: Mapping[str, str]) -> list[RadarProfile]:
    from ..config.profile import load_profile

    loaded = [override_profile(load_profile(n), overrides) for n in names]
    refuse_repeated(loaded)
    return loaded


def _render(
    files: Sequence[Path],
    wanted: range,
    chosen: Sequence[RadarProfile],
    options: LidarOptions,
    seed: int,
    root: Path,
    *,
    pictures: bool,
    quiet: bool,
) -> dict[str, Any]:
    """Write every frame of every radar and return the summary."""
    from .. import runs
    from ..lidar.door import door_counts
    from ..pipeline import simulate

    mount = pose_of("mount", options.mount)
    records: dict[str, list[dict[str, Any]]] = {p.name: [] for p in chosen}
    points = []
    with progress(len(wanted) * len(chosen), "simulating", quiet=quiet) as step:
        for index in wanted:
            read = read_frame(files, index, options)
            points.append({"frame": index} | read.summary())
            for used in chosen:
                step(f"{used.name} frame {index}")
                done = simulate(
                    read, used, mount=mount, seed=seed, frame=index, model=options.model, accuracy=options.accuracy
                )
                folder = runs.frame_folder(root, used.name, index)
                runs.write_frame(folder, done)
                if pictures:
                    _draw(folder, files[index], read, done)
                names = {
                    int(i): read.names.get(int(i), f"object {i}") for i in sorted(set(read.object_id.tolist()) - {0})
                }
                records[used.name].append(runs.frame_summary(done, names))
                points[-1]["door"] = door_counts(read, done.scatterers)
                step(advance=1)
    from . import _version

    return {
        "version": _version(),
        "source": [str(files[i]) for i in wanted],
        "backend": None,
        "seed": seed,
        "lidar": points,
        "radars": [{"name": p.name, "profile": p.name, "frames": records[p.name]} for p in chosen],
    }


def _draw(folder: Path, file: Path, read: LidarFrame, done: Frame) -> None:
    from ..plot import write_pictures

    title = f"{file.name}, {done.profile.name}, frame {done.frame}"
    write_pictures(folder, done, names=dict(read.names), title=title)


def _write_config(
    path: Path, files: Sequence[Path], options: LidarOptions, seed: int, chosen: Sequence[RadarProfile]
) -> None:
    import dataclasses

    import yaml

    source = {"files": [str(f.resolve()) for f in files]} | dataclasses.asdict(options) | {"seed": seed}
    source["side_file"] = [str(Path(p).resolve()) for p in options.side_file]
    data = {"lidar": source, "profiles": [p.model_dump(mode="json", exclude_none=True) for p in chosen]}
    text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=120)
    path.write_text(f"# Written by shenron-rt lidar.\n{text}", encoding="utf-8")


def _show(item: Mapping[str, Any]) -> None:
    """Print what the last frame's points are."""
    count, door = item["points"], item["door"]
    tags = [[name, n, f"{100 * n / max(count, 1):.1f}"] for name, n in item["tags"].items()]
    left_out = f" of {item['points_read']} read" if item["points_read"] != count else ""
    show_table(f"{Path(item['path']).name}: {count} points{left_out}", ("tag", "points [-]", "share [%]"), tags)
    actors = [[i, item["names"].get(i), n] for i, n in item["points_per_actor"].items()]
    if actors:
        show_table("Points of actors", ("id", "name", "points [-]"), actors)
    say(
        f"layout: {item['layout']}; tags numbered as in {item['tag_table']}; "
        f"untagged {100 * item['untagged_share']:.1f} %"
    )
    say(f"grid: {item['grid']}")
    short = (
        f"; {_DEFAULT_RANGE_M:g} m is CARLA's default range, is it meant?"
        if item["reach_m"] <= _DEFAULT_RANGE_M
        else ""
    )
    part = "; a part of a sweep, --merge-sweeps joins two" if item["azimuth_covered_deg"] < 330 else ""
    say(f"reach: {item['reach_m']:.1f} m over {item['azimuth_covered_deg']:.0f} of 360 deg{part}{short}")
    say(
        f"incidence: {door['cosine_from_normal']} points from estimated normals as the radar sees them "
        f"({door['facing_away_from_the_radar']} face away), {door['cosine_recorded']} as the LiDAR recorded it; "
        f"{item['cosines_clipped']} cosines clipped"
    )
    say(f"velocity: {item['velocity']}")
    for note in item["notes"]:
        say(f"note: {note}")
