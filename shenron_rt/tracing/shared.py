"""One cast of rays for several radars that stand at one place.

The rays cover the union of the patterns. Which face each of them meets is found once, at the middle of one radar's
frame, the one with the widest pattern; everything metric is each radar's own, at the middle of its own frame. What is
seen is therefore that of another instant of the frame: an outline is out of its place by v dt / r, as it is within a
frame anyway, during which everything moves and nothing is traced again.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from .._typing import IntArray
from ..config.profile import RadarProfile
from ..config.scene import RadarMount, Scene
from ..errors import InputError
from ..physics.antenna import AntennaPattern
from ..randomness import frame_generator
from ..scatterers import Scatterers
from ..scene.world import World, build_world
from .advice import advise_thin
from .assembly import assembled
from .backend import choose_backend
from .launch import Cells, UnionPattern, lit_part, pattern_cells, turned
from .launches import Launch
from .trace import _aim_generator, _aims, _cast, _clear, _gathered, _point_rows, _prepared, bodies_of

__all__ = ["trace_shared"]


def trace_shared(
    scene: Scene,
    radars: Sequence[str],
    *,
    time: float = 0.0,
    seed: int | None = None,
    frame: int = 0,
    rays: int = 300_000,
    backend: str = "auto",
) -> dict[str, Scatterers]:
    """Cast rays once for several radars at one place, to first surfaces.

    Parameters
    ----------
    scene : Scene
    radars : sequence of str
        Names; their poses are the same.
    time : float
        Scene seconds at the first chirp's start of all of them [s].
    seed : int, optional
        Default: the scene's.
    frame : int
    rays : int
        About how many cells cover the union of the patterns down to -40 dB two-way. Each radar has those which its own
        pattern reaches: as far apart as the others', fewer than alone where its pattern is narrower.
    backend : str
        As for :func:`shenron_rt.trace`.

    Returns
    -------
    dict of str to Scatterers
        In the order of ``radars``. Where the widest pattern holds the others, those of its radar are the bytes that
        :func:`shenron_rt.trace` gives.

    Raises
    ------
    InputError
        Radars at several places, and what :func:`shenron_rt.trace` raises.
    """
    if rays < 100:
        raise InputError(f"rays: at least 100 are needed to cover an antenna pattern, got {rays}")
    mounts = [scene.radar(name) for name in radars]
    if len({(m.xyz_m, m.ypr_deg) for m in mounts}) != 1:
        raise InputError(f"trace_shared: radars {', '.join(radars)} stand at several places")
    profiles = [scene.profile_of(m) for m in mounts]
    run_seed = scene.seed if seed is None else seed
    base, lit = _cells(tuple(p.pattern for p in profiles), rays)
    lead = max(range(len(mounts)), key=lambda k: len(lit[k][0]))
    world, caster = _prepared(scene, mounts[lead], time + profiles[lead].frame_mid_s, choose_backend(backend))
    name = mounts[lead].name
    aimed = _aims(world, run_seed, frame, name)
    advise_thin(world, profiles[lead].pattern, base.spacing, aimed)
    shift = frame_generator(run_seed, frame, name, "rays").uniform(-0.5, 0.5, 2)
    launches = [Launch(turned(base, shift), frame_generator(run_seed, frame, name, "speckle")), *aimed.values()]
    parts, hits = _cast(world, caster, launches, list(aimed))

    def scatterers(mount: RadarMount, profile: RadarProfile, cells: Cells, rows: IntArray) -> Scatterers:
        instant = time + profile.frame_mid_s
        own = build_world(scene, mount, instant, *bodies_of(scene))
        at = np.full(len(base), -1, dtype=np.int64)
        at[rows] = np.arange(len(rows))
        counting = at[hits[0]]
        mine = [
            Launch(turned(cells, shift), frame_generator(run_seed, frame, mount.name, "speckle")),
            *_own_numbers(own, aimed, run_seed, frame, mount.name),
        ]
        found = [counting[counting >= 0], *hits[1:]]
        if mount.blocked_below_deg is not None:
            found = [_clear(launch.cells, h, mount.blocked_below_deg) for launch, h in zip(mine, found, strict=True)]
        numbers = [launch.draw() for launch in mine]
        points = _point_rows(scene, own, caster, instant)
        columns = _gathered(own, mine, [parts[0][rows], *parts[1:]], found, numbers, points)
        return assembled(columns, None, scene, own, caster, mount.name, run_seed, frame)

    return {m.name: scatterers(m, p, *part) for m, p, part in zip(mounts, profiles, lit, strict=True)}


def _own_numbers(world: World, aimed: dict[int, Launch], seed: int, frame: int, radar: str) -> list[Launch]:
    """Return the aimed launches with a radar's own random numbers, drawn as where its own numbers place the grids."""
    launches = []
    for body, launch in aimed.items():
        generator = _aim_generator(world.bodies[body], seed, frame, radar)
        generator.uniform(-0.5, 0.5, 2)
        launches.append(Launch(launch.cells, generator))
    return launches


@functools.lru_cache(maxsize=2)
def _cells(patterns: tuple[AntennaPattern, ...], rays: int) -> tuple[Cells, list[tuple[Cells, IntArray]]]:
    """Return the cells of the union of patterns, and of each pattern those that it reaches, with their rows."""
    base = pattern_cells(UnionPattern(patterns), rays)
    return base, [lit_part(base, p) for p in patterns]
