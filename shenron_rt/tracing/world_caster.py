"""Nearest hits in a scene that moves: what stands still is prepared once, what moves is moved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._typing import FloatArray, IntArray, NDArray
from ..config.scene import Scene
from ..scene.motion_of import trajectory_of
from ..scene.world import World
from .backend import Backend
from .caster import RayCaster

__all__ = ["WorldCaster", "anchor"]

#: Moving rigid parts of this many triangles have a search tree of their own; below, fitting it anew each frame is less
#: work than casting at one more scene.
_OWN_TREE = 1000
#: No more of them than this: each takes a pass over the rays.
_MOST_TREES = 32
#: Added to the sphere about a part, far above what float32 loses at its distance [m].
_SLACK_M = 0.05


def anchor(scene: Scene) -> FloatArray:
    """Return a point of the world near where the ego vehicle starts, the same for every frame of a scene [m]."""
    ego = scene.ego
    start = trajectory_of(ego, scene.folder).position[0] if ego.has_trajectory else ego.pose.translation
    return np.asarray(np.round(start))


@dataclass(frozen=True, eq=False)
class _Rigid:
    """Triangles that keep their places among themselves, in a frame of their own: their search tree is built once.

    Parameters
    ----------
    caster : RayCaster
    rows : (f + 1,) int32
        Of the world's faces; the last, -1, answers for a miss.
    center : (3,) float
    radius : float
        Of a sphere that holds them, infinite for what is everywhere [m].
    link : int
        Of the world; -1 for what stands still.
    whole : bool
        Whether it is all of the world, face by face.
    """

    caster: RayCaster
    rows: IntArray
    center: FloatArray
    radius: float
    link: int
    whole: bool


class WorldCaster:
    """Casts rays of a radar at a world; :meth:`place` makes it the next instant's.

    What never moves keeps its place in the world, about a point near the start of the ego vehicle; each large rigid
    part that moves keeps its own frame. Rays are taken there, so that neither vertices nor search trees are touched
    again. Small parts that move, of which there may be thousands, are one mesh in the frame of the radar whose vertices
    move. Which face is nearest where several are hit follows from their planes in float64.

    Parameters
    ----------
    world : World
        At any instant.
    anchor : (3,) float
        A point of the world near where the radar will be [m].
    backend : str
    """

    def __init__(self, world: World, anchor: FloatArray, backend: Backend) -> None:
        self.backend: Backend = backend
        self._anchor = anchor
        links = np.concatenate([[0], np.cumsum([len(b.links) for b in world.bodies])]).astype(np.int64)
        moves = np.array([b.moves for b in world.bodies for _ in b.links], dtype=bool)
        size = np.bincount(world.face_link, minlength=int(links[-1]))
        own = np.flatnonzero(moves & (size >= _OWN_TREE))
        own = own[np.argsort(-size[own], kind="stable")][:_MOST_TREES]
        self._rigid = []
        still = np.flatnonzero(~moves[world.face_link]) if world.face_link.size else np.zeros(0, np.int64)
        if still.size:
            self._rigid.append(_rigid(_at_rest(world, anchor), world, still, -1, backend))
        for link in sorted(own.tolist()):
            rest = np.concatenate([b.mesh.vertices for b in world.bodies])
            self._rigid.append(_rigid(rest, world, np.flatnonzero(world.face_link == link), link, backend))
        loose = np.flatnonzero(moves[world.face_link] & ~np.isin(world.face_link, own))
        self._loose_rows = np.append(loose, -1).astype(np.int32)
        self._loose_vertices, faces = _used(world.faces[loose])
        self._loose = RayCaster(world.vertices[self._loose_vertices], faces, backend)
        self._world = world

    def place(self, world: World) -> None:
        """Make this the caster of another instant, or another radar, of the same scene."""
        self._world = world
        self._loose.move(world.vertices[self._loose_vertices])

    def cast(
        self, directions: NDArray[np.float32], origins: NDArray[np.float32] | None = None, *, coherent: bool = False
    ) -> IntArray:
        """Return (n,) int32 row of the nearest face along each direction, -1 where nothing is hit.

        Parameters
        ----------
        directions : (3, n) float32
            Unit vectors, frame of the radar, component by component.
        origins : (3, n) float32, optional
            Where each ray starts; default: at the radar [m].
        coherent : bool
            Whether neighbours in the list are neighbours in space; see :meth:`RayCaster.cast`.
        """
        nearest = self._loose_rows[self._loose.cast(directions, origins)] if self._loose.n_faces else None
        for rigid in self._rigid:
            rotation, shift = self._pose(rigid)  # radar to the part's frame
            rays = _towards(rigid, rotation, shift, directions, origins)
            d, o = (directions, origins) if rays is None else (directions[:, rays], _columns(origins, rays))
            start = shift[:, None] if o is None else _turned(rotation, o) + shift[:, None]
            hit = rigid.caster.cast(_turned(rotation, d), start, coherent=coherent and rays is None)
            hit = hit if rigid.whole else rigid.rows[hit]
            if nearest is None and rays is None:
                nearest = hit
                continue
            nearest = _nothing(directions) if nearest is None else nearest
            self._merge(nearest, hit, rays, directions, origins)
        return _nothing(directions) if nearest is None else nearest

    def _pose(self, rigid: _Rigid) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return rotation and shift from the radar's frame to that of a rigid part."""
        world = self._world
        if rigid.link < 0:
            eye = world.radar_state
            return eye.rotation.astype(np.float32), (eye.origin - self._anchor).astype(np.float32)
        back = world.link_rotation[rigid.link].T
        return back.astype(np.float32), (-back @ world.link_origin[rigid.link]).astype(np.float32)

    def _merge(
        self,
        nearest: IntArray,
        hit: IntArray,
        rays: IntArray | None,
        directions: NDArray[np.float32],
        origins: NDArray[np.float32] | None,
    ) -> None:
        """Put hits of some rays (None: all) into ``nearest`` where they are nearer than what is there."""
        found = np.flatnonzero(hit >= 0)
        ray = found if rays is None else rays[found]
        hit = hit[found]
        both = np.flatnonzero(nearest[ray] >= 0)
        d, o = directions[:, ray[both]], _columns(origins, ray[both])
        behind = self._distance(nearest[ray[both]], d, o) <= self._distance(hit[both], d, o)
        hit[both[behind]] = nearest[ray[both[behind]]]
        nearest[ray] = hit

    def _distance(self, face: IntArray, d: NDArray[np.float32], o: NDArray[np.float32] | None) -> FloatArray:
        """Return how far each ray goes to the plane of a face [m]."""
        normal = self._world.face_normal[face]
        height = self._world.face_offset[face]
        if o is not None:
            height = height - np.einsum("ij,ji->i", normal, o.astype(np.float64))
        along = np.einsum("ij,ji->i", normal, d.astype(np.float64))
        return np.asarray(np.abs(height) / np.maximum(np.abs(along), 1e-12))


