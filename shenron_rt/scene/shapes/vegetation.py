"""A broad-leaved tree: a wooden trunk with branches under a crown of leafy clumps."""

from __future__ import annotations

import numpy as np

from ..._typing import FloatArray
from ...tags import SemanticTag
from ._piece import Piece, ellipsoid, join, tube

__all__ = ["tree"]

_CLUMPS = 14
_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
_CLUMP_FREQUENCY = 4


def tree(h: float = 8.0, crown: float | None = None) -> list[Piece]:
    """Return a tree of height ``h`` with a crown of diameter ``crown`` (0.6 h by default) [m], about 5 k triangles.

    The trunk stands on z = 0 at the origin, the crown begins at 0.3 h. It is the same tree every time.
    """
    width = 0.6 * h if crown is None else crown
    base = 0.3 * h
    stem = np.stack([np.zeros(9), np.zeros(9), np.linspace(0.0, 0.75 * h, 9)], axis=1)
    thick = 0.022 * h * (1.0 - 0.75 * np.linspace(0.0, 1.0, 9)) * np.array([1.25, *[1.0] * 8])
    wood = [tube(stem, thick, 16)]
    centres, size = _clumps(h, width, base)
    for centre in centres[::3]:
        foot = np.array([0.0, 0.0, base + 0.3 * (centre[2] - base)])
        bend = foot + np.linspace(0.0, 1.0, 5)[:, None] * (centre - foot)
        wood.append(tube(bend, np.linspace(0.008, 0.003, 5) * h, 8))
    leaves = [ellipsoid(size, _CLUMP_FREQUENCY, centre) for centre in centres]
    return [
        Piece("trunk", "trunk", SemanticTag.Vegetation, *join(*wood)),
        Piece("crown", "vegetation", SemanticTag.Vegetation, *join(*leaves)),
    ]


def _clumps(h: float, width: float, base: float) -> tuple[FloatArray, FloatArray]:
    """Return the centres (n, 3) and the common semi-axes (3,) of the clumps [m]: a spiral round one heart."""
    size = np.array([0.24 * width, 0.24 * width, 0.17 * (h - base)])
    k = np.arange(_CLUMPS)
    up = 1.0 - 2.0 * (k + 0.5) / _CLUMPS
    around = k * _GOLDEN_ANGLE
    out = np.sqrt(1.0 - up**2)
    # Clumps touch the ellipsoid of the whole crown from inside, so that the tree keeps its height and width.
    reach = np.array([width / 2.0, width / 2.0, (h - base) / 2.0]) - size
    direction = np.stack([out * np.cos(around), out * np.sin(around), up], axis=1)
    direction[0] = [0.0, 0.0, 1.0]
    middle = np.array([0.0, 0.0, (h + base) / 2.0])
    return np.concatenate([middle + direction * reach, middle[None]]), size
