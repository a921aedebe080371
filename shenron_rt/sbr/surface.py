"""What rays bounce on: a mesh with the normals, the smooth surfaces and the reflectors of its faces."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .._typing import ComplexArray, FloatArray, IntArray
from ..scene.mesh import TaggedMesh
from ..scene.smooth import connected, smooth_groups
from ..tracing.backend import Backend
from ..tracing.caster import RayCaster
from .vectors import dot

__all__ = ["Reflector", "Surface"]

#: How far above its surface a reflected ray starts, as a share of the size of the target: float32 coordinates, which
#: the caster works in, are off by up to 6e-8 of it.
_LIFT = 2e-6
#: How far above a facet's plane its neighbours may rise on a convex body, as a share of the size of the target.
_FLAT = 1e-9


@dataclass(frozen=True)
class Reflector:
    """How a surface reflects.

    Parameters
    ----------
    coefficients : callable or None
        (frequency [Hz], cosine of incidence (n,)) -> (TE, TM), each (n,) complex; None is a perfect conductor.
    roughness_m : float
        RMS height; weakens what is coherent [m].
    """

    coefficients: Callable[[float, FloatArray], tuple[ComplexArray, ComplexArray]] | None = None
    roughness_m: float = 0.0


@dataclass(frozen=True, eq=False)
class Surface:
    """A target.

    Parameters
    ----------
    mesh : TaggedMesh
        In the frame of the target; phases refer to its origin.
    reflectors : sequence of Reflector
    reflector : (f,) int
        Row of ``reflectors`` for each face.
    backend : str
        ``"cuda"``, ``"llvm"`` or ``"scalar"``.
    """

    mesh: TaggedMesh
    reflectors: Sequence[Reflector]
    reflector: IntArray
    backend: Backend

    @functools.cached_property
    def centre(self) -> FloatArray:
        """(3,) middle of the bounding box [m]."""
        return np.asarray(self.mesh.bounds.mean(axis=0))

    @functools.cached_property
    def points(self) -> FloatArray:
        """(v, 3) vertices of faces, from the centre [m]."""
        used = np.zeros(len(self.mesh.vertices), dtype=bool)
        used[self.mesh.faces] = True
        return np.asarray(self.mesh.vertices[used] - self.centre)

    @functools.cached_property
    def radius(self) -> float:
        """Largest distance of a vertex from the centre [m]."""
        return float(np.sqrt(dot(self.points, self.points).max()))

    @functools.cached_property
    def normal(self) -> FloatArray:
        """(f, 3) unit normals, either side."""
        return self.mesh.face_normal

    @functools.cached_property
    def offset(self) -> FloatArray:
        """(f,) normal . p on the plane of each face [m]."""
        return np.asarray(np.einsum("ij,ij->i", self.normal, self.mesh.vertices[self.mesh.faces[:, 0]]))

    @functools.cached_property
    def group(self) -> IntArray:
        """(f,) int64 number of the smooth surface of one reflector that each face belongs to."""
        return smooth_groups(self.mesh, self.reflector)

    @functools.cached_property
    def outward(self) -> int:
        """1 or -1, the sign that turns ``normal`` outwards, where the body is closed and convex; 0 where it is not."""
        a, b = self.mesh.adjacent
        n, normal = self.mesh.n_faces, self.normal
        if 2 * len(a) != 3 * n or connected(a, b, n).any():
            return 0
        middle = self.mesh.vertices[self.mesh.faces].mean(axis=1)
        bend = np.concatenate([dot(normal[a], middle[b] - middle[a]), dot(normal[b], middle[a] - middle[b])])
        for sign in (1, -1):  # a closed surface that bends inwards across every edge is that of a convex body
            if (sign * bend <= _FLAT * self.radius).all():
                return sign
        return 0

    @functools.cached_property
    def corner_normal(self) -> FloatArray:
        """(f, 3, 3) outward unit normals at the corners of a convex body.

        Averaged by area over the faces of the smooth surface that meet there.
        """
        corner, group = self.mesh.corner, self.group
        _, place = np.unique(corner * (int(group.max()) + 1) + group[:, None], return_inverse=True)
        place = place.reshape(-1, 3)
        weight = self.outward * self.normal * self.mesh.face_area[:, None]
        total = [np.bincount(place.ravel(), np.repeat(w, 3)) for w in weight.T]
        normal: FloatArray = np.stack(total, axis=1)
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        return np.asarray(normal[place])

    @functools.cached_property
    def convex(self) -> bool:
        """Whether no facet can hide another: a closed convex body, or one flat face."""
        reach = self.mesh.vertices[self.mesh.faces].reshape(-1, 3) @ self.normal[0] - self.offset[0]
        return self.outward != 0 or bool((np.abs(reach) <= _FLAT * self.radius).all())

    @functools.cached_property
    def caster(self) -> RayCaster:
        """The triangles about the centre, where float32 is finest."""
        return RayCaster(self.mesh.vertices - self.centre, self.mesh.faces, self.backend)

    @property
    def lift(self) -> float:
        """Height above a surface at which a reflected ray starts [m]."""
        return _LIFT * self.radius

    @property
    def conducts(self) -> bool:
        """Whether every face is a smooth perfect conductor."""
        return all(r.coefficients is None and r.roughness_m == 0.0 for r in self.reflectors)
