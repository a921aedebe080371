"""Frame transforms of a run: world, ego, sensors and moving bodies at one instant."""

from __future__ import annotations

import functools
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._typing import FloatArray, IntArray
from ..config._base import Placed
from ..config.materials import MaterialTable, load_materials
from ..config.scene import Scene, StaticPart
from ..errors import InputError
from ..frames import Pose
from ..run_source import RunSource
from ..scene.world import Body, World, build_world, load_bodies

__all__ = [
    "EGO", "WORLD", "PlacedBody", "ScenePoses", "Transform", "identity_ego", "mount_transforms", "radar_frame",
    "rigid_fit",
]  # fmt: skip

WORLD, EGO = "world", "ego"
#: A rigid body's vertices follow its pose to rounding; at 10 km from the ego vehicle that is a nanometre [m].
_RIGID_M = 1e-6
#: Vertices of a body that its pose is found from.
_FIT_VERTICES = 256


@dataclass(frozen=True)
class Transform:
    """Pose of the frame ``child`` in the frame ``parent``: p_parent = rotation p_child + origin.

    Parameters
    ----------
    parent, child : str
    rotation : (3, 3) float
    origin : (3,) float
        Metres.
    """

    parent: str
    child: str
    rotation: FloatArray
    origin: FloatArray

    @property
    def quaternion(self) -> FloatArray:
        """(4,) x, y, z, w of the rotation, w >= 0."""
        from scipy.spatial.transform import Rotation

        return np.asarray(Rotation.from_matrix(self.rotation).as_quat(canonical=True), dtype=np.float64)

    def apply(self, points: FloatArray) -> FloatArray:
        """Map (n, 3) points from the child to the parent frame [m]."""
        mapped: FloatArray = points @ self.rotation.T + self.origin
        return mapped

    def then(self, child: Transform) -> Transform:
        """Return the pose of ``child``, given in this one's child frame, in this one's parent frame."""
        origin = self.rotation @ child.origin + self.origin
        return Transform(self.parent, child.child, self.rotation @ child.rotation, origin)


@dataclass(frozen=True, eq=False)
class PlacedBody:
    """A body of the scene, or a part of one that moves by itself, with the name of its frame.

    Parameters
    ----------
    frame : str
        ``body/<name>``, or ``world`` for what does not move.
    label : str
        Unique among the bodies.
    body : Body
    pose : Transform
        At the instant that was asked for.
    faces : (f,) int
        Rows of the body's mesh that this is.
    """

    frame: str
    label: str
    body: Body
    pose: Transform
    faces: IntArray


