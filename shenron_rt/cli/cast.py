"""``shenron-rt cast-lidar``: the semantic LiDAR twin of a mesh scene, in CARLA's own files."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from ..errors import InputError
from .common import Json, Overrides, Overwrite, SetOptions, frame_range, print_json, progress, say, show_table

if TYPE_CHECKING:
    from ..config.scene import LidarMount, Scene

__all__ = ["cast_lidar"]

#: The LiDAR of a scene that has none.
_ROOF: dict[str, Any] = {
    "name": "roof",
    "xyz_m": (0.0, 0.0, 2.5),
    "channels": 64,
    "range_m": 100.0,
    "points_per_second": 600_000,
}


def cast_lidar(
    scene: str = "braking",
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["-o", "--output"], help="Folder of the frames.")] = None,
    overwrite: Overwrite = False,
    lidar: Annotated[str | None, Parameter(help="Which of the scene's lidars.")] = None,
    layout: Annotated[list[Literal["ply", "bin", "npy"]] | None, Parameter(negative=())] = None,
    side_file: Annotated[Literal["own", "carla"], Parameter(help="Layout of the side files.")] = "own",
    frames: str = "0:1",
    tick_s: float | None = None,
    dropoff: float = 0.0,
    noise_stddev_m: float = 0.0,
    seed: int | None = None,
    backend: Literal["auto", "cuda", "llvm", "scalar"] = "auto",
    set_: SetOptions = None,
    json_: Json = False,
) -> int:
    """Cast a semantic LiDAR over a scene and write its frames as CARLA's client would.

    Parameters
    ----------
    scene
        Name of a bundled scene, or a YAML file. Without lidars: 64 channels on the roof, 0,0,2.5, 100 m.
    layout
        ply as save_to_disk (default), bin as raw_data, npy of the same records; may be repeated.
    frames
        Frames A:B, B not included.
    tick_s
        Simulation step: frames are that far apart and hold the part of the sweep a step covers. Default: whole
        revolutions, at the scene's frame period.
    dropoff
        Share of points lost at random.
    noise_stddev_m
        Of the range.
    seed
        Of dropoff and noise. Default: the scene's.
    """
    from .. import runs
    from ..config.scene import LidarMount, load_scene
    from ..tracing.lidar import lidar_of

    overrides = Overrides(set_)
    if overrides.profile:
        raise InputError(f"--set {next(iter(overrides.profile))}: cast-lidar has no radar; allowed: scene.")
    loaded = load_scene(scene, overrides.scene)
    mount = LidarMount(**_ROOF) if lidar is None and not loaded.lidars else lidar_of(loaded, lidar)
    options = {"seed": seed, "tick_s": tick_s, "dropoff": dropoff, "noise_stddev_m": noise_stddev_m, "backend": backend}
    default = partial(runs.default_folder, loaded.name, mount.name)
    target = output or default()
    with runs.write_run(target, overwrite=overwrite, another=None if output else default) as place:
        records = _write(
            loaded, mount, frame_range(frames), place.partial, layout or ["ply"], side_file, options, json_
        )
        summary = {"scene": loaded.name, "lidar": mount.model_dump(mode="json"), "tick_s": tick_s, "frames": records}
        runs.write_json(place.partial / "summary.json", summary)
    if json_:
        print_json(summary)
        return 0
    columns = ("file", "time [s]", "points [-]", "objects [-]", "commonest tags")
    rows = [(r["files"][0], f"{r['time_s']:g}", r["points"], r["objects"], r["commonest"]) for r in records]
    show_table(f"{loaded.name}, lidar {mount.name}", columns, rows)
    say(f"{place.folder}: {len(records)} frames; shenron-rt lidar reads them with --tag-table 0.9.14 --frame carla")
    return 0


def _write(
    scene: Scene,
    mount: LidarMount,
    wanted: range,
    folder: Path,
    layouts: list[Literal["ply", "bin", "npy"]],
    side_layout: Literal["own", "carla"],
    options: dict[str, Any],
    quiet: bool,
) -> list[dict[str, Any]]:
    from ..lidar.side_writer import scene_side_file, write_side_file
    from ..lidar.writers import write_semantic_lidar
    from ..tracing.lidar import cast_lidar

    period = options["tick_s"] or scene.frame_period_s
    records = []
    with progress(len(wanted), "casting", quiet=quiet) as step:
        for index in wanted:
            frame = cast_lidar(scene, mount, time=index * period, frame=index, **options)
            stem = f"frame_{index:06d}"
            files = [f"{stem}.{layout}" for layout in dict.fromkeys(layouts)]
            for name in files:
                write_semantic_lidar(folder / name, frame)
            write_side_file(folder / f"{stem}.yaml", scene_side_file(scene, mount, index * period), layout=side_layout)
            counted = frame.summary()
            commonest = ", ".join(f"{tag} {n}" for tag, n in list(counted["tags"].items())[:4])
            records.append(
                {
                    "frame": index, "time_s": index * period, "files": files, "side_file": f"{stem}.yaml",
                    "points": len(frame), "objects": len(counted["points_per_actor"]), "commonest": commonest,
                    "tags": counted["tags"], "points_per_object": counted["points_per_actor"],
                }
            )  # fmt: skip
            step(advance=1)
    return records
