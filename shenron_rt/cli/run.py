"""``shenron-rt run``: a mesh scene in, a run folder out."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from ..errors import InputError
from .common import (
    Json,
    Output,
    Overrides,
    Overwrite,
    ProfileNames,
    SetOptions,
    frame_range,
    override_profile,
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
        Rays of each radar and frame. Default: 300000.
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
    options = _options({"max_bounces": loaded.max_bounces, **loaded.run}, given)
    keep = parts_of(write)
    loaded = _with_profiles(loaded, profile or [], overrides.profile)
    loaded = loaded.model_copy(update={"seed": loaded.seed if seed is None else _seed(seed), "run": options.record()})
    if not loaded.radars:
        raise InputError(f"{scene}: the scene has no radars; give it at least one under radars:")
    default = partial(runs.default_folder, loaded.name, _profile_label(loaded))
    started = clock.perf_counter()
    with runs.write_run(output or default(), overwrite=overwrite, another=None if output else default) as place:
        summary = _render(loaded, options, place.partial, keep=keep, pictures=pictures, quiet=json_)
        runs.write_json(place.partial / "summary.json", summary)
        _write_config(place.partial / "config.yaml", loaded)
    if json_:
        print_json(summary)
    else:
        from .report import show_run

        show_run(summary)
        say(f"{place.folder}: written in {clock.perf_counter() - started:.1f} s, {summary['backend']} backend")
    return 0


@dataclass(frozen=True)
class _Options:
    frames: str = "0:1"
    rays: int = 300_000
    max_bounces: int = 1
    backend: str = "auto"
    accuracy: float = 1e-5
    model: str = "physical"
    retrace: int = 1

    def record(self) -> dict[str, Any]:
        """Return what the config keeps; ``retrace`` only where it is asked for, as older versions do not know it."""
        return {k: v for k, v in asdict(self).items() if k != "retrace" or v != 1}


def _options(earlier: Mapping[str, Any], given: Mapping[str, Any]) -> _Options:
    """Merge the options of an earlier run's config with those given now."""
    known = asdict(_Options())
    unknown = sorted(set(earlier) - set(known))
    if unknown:
        raise InputError(f"run: unknown option {unknown[0]!r} in the config; known: {', '.join(known)}")
    merged = (
        known | {k: type(known[k])(v) for k, v in earlier.items()} | {k: v for k, v in given.items() if v is not None}
    )
    if merged["rays"] < 1:
        raise InputError(f"--rays {merged['rays']}: at least 1 is needed")
    frame_range(merged["frames"])
    return _Options(**merged)


def _seed(seed: int) -> int:
    if seed < 0:
        raise InputError(f"--seed {seed}: a whole number from 0 up is needed")
    return seed


def _with_profiles(scene: Scene, names: list[str], overrides: Mapping[str, str]) -> Scene:
    """Put profiles into the radars: one replaces them all, several make a copy of each radar for each."""
    from ..config.profile import load_profile

    if not names:
        mounts = [(r.name, r, scene.profile_of(r)) for r in scene.radars]
    else:
        loaded = [load_profile(n) for n in names]
        repeated = sorted({p.name for p in loaded if [q.name for q in loaded].count(p.name) > 1})
        if repeated:
            raise InputError(f"--profile {repeated[0]}: given twice")
        mounts = [(r.name if len(loaded) == 1 else f"{r.name}_{p.name}", r, p) for r in scene.radars for p in loaded]
    radars = [
        mount.model_copy(update={"name": name, "profile": override_profile(used, overrides)})
        for name, mount, used in mounts
    ]
    return scene.model_copy(update={"radars": tuple(radars)})


def _profile_label(scene: Scene) -> str:
    return "+".join(dict.fromkeys(scene.profile_of(r).name for r in scene.radars))


def _render(
    scene: Scene, options: _Options, root: Path, *, keep: tuple[str, ...], pictures: bool, quiet: bool
) -> dict[str, Any]:
    """Write every frame of every radar and return the summary."""
    from .. import runs
    from ..scene.motion_of import check_times
    from ..sequence import simulate_sequence

    wanted = frame_range(options.frames)
    check_times(scene, (k * scene.frame_period_s + dt for k in wanted for dt in _mid_frames(scene)))
    names = scene.object_names()
    radars, backends = [], []
    with progress(len(wanted) * len(scene.radars), "rendering", quiet=quiet) as step:
        for mount in scene.radars:
            used = scene.profile_of(mount)
            records = []
            step(f"{mount.name} frame {wanted.start}")
            sequence = simulate_sequence(
                scene,
                used,
                frames=wanted,
                radar=mount.name,
                seed=scene.seed,
                rays=options.rays,
                max_bounces=options.max_bounces,
                backend=options.backend,
                accuracy=options.accuracy,
                model=options.model,
                retrace=options.retrace,
            )
            for frame in sequence:
                folder = runs.frame_folder(root, mount.name, frame.frame)
                runs.write_frame(folder, frame, keep)
                if pictures:
                    _draw(folder, scene, mount, used, frame, first=frame.frame == wanted.start)
                records.append(runs.frame_summary(frame, names))
                backends.append(frame.backend)
                step(f"{mount.name} frame {frame.frame + 1}", advance=1)
            radars.append({"name": mount.name, "profile": used.name, "frames": records})
    return {
        "version": _version(),
        "scene": scene.name,
        "backend": backends[0],
        "seed": scene.seed,
        "rays": options.rays,
        "max_bounces": options.max_bounces,
        "model": options.model,
        "radars": radars,
    }


def _mid_frames(scene: Scene) -> list[float]:
    """Return when each radar's frame has its middle, after its start [s]."""
    return [scene.profile_of(r).frame_mid_s for r in scene.radars]


def _version() -> str:
    from . import _version as version

    return version()


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


def _write_config(path: Path, scene: Scene) -> None:
    """Write the scene with its profiles inside and its files by absolute path, so that it runs from anywhere."""
    import yaml

    data: dict[str, Any] = scene.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    always = scene.model_dump(mode="json", include={"version", "name", "seed", "frame_period_s", "weather"})
    data = always | data
    data["radars"] = [
        r.model_dump(mode="json", exclude_none=True)
        | {"profile": scene.profile_of(r).model_dump(mode="json", exclude_none=True)}
        for r in scene.radars
    ]
    if scene.interferers:
        data["interferers"] = [
            i.model_dump(mode="json", exclude_none=True)
            | {"profile": scene.profile_of(i).model_dump(mode="json", exclude_none=True)}
            for i in scene.interferers
        ]
    located = _locator(scene.folder)
    for part in (data.get("ego", {}), *data.get("static", ()), *data.get("actors", ())):
        for key in ("mesh", "resolve", "carla_tags", "trajectory_file"):
            if key in part:
                part[key] = located(part[key])
    data["materials"] = located(str(scene.materials))
    text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=120)
    path.write_text(f"# Written by shenron-rt run; shenron-rt run {path.name} does it again.\n{text}", encoding="utf-8")


def _locator(folder: Path) -> Callable[[str], str]:
    def located(text: str) -> str:
        file = folder / text
        return str(file.resolve()) if file.is_file() or any(file.glob("*.meta.yaml")) else text

    return located
