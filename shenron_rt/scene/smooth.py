"""Smooth surfaces of a mesh: faces that meet at small angles belong together."""

from __future__ import annotations

import numpy as np

from .._typing import IntArray
from .mesh import TaggedMesh

__all__ = ["SMOOTH_ANGLE", "connected", "smooth_groups"]

#: Faces that meet at less than this belong to one smooth surface: facets of a round body do, sides of a box do not.
SMOOTH_ANGLE = np.radians(30.0)


def connected(a: IntArray, b: IntArray, n: int) -> IntArray:
    """Return (n,) numbers, equal for faces that hang together by the pairs a, b."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def smooth_groups(mesh: TaggedMesh, kind: IntArray | None = None, below: float = SMOOTH_ANGLE) -> IntArray:
    """Return (f,) numbers, equal for faces connected over edges at which the surface bends by less than an angle.

    Parameters
    ----------
    mesh : TaggedMesh
    kind : (f,) int, optional
        Faces of different kinds are never in one group.
    below : float
        [rad].
    """
    a, b = mesh.adjacent
    bend = np.abs(np.einsum("ij,ij->i", mesh.face_normal[a], mesh.face_normal[b]))
    joined = bend >= np.cos(below)
    if kind is not None:
        joined &= kind[a] == kind[b]
    return connected(a[joined], b[joined], mesh.n_faces)
