"""The geometry of rays that bounce: where, on what, under which direction, how far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._parallel import map_blocks
from .._typing import BoolArray, FloatArray, IntArray, NDArray
from .surface import Surface
from .vectors import dot, mirrored
from .views import Rays, Views

__all__ = ["Bounce", "Chain", "sees", "trace_chain"]

#: Multiplier of the hash of a chain of surfaces (the golden ratio times 2^64).
_MIX = np.uint64(0x9E3779B97F4A7C15)


@dataclass(frozen=True, eq=False)
class Bounce:
    """The hits of one order, a row for each ray that has one.

    Parameters
    ----------
    row_of : (n_rays,) int32
        Row of each ray; -1 where it has gone.
    ray : (m,) int32
        The ray of each row.
    parent : (m,) int32
        Row of the bounce before (of the ray itself at the first).
    position, direction, normal : (m, 3) float
        Hit, direction of arrival, unit normal on the side that is lit.
    across_u, across_v : (m, 3) float
        See :class:`~shenron_rt.sbr.views.Rays`; as they arrive.
    path : (m,) float
        [m].
    face : (m,) int32
    free : (m,) bool
        Whether nothing stands between the hit and the receiver.
    signature : (m,) uint64
        Equal where the surfaces up to this hit are.
    """

    row_of: IntArray
    ray: IntArray
    parent: IntArray
    position: FloatArray
    direction: FloatArray
    normal: FloatArray
    across_u: FloatArray
    across_v: FloatArray
    path: FloatArray
    face: IntArray
    free: BoolArray
    signature: NDArray[np.uint64]

    def __len__(self) -> int:
        return len(self.ray)


@dataclass(frozen=True, eq=False)
class Chain:
    """All bounces of some rays, and (n_rays,) uint64 numbers that are equal where the surfaces along them are."""

    rays: Rays
    bounces: tuple[Bounce, ...]
    signature: NDArray[np.uint64]


def trace_chain(surface: Surface, views: Views, rays: Rays, max_bounces: int, monostatic: bool = True) -> Chain:
    """Follow rays over flat facets.

    Parameters
    ----------
    surface : Surface
    views : Views
        That the rays belong to.
    rays : Rays
    max_bounces : int
    monostatic : bool
        Find out which hits see the place the light comes from; if not, ``free`` is true everywhere.

    Returns
    -------
    Chain
    """
    n = len(rays)
    signature = np.zeros(n, dtype=np.uint64)
    bounces: list[Bounce] = []
    parent = np.arange(n, dtype=np.int32)
    ray, origin, lifted, direction = parent, rays.origin, rays.origin, rays.direction
    across_u, across_v, path = rays.across_u, rays.across_v, rays.path
    for order in range(max_bounces):
        start = np.ascontiguousarray((lifted - surface.centre).T, dtype=np.float32)
        face = surface.caster.cast(np.ascontiguousarray(direction.T, dtype=np.float32), start)
        hit = np.flatnonzero(face >= 0)
        if not len(hit):
            break
        face = face[hit]

        def block(
            rows: slice,
            hit: IntArray = hit,
            face: IntArray = face,
            at: tuple[FloatArray, ...] = (origin, direction, across_u, across_v, path),
        ) -> tuple[FloatArray, ...]:
            o, d, u, v, length = (a[hit[rows]] for a in at)
            normal = surface.normal[face[rows]]
            along = dot(normal, d)
            reach = (surface.offset[face[rows]] - dot(normal, o)) / along
            normal = normal * np.where(along > 0, -1.0, 1.0)[:, None]
            return o + reach[:, None] * d, d, normal, u, v, length + reach

        parts = map_blocks(block, len(hit))
        position, d, normal, u, v, length = (np.concatenate(column) for column in zip(*parts, strict=True))
        row_of = np.full(n, -1, dtype=np.int32)
        row_of[ray[hit]] = np.arange(len(hit), dtype=np.int32)
        lifted = position + surface.lift * normal
        ray = ray[hit]
        free = np.ones(len(ray), dtype=bool)
        if monostatic and order > 0:  # the light itself has come all the way to the first hits
            free = sees(surface, views, lifted, normal, rays.view[ray])
        label = (surface.group[face].astype(np.uint64) << np.uint64(1)) + free + np.uint64(2)
        signature[ray] = (signature[ray] ^ label) * _MIX
        bounces.append(Bounce(row_of, ray, parent[hit], position, d, normal, u, v, length, face, free, signature[ray]))
        origin, path, parent = position, length, np.arange(len(hit), dtype=np.int32)
        if order + 1 < max_bounces:
            direction, across_u, across_v = (mirrored(a, normal) for a in (d, u, v))
    return Chain(rays, tuple(bounces), signature)


def sees(surface: Surface, views: Views, lifted: FloatArray, normal: FloatArray, view: IntArray) -> BoolArray:
    """Return whether the lit side of the surface at points just above it sees a radar.

    Parameters
    ----------
    surface : Surface
    views : Views
    lifted, normal : (n, 3) float
    view : (n,) int
        Row of the views for each point.
    """
    toward, _, _ = views.seen_from(lifted, view)
    free: BoolArray = dot(toward, normal) > 0
    look = np.flatnonzero(free)
    start = np.ascontiguousarray((lifted[look] - surface.centre).T, dtype=np.float32)
    free[look] = surface.caster.cast(np.ascontiguousarray(toward[look].T, dtype=np.float32), start) < 0
    return free