def _rigid(vertices: FloatArray, world: World, faces: IntArray, link: int, backend: Backend) -> _Rigid:
    used, triangles = _used(world.faces[faces])
    points = vertices[used]
    low, high = points.min(axis=0), points.max(axis=0)
    radius = np.inf if link < 0 else float(np.linalg.norm(high - low)) / 2.0 + _SLACK_M
    rows = np.append(faces, -1).astype(np.int32)
    whole = len(faces) == len(world.faces)
    return _Rigid(RayCaster(points, triangles, backend), rows, (low + high) / 2.0, radius, link, whole)


def _at_rest(world: World, anchor: FloatArray) -> FloatArray:
    """Return the vertices of bodies that stand still, relative to the anchor; of those that move, as they are."""
    placed = []
    for body in world.bodies:
        pose = body.source.pose
        points = body.mesh.vertices
        placed.append(points if body.moves else points @ pose.rotation.T + (pose.translation - anchor))
    return np.concatenate(placed)


def _towards(
    rigid: _Rigid,
    rotation: NDArray[np.float32],
    shift: NDArray[np.float32],
    d: NDArray[np.float32],
    o: NDArray[np.float32] | None,
) -> IntArray | None:
    """Return the rays that pass the sphere about a rigid part; None stands for all."""
    if not np.isfinite(rigid.radius):
        return None
    center = (rotation.T @ (rigid.center.astype(np.float32) - shift))[:, None]
    if o is not None:
        center = center - o
    along = d[0] * center[0]
    along += d[1] * center[1]
    along += d[2] * center[2]
    square = center[0] ** 2 + center[1] ** 2 + center[2] ** 2
    near = np.float32(rigid.radius) ** 2
    # the foot of the centre on the ray lies within the sphere, or its start does
    if o is None:
        return None if square[0] <= near else np.flatnonzero(along >= np.sqrt(square[0] - near))
    return np.flatnonzero((square - along**2 <= near) & ((along > 0) | (square <= near)))


def _nothing(directions: NDArray[np.float32]) -> IntArray:
    return np.full(directions.shape[1], -1, dtype=np.int32)


def _columns(rows: NDArray[np.float32] | None, which: IntArray) -> NDArray[np.float32] | None:
    return None if rows is None else rows[:, which]


def _used(faces: IntArray) -> tuple[IntArray, IntArray]:
    """Return the vertices that faces use, and the faces in their numbers."""
    used, index = np.unique(faces, return_inverse=True)
    return used, index.reshape(-1, 3).astype(np.int32)


def _turned(rotation: NDArray[np.float32], rows: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (3, n) rotated columns, by sums whose order does not depend on the number of threads."""
    if np.array_equal(rotation, np.eye(3)):
        return rows
    x, y, z = rows
    return np.stack([r[0] * x + r[1] * y + r[2] * z for r in rotation])
