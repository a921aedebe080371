"""Polygons to triangles."""

from __future__ import annotations

import numpy as np

from ..._typing import IntArray

__all__ = ["fan"]


def fan(index: IntArray, count: IntArray) -> tuple[IntArray, IntArray]:
    """Split polygons into fans around their first corner.

    Parameters
    ----------
    index : (sum of count,) int64
        Vertex of each corner, polygon after polygon.
    count : (n,) int64
        Corners of each polygon, at least 3.

    Returns
    -------
    triangles : (t, 3) int64
    source : (t,) int64
        The polygon each triangle came from.
    """
    first = np.cumsum(count) - count
    triangles = count - 2
    source = np.repeat(np.arange(len(count)), triangles)
    step = np.arange(len(source)) - np.repeat(np.cumsum(triangles) - triangles, triangles)
    start = first[source]
    return np.stack([index[start], index[start + step + 1], index[start + step + 2]], axis=1), source
