"""Scatterers from the columns that rays of any kind of trace fill."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..config.scene import Scene
from ..paths import Paths
from ..scatterers import Scatterers
from ..scene.world import World
from .world_caster import WorldCaster

__all__ = ["assembled"]


def assembled(
    columns: Mapping[str, Any], paths: Paths | None, scene: Scene, world: World, caster: WorldCaster, radar: str,
    seed: int, frame: int,
) -> Scatterers:  # fmt: skip
    """Return the scatterers of a radar, with what scene, world and caster know of them."""
    return Scatterers(
        **columns,
        paths=paths,
        material_names=tuple(world.materials.materials),
        weather=None if scene.weather is None else scene.weather.plain(),
        radar=radar,
        seed=seed,
        frame=frame,
        backend=caster.backend,
        door="mesh",
    )
