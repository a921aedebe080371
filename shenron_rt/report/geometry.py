"""The scene of a page: each mesh once, and where it stands in every frame."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._typing import FloatArray, IntArray
from ..config.materials import MaterialTable, load_materials
from ..config.scene import Scene
from ..errors import ShenronError
from ..plot.top_view import feature_edges
from ..scene.world import Body, build_world, load_bodies
from .arrays import Arrays
from .source import RadarFiles

__all__ = ["Middles", "SceneMeshes", "rigid_motions"]

#: Edges of a mesh that a page draws.
_MOST_EDGES = 50_000
#: Vertices of a body that tell how it has moved.
_ANCHORS = 64
#: A body that moves less than this over a run stands [m].
_STANDS_M = 1e-3

#: (frames, 3) middles of bodies in the radar frame [m], by object id.
Middles = dict[int, FloatArray]

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class SceneMeshes:
    """The bodies of a scene, and which mesh of a page each one shows.

    Parameters
    ----------
    scene : Scene
    bodies : tuple of Body
    materials : MaterialTable
    mesh_of : tuple of int
        Mesh of the page, by body.
    records : list of dict
        Of each mesh: ``faces`` drawn, ``all_faces``, ``runs`` ([tag, first face, faces] of faces of one tag).
    """

    scene: Scene
    bodies: tuple[Body, ...]
    materials: MaterialTable
    mesh_of: tuple[int, ...]
    records: list[dict[str, Any]]

    @classmethod
    def add_to(cls, arrays: Arrays, scene: Scene, most_faces: int) -> SceneMeshes:
        """Add ``m<k>.vertices`` (v, 3) float32 [m], ``m<k>.faces`` (f, 3), ``m<k>.edges`` (e, 2) uint32 of each mesh.

        Meshes that cannot be read any more, on another machine for example, are left out with a warning.

        Parameters
        ----------
        arrays : Arrays
        scene : Scene
        most_faces : int
            Faces of all meshes together; the smallest are left out where there are more. Edges are those of all faces.
        """
        bodies, materials = _loaded(scene)
        distinct: dict[tuple[int, bytes], Body] = {}
        for body in bodies:  # ready-made shapes of one kind share a mesh
            distinct.setdefault((id(body.mesh), body.tag.tobytes()), body)
        area = np.concatenate([np.zeros(0), *(b.mesh.face_area for b in distinct.values())])
        least = 0.0 if len(area) <= most_faces else float(np.partition(area, -most_faces)[-most_faces])
        records = [_add_mesh(arrays, k, body, least) for k, body in enumerate(distinct.values())]
        order = {key: k for k, key in enumerate(distinct)}
        mesh_of = tuple(order[id(b.mesh), b.tag.tobytes()] for b in bodies)
        return cls(scene, bodies, materials, mesh_of, records)

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
        counts = [len(b.mesh.vertices) for b in self.bodies]
        begin = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
        anchors = [_anchors(n) for n in counts]
        rest = [b.mesh.vertices[a] for b, a in zip(self.bodies, anchors, strict=True)]
        poses = np.zeros((len(self.bodies), len(radar.frames), 12))
        eyes = np.zeros((len(radar.frames), 15))
        middles: dict[int, list[FloatArray]] = {b.object_id: [] for b in self.bodies if b.object_id}
        for k, frame in enumerate(radar.frames):
            world = build_world(self.scene, mount, frame.mid_s, self.bodies, self.materials)
            eye = world.radar_state
            eyes[k] = np.concatenate([eye.rotation.ravel(), eye.origin, eye.velocity])
            if not self.bodies:
                continue
            placed = [world.vertices[start + a] for start, a in zip(begin[:-1], anchors, strict=True)]
            rotation, origin = rigid_motions(rest, placed)
            poses[:, k, :9] = (eye.rotation @ rotation).reshape(-1, 9)
            poses[:, k, 9:] = origin @ eye.rotation.T + eye.origin
            low = np.minimum.reduceat(world.vertices, begin[:-1], axis=0)
            high = np.maximum.reduceat(world.vertices, begin[:-1], axis=0)
            for body, middle in zip(self.bodies, (low + high) / 2, strict=True):
                if body.object_id:
                    middles[body.object_id].append(middle)
        arrays.add(f"{prefix}.poses", poses, "f4")
        arrays.add(f"{prefix}.radar", eyes, "f4")
        moves = np.ptp(poses, axis=1).max(axis=1, initial=0.0) > _STANDS_M
        records = [
            {"mesh": m, "id": b.object_id, "name": b.source.name, "moves": bool(moving)}
            for b, m, moving in zip(self.bodies, self.mesh_of, moves, strict=True)
        ]
        # several bodies of one id have no one middle
        return records, {i: np.stack(m) for i, m in middles.items() if len(m) == len(radar.frames)}


def _loaded(scene: Scene) -> tuple[tuple[Body, ...], MaterialTable]:
    try:
        return load_bodies(scene)
    except ShenronError as error:
        _log.warning("the page has no meshes: %s", error)
        return (), load_materials("automotive")


def _anchors(count: int) -> IntArray:
    """Return vertices that stand for all of a body: spread over its list by a prime stride, off its patterns."""
    return np.unique(np.arange(_ANCHORS) * 7919 % count) if count > _ANCHORS else np.arange(count)


def rigid_motions(rest: list[FloatArray], placed: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return rotation (b, 3, 3) and shift (b, 3) [m] that take the points of each body nearest to where they are.

    Parameters
    ----------
    rest, placed : list of (n, 3) float
        The same points of each of b bodies [m].

    References
    ----------
    W. Kabsch, "A solution for the best rotation to relate two sets of vectors", Acta Cryst. A32 (1976) 922,
    doi:10.1107/S0567739476001873.
    """
    middle = np.stack([p.mean(axis=0) for p in rest])
    there = np.stack([p.mean(axis=0) for p in placed])
    spread = [(p - m).T @ (q - t) for p, q, m, t in zip(rest, placed, middle, there, strict=True)]
    u, _, vt = np.linalg.svd(np.stack(spread))
    # a mirror image would fit a flat body as well: keep the determinant at +1
    mirror = np.ones((len(rest), 3))
    mirror[:, 2] = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    rotation = np.einsum("bji,bj,bkj->bik", vt, mirror, u)
    return rotation, there - np.einsum("bij,bj->bi", rotation, middle)


def _add_mesh(arrays: Arrays, k: int, body: Body, least: float) -> dict[str, Any]:
    mesh = body.mesh
    shown = np.flatnonzero(mesh.face_area >= least)
    shown = shown[np.argsort(body.tag[shown], kind="stable")]
    faces = mesh.faces[shown]
    edges = _longest(mesh.vertices, feature_edges(mesh.vertices, mesh.faces))
    used, row = np.unique(np.concatenate([faces.ravel(), edges.ravel()]), return_inverse=True)
    arrays.add(f"m{k}.vertices", mesh.vertices[used], "f4")
    arrays.add(f"m{k}.faces", row[: faces.size].reshape(-1, 3), "u4")
    arrays.add(f"m{k}.edges", row[faces.size :].reshape(-1, 2), "u4")
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
    count = np.diff(first, append=len(tags))
    return [[int(tags[i]), int(i), int(n)] for i, n in zip(first, count, strict=True)]
