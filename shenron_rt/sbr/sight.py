"""Which facets a radar sees whole, which not at all, and which in part.

A round body is lit as far as its own normals, not those of its facets, are turned to the light.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .._typing import FloatArray, IntArray, NDArray
from .chain import sees
from .subdivide import shortened
from .surface import Surface
from .vectors import dot
from .views import Views

__all__ = ["HIDDEN", "LIMB", "PARTLY", "WHOLE", "Sight", "heights"]

#: Not seen, seen whole, turned away in part at the limb of a convex body, hidden in part by something else.
HIDDEN, WHOLE, LIMB, PARTLY = 0, 1, 2, 3
#: Facets of a body that is not convex up to which every one is looked at, and rays a view for that, in cells of the
#: lattice: beyond, looking would cost more than what it is for.
_MOST_FACES, _MOST_RAYS = 5000, 4.0
#: Rays a view that are always worth it.
_FEW_RAYS = 4096
#: Longest side of the parts of a facet that are looked at, in what must be noticed: their middles are closer.
_SIDE = 2.0
#: How far from the middle of a facet towards its corners it is looked at.
_INSET = 0.95


class Sight:
    """Looks at every facet of a surface.

    Parameters
    ----------
    surface : Surface
    step : float
        Something as wide as this that hides a facet is noticed [m].
    """

    def __init__(self, surface: Surface, step: float) -> None:
        self._surface = surface
        self._points, self._face = np.zeros((0, 3)), np.zeros(0, dtype=np.int64)
        self.possible = surface.convex
        """Whether it can tell."""
        if not surface.convex and surface.mesh.n_faces <= _MOST_FACES:
            triangles = surface.mesh.vertices[surface.mesh.faces]
            most = int(max(_MOST_RAYS * (2.0 * surface.radius / step) ** 2, _FEW_RAYS))
            cut = shortened(triangles, lambda place: np.full(len(place), _SIDE * step), most)
            if cut is not None:
                self.possible = True
                self._points, self._face = _places(triangles, *cut)

    def blocks(self, views: Views, most: int, parts: int) -> Iterator[tuple[slice, NDArray[np.int8]]]:
        """Yield some views after the other, and (b, f) what they see of every facet.

        ``most`` bounds b times the facets, rays and parts of facets.
        """
        size = max(1, most // max(3 * self._surface.mesh.n_faces, len(self._face), parts))
        for start in range(0, len(views), size):
            rows = slice(start, min(start + size, len(views)))
            yield rows, self.of(views.select(rows))

    def of(self, views: Views) -> NDArray[np.int8]:
        """Return (a, f) :data:`HIDDEN`, :data:`WHOLE`, :data:`LIMB` or :data:`PARTLY`."""
        if self._surface.convex:
            return self._of_convex(views)
        surface, n = self._surface, len(self._face)
        view = np.repeat(np.arange(len(views)), n)
        points = np.tile(self._points, (len(views), 1))
        normal = np.tile(surface.normal[self._face], (len(views), 1))
        normal *= np.where(dot(views.seen_from(points, view)[0], normal) < 0.0, -1.0, 1.0)[:, None]
        seen = sees(surface, views, points + surface.lift * normal, normal, view).reshape(len(views), n)
        first = np.flatnonzero(np.diff(self._face, prepend=-1))
        count = np.add.reduceat(seen, first, axis=1, dtype=np.int64)
        whole = count == np.diff(np.append(first, n))
        return np.where(whole, WHOLE, np.where(count == 0, HIDDEN, PARTLY)).astype(np.int8)

    def _of_convex(self, views: Views) -> NDArray[np.int8]:
        """Return what a convex body shows: the facets with a corner that is turned to the radar; of a flat one, all."""
        surface = self._surface
        if surface.outward == 0:
            return np.full((len(views), surface.mesh.n_faces), WHOLE, dtype=np.int8)
        corners, normal = surface.mesh.vertices[surface.mesh.faces], surface.corner_normal
        view = np.arange(len(views))[:, None]
        up = np.stack([heights(views, view, corners[:, k], normal[:, k]) for k in range(3)]) > 0.0
        return np.where(up.all(axis=0), WHOLE, np.where(up.any(axis=0), LIMB, HIDDEN)).astype(np.int8)


def heights(views: Views, view: IntArray, points: FloatArray, normal: FloatArray) -> FloatArray:
    """Return how far normals at points are turned to radars, in any unit; negative is away.

    Parameters
    ----------
    views : Views
    view : (a, 1) or (n,) int
        For every point, or one each.
    points, normal : (n, 3) float
    """
    toward = views.toward[view]
    height = toward[..., 0] * normal[:, 0] + toward[..., 1] * normal[:, 1] + toward[..., 2] * normal[:, 2]
    if views.distance is not None:
        height = views.distance * height - dot(points, normal)
    return np.asarray(height)


def _places(triangles: FloatArray, parts: FloatArray, face: IntArray) -> tuple[FloatArray, IntArray]:
    """Return points on triangles and the row of each, sorted by it: middles of their parts, and near their corners."""
    middle = triangles.mean(axis=1, keepdims=True)
    corners = middle + _INSET * (triangles - middle)
    points = np.concatenate([parts.mean(axis=1), corners.reshape(-1, 3)])
    row = np.concatenate([face, np.repeat(np.arange(len(triangles)), 3)])
    order = np.argsort(row, kind="stable")
    return points[order], row[order]
