"""A plan's runs, each with a name and the configuration that makes it, and the pieces of work they are cut into."""

from __future__ import annotations

import hashlib
import itertools
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..config.plan import BatchPlan
from ..config.scene import Scene, load_scene
from ..errors import InputError
from ..run_setup import config_text, frame_range, merge_options, profile_label, split_overrides, with_profiles

__all__ = ["PlannedRun", "Unit", "expand", "input_files", "units_of"]

#: Longest name of a run's folder before it is cut.
_LONGEST = 100


@dataclass(frozen=True)
class PlannedRun:
    """One run of a batch.

    Parameters
    ----------
    name : str
        Of its folder, unique in the batch.
    scene : str
    profiles : tuple of str
        In use, in the order of the radars.
    seed : int
    frames : range
    values : mapping
        What ``set`` gives for this run.
    config : str
        The text of its ``config.yaml``: all that its frames depend on but the files it names.
    files : tuple of Path
        Those.
    chained : bool
        Whether frames depend on the frame before them, so that they are one piece of work.
    """

    name: str
    scene: str
    profiles: tuple[str, ...]
    seed: int
    frames: range
    values: Mapping[str, Any]
    config: str
    files: tuple[Path, ...]
    chained: bool


@dataclass(frozen=True)
class Unit:
    """A piece of work: a block of frames of one run. Holds names alone, so that it travels to any process.

    Parameters
    ----------
    root : str
        Absolute path of the batch folder.
    run : str
        Name of the run.
    first, stop : int
        Frames, ``stop`` not included.
    write : str or None
        What to keep of every frame, as ``--write`` of ``shenron-rt run``.
    threads : int
        Most threads the work may use; 0 is no limit.
    """

    root: str
    run: str
    first: int
    stop: int
    write: str | None = None
    threads: int = 0

    @property
    def block(self) -> str:
        """Name of the block's folder."""
        return f"frames_{self.first:06d}_{self.stop:06d}"

    @property
    def label(self) -> str:
        """The unit in words."""
        return f"{self.run} frames {self.first}:{self.stop}"


def expand(plan: BatchPlan) -> list[PlannedRun]:
    """Return every run of a plan, checked: nothing that a run's settings could say wrong is left for later.

    Raises
    ------
    ConfigError, InputError, NotFoundError
        A scene, profile, key or option that cannot be used, or two runs that are the same.
    """
    runs = [_planned(plan, *choice) for choice in _choices(plan)]
    twice = [r for r, n in Counter(r.config for r in runs).items() if n > 1]
    if twice:
        same = [r.name for r in runs if r.config == twice[0]]
        raise InputError(f"plan {plan.name}: {len(same)} runs are the same ({same[0]}); a value is given twice")
    count = Counter(r.name for r in runs)
    return [r if count[r.name] == 1 and len(r.name) <= _LONGEST else _told_apart(r) for r in runs]


def _choices(plan: BatchPlan) -> Iterator[tuple[str, list[str], int | None, dict[str, Any]]]:
    profiles = [[p] if isinstance(p, str) else list(p) for p in plan.profiles] or [[]]
    seeds: list[int | None] = [*plan.seeds] or [None]
    values = [v if isinstance(v, list) else [v] for v in plan.set.values()]
    for scene, names, seed in itertools.product(plan.scenes, profiles, seeds):
        for combination in itertools.product(*values):
            yield scene, names, seed, dict(zip(plan.set, combination, strict=True))


def _planned(plan: BatchPlan, source: str, profiles: list[str], seed: int | None, values: dict[str, Any]) -> PlannedRun:
    of_scene, of_profile = split_overrides(values)
    scene = load_scene(_beside(plan, source), of_scene)
    if not scene.radars:
        raise InputError(f"{source}: the scene has no radars; give it at least one under radars:")
    options = merge_options(
        {"max_bounces": scene.max_bounces, **scene.run}, plan.options.model_dump() | {"frames": plan.frames}
    )
    scene = with_profiles(scene, [str(_beside(plan, p)) for p in profiles], of_profile)
    update = {"seed": scene.seed if seed is None else seed, "run": options.record()}
    scene = scene.model_copy(update=update)
    swept = [k for k, v in plan.set.items() if isinstance(v, list) and len(v) > 1]
    parts = [scene.name, profile_label(scene), f"seed{scene.seed}"]
    parts += [f"{k.rpartition('.')[2]}={values[k]}" for k in swept]
    return PlannedRun(
        name=re.sub(r"[^\w.+=-]+", "_", "-".join(parts)).lstrip("."),
        scene=scene.name,
        profiles=tuple(scene.profile_of(r).name for r in scene.radars),
        seed=scene.seed,
        frames=frame_range(plan.frames),
        values=values,
        config=config_text(scene),
        files=input_files(scene),
        chained=any(scene.profile_of(r).processing.ambiguity == "two_frame" for r in scene.radars),
    )


def _beside(plan: BatchPlan, name: str) -> str | Path:
    """Return a file beside the plan where there is one, else the name as it is."""
    file = plan.folder / name
    return file if file.suffix in (".yaml", ".yml") and file.is_file() else name


def _told_apart(run: PlannedRun) -> PlannedRun:
    """Return the run under a name that ends in a part of its configuration's checksum."""
    from dataclasses import replace

    return replace(run, name=f"{run.name[:_LONGEST]}-{hashlib.sha256(run.config.encode()).hexdigest()[:8]}")


def input_files(scene: Scene) -> tuple[Path, ...]:
    """Return the files that a scene names: meshes, what says their tags, the material table."""
    names: set[str] = {str(scene.materials)}
    for part in (scene.ego, *scene.static, *scene.actors):
        for key in ("mesh", "resolve", "carla_tags", "trajectory_file"):
            value = getattr(part, key, None)
            if isinstance(value, str | Path):
                names.add(str(value))
    return tuple(sorted(f.resolve() for n in names if (f := scene.folder / n).is_file()))


def units_of(run: PlannedRun, root: Path, plan: BatchPlan) -> list[Unit]:
    """Return the run's frames in the plan's blocks; in one where each depends on the one before it."""
    last = run.frames.stop
    block = len(run.frames) if run.chained else plan.block
    starts = range(run.frames.start, last, block)
    return [Unit(str(root), run.name, k, min(k + block, last), plan.write) for k in starts]
