"""``shenron-rt run``: a mesh scene in, a run folder out."""

from __future__ import annotations

import time as clock
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from ..errors import InputError
from ..run_setup import RunOptions, config_text, merge_options, profile_label, summary_of, with_profiles
from .common import (
    Json,
    Output,
    Overrides,
    Overwrite,
    ProfileNames,
    SetOptions,
    check_seed,
    frame_range,
    print_json,
    progress,
    say,
)

if TYPE_CHECKING:
    from ..config.profile import RadarProfile
    from ..config.scene import RadarMount, Scene
    from ..pipeline import Frame

__all__ = ["run"]

BackendName = Literal["auto", "cuda", "llvm", "scalar"]


def run(
    scene: str = "braking",
    /,
    *,
    output: Output = None,
    overwrite: Overwrite = False,
    profile: ProfileNames = None,
    set_: SetOptions = None,
    seed: int | None = None,
    frames: str | None = None,
    rays: int | None = None,
    max_bounces: int | None = None,
    backend: BackendName | None = None,
    accuracy: float | None = None,
    model: str | None = None,
    pictures: Annotated[bool, Parameter(help="Draw the pictures of every frame.")] = True,
    write: str | None = None,
    retrace: int | None = None,
    json_: Json = False,
) -> int:
    """Render a scene: scatterers, ADC cube, maps, detections and pictures of every radar.

    Parameters
    ----------
    scene
        Name of a bundled scene, or a YAML file; also the config.yaml of an earlier run.
    seed
        Seed of the run. Default: the scene's.
    frames
        Frames A:B, B not included. Default: 0:1.
    rays
        Rays of each radar and frame; of radars at one place those of all together. Default: 300000.
    max_bounces
        Surfaces along a path, 1 to 5. Default: the scene's, 1 unless it says otherwise.
    backend
        Ray tracing backend. Default: auto (cuda, then llvm, then scalar).
    accuracy
        Of the ADC synthesis, relative to the RMS of the cube. Default: 1e-5.
    model
        Echo model: physical, shenron, shenron:as_released, with switches as in shenron:corrected-r4. Default: physical.
    write
        What to keep of every frame, with commas: scatterers, returns, adc, cube, maps (a part of cube), detections.
        Default: all of it.
    retrace
        Trace so many instants of every frame, for what turns fast. Default: 1, mid-frame.
    """
    from .. import runs
    from ..config.scene import load_scene
    from ..run_frames import parts_of

    overrides = Overrides(set_)
    loaded = load_scene(scene, overrides.scene)
    given = {
        "frames": frames, "rays": rays, "max_bounces": max_bounces, "backend": backend, "accuracy": accuracy,
        "model": model, "retrace": retrace,
    }  # fmt: skip
    options = merge_options({"max_bounces": loaded.max_bounces, **loaded.run}, given)
    keep = parts_of(write)
    loaded = with_profiles(loaded, profile or [], overrides.profile)
    loaded = loaded.model_copy(
        update={"seed": loaded.seed if seed is None else check_seed(seed), "run": options.record()}
    )
    if not loaded.radars:
        raise InputError(f"{scene}: the scene has no radars; give it at least one under radars:")
    default = partial(runs.default_folder, loaded.name, profile_label(loaded))
    started = clock.perf_counter()
    with runs.write_run(output or default(), overwrite=overwrite, another=None if output else default) as place:
        summary = _render(loaded, options, place.partial, keep=keep, pictures=pictures, quiet=json_)
        runs.write_json(place.partial / "summary.json", summary)
        (place.partial / "config.yaml").write_text(config_text(loaded), encoding="utf-8")
    if json_:
        print_json(summary)
    else:
        from .report import show_run

        show_run(summary)
        say(f"{place.folder}: written in {clock.perf_counter() - started:.1f} s, {summary['backend']} backend")
    return 0


def _render(
    scene: Scene, options: RunOptions, root: Path, *, keep: tuple[str, ...], pictures: bool, quiet: bool
) -> dict[str, Any]:
    """Write every frame of every radar and return the summary."""
    from .. import runs
    from ..rendering import rendered

    wanted = frame_range(options.frames)
    names = scene.object_names()
    radars: dict[str, dict[str, Any]] = {
        r.name: {"name": r.name, "profile": scene.profile_of(r).name, "frames": []} for r in scene.radars
    }
    backend = ""
    with progress(len(wanted) * len(scene.radars), "rendering", quiet=quiet) as step:
        step(f"frame {wanted.start}")
        for mount, frame in rendered(scene, options, wanted):
            folder = runs.frame_folder(root, mount.name, frame.frame)
            runs.write_frame(folder, frame, keep)
            if pictures:
                _draw(folder, scene, mount, scene.profile_of(mount), frame, first=frame.frame == wanted.start)
            radars[mount.name]["frames"].append(runs.frame_summary(frame, names))
            backend = frame.backend
            step(f"{mount.name} frame {frame.frame}", advance=1)
    return summary_of(scene.name, scene.seed, options, backend, list(radars.values()))


def _draw(folder: Path, scene: Scene, mount: RadarMount, used: RadarProfile, frame: Frame, *, first: bool) -> None:
    from ..plot import antenna_cuts, write_pictures
    from ..plot._style import save
    from ..scene.world import build_world
    from ..tracing.trace import bodies_of

    bodies, table = bodies_of(scene)
    world = build_world(scene, mount, frame.time + used.frame_mid_s, bodies, table)
    title = f"{scene.name}, {mount.name} ({used.name}), frame {frame.frame}"
    write_pictures(folder, frame, names=scene.object_names(), mesh=(world.vertices, world.faces), title=title)
    if first:
        save(antenna_cuts(used), folder / "antenna.png")
