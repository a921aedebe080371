"""Facets as flat polygons over which the path is nearly linear."""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from .._typing import FloatArray, IntArray
from .sight import heights
from .subdivide import clipped, shortened
from .surface import Surface
from .views import Views

__all__ = ["Parts", "facet_parts"]

#: How far the path to a corner of a part of a facet may deviate from linear, in wavelengths; its mean is taken out.
_STRAIGHT = 1.0 / 256.0
#: How near the nearest point of a part is taken to be to a radar at least, in distances of its middle.
_NEAREST = 0.05
#: Parts of all facets: more are slower than cells, and take gigabytes.
_MOST = 1 << 20


@dataclass(frozen=True, eq=False)
class Parts:
    """Triangles, each in the plane of a facet.

    Parameters
    ----------
    surface : Surface
    face : (m,) int
    corners : (m, 3, 6) float
        Where they are [m], and the outward normal of the body there, which only means something on a convex one.
    """

    surface: Surface
    face: IntArray
    corners: FloatArray

    @functools.cached_property
    def middle(self) -> FloatArray:
        """(m, 3) centroids [m]."""
        return np.asarray(self.corners[:, :, :3].mean(axis=1))

    @functools.cached_property
    def along(self) -> FloatArray:
        """(m, 3) unit vectors along the first sides."""
        side = self.corners[:, 1, :3] - self.corners[:, 0, :3]
        return np.asarray(side / np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-300))

    @functools.cached_property
    def across(self) -> FloatArray:
        """(m, 3) unit vectors to the left of them, seen from the end of the facet's normal."""
        return np.cross(self.surface.normal[self.face], self.along)

    @functools.cached_property
    def outline(self) -> FloatArray:
        """(m, 3, 2) corners along these two from the centroids, counter-clockwise [m]."""
        corner = self.corners[:, :, :3] - self.middle[:, None, :]
        return np.stack([np.einsum("nki,ni->nk", corner, a) for a in (self.along, self.across)], axis=2)

    def turned_to(self, views: Views, view: IntArray, rows: IntArray) -> tuple[Parts, IntArray]:
        """Return what of some triangles is turned to radars, and the row of each such piece in them.

        Parameters
        ----------
        views : Views
        view, rows : (n,) int
            Row of ``views``, and the triangle.
        """
        corners = self.corners[rows]
        height = np.stack([heights(views, view, corners[:, k, :3], corners[:, k, 3:]) for k in range(3)], axis=1)
        above, row = clipped(corners, height)
        return Parts(self.surface, self.face[rows[row]], above), row


def facet_parts(surface: Surface, legs: list[Views], wavelength: float) -> Parts | None:
    """Return all facets, cut smaller where waves are spherical; None where that takes too many parts.

    Parameters
    ----------
    surface : Surface
    legs : list of Views
        From where it is lit, and where it is seen.
    wavelength : float
        The shortest [m].
    """
    triangles = surface.mesh.vertices[surface.mesh.faces]
    normal = surface.corner_normal if surface.outward else np.zeros_like(triangles)
    corners = np.concatenate([triangles, normal], axis=2)
    radars = [leg.distance * leg.toward for leg in legs if leg.distance is not None]
    if not radars:
        return Parts(surface, np.arange(len(triangles)), corners)
    from scipy.spatial import cKDTree

    places = cKDTree(np.concatenate(radars))

    def longest(place: FloatArray) -> FloatArray:
        middle = place.mean(axis=1)
        size = np.linalg.norm(place - middle[:, None, :], axis=2).max(axis=1)
        away = places.query(middle)[0]
        nearest = np.maximum(away - size, _NEAREST * away)
        # each leg bends by x^2 / (2 R) at x from the centroid, which no corner is farther from than 2/3 of a side
        return np.asarray(1.5 * np.sqrt(_STRAIGHT * wavelength * nearest))

    cut = shortened(corners, longest, _MOST)
    return None if cut is None else Parts(surface, cut[1], cut[0])
