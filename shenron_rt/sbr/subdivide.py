"""Triangles cut into equal smaller ones."""

from __future__ import annotations

import numpy as np

from .._typing import FloatArray, IntArray

__all__ = ["subdivided"]


def subdivided(triangles: FloatArray, parts: IntArray) -> tuple[FloatArray, IntArray]:
    """Cut every side of some triangles into equal parts and return the triangles between.

    Parameters
    ----------
    triangles : (n, 3, d) float
        Anything that is linear over a triangle: places, normals.
    parts : (n,) int
        Parts a side, at least 1; a triangle becomes that number squared.

    Returns
    -------
    smaller : (m, 3, d) float
        Wound as the given ones.
    row : (m,) int
        The triangle that each is part of.
    """
    pieces, rows = [], []
    for count in np.unique(parts).tolist():
        row = np.flatnonzero(parts == count)
        a = triangles[row, 0]
        u, v = (triangles[row, 1] - a) / count, (triangles[row, 2] - a) / count
        corner = _grid(count)
        cut = a[:, None, None] + corner[None, :, :, :1] * u[:, None, None] + corner[None, :, :, 1:] * v[:, None, None]
        pieces.append(cut.reshape(-1, 3, triangles.shape[2]))
        rows.append(np.repeat(row, len(corner)))
    if not pieces:
        return triangles, np.zeros(0, dtype=np.int64)
    return np.concatenate(pieces), np.concatenate(rows)


def _grid(count: int) -> FloatArray:
    """Return (count^2, 3, 2) steps along both sides to the corners of the parts."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(count), np.arange(count), indexing="ij"))
    at = np.stack([i, j], axis=1).astype(np.float64)
    upright = at[i + j < count][:, None, :] + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    turned = at[i + j < count - 1][:, None, :] + np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    return np.concatenate([upright, turned])


def clipped(triangles: FloatArray, height: FloatArray) -> tuple[FloatArray, IntArray]:
    """Cut off what lies below zero.

    Parameters
    ----------
    triangles : (n, 3, d) float
        Anything that is linear over a triangle: places, normals.
    height : (n, 3) float
        At the corners; linear too.

    Returns
    -------
    above : (m, 3, d) float
        Wound as the given ones.
    row : (m,) int
        The triangle that each is part of.
    """
    up = height > 0.0
    count = up.sum(axis=1)
    whole, one, two = (np.flatnonzero(count == c) for c in (3, 1, 2))
    pieces, rows = [triangles[whole]], [whole]
    for row, lone in ((one, up), (two, ~up)):
        first = lone[row].argmax(axis=1)
        turn = (first[:, None] + np.arange(3)) % 3  # the corner that is alone on its side first
        corner = np.take_along_axis(triangles[row], turn[:, :, None], axis=1)
        level = np.take_along_axis(height[row], turn, axis=1)
        share = level[:, :1] / (level[:, :1] - level[:, 1:])
        cut = corner[:, :1] + share[:, :, None] * (corner[:, 1:] - corner[:, :1])
        if row is one:
            pieces.append(np.concatenate([corner[:, :1], cut], axis=1))
            rows.append(row)
        else:
            pieces.append(np.stack([cut[:, 0], corner[:, 1], corner[:, 2]], axis=1))
            pieces.append(np.stack([cut[:, 0], corner[:, 2], cut[:, 1]], axis=1))
            rows += [row, row]
    return np.concatenate(pieces), np.concatenate(rows)
