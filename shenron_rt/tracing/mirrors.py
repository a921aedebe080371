"""Small bodies in the mirror of large planes, and the paths over several surfaces of all launches together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._typing import BoolArray, IntArray
from ..paths import Paths
from ..randomness import frame_generator
from ..scene.world import World
from .bounces import MIRROR_M2, trace_paths
from .launch import aimed_cells
from .launches import Launch, launch_directions
from .world_caster import WorldCaster

__all__ = ["Image", "bounced_paths", "image_launches"]


@dataclass(frozen=True)
class Image:
    """Rays at the mirror image of a body in a plane."""

    body: int
    plane: int
    launch: Launch


def image_launches(
    world: World, caster: WorldCaster, aimed: dict[int, Launch], seed: int, frame: int, radar: str
) -> list[Image]:
    """Return launches at the mirror images of aimed bodies, in the large planes that show them to the radar."""
    large = np.flatnonzero(world.face_patch >= MIRROR_M2)
    _, pick = np.unique(world.face_plane[large], return_index=True)
    face = large[pick]
    images = []
    for body in aimed:
        item = world.bodies[body]
        points = world.vertices[world.vertex_start[body] : world.vertex_start[body + 1]]
        mirrors = face[world.face_body[face] != body]
        normal, offset = world.face_normal[mirrors], world.face_offset[mirrors]
        box = np.stack(np.meshgrid(*np.stack([points.min(axis=0), points.max(axis=0)], axis=1)), axis=-1).reshape(-1, 3)
        probes = np.concatenate([box.mean(axis=0, keepdims=True), box])
        height = probes @ normal.T - offset  # of each probe above each plane; the radar is at -offset
        seen = probes[:, None] - 2.0 * height[:, :, None] * normal
        both = height * -offset > 0
        rays = np.ascontiguousarray(seen.reshape(-1, 3).T / np.linalg.norm(seen.reshape(-1, 3), axis=1), np.float32)
        hit = caster.cast(rays).reshape(both.shape)
        shown = both & (hit >= 0) & (world.face_plane[hit] == world.face_plane[mirrors])
        for k in np.flatnonzero(shown.any(axis=0)).tolist():
            generator = frame_generator(seed, frame, radar, f"image {item.object_id} {item.source.name} {k}")
            above = points @ normal[k] - offset[k]
            mirrored = points - 2.0 * above[:, None] * normal[k]
            cells = aimed_cells(mirrored, item.source.aim or 0, generator.uniform(-0.5, 0.5, 2))
            if cells is not None:
                images.append(Image(body, int(world.face_plane[mirrors[k]]), Launch(cells, generator)))
    return images


def bounced_paths(
    world: World,
    caster: WorldCaster,
    launches: list[Launch],
    parts: list[IntArray],
    hits: list[IntArray],
    images: list[Image],
    max_bounces: int,
    wavenumber: float,
) -> Paths:
    """Return the paths over several surfaces, each seen by one launch only.

    What shows an aimed body in its second hit, in a plane that has rays of its own for that, is left to them.
    """
    taken = {(image.plane, image.body) for image in images}

    def not_taken(first: IntArray, second: IntArray) -> BoolArray:
        keep = np.ones(len(first), dtype=bool)
        for plane, body in taken:
            keep &= (world.face_plane[first] != plane) | (world.face_body[second] != body)
        return keep

    found = [
        trace_paths(world, caster, launch.cells, part[hit], hit, max_bounces, wavenumber, not_taken)
        for launch, part, hit in zip(launches, parts, hits, strict=True)
    ]
    for image in images:
        face = caster.cast(launch_directions([image.launch]))
        hit = np.flatnonzero((face >= 0) & (world.face_plane[face] == image.plane))

        def shown(first: IntArray, second: IntArray, body: int = image.body) -> BoolArray:
            return np.asarray(world.face_body[second] == body)

        found.append(trace_paths(world, caster, image.launch.cells, face[hit], hit, max_bounces, wavenumber, shown))
    return Paths.join(found)
