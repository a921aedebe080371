"""The scene of a page: each mesh once, and where it stands in every frame."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._typing import FloatArray, IntArray
from ..config.materials import MaterialTable, load_materials
from ..config.scene import Scene
from ..errors import ShenronError
from ..plot.top_view import feature_edges
from ..run_source import RunRadar
from ..scene.bodies import Body, load_bodies
from ..scene.world import build_world
from .arrays import Arrays

__all__ = ["Middles", "SceneMeshes"]

#: Edges of a link that a page draws.
_MOST_EDGES = 50_000
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
        Of each mesh: ``faces`` drawn, ``all_faces``, ``runs`` ([link, tag, first face, faces] of one link and tag),
        ``edge_runs`` ([link, first edge, edges]).
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
            Faces of all meshes together; the smallest are left out where there are more, of equal ones some here and
            there. Edges are those of all faces.
        """
        bodies, materials = _loaded(scene)
        distinct: dict[tuple[int, bytes], Body] = {}
        for body in bodies:  # ready-made shapes of one kind share a mesh
            distinct.setdefault((id(body.mesh), body.tag.tobytes()), body)
        shown = _largest([b.mesh.face_area for b in distinct.values()], most_faces)
        records = [_add_mesh(arrays, k, *each) for k, each in enumerate(zip(distinct.values(), shown, strict=True))]
        order = {key: k for k, key in enumerate(distinct)}
        mesh_of = tuple(order[id(b.mesh), b.tag.tobytes()] for b in bodies)
        return cls(scene, bodies, materials, mesh_of, records)

    def add_poses(self, arrays: Arrays, prefix: str, radar: RunRadar) -> tuple[list[dict[str, Any]], Middles]:
        """Add where bodies and radar stand in every frame; return the bodies, and the middles of those with an id.

        Parameters
        ----------
        arrays : Arrays
            Gets ``<prefix>.poses``, (links, frames, 12) float32: rotation (9) and origin (3) of links in the world,
            those of a body from its row ``pose`` on, and ``<prefix>.radar``, (frames, 15): those of the radar, and its
            velocity (3).
        prefix : str
        radar : RunRadar
        """
        mount = self.scene.radar(radar.name)
        first = np.concatenate([[0], np.cumsum([len(b.links) for b in self.bodies])]).astype(np.int64)
        poses = np.zeros((first[-1], len(radar.frames), 12))
        eyes = np.zeros((len(radar.frames), 15))
        middles: dict[int, list[FloatArray]] = {b.object_id: [] for b in self.bodies if b.object_id}
        for k, frame in enumerate(radar.frames):
            world = build_world(self.scene, mount, frame.mid_s, self.bodies, self.materials)
            eye = world.radar_state
            eyes[k] = np.concatenate([eye.rotation.ravel(), eye.origin, eye.velocity])
            if not self.bodies:
                continue
            poses[:, k, :9] = (eye.rotation @ world.link_rotation).reshape(-1, 9)
            poses[:, k, 9:] = world.link_origin @ eye.rotation.T + eye.origin
            low = np.minimum.reduceat(world.vertices, world.vertex_start[:-1], axis=0)
            high = np.maximum.reduceat(world.vertices, world.vertex_start[:-1], axis=0)
            for body, middle in zip(self.bodies, (low + high) / 2, strict=True):
                if body.object_id:
                    middles[body.object_id].append(middle)
        arrays.add(f"{prefix}.poses", poses, "f4")
        arrays.add(f"{prefix}.radar", eyes, "f4")
        moves = np.ptp(poses[first[:-1]], axis=1).max(axis=1, initial=0.0) > _STANDS_M
        records = [
            {"mesh": m, "pose": int(row), "id": b.object_id, "name": b.source.name, "moves": bool(moving)}
            for b, m, row, moving in zip(self.bodies, self.mesh_of, first[:-1], moves, strict=True)
        ]
        # several bodies of one id have no one middle
        return records, {i: np.stack(m) for i, m in middles.items() if len(m) == len(radar.frames)}


def _loaded(scene: Scene) -> tuple[tuple[Body, ...], MaterialTable]:
    try:
        return load_bodies(scene)
    except ShenronError as error:
        _log.warning("the page has no meshes: %s", error)
        return (), load_materials("automotive")


def _largest(areas: Sequence[FloatArray], most: int) -> list[IntArray]:
    """Return the rows of the largest faces of each mesh, ``most`` of all together."""
    area = np.concatenate([np.zeros(0), *areas])
    if len(area) <= most:
        return [np.arange(len(a)) for a in areas]
    # a fine grid has many faces of one size: golden steps take some of them everywhere, not all of one side
    spread = np.arange(len(area)) * ((np.sqrt(5) - 1) / 2) % 1.0
    kept = np.zeros(len(area), dtype=bool)
    kept[np.lexsort((spread, -area))[:most]] = True
    return [np.flatnonzero(part) for part in np.split(kept, np.cumsum([len(a) for a in areas])[:-1])]


def _add_mesh(arrays: Arrays, k: int, body: Body, shown: IntArray) -> dict[str, Any]:
    mesh = body.mesh
    shown = shown[np.lexsort((body.tag[shown], body.face_link[shown]))]
    faces = mesh.faces[shown]
    edges = [_longest(mesh.vertices, _edges(body, link)) for link in range(len(body.links))]
    used, row = np.unique(np.concatenate([faces.ravel(), *(e.ravel() for e in edges)]), return_inverse=True)
    arrays.add(f"m{k}.vertices", mesh.vertices[used], "f4")
    arrays.add(f"m{k}.faces", row[: faces.size].reshape(-1, 3), "u4")
    arrays.add(f"m{k}.edges", row[faces.size :].reshape(-1, 2), "u4")
    return {
        "faces": len(shown),
        "all_faces": mesh.n_faces,
        "runs": _runs(np.column_stack([body.face_link[shown], body.tag[shown]])),
        "edge_runs": _runs(np.repeat(np.arange(len(edges)), [len(e) for e in edges])[:, None]),
    }


def _edges(body: Body, link: int) -> IntArray:
    """Return the feature edges of one link, which never run from one that turns to one that does not."""
    return feature_edges(body.mesh.vertices, body.mesh.faces[body.face_link == link])


def _longest(vertices: FloatArray, edges: IntArray) -> IntArray:
    """Return the longest edges, as many as are drawn of a mesh."""
    if len(edges) <= _MOST_EDGES:
        return edges
    length = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    return edges[np.argpartition(-length, _MOST_EDGES)[:_MOST_EDGES]]


def _runs(keys: IntArray) -> list[list[int]]:
    """Return [key ..., first, count] of each run of equal (n, k) rows."""
    if not len(keys):
        return []
    new = np.any(np.diff(keys.astype(np.int64), axis=0) != 0, axis=1)
    first = np.concatenate([[0], np.flatnonzero(new) + 1])
    count = np.diff(first, append=len(keys))
    return [[*map(int, keys[i]), int(i), int(n)] for i, n in zip(first, count, strict=True)]
