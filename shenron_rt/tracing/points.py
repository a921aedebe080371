"""Point targets in the mirror of large planes: the ways between a radar and a point that a road or a wall adds."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np

from .._typing import BoolArray, FloatArray, IntArray, NDArray
from ..paths import Paths
from ..scene.world import World
from .bounces import MIRROR_M2, facing, lifted, reaches
from .world_caster import WorldCaster

__all__ = ["point_paths"]


def point_paths(world: World, caster: WorldCaster, targets: dict[str, NDArray[Any]], max_bounces: int) -> Paths:
    """Return the ways to point targets and back that go over one large plane at least on one leg, over two at most.

    Parameters
    ----------
    world : World
    caster : WorldCaster
    targets : dict
        Columns of point targets that the radar sees, as of the scatterers: ``position`` (n, 3) [m], ``velocity``
        (n, 3) [m/s], ``object_id``, ``tag``, ``rcs`` (n,) [m^2].
    max_bounces : int
        Surfaces along a path, the target itself among them.

    Returns
    -------
    Paths
        For each plane that shows a target: radar, plane, target, radar, for both senses; and with three surfaces the
        plane on both legs, or two planes, for both senses.
    """
    n = len(targets["position"])
    if max_bounces < 2 or n == 0 or not len(world.face_plane):
        return Paths.none()
    target, face, point = _shown(world, caster, targets["position"])
    found = [_chain(world, targets, target, [(face, point), None], two_way=True)]
    if max_bounces >= 3:
        found.append(_chain(world, targets, target, [(face, point), None, (face, point)], two_way=False))
        first, second = _pairs(target)
        legs = [(face[first], point[first]), None, (face[second], point[second])]
        found.append(_chain(world, targets, target[first], legs, two_way=True))
    return Paths.join(found)


def _shown(world: World, caster: WorldCaster, position: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Return which targets are seen in which planes: target (m,), a face of the plane (m,), where on it (m, 3)."""
    large = np.flatnonzero(world.face_patch >= MIRROR_M2)
    _, pick = np.unique(world.face_plane[large], return_index=True)
    mirrors = large[pick]
    normal, offset = world.face_normal[mirrors], world.face_offset[mirrors]
    height = position @ normal.T - offset  # of each target above each plane; the radar is at -offset
    target, mirror = np.nonzero(height * -offset > 0)
    image = position[target] - 2.0 * height[target, mirror][:, None] * normal[mirror]
    along = image / np.linalg.norm(image, axis=1, keepdims=True)
    hit = caster.cast(np.ascontiguousarray(along.T, dtype=np.float32))
    plane = np.append(world.face_plane, np.int32(-1))[hit]  # a miss, -1, reads the last
    seen = np.flatnonzero(plane == world.face_plane[mirrors[mirror]])
    target, along, face = target[seen], along[seen], hit[seen]
    reach = world.face_offset[face] / np.einsum("ij,ij->i", world.face_normal[face], along)
    point = reach[:, None] * along
    free = reaches(world, caster, lifted(point, facing(world, face, along)), position[target])
    return target[free], face[free], point[free]


def _pairs(target: IntArray) -> tuple[IntArray, IntArray]:
    """Return rows of two different planes that show the same target."""
    rows = [pair for t in np.unique(target) for pair in combinations(np.flatnonzero(target == t).tolist(), 2)]
    both = np.array(rows, dtype=np.int64).reshape(-1, 2)
    return both[:, 0], both[:, 1]


def _chain(
    world: World,
    targets: dict[str, NDArray[Any]],
    target: IntArray,
    hits: list[tuple[IntArray, FloatArray] | None],
    *,
    two_way: bool,
) -> Paths:
    """Return paths over hits in their order, each a face and a point on it (n,) and (n, 3), or None: the target."""
    n, count = len(target), len(hits)
    own = targets["position"][target]
    ends = next(k for k, hit in enumerate(hits) if hit is None)

    def column(surface: NDArray[Any], of_target: NDArray[Any]) -> NDArray[Any]:
        return np.stack([of_target if hit is None else surface[hit[0]] for hit in hits], axis=1)

    point = np.stack([own if hit is None else hit[1] for hit in hits], axis=1)
    body = column(world.face_link, np.zeros(n, dtype=world.face_link.dtype))
    at_target: BoolArray = (np.arange(count) == ends)[None, :, None]
    moving = world.drift[body] + np.cross(world.turn[body], point)
    before = np.concatenate([np.zeros((n, 1, 3)), point[:, :-1]], axis=1)
    normal = column(world.face_normal, -own / np.linalg.norm(own, axis=1, keepdims=True))
    side = np.einsum("nbi,nbi->nb", normal, point - before)
    face_id, target_id = world.object_id[world.face_body], targets["object_id"][target]
    return Paths(
        count=np.full(n, count, dtype=np.uint8),
        point=point,
        normal=normal * np.where(side > 0, -1.0, 1.0)[:, :, None],
        velocity=np.where(at_target, targets["velocity"][target][:, None, :], moving),
        material=column(world.face_material, np.zeros(n, dtype=world.face_material.dtype)),
        object_id=column(face_id, target_id),
        tag=column(world.face_tag, targets["tag"][target]),
        radiates=np.full(n, ends, dtype=np.uint8),
        two_way=np.full(n, two_way),
        area=np.zeros((n, 3)),
        slope=np.zeros((n, 2)),
        curvature=np.zeros((n, 3)),
        rcs=targets["rcs"][target],
    )
