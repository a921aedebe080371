"""Ray launch: cells that tile the solid angle without gap or overlap.

A cell is a square of a cube map (gnomonic projection, equal angles along both axes), so that its edges are planes
through the radar and its footprint on a flat surface is an exact quadrilateral. Anti-aliasing turns the whole grid by
one random angle a frame; a jitter of its own for every ray would destroy the phase of flat surfaces.
"""

from __future__ import annotations

import functools
from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from .._typing import ArrayLike, BoolArray, FloatArray, IntArray
from ..constants import PATTERN_FLOOR_TWO_WAY_DB
from ..frames import rotation_matrix, spherical
from ..physics.antenna import AntennaPattern

__all__ = ["Cells", "UnionPattern", "aimed_cells", "lit_part", "pattern_cells", "turned"]


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of solid angle around unit directions.

    Parameters
    ----------
    direction : (n, 3) float
        Unit vectors, before ``turn``.
    edges : (n, 2, 3) float
        Half edges, before ``turn``: the corners are the directions d +- e_u +- e_v (not of unit length), e_u x e_v
        points outward.
    solid_angle : (n,) float
        [sr].
    spacing : float
        Angle between neighbours [rad].
    neighbour : (n, 4) int32
        The cells across the edges towards -v, +u, +v, -u; -1 at the rim of a patch.
    turn : (3, 3) float or None
        Rotation of the whole grid, applied when cells are asked for.
    """

    direction: FloatArray
    edges: FloatArray
    solid_angle: FloatArray
    spacing: float
    neighbour: IntArray
    turn: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.direction)

    def directions_of(self, cells: IntArray | slice) -> FloatArray:
        """Return (m, 3) unit vectors of some cells, turned with the grid."""
        d = self.direction[cells]
        return d if self.turn is None else d @ self.turn.T

    def edges_of(self, cells: IntArray) -> FloatArray:
        """Return (m, 2, 3) half edges of some cells, turned with the grid."""
        edges = self.edges[cells]
        return edges if self.turn is None else (edges.reshape(-1, 3) @ self.turn.T).reshape(-1, 2, 3)


def _patch(axes: FloatArray, x_edges: FloatArray, y_edges: FloatArray, spacing: float) -> Cells:
    """Return the cells of a gnomonic patch: rows of ``axes`` are its normal and its two tangents."""
    x, hx = (x_edges[1:] + x_edges[:-1]) / 2, np.diff(x_edges) / 2
    y, hy = (y_edges[1:] + y_edges[:-1]) / 2, np.diff(y_edges) / 2
    X, Y = (a.ravel() for a in np.meshgrid(x, y, indexing="ij"))
    HX, HY = (a.ravel() for a in np.meshgrid(hx, hy, indexing="ij"))
    scale = 1.0 / np.sqrt(1.0 + X**2 + Y**2)
    local = np.column_stack([scale, X * scale, Y * scale])
    edges = np.zeros((len(local), 2, 3))
    edges[:, 0, 1] = HX * scale
    edges[:, 1, 2] = HY * scale
    # exact solid angle of a rectangle of the gnomonic plane, by its corner function
    corner = np.arctan2(x_edges[:, None] * y_edges[None], np.sqrt(1 + x_edges[:, None] ** 2 + y_edges[None] ** 2))
    solid = (corner[1:, 1:] - corner[:-1, 1:] - corner[1:, :-1] + corner[:-1, :-1]).ravel()
    turned_edges = (edges.reshape(-1, 3) @ axes).reshape(-1, 2, 3)
    return Cells(local @ axes, turned_edges, solid, spacing, _grid_neighbours(len(x), len(y)))


def _grid_neighbours(nx: int, ny: int) -> IntArray:
    index = np.full((nx + 2, ny + 2), -1, dtype=np.int32)
    index[1:-1, 1:-1] = np.arange(nx * ny, dtype=np.int32).reshape(nx, ny)
    across = (index[1:-1, :-2], index[2:, 1:-1], index[1:-1, 2:], index[:-2, 1:-1])
    return np.stack([a.ravel() for a in across], axis=1)


# Faces of the cube: outward normal and two tangents, right-handed seen from outside.
_CUBE = np.array(
    [
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, -1, 0], [0, 0, 1]],
        [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
        [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
        [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
    ],
    dtype=np.float64,
)


def _cube(cells_per_edge: int) -> Cells:
    edges = np.tan(np.linspace(-np.pi / 4, np.pi / 4, cells_per_edge + 1))
    spacing = np.pi / 2 / cells_per_edge
    faces = [_patch(axes, edges, edges, spacing) for axes in _CUBE]
    first = np.arange(len(faces), dtype=np.int32) * cells_per_edge**2
    return Cells(
        np.concatenate([f.direction for f in faces]),
        np.concatenate([f.edges for f in faces]),
        np.concatenate([f.solid_angle for f in faces]),
        spacing,
        np.concatenate([np.where(f.neighbour < 0, -1, f.neighbour + k) for f, k in zip(faces, first, strict=True)]),
    )


def _lit(cells: Cells, pattern: AntennaPattern, margin: float) -> BoolArray:
    """Return which cells reach the pattern's floor anywhere within ``margin`` of their centre."""
    _, az, el = spherical(cells.direction)
    floor = 10 ** (PATTERN_FLOOR_TWO_WAY_DB / 20)  # one way, power
    lit = np.zeros(len(cells), dtype=bool)
    for step_az, step_el in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)):
        shifted_az = az + step_az * margin / np.maximum(np.cos(el), margin)
        shifted_az = (shifted_az + np.pi) % (2 * np.pi) - np.pi
        lit |= pattern(shifted_az, np.clip(el + step_el * margin, -np.pi / 2, np.pi / 2)) >= floor
    return lit


