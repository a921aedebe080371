"""The scene of a page: each mesh once, and where it stands in every frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._typing import FloatArray, IntArray
from ..config.scene import Scene
from ..plot.top_view import feature_edges
from ..scene.world import Body, World, build_world, load_bodies
from .arrays import Arrays
from .source import RadarFiles

__all__ = ["SceneMeshes", "rigid_motion"]

#: Edges of a mesh that a page draws.
_MOST_EDGES = 50_000
#: A body that moves less than this over a run stands [m].
_STANDS_M = 1e-3

Middles = dict[int, FloatArray]


@dataclass(frozen=True, eq=False)
class SceneMeshes:
    """The bodies of a scene, and which mesh of a page each one shows.

    Parameters
    ----------
    bodies : tuple of Body
    mesh_of : tuple of int
        Mesh of the page, by body.
    records : list of dict
        Of each mesh: ``faces`` drawn, ``all_faces``, ``runs`` ([tag, first face, faces] of faces of one tag).
    """

    scene: Scene
    bodies: tuple[Body, ...]
    mesh_of: tuple[int, ...]
    records: list[dict[str, Any]]

    @classmethod
    def add_to(cls, arrays: Arrays, scene: Scene, most_faces: int) -> SceneMeshes:
        """Add ``m<k>.vertices`` (v, 3) float32 [m], ``m<k>.faces`` (f, 3), ``m<k>.edges`` (e, 2) uint32 of each mesh.

        Parameters
        ----------
        arrays : Arrays
        scene : Scene
        most_faces : int
            Faces of all meshes together; the smallest are left out where there are more. Edges are those of all faces.

        Raises
        ------
        InputError, NotFoundError
            A mesh that cannot be read any more.
        """
        bodies, _ = load_bodies(scene)
        distinct: dict[tuple[int, bytes], Body] = {}
        for body in bodies:  # ready-made shapes of one kind share a mesh
            distinct.setdefault((id(body.mesh), body.tag.tobytes()), body)
        area = np.concatenate([b.mesh.face_area for b in distinct.values()] or [np.zeros(0)])
        least = 0.0 if len(area) <= most_faces else float(np.partition(area, -most_faces)[-most_faces])
        records = [_add_mesh(arrays, k, body, least) for k, body in enumerate(distinct.values())]
        order = {key: k for k, key in enumerate(distinct)}
        mesh_of = tuple(order[id(b.mesh), b.tag.tobytes()] for b in bodies)
        return cls(scene, bodies, mesh_of, records)

    def add_poses(self, arrays: Arrays, prefix: str, radar: RadarFiles) -> tuple[list[dict[str, Any]], Middles]:
        """Add where bodies and radar stand in every frame; return the bodies, and the middles of those with an id.

        Parameters
        ----------
        arrays : Arrays
            Gets ``<prefix>.poses``, (bodies, frames, 12) float32: rotation (9) and origin (3) of bodies in the world,
            and ``<prefix>.radar``, (frames, 15): those of the radar, and its velocity (3).
        prefix : str
        radar : RadarFiles
        """
        mount = self.scene.radar(radar.name)
        _, materials = load_bodies(self.scene)
        poses = np.zeros((len(self.bodies), len(radar.frames), 12))
        eyes = np.zeros((len(radar.frames), 15))
        middles: dict[int, list[FloatArray]] = {}
        for k, frame in enumerate(radar.frames):
            world = build_world(self.scene, mount, frame.mid_s, self.bodies, materials)
            for b, body in enumerate(self.bodies):
                placed = world.vertices[world.vertex_start[b] : world.vertex_start[b + 1]]
                poses[b, k] = _in_world(body, placed, world)
                if body.object_id:
                    middle = (placed.min(axis=0) + placed.max(axis=0)) / 2
                    middles.setdefault(body.object_id, []).append(middle)
            state = world.radar_state
            eyes[k] = np.concatenate([state.rotation.ravel(), state.origin, state.velocity])
        arrays.add(f"{prefix}.poses", poses, "f4")
        arrays.add(f"{prefix}.radar", eyes, "f4")
        moves = np.ptp(poses, axis=1).max(axis=1, initial=0.0) > _STANDS_M
        records = [
            {"mesh": m, "id": b.object_id, "name": b.source.name, "moves": bool(moving)}
            for b, m, moving in zip(self.bodies, self.mesh_of, moves, strict=True)
        ]
        n = len(radar.frames)
        return records, {i: np.stack(m) for i, m in middles.items() if len(m) == n}


def _in_world(body: Body, placed: FloatArray, world: World) -> FloatArray:
    rotation, origin = rigid_motion(body.mesh.vertices, placed)
    state = world.radar_state
    return np.concatenate([(state.rotation @ rotation).ravel(), state.rotation @ origin + state.origin])


def rigid_motion(rest: FloatArray, placed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rotation (3, 3) and shift (3,) [m] that take (n, 3) points nearest to (n, 3) others.

    References
    ----------
    W. Kabsch, "A solution for the best rotation to relate two sets of vectors", Acta Cryst. A32 (1976) 922,
    doi:10.1107/S0567739476001873.
    """
    middle, there = rest.mean(axis=0), placed.mean(axis=0)
    u, _, vt = np.linalg.svd((rest - middle).T @ (placed - there))
    # a mirror image would fit a flat body as well: keep the determinant at +1
    mirror = np.array([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt))])
    rotation = (vt.T * mirror) @ u.T
    return rotation, there - rotation @ middle


def _add_mesh(arrays: Arrays, k: int, body: Body, least: float) -> dict[str, Any]:
    mesh = body.mesh
    shown = np.flatnonzero(mesh.face_area >= least)
    shown = shown[np.argsort(body.tag[shown], kind="stable")]
    arrays.add(f"m{k}.vertices", mesh.vertices, "f4")
    arrays.add(f"m{k}.faces", mesh.faces[shown], "u4")
    arrays.add(f"m{k}.edges", _longest(mesh.vertices, feature_edges(mesh.vertices, mesh.faces)), "u4")
    return {"faces": len(shown), "all_faces": mesh.n_faces, "runs": _runs(body.tag[shown])}


def _longest(vertices: FloatArray, edges: IntArray) -> IntArray:
    """Return the longest edges, as many as are drawn of a mesh."""
    if len(edges) <= _MOST_EDGES:
        return edges
    length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    return edges[np.argpartition(-length, _MOST_EDGES)[:_MOST_EDGES]]


def _runs(tags: IntArray) -> list[list[int]]:
    """Return [tag, first, count] of each run of equal tags."""
    first = np.flatnonzero(np.diff(tags.astype(np.int64), prepend=-1))
    count: Sequence[int] = np.diff(first, append=len(tags)).tolist()
    return [[int(tags[i]), int(i), n] for i, n in zip(first, count, strict=True)]
