"""A scene's geometry at one instant, in the frame of one radar."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._typing import FloatArray, IntArray, NDArray
from ..config._base import Placed
from ..config.materials import MaterialTable
from ..config.scene import Scene
from .bodies import Body, load_bodies, source_mesh
from .motion import BodyState
from .motion_of import ego_state, state_of
from .odometer import ride_of

__all__ = ["Body", "World", "build_world", "load_bodies", "source_mesh"]


@dataclass(frozen=True, eq=False)
class World:
    """All triangles in the frame of one radar at one instant; rows of faces run body after body.

    Parameters
    ----------
    vertices : (v, 3) float64
        Radar frame [m].
    faces : (f, 3) int32
    face_normal : (f, 3) float64
        Unit normals, either side.
    face_offset : (f,) float64
        normal . p on the face's plane [m].
    face_body : (f,) int32
    face_link : (f,) int32
        Row of ``drift`` and ``turn``: the rigid part that each face belongs to.
    face_tag : (f,) uint8
    face_material : (f,) uint16
    face_plane : (f,) int32
        Equal for coplanar faces of one body and one material.
    face_patch : (f,) float
        Area of all faces of that plane [m^2].
    bodies : tuple of Body
    vertex_start : (b + 1,) int64
        Where each body's vertices begin.
    drift : (l, 3) float
        A point p of link l moves at drift[l] + turn[l] x p relative to the radar [m/s].
    turn : (l, 3) float
        [rad/s].
    link_rotation : (l, 3, 3) float
        From the frame of a link's mesh to the radar's.
    link_origin : (l, 3) float
        [m].
    materials : MaterialTable
    radar_state : BodyState
        The radar in the world frame.
    """

    vertices: FloatArray
    faces: IntArray
    face_normal: FloatArray
    face_offset: FloatArray
    face_body: IntArray
    face_link: IntArray
    face_tag: IntArray
    face_material: IntArray
    face_plane: IntArray
    face_patch: FloatArray
    bodies: tuple[Body, ...]
    vertex_start: IntArray
    drift: FloatArray
    turn: FloatArray
    link_rotation: FloatArray
    link_origin: FloatArray
    materials: MaterialTable
    radar_state: BodyState

    @functools.cached_property
    def face_bend(self) -> FloatArray:
        """(f,) mean angle between each face and those beside it [rad]."""
        return _stack([b.bend for b in self.bodies], (0,), np.float64)

    def velocity_of(self, face: IntArray, point: FloatArray) -> FloatArray:
        """Return the velocity of points (..., 3) on faces (...) relative to the radar [m/s]."""
        link = self.face_link[face]
        velocity = self.drift[link]
        return np.asarray(velocity + np.cross(self.turn[link], point)) if np.any(self.turn) else velocity

    @property
    def object_id(self) -> IntArray:
        """(b,) uint32 id of each body."""
        return np.array([b.object_id for b in self.bodies], dtype=np.uint32)


@dataclass(frozen=True, eq=False)
class _Stacked:
    """What does not change from frame to frame: the rows of all bodies, one after the other."""

    faces: IntArray
    face_body: IntArray
    face_link: IntArray
    face_tag: IntArray
    face_material: IntArray
    face_plane: IntArray
    face_patch: FloatArray
    vertex_start: IntArray


@functools.lru_cache(maxsize=4)
def _stacked(bodies: tuple[Body, ...]) -> _Stacked:
    start = np.concatenate([[0], np.cumsum([len(b.mesh.vertices) for b in bodies])]).astype(np.int64)
    first_plane = np.cumsum([0, *(int(b.plane.max(initial=-1)) + 1 for b in bodies)])
    first_link = np.cumsum([0, *(len(b.links) for b in bodies)])
    counts = [len(b.mesh.faces) for b in bodies]
    numbered = list(zip(bodies, start[:-1], first_plane[:-1], first_link[:-1], strict=True))
    return _Stacked(
        faces=_stack([b.mesh.faces + int(s) for b, s, _, _ in numbered], (0, 3), np.int32),
        face_body=np.repeat(np.arange(len(bodies), dtype=np.int32), counts),
        face_link=_stack([b.face_link + int(k) for b, _, _, k in numbered], (0,), np.int32),
        face_tag=_stack([b.tag for b in bodies], (0,), np.uint8),
        face_material=_stack([b.material for b in bodies], (0,), np.uint16),
        face_plane=_stack([b.plane + int(p) for b, _, p, _ in numbered], (0,), np.int32),
        face_patch=_stack([b.patch for b in bodies], (0,), np.float64),
        vertex_start=start,
    )


def build_world(scene: Scene, radar: Placed, time: float, bodies: tuple[Body, ...], materials: MaterialTable) -> World:
    """Place every body as it stands at ``time``, as seen from ``radar``.

    Parameters
    ----------
    scene : Scene
    radar : RadarMount or LidarMount
        Any sensor with a pose in the ego frame.
    time : float
        Scene seconds.
    bodies, materials
        From :func:`load_bodies`.

    Notes
    -----
    Coordinates are taken relative to the radar in float64 before any cast to float32: one float32 ulp at 1 km is 60 um,
    a tenth of a radian of 77 GHz phase.
    """
    eye = ego_state(scene, time).mounted(radar.pose)
    fixed = _stacked(bodies)
    placed = [_placed(scene, body, time, eye) for body in bodies]
    points = _stack([p.vertices for p in placed], (0, 3), np.float64)
    normal = _stack([p.normals for p in placed], (0, 3), np.float64)
    return World(
        vertices=points,
        faces=fixed.faces,
        face_normal=normal,
        face_offset=np.einsum("ij,ij->i", normal, points[fixed.faces[:, 0]]),
        face_body=fixed.face_body,
        face_link=fixed.face_link,
        face_tag=fixed.face_tag,
        face_material=fixed.face_material,
        face_plane=fixed.face_plane,
        face_patch=fixed.face_patch,
        bodies=bodies,
        vertex_start=fixed.vertex_start,
        drift=_stack([p.drift for p in placed], (0, 3), np.float64),
        turn=_stack([p.turn for p in placed], (0, 3), np.float64),
        link_rotation=_stack([p.rotation for p in placed], (0, 3, 3), np.float64),
        link_origin=_stack([p.origin for p in placed], (0, 3), np.float64),
        materials=materials,
        radar_state=eye,
    )


@dataclass(frozen=True, eq=False)
class _Placed:
    """A body in the frame of the radar: rows of its vertices and faces, and of its links."""

    vertices: FloatArray
    normals: FloatArray
    drift: FloatArray
    turn: FloatArray
    rotation: FloatArray
    origin: FloatArray


def _placed(scene: Scene, body: Body, time: float, eye: BodyState) -> _Placed:
    """Return a body at ``time`` as seen from ``eye``."""
    state = state_of(body.source, scene.folder, time)
    states, turned, moved = [state], [np.eye(3)], [np.zeros(3)]
    if len(body.links) > 1:
        ride = ride_of(body.source, scene.folder, time)
        for link in body.links[1:]:
            if link.motion is not None:
                own = link.motion.at(ride)
                states.append(state.carrying(own))
                turned.append(own.rotation)
                moved.append(own.origin)
    to_radar = eye.rotation.T @ state.rotation
    rotation = to_radar @ np.stack(turned)
    origin = np.stack(moved) @ to_radar.T + eye.rotation.T @ (state.origin - eye.origin)
    motion = [relative_motion(s, eye) for s in states]
    return _Placed(
        _moved(body.mesh.vertices, rotation, body.vertex_link) + origin[body.vertex_link],
        _moved(body.mesh.face_normal, rotation, body.face_link),
        np.stack([drift for drift, _ in motion]),
        np.stack([turn for _, turn in motion]),
        rotation,
        origin,
    )


def _moved(rows: FloatArray, rotation: FloatArray, link: IntArray) -> FloatArray:
    """Return (n, 3) rows turned by the rotation of their link."""
    if len(rotation) == 1:
        return np.asarray(rows @ rotation[0].T)
    return np.asarray(np.einsum("nij,nj->ni", rotation[link], rows))


def _stack(items: list[NDArray[Any]], empty: tuple[int, ...], dtype: type[np.generic]) -> NDArray[Any]:
    return np.concatenate(items).astype(dtype, copy=False) if items else np.zeros(empty, dtype)


def relative_motion(state: BodyState, eye: BodyState) -> tuple[FloatArray, FloatArray]:
    """Return drift [m/s] and turn [rad/s] so that a body's point p moves at drift + turn x p in the radar's frame.

    The frame turns with the radar, so that p(t) = p + V t follows the point as the radar sees it; turning of the radar
    does not change any range rate.
    """
    drift = state.velocity + np.cross(state.spin, eye.origin - state.origin) - eye.velocity
    return eye.rotation.T @ drift, eye.rotation.T @ (state.spin - eye.spin)