def pattern_cells(pattern: AntennaPattern, rays: int) -> Cells:
    """Return about ``rays`` cells that cover a pattern down to -40 dB two-way, boresight along +x.

    The set depends on the pattern and the number of rays alone, never on the scene; the last few are kept.
    """
    if not isinstance(pattern, Hashable):
        return _pattern_cells(pattern, rays)
    return _kept_pattern_cells(pattern, rays)


@functools.lru_cache(maxsize=8)
def _kept_pattern_cells(pattern: Hashable, rays: int) -> Cells:
    return _pattern_cells(cast("AntennaPattern", pattern), rays)


def _pattern_cells(pattern: AntennaPattern, rays: int) -> Cells:
    coarse = _cube(48)
    share = float(coarse.solid_angle[_lit(coarse, pattern, coarse.spacing)].sum() / (4 * np.pi))
    cells = _cube(max(4, round(np.sqrt(rays / (6 * share)))))
    keep = _lit(cells, pattern, cells.spacing)
    return _kept(cells, keep)


def _kept(cells: Cells, keep: BoolArray) -> Cells:
    """Return some of the cells, with neighbours among themselves."""
    row = np.full(len(cells) + 1, -1, dtype=np.int32)  # the last entry answers for -1
    row[:-1][keep] = np.arange(keep.sum(), dtype=np.int32)
    neighbour = row[cells.neighbour[keep]]
    return Cells(cells.direction[keep], cells.edges[keep], cells.solid_angle[keep], cells.spacing, neighbour)


@dataclass(frozen=True)
class UnionPattern:
    """The largest of several patterns in each direction."""

    patterns: tuple[AntennaPattern, ...]

    def __call__(self, azimuth: ArrayLike, elevation: ArrayLike) -> FloatArray:
        """Return the one-way power relative to the peak."""
        return cast("FloatArray", np.max([p(azimuth, elevation) for p in self.patterns], axis=0))


def lit_part(cells: Cells, pattern: AntennaPattern) -> tuple[Cells, IntArray]:
    """Return the cells in which a pattern reaches -40 dB two-way, and their rows in ``cells``, which are not turned."""
    keep = _lit(cells, pattern, cells.spacing)
    return _kept(cells, keep), np.flatnonzero(keep)


def turned(cells: Cells, shift: FloatArray) -> Cells:
    """Turn the whole grid by up to half a cell.

    Parameters
    ----------
    cells : Cells
    shift : (2,) float
        Fractions of a cell in yaw and pitch, uniform in [-0.5, 0.5].
    """
    yaw, pitch = np.degrees(np.asarray(shift) * cells.spacing)
    R = rotation_matrix((yaw, pitch, 0.0))
    return replace(cells, turn=R)


def aimed_cells(points: FloatArray, rays: int, shift: FloatArray) -> Cells | None:
    """Return about ``rays`` cells of a gnomonic patch that holds all ``points`` as seen from the origin.

    Parameters
    ----------
    points : (n, 3) float
        Vertices of the target, radar frame [m].
    rays : int
    shift : (2,) float
        Fractions of a cell by which the grid is moved.

    Returns
    -------
    Cells or None
        ``None`` where the radar stands within the target's bounds, so that no patch can hold it.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    axis = (low + high) / 2
    length = np.linalg.norm(axis)
    if length == 0:
        return None
    normal = axis / length
    side = np.cross([0.0, 0.0, 1.0], normal)
    if np.linalg.norm(side) < 1e-6:
        side = np.array([0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    axes = np.stack([normal, side, np.cross(normal, side)])
    local = points @ axes.T
    if local[:, 0].min() <= 1e-3 * length:
        return None
    plane = local[:, 1:] / local[:, :1]
    x0, y0 = plane.min(axis=0)
    x1, y1 = plane.max(axis=0)
    width, height = max(x1 - x0, 1e-9), max(y1 - y0, 1e-9)
    step = np.sqrt(width * height / rays)
    step = max(step, max(width, height) / rays)  # a target seen edge-on still gets no more than ``rays`` columns
    nx, ny = int(np.ceil(width / step)) + 2, int(np.ceil(height / step)) + 2
    x_edges = (x0 + x1) / 2 + (np.arange(nx + 1) - nx / 2 + shift[0]) * step
    y_edges = (y0 + y1) / 2 + (np.arange(ny + 1) - ny / 2 + shift[1]) * step
    return _patch(axes, x_edges, y_edges, float(step))
