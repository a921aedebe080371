"""Cells of the lattice of rays: their corners, and how they are cut in four."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._typing import BoolArray, FloatArray, IntArray
from .surface import Surface
from .views import Views

__all__ = ["Cells", "Lattice", "covering"]

#: Largest number that is looked up in a table (of 5 bytes each) and not found by sorting.
_TABLE = 1 << 23
#: Vertices of a target up to which cells are refined at them.
_MOST_TIPS = 256
#: Corners of a cell, in order around it (u to the right, v up).
_CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


@dataclass(frozen=True, eq=False)
class Lattice:
    """Square lattices in the planes across the views, one for each.

    Parameters
    ----------
    low : (a, 2) float
        Lower left corner, along H and V from the centre of the target [m].
    step : float
        Side of a cell of level 0 [m].
    tips : (a, t, 2) float
        Where vertices of the target appear [m]; none on targets with many.
    """

    low: FloatArray
    step: float
    tips: FloatArray

    def points(self, view: IntArray, ij: IntArray, level: int) -> tuple[FloatArray, FloatArray]:
        """Return (n,) coordinates of lattice points of a level [m]."""
        size = self.step / 2**level
        low = self.low[view]
        return low[:, 0] + ij[:, 0] * size, low[:, 1] + ij[:, 1] * size

    def holds_tip(self, cells: Cells) -> BoolArray:
        """Return (n,) whether a vertex appears in a cell: no corner of it need see the tip of a sharp triangle."""
        if not self.tips.size or not len(cells):
            return np.zeros(len(cells), dtype=bool)
        ij = np.floor((self.tips - self.low[:, None, :]) / (self.step / 2**cells.level)).astype(np.int64)
        low = cells.ij.min(axis=0)
        width, height = (cells.ij.max(axis=0) - low + 1).tolist()
        inside = ((ij >= low) & (ij < low + np.array([width, height]))).all(axis=2)
        view = np.broadcast_to(np.arange(len(self.low))[:, None], inside.shape)[inside]
        at, own = ij[inside] - low, cells.ij - low
        tips = (view * height + at[:, 1]) * width + at[:, 0]
        return np.isin((cells.view.astype(np.int64) * height + own[:, 1]) * width + own[:, 0], tips)


@dataclass(frozen=True, eq=False)
class Cells:
    """Some cells of one level.

    Parameters
    ----------
    level : int
        Their side is the lattice's step over 2^level.
    view : (n,) int
    ij : (n, 2) int
        Column and row of the lower left corner, in sides of this level.
    done : (n,) int
        Bounces that coarser cells have integrated already.
    """

    level: int
    view: IntArray
    ij: IntArray
    done: IntArray

    def __len__(self) -> int:
        return len(self.view)

    def select(self, rows: IntArray) -> Cells:
        """Return some of the cells."""
        return Cells(self.level, self.view[rows], self.ij[rows], self.done[rows])

    def quartered(self) -> Cells:
        """Return the four cells of the next level in each."""
        n = len(self)
        ij = (2 * self.ij[:, None, :] + _CORNERS).reshape(4 * n, 2)
        return Cells(self.level + 1, np.repeat(self.view, 4), ij, np.repeat(self.done, 4))

    def corners(self) -> tuple[IntArray, IntArray, IntArray]:
        """Return the lattice points they stand on.

        Returns
        -------
        view : (m,) int
        ij : (m, 2) int
            Each point once.
        corner : (n, 4) int
            Points of every cell, in order around it.
        """
        column, row = self.ij.T
        left, lowest = int(column.min(initial=0)), int(row.min(initial=0))
        width, height = int(column.max(initial=0)) - left + 2, int(row.max(initial=0)) - lowest + 2
        key = (self.view.astype(np.int64) * height + (row - lowest)) * width + (column - left)
        points, corner = _distinct((key[:, None] + (_CORNERS[:, 0] + width * _CORNERS[:, 1])).ravel())
        where, column = np.divmod(points, width)
        number, row = np.divmod(where, height)
        return number, np.stack([column + left, row + lowest], axis=1), corner.reshape(-1, 4)


def covering(surface: Surface, lit: Views, step: float, seed: int) -> tuple[Lattice, IntArray]:
    """Return square lattices that cover the silhouettes, shifted at random, and their numbers of columns and rows.

    Parameters
    ----------
    surface : Surface
    lit : Views
    step : float
        Side of a cell [m].
    seed : int

    Returns
    -------
    Lattice
    counts : (a, 2) int
        Columns and rows.
    """
    points = surface.points
    x, y = lit.horizontal @ points.T, lit.vertical @ points.T
    if lit.distance is not None:
        # onto the plane through the centre, along rays from the radar
        ahead = lit.toward @ surface.centre
        away = lit.toward @ points.T
        scale = (lit.distance - ahead)[:, None] / np.maximum((lit.distance - ahead)[:, None] - away, 1e-9)
        right, up = (lit.horizontal @ surface.centre)[:, None], (lit.vertical @ surface.centre)[:, None]
        x, y = (x + right) * scale - right, (y + up) * scale - up
    low, high = np.stack([x.min(axis=1), y.min(axis=1)], axis=1), np.stack([x.max(axis=1), y.max(axis=1)], axis=1)
    shift = np.random.default_rng(seed).random((len(lit), 2))
    low = low - (0.5 + 0.5 * shift) * step
    tips = np.stack([x, y], axis=2) if len(points) <= _MOST_TIPS else np.zeros((len(lit), 0, 2))
    return Lattice(low, step, tips), np.ceil((high - low) / step + 0.25).astype(np.int64)


def _distinct(key: IntArray) -> tuple[IntArray, IntArray]:
    """Return sorted distinct numbers >= 0, and the row of each given one in them."""
    if not len(key) or key.max() > _TABLE:
        points, row = np.unique(key, return_inverse=True)
        return points, row.reshape(-1)
    there = np.zeros(int(key.max()) + 1, dtype=bool)
    there[key] = True
    points = np.flatnonzero(there)
    row = np.zeros(len(there), dtype=np.int32)
    row[points] = np.arange(len(points), dtype=np.int32)
    return points, row[key]