class ScenePoses:
    """Poses of a scene through :func:`~shenron_rt.scene.world.build_world`, whatever moves its bodies.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    @functools.cached_property
    def _loaded(self) -> tuple[tuple[Body, ...], MaterialTable]:
        return load_bodies(self.scene)  # meshes are read when a body is asked for, the ego vehicle needs none

    def ego(self, time_s: float) -> Transform:
        """Return the ego frame in the world at that scene time."""
        return _ego(self._world(time_s, (), load_materials(self.scene.materials)))

    def bodies(self, time_s: float, *, moving: bool) -> list[PlacedBody]:
        """Return the moving or the static bodies as they stand in the world at that scene time, part by part.

        Raises
        ------
        InputError
            A part that is no rigid copy of its mesh.
        """
        everything, materials = self._loaded
        labels = _labels(everything)
        chosen = [k for k, body in enumerate(everything) if isinstance(body.source, StaticPart) is not moving]
        bodies = tuple(everything[k] for k in chosen)
        world = self._world(time_s, bodies, materials)
        ego = _ego(world)
        placed = []
        for row, (k, body) in enumerate(zip(chosen, bodies, strict=True)):
            seen = world.vertices[world.vertex_start[row] : world.vertex_start[row + 1]]
            for name, faces in _rigid_parts(body):
                label = f"{labels[k]}/{name}" if name else labels[k]
                used = np.unique(body.mesh.faces[faces])
                local = rigid_fit(body.mesh.vertices[used], seen[used], child=f"body/{label}")
                frame = f"body/{label}" if moving else WORLD
                placed.append(PlacedBody(frame, label, body, ego.then(local), faces))
        return placed

    def _world(self, time_s: float, bodies: tuple[Body, ...], materials: MaterialTable) -> World:
        # a sensor at the ego vehicle's origin: the frame of the result is the ego frame
        return build_world(self.scene, Placed(), time_s, bodies, materials)


def _ego(world: World) -> Transform:
    return Transform(WORLD, EGO, world.radar_state.rotation, world.radar_state.origin)


def identity_ego() -> Transform:
    """Return the ego frame of a run that knows no world: it is the world."""
    return Transform(WORLD, EGO, np.eye(3), np.zeros(3))


def _rigid_parts(body: Body) -> list[tuple[str, IntArray]]:
    """Return name and faces of every part of a body that is rigid in itself; the body proper has no name."""
    parts = []
    for number in np.unique(body.face_link).tolist():
        # names of parts may be patterns, "front left [tr]*": numbers keep them apart
        name = re.sub(r"\W+", "_", f"{number} {body.links[number].name}").strip("_") if number else ""
        parts.append((name, np.flatnonzero(body.face_link == number)))
    return parts


def _labels(bodies: Sequence[Body]) -> list[str]:
    """Return a name for each body: its own, else its id; numbered where it occurs again."""
    labels: dict[str, None] = {}
    for body in bodies:
        base = body.source.name or (f"object_{body.object_id}" if body.object_id else "static")
        label, number = base, 2
        while label in labels:
            label, number = f"{base}_{number}", number + 1
        labels[label] = None
    return list(labels)


def rigid_fit(own: FloatArray, seen: FloatArray, *, child: str, parent: str = EGO) -> Transform:
    """Return the rigid motion that takes a body's vertices where they are seen.

    Parameters
    ----------
    own, seen : (n, 3) float
        The same vertices in the body's and in the parent's frame [m].
    child, parent : str
        Names of the frames.

    Raises
    ------
    InputError
        The two differ by more than a rigid motion.

    Notes
    -----
    Kabsch's least squares: with H = sum of own seen^T about the means and H = U S V^T, R = V diag(1, 1, d) U^T,
    d = det(V U^T); exact for bodies in one plane too.

    References
    ----------
    W. Kabsch, Acta Crystallographica A32 (1976) 922, doi:10.1107/S0567739476001873
    """
    rows = np.unique(np.linspace(0, len(own) - 1, _FIT_VERTICES).astype(np.int64))
    a, b = own[rows], seen[rows]
    mean_a, mean_b = a.mean(axis=0), b.mean(axis=0)
    u, _, vt = np.linalg.svd((a - mean_a).T @ (b - mean_b))
    turn = np.diag([1.0, 1.0, float(np.sign(np.linalg.det(vt.T @ u.T)))])
    rotation = vt.T @ turn @ u.T
    found = Transform(parent, child, rotation, mean_b - rotation @ mean_a)
    error = float(np.abs(found.apply(own) - seen).max(initial=0.0))
    if error > _RIGID_M:
        raise InputError(
            f"{child}: its vertices are up to {error:g} m from a rigid copy of its mesh; only rigid ones move"
        )
    return found


def radar_frame(name: str) -> str:
    """Return the name of a radar's frame."""
    return f"radar/{name}"


def mount_transforms(source: RunSource, extra: Sequence[tuple[str, Pose]] = ()) -> list[Transform]:
    """Return the poses of all sensors in the ego frame.

    Parameters
    ----------
    source : RunSource
    extra : sequence of (str, Pose)
        Frames of other sensors: a LiDAR, a recorded radar.
    """
    mounts = [(radar_frame(r.name), r.mount) for r in source.radars]
    return [Transform(EGO, name, pose.rotation, pose.translation) for name, pose in [*mounts, *extra]]
