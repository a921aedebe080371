"""Nearest hits of rays, by Mitsuba; everything metric is computed from the triangle in float64."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np

from .._typing import FloatArray, IntArray, NDArray
from .backend import Backend, use_backend

__all__ = ["RayCaster"]

#: Rays handed to Mitsuba at a time; bounds memory.
_BLOCK = 1 << 20


class RayCaster:
    """A set of triangles that rays can be cast at.

    Parameters
    ----------
    vertices : (v, 3) float
        Relative to the radar or the middle of a target, so that float32 keeps its precision near it [m].
    faces : (f, 3) int
    backend : str
    """

    #: Rays that this process has cast so far: what a trial of a sweep counts its cost by.
    rays_cast: ClassVar[int] = 0
    #: Mitsuba scenes that this process has made so far; moving vertices makes none.
    scenes_made: ClassVar[int] = 0

    def __init__(self, vertices: FloatArray, faces: IntArray, backend: Backend) -> None:
        self.backend = backend
        self.n_faces = len(faces)
        self._scene: Any = None
        self._parameters: Any = None
        if self.n_faces:
            with use_backend(backend) as mi:
                mesh = mi.Mesh("world", len(vertices), len(faces))
                parameters = mi.traverse(mesh)
                parameters["faces"] = np.ascontiguousarray(faces, dtype=np.uint32).ravel()
                parameters["vertex_positions"] = _flat(vertices)
                parameters.update()
                self._scene = mi.load_dict({"type": "scene", "world": mesh})
                self._parameters = mi.traverse(self._scene)
            RayCaster.scenes_made += 1

    def move(self, vertices: FloatArray) -> None:
        """Put the vertices elsewhere; scene, triangles and kernels stay, their search tree is fitted anew.

        Parameters
        ----------
        vertices : (v, 3) float
            As many as before [m].
        """
        if self._scene is None:
            return
        with use_backend(self.backend):
            self._parameters["world.vertex_positions"] = _flat(vertices)
            self._parameters.update()

    def cast(
        self, directions: NDArray[np.float32], origins: NDArray[np.float32] | None = None, *, coherent: bool = False
    ) -> IntArray:
        """Return (n,) int32 row of the nearest face along each direction, -1 where nothing is hit.

        Parameters
        ----------
        directions : (3, n) float32
            Unit vectors, component by component.
        origins : (3, n) or (3, 1) float32, optional
            Where each ray starts, or all do; default: at the origin [m].
        coherent : bool
            Whether neighbours in the list are neighbours in space, without gaps: takes half the time. Embree misses
            faces where they are not.
        """
        n = directions.shape[1]
        RayCaster.rays_cast += n
        if self._scene is None or n == 0:
            return np.full(n, -1, dtype=np.int32)
        with use_backend(self.backend) as mi:
            run = self._one_by_one if self.backend == "scalar" else self._at_once
            blocks = []
            for i in range(0, n, _BLOCK):
                part = slice(i, i + _BLOCK)
                start = origins if origins is None or origins.shape[1] == 1 else origins[:, part]
                blocks.append(run(mi, directions[:, part], start, coherent))
        return np.concatenate(blocks)

    def _at_once(self, mi: Any, d: NDArray[np.float32], o: NDArray[np.float32] | None, coherent: bool) -> IntArray:
        import drjit as dr

        def vectors(rows: NDArray[np.float32]) -> Any:
            return (mi.Float(np.ascontiguousarray(c)) for c in rows)

        # arrays of length 1 and not literals: another place of the eye must not need another kernel
        start = mi.Point3f(0, 0, 0) if o is None else mi.Point3f(*vectors(o))
        ray = mi.Ray3f(start, mi.Vector3f(*vectors(d)))
        hit = self._scene.ray_intersect_preliminary(ray, coherent=coherent)
        prim = dr.select(hit.is_valid(), mi.Int(hit.prim_index), mi.Int(-1))
        return np.asarray(prim.numpy(), dtype=np.int32)

    def _one_by_one(self, mi: Any, d: NDArray[np.float32], o: NDArray[np.float32] | None, coherent: bool) -> IntArray:
        cast, Ray, Point = self._scene.ray_intersect_preliminary, mi.Ray3f, mi.Point3f
        starts: Iterable[Any]
        if o is None or o.shape[1] == 1:
            starts = itertools.repeat(Point(0, 0, 0) if o is None else Point(o[:, 0].tolist()))
        else:
            starts = map(Point, o.T.tolist())
        hits = (cast(Ray(start, direction), coherent) for start, direction in zip(starts, d.T.tolist(), strict=False))
        return np.fromiter((h.prim_index if h.is_valid() else -1 for h in hits), np.int32, d.shape[1])


def _flat(vertices: FloatArray) -> NDArray[np.float32]:
    return np.ascontiguousarray(vertices, dtype=np.float32).ravel()
