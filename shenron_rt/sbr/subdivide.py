"""Triangles cut into equal smaller ones."""

from __future__ import annotations

import numpy as np

from .._typing import FloatArray, IntArray

__all__ = ["subdivided"]


def subdivided(triangles: FloatArray, parts: IntArray) -> tuple[FloatArray, IntArray]:
    """Cut every side of some triangles into equal parts and return the triangles between.

    Parameters
    ----------
    triangles : (n, 3, 3) float
    parts : (n,) int
        Parts a side, at least 1; a triangle becomes that number squared.

    Returns
    -------
    smaller : (m, 3, 3) float
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
        pieces.append(cut.reshape(-1, 3, 3))
        rows.append(np.repeat(row, len(corner)))
    if not pieces:
        return np.zeros((0, 3, 3)), np.zeros(0, dtype=np.int64)
    return np.concatenate(pieces), np.concatenate(rows)


def _grid(count: int) -> FloatArray:
    """Return (count^2, 3, 2) steps along both sides to the corners of the parts."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(count), np.arange(count), indexing="ij"))
    at = np.stack([i, j], axis=1).astype(np.float64)
    upright = at[i + j < count][:, None, :] + np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    turned = at[i + j < count - 1][:, None, :] + np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    return np.concatenate([upright, turned])
