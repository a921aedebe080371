"""Nearest hits in a scene that moves: what stands still is prepared once, what moves is moved."""

from __future__ import annotations

import numpy as np

from .._typing import FloatArray, IntArray, NDArray
from ..config.scene import Scene
from ..scene.bodies import Body
from ..scene.motion_of import trajectory_of
from ..scene.world import World
from .backend import Backend
from .caster import RayCaster

__all__ = ["WorldCaster", "anchor"]


def anchor(scene: Scene) -> FloatArray:
    """Return a point of the world near where the ego vehicle starts, the same for every frame of a scene [m]."""
    ego = scene.ego
    start = trajectory_of(ego, scene.folder).position[0] if ego.has_trajectory else ego.pose.translation
    return np.asarray(np.round(start))


class WorldCaster:
    """Casts rays of a radar at a world; :meth:`place` makes it the next instant's.

    Two sets of triangles. What never moves keeps its place in the world, about a point near the start of the ego
    vehicle, and the rays are taken there: neither its vertices nor its search tree are touched again. What moves is
    placed in the frame of the radar, which moves vertices of a mesh that stays. Which face is nearest where both are
    hit follows from their planes in float64.

    Parameters
    ----------
    world : World
    bodies : tuple of Body
        Of the world.
    anchor : (3,) float
        A point of the world near where the radar will be [m].
    backend : str
    """

    def __init__(self, world: World, anchor: FloatArray, backend: Backend) -> None:
        self.backend: Backend = backend
        self._anchor = anchor
        moves = np.array([b.moves for b in world.bodies], dtype=bool)
        self._rows = [np.flatnonzero(moves[world.face_body] == kind).astype(np.int32) for kind in (False, True)]
        self._vertices = np.flatnonzero(np.repeat(moves, np.diff(world.vertex_start)))
        still = [_in_world(b, anchor) for b in world.bodies]
        points = np.concatenate(still) if still else np.zeros((0, 3))
        self._still = RayCaster(*_compact(points, world.faces[self._rows[0]]), backend)
        self._moving = RayCaster(world.vertices[self._vertices], self._renumbered(world), backend)
        self._take(world)

    def _renumbered(self, world: World) -> IntArray:
        number = np.zeros(len(world.vertices), dtype=np.int32)
        number[self._vertices] = np.arange(len(self._vertices), dtype=np.int32)
        return number[world.faces[self._rows[1]]]

    def _take(self, world: World) -> None:
        self._world = world
        eye = world.radar_state
        self._turn = eye.rotation.astype(np.float32)
        self._eye = (eye.origin - self._anchor).astype(np.float32)

    def place(self, world: World) -> None:
        """Make this the caster of another instant, or another radar, of the same scene."""
        self._take(world)
        self._moving.move(world.vertices[self._vertices])

    def cast(self, directions: NDArray[np.float32], origins: NDArray[np.float32] | None = None) -> IntArray:
        """Return (n,) int32 row of the nearest face along each direction, -1 where nothing is hit.

        Parameters
        ----------
        directions : (3, n) float32
            Unit vectors, frame of the radar, component by component.
        origins : (3, n) float32, optional
            Where each ray starts; default: at the radar [m].
        """
        moving = self._row(self._moving.cast(directions, origins) if self._moving.n_faces else None, 1, directions)
        if not self._still.n_faces:
            return moving
        eye = self._eye[:, None]
        start = eye if origins is None else _turned(self._turn, origins) + eye
        still = self._row(self._still.cast(_turned(self._turn, directions), start), 0, directions)
        if not self._moving.n_faces:
            return still
        nearest = np.where(moving >= 0, moving, still)
        both = np.flatnonzero((moving >= 0) & (still >= 0))
        d, o = directions[:, both], None if origins is None else origins[:, both]
        behind = self._distance(still[both], d, o) < self._distance(moving[both], d, o)
        nearest[both[behind]] = still[both[behind]]
        return nearest

    def _row(self, hit: IntArray | None, kind: int, directions: NDArray[np.float32]) -> IntArray:
        """Return the rows of the world's faces for those of one of the two sets."""
        if hit is None:
            return np.full(directions.shape[1], -1, dtype=np.int32)
        return np.append(self._rows[kind], np.int32(-1))[hit]

    def _distance(self, face: IntArray, d: NDArray[np.float32], o: NDArray[np.float32] | None) -> FloatArray:
        """Return how far each ray goes to the plane of a face [m]."""
        normal = self._world.face_normal[face]
        height = self._world.face_offset[face]
        if o is not None:
            height = height - np.einsum("ij,ji->i", normal, o.astype(np.float64))
        along = np.einsum("ij,ji->i", normal, d.astype(np.float64))
        return np.asarray(np.abs(height) / np.maximum(np.abs(along), 1e-12))


def _in_world(body: Body, anchor: FloatArray) -> FloatArray:
    """Return the vertices of a body that stands still, relative to the anchor; of one that moves, as they are."""
    if body.moves:
        return body.mesh.vertices
    pose = body.source.pose
    return np.asarray(body.mesh.vertices @ pose.rotation.T + (pose.translation - anchor))


def _compact(points: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the vertices that faces use, and the faces in their numbers."""
    used, index = np.unique(faces, return_inverse=True)
    return points[used], index.reshape(-1, 3).astype(np.int32)


def _turned(rotation: NDArray[np.float32], rows: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (3, n) rotated columns, by sums whose order does not depend on the number of threads."""
    x, y, z = rows
    return np.stack([r[0] * x + r[1] * y + r[2] * z for r in rotation])
