"""Flat polygons: the exact integral of a linear phase over one, and convex clipping, for many polygons at once.

Written apart from what the solvers use, so that the references do not share their mistakes.
"""

from __future__ import annotations

import numpy as np

from ..._typing import ComplexArray, FloatArray

__all__ = ["clip_convex", "polygon_area", "polygon_transform"]

#: Largest phase [rad] across a polygon below which its integral is its area: the error is this number.
_NO_PHASE = 1e-9


def polygon_area(vertices: FloatArray) -> FloatArray:
    """Return the signed area (...) [m^2] of polygons (..., n, 2) [m]; positive where they run counter-clockwise."""
    x, y = vertices[..., 0], vertices[..., 1]
    # about the first vertex: no cancellation for a small polygon far from the origin
    x, y = x - x[..., :1], y - y[..., :1]
    return np.asarray(0.5 * np.sum(x * np.roll(y, -1, axis=-1) - np.roll(x, -1, axis=-1) * y, axis=-1))


def _sinc_minus_one(y: FloatArray) -> FloatArray:
    """Return sin(y)/y - 1 without cancellation."""
    square = y * y
    # the next term of the series is y^8/362880: below 1e-16 of the first for y < 0.05
    series = -square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0))
    return np.where(np.abs(y) < 0.05, series, np.sinc(y / np.pi) - 1.0)


def polygon_transform(vertices: FloatArray, wave_vector: FloatArray) -> ComplexArray:
    """Return the integral of exp(j w.r) over flat polygons, exactly.

    Parameters
    ----------
    vertices : (..., n, 2) float
        Corners in the polygon's own plane, in order; repeated corners (edges of no length) do no harm. [m]
    wave_vector : (..., 2) float
        w, the gradient of the phase in that plane. [rad/m]

    Returns
    -------
    (...) complex [m^2]
        Negative of it for polygons that run clockwise; the signed area where w = 0.

    Notes
    -----
    Sum over the edges (start p, vector l, middle m) of (w x l) e^{j w.m} sinc(w.l/2)/(j w^2), by Green's theorem with
    (-w_y, w_x) e^{j w.r}/(j w^2). As the edges' (w x l) sum to zero, one is taken off each phasor, which removes the
    cancellation of small w: the relative error is below 1e-12 for every w (measured against moments and quadrature).
    Polygons need not be convex.

    References
    ----------
    .. [1] W. B. Gordon, "Far-field approximations to the Kirchhoff-Helmholtz representations of scattered fields",
       IEEE Trans. Antennas Propag. 23(4), 590-592 (1975).
    """
    edge = np.roll(vertices, -1, axis=-2) - vertices
    middle = vertices + 0.5 * edge
    wx, wy = wave_vector[..., None, 0], wave_vector[..., None, 1]
    across = wx * edge[..., 1] - wy * edge[..., 0]
    phase = wx * middle[..., 0] + wy * middle[..., 1]
    half = 0.5 * (wx * edge[..., 0] + wy * edge[..., 1])
    bend = _sinc_minus_one(half)
    phasor = np.expm1(1j * phase) * (1.0 + bend) + bend
    square = np.sum(wave_vector**2, axis=-1)
    extent = np.max(np.abs(vertices), axis=(-2, -1))
    flat = np.sqrt(square) * extent < _NO_PHASE
    total = np.sum(across * phasor, axis=-1) / (1j * np.where(flat, 1.0, square))
    return np.where(flat, polygon_area(vertices), total)


def _clip_half_plane(polygons: FloatArray, point: FloatArray, along: FloatArray) -> FloatArray:
    """Return convex polygons (m, n, 2) cut to what lies left of a line; rows that need fewer corners repeat one."""
    depth = along[0] * (polygons[..., 1] - point[1]) - along[1] * (polygons[..., 0] - point[0])
    affected = np.nonzero(np.any(depth < 0.0, axis=1))[0]
    if not len(affected):
        return polygons
    # one corner more than before at most; the others get a repeated last corner, an edge of no length
    result = np.concatenate([polygons, polygons[:, -1:]], axis=1)
    result[affected] = _cut(polygons[affected], depth[affected])
    # drop the last column again where every row only repeats its first corner there
    new = np.all(np.any(result[:, -1:] != result[:, [0, -2]], axis=2), axis=1)
    return result if np.any(new) else result[:, :-1]


def _cut(polygons: FloatArray, depth: FloatArray) -> FloatArray:
    """Return convex polygons (m, n, 2) as (m, n + 1, 2), cut to where ``depth`` (m, n) of their corners is positive."""
    m, n = depth.shape
    inside, there = depth >= 0.0, np.roll(depth, -1, axis=1)
    crosses = inside != np.roll(inside, -1, axis=1)
    share = np.where(crosses, depth, 0.0) / np.where(crosses, depth - there, 1.0)
    crossing = polygons + share[..., None] * (np.roll(polygons, -1, axis=1) - polygons)
    keep = np.stack([inside, crosses], axis=-1).reshape(m, 2 * n)
    corners = np.stack([polygons, crossing], axis=2).reshape(m, 2 * n, 2)
    # Every kept corner moves to its rank in its row; ranks beyond the last repeat the first.
    first = corners[np.arange(m), np.argmax(keep, axis=1)]
    result = np.repeat(np.where(np.any(keep, axis=1, keepdims=True), first, 0.0)[:, None, :], n + 1, axis=1)
    row, column = np.nonzero(keep)
    result[row, (np.cumsum(keep, axis=1) - 1)[row, column]] = corners[row, column]
    return result


def clip_convex(polygons: FloatArray, window: FloatArray) -> FloatArray:
    """Return what convex polygons have in common with a convex window (Sutherland and Hodgman, one edge at a time).

    Parameters
    ----------
    polygons : (m, n, 2) float
        Convex polygons of either sense. [m]
    window : (k, 2) float
        Convex polygon, counter-clockwise. [m]

    Returns
    -------
    (m, p, 2) float [m]
        p <= n + k; rows with fewer corners repeat one, an empty row repeats the origin: area and integral are zero.

    References
    ----------
    .. [1] I. E. Sutherland, G. W. Hodgman, "Reentrant polygon clipping", Communications of the ACM 17(1), 32-42 (1974).
    """
    for point, following in zip(window, np.roll(window, -1, axis=0), strict=True):
        polygons = _clip_half_plane(polygons, point, following - point)
    return polygons
