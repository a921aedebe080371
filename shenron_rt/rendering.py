"""The frames of a run, of all its radars; those that stand at one place share their rays."""

from __future__ import annotations

from collections.abc import Iterator

from .config.scene import RadarMount, Scene
from .pipeline import Frame, SceneChain
from .run_setup import RunOptions
from .scene.motion_of import check_times
from .sequence import simulate_sequence
from .tracing.shared import trace_shared

__all__ = ["rendered"]


def rendered(scene: Scene, options: RunOptions, frames: range) -> Iterator[tuple[RadarMount, Frame]]:
    """Render frames of every radar of a scene.

    Parameters
    ----------
    scene : Scene
    options : RunOptions
        Its own ``frames`` are not looked at.
    frames : range
        Frame k begins at k times the scene's frame period.

    Yields
    ------
    RadarMount, Frame
        Those of one radar in the order of ``frames``. Radars at one place share one cast of rays a frame where first
        surfaces at one instant are all that is asked for; see :func:`shenron_rt.tracing.shared.trace_shared`.

    Raises
    ------
    InputError
        Something of the scene has no pose at one of the frames, raised before the first; and what a frame raises.
    """
    middles = [scene.profile_of(m).frame_mid_s for m in scene.radars]
    check_times(scene, (k * scene.frame_period_s + dt for k in frames for dt in middles))
    for group in _at_one_place(scene):
        if len(group) > 1 and options.max_bounces == 1 and options.retrace == 1:
            yield from _shared(scene, group, options, frames)
            continue
        for mount in group:
            used = scene.profile_of(mount)
            for frame in simulate_sequence(
                scene, used, frames=frames, radar=mount.name, seed=scene.seed, **options.arguments()
            ):
                yield mount, frame


def _at_one_place(scene: Scene) -> list[list[RadarMount]]:
    groups: dict[object, list[RadarMount]] = {}
    for mount in scene.radars:
        groups.setdefault((mount.xyz_m, mount.ypr_deg), []).append(mount)
    return list(groups.values())


def _shared(
    scene: Scene, group: list[RadarMount], options: RunOptions, frames: range
) -> Iterator[tuple[RadarMount, Frame]]:
    chains = [
        SceneChain(scene, m, scene.profile_of(m), seed=scene.seed, noise="thermal", **options.arguments())
        for m in group
    ]
    last: dict[str, Frame] = {}
    for index in frames:
        time = index * scene.frame_period_s
        seen = trace_shared(
            scene, [m.name for m in group], time=time, frame=index, rays=options.rays, backend=options.backend
        )
        for chain in chains:
            name = chain.mount.name
            last[name] = chain.finish(seen[name], time, last.get(name))
            yield chain.mount, last[name]
