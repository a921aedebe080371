"""Scatterers over the edges of the scene's mesh, seen from above: forward up, left on the left."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from .._typing import ArrayLike, FloatArray, IntArray
from ._style import counted, dbm, new_figure, ring

if TYPE_CHECKING:
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure

    from ..dsp import Detections
    from ..returns import Returns
    from ..scatterers import Scatterers

__all__ = ["feature_edges", "top_view"]

_PIXELS = 560
_SPAN_DB = 60.0
#: Size of the axes [inch].
_WIDTH, _HEIGHT = 6.75, 5.25
_BACKGROUND, _EDGE = 0.07, 0.5
#: Edges between faces that turn by more than this are drawn; flat triangulation is not.
_FEATURE_DEG = 30.0


def top_view(
    scatterers: Scatterers,
    returns: Returns | None = None,
    detections: Detections | None = None,
    *,
    mesh: tuple[FloatArray, IntArray] | None = None,
    reach_m: float | None = None,
    title: str = "",
) -> Figure:
    """Draw the point cloud of one radar.

    Parameters
    ----------
    scatterers : Scatterers
    returns : Returns, optional
        Colours the points by received power.
    detections : Detections, optional
    mesh : ((v, 3) float, (f, 3) int), optional
        Vertices [m] and faces in the radar frame.
    reach_m : float, optional
        Nothing farther is shown; where all scatterers are nearer, the picture ends with them.
    title : str

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure, axes = new_figure(8.6, 6.4)
    axes.set_position((0.08, 0.08, _WIDTH / 8.6, _HEIGHT / 6.4))
    x0, x1, half = _window(scatterers, reach_m)
    pitch = max(x1 - x0, 2 * half * _HEIGHT / _WIDTH) / _PIXELS
    rows, columns = math.ceil((x1 - x0) / pitch), math.ceil(2 * half / pitch)
    grid = _Grid(x0, half, pitch, rows, columns)
    picture = np.full((rows, columns, 3), _BACKGROUND)
    if mesh is not None and len(mesh[1]):
        picture[_edge_mask(*mesh, grid)] = _EDGE
    mappable = _paint(picture, scatterers, returns, grid)
    axes.imshow(picture, origin="lower", extent=(half, -half, x0, x1), interpolation="nearest")
    if detections is not None and len(detections):
        ring(axes, detections.y, detections.x, detections.ghost)
    axes.plot(0, 0, marker="^", ms=8, color="white", mec="black", clip_on=False)
    axes.set_xlim(half, -half)
    axes.set_ylim(x0, x1)
    axes.set_aspect("equal")
    axes.set_xlabel("left  <-  y [m]  ->  right")
    axes.set_ylabel("x forward [m]")
    if mappable is not None:
        bar = figure.colorbar(mappable, cax=figure.add_axes((0.89, 0.12, 0.022, 0.74)))
        bar.set_label(f"received power of the strongest echo in a pixel [dBm], {_SPAN_DB:.0f} dB shown", fontsize=8.5)
        bar.ax.tick_params(labelsize=8)
    figure.text(0.08, 0.955, title or "Scatterers, top view", fontsize=11, weight="bold", va="center")
    grey = "" if mesh is None else "mesh edges grey, "
    marked = "o detections" if detections is None or not detections.ghost.any() else counted(detections.ghost)
    legend = f"{len(scatterers):,} scatterers, {grey}{marked}"
    figure.text(0.86, 0.918, legend, fontsize=8, ha="right", color="#555b66")
    return figure


class _Grid:
    """Square pixels over the ground: row up = forward, column right = to the right."""

    def __init__(self, x0: float, half: float, pitch: float, rows: int, columns: int) -> None:
        self.x0, self.half, self.pitch, self.rows, self.columns = x0, half, pitch, rows, columns

    def flat(self, xy: FloatArray) -> tuple[IntArray, IntArray]:
        """Return (flat pixel index, mask of the points that are inside)."""
        row = np.floor((xy[:, 0] - self.x0) / self.pitch).astype(np.int64)
        column = np.floor((self.half - xy[:, 1]) / self.pitch).astype(np.int64)
        inside = (row >= 0) & (row < self.rows) & (column >= 0) & (column < self.columns)
        return row[inside] * self.columns + column[inside], inside


def _window(scatterers: Scatterers, reach_m: float | None) -> tuple[float, float, float]:
    """Return (nearest x, farthest x, half width) shown [m]."""
    if len(scatterers) == 0:
        far, wide = reach_m or 50.0, (reach_m or 50.0) / 2
    else:
        x, y = scatterers.position[:, 0], np.abs(scatterers.position[:, 1])
        far = min(float(np.percentile(x, 99.9)) * 1.05 + 2, reach_m or np.inf)
        wide = float(np.percentile(y[x <= far], 99)) * 1.1 + 2 if np.any(x <= far) else far / 2
    half = float(np.clip(wide, 0.25 * far, 0.65 * far))
    return -0.03 * far, far, half


def _paint(picture: FloatArray, scatterers: Scatterers, returns: Returns | None, grid: _Grid) -> ScalarMappable | None:
    """Colour the pixels that hold scatterers; return what the colour bar needs."""
    if len(scatterers) == 0:
        return None
    if returns is None or len(returns) == 0:
        index, _ = grid.flat(scatterers.position)
        picture.reshape(-1, 3)[index] = 0.92
        return None
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    index, inside = grid.flat(returns.position)
    level = np.full(grid.rows * grid.columns, -np.inf)
    np.maximum.at(level, index, dbm(np.abs(returns.amplitude[inside]) ** 2))
    lit = np.isfinite(level)
    if not lit.any():
        return None
    top = float(np.ceil(level.max()))
    norm = Normalize(top - _SPAN_DB, top)
    # the dark end of the map would drown in the background: start where it is light
    shade = colormaps["plasma"](0.25 + 0.75 * np.clip(norm(level[lit]), 0, 1))[:, :3]
    picture.reshape(-1, 3)[lit] = shade
    light = colormaps["plasma"](np.linspace(0.25, 1, 256))
    return ScalarMappable(norm, ListedColormap(light))


def feature_edges(vertices: ArrayLike, faces: ArrayLike, angle_deg: float = _FEATURE_DEG) -> IntArray:
    """Return the (e, 2) edges at a border or a crease of a triangle mesh.

    Parameters
    ----------
    vertices : (v, 3) array_like
    faces : (f, 3) array_like of int
    angle_deg : float
        Creases turn by more than this.
    """
    p = np.asarray(vertices, dtype=np.float64)
    f = _welded(p, np.asarray(faces, dtype=np.int64))
    normal = np.cross(p[f[:, 1]] - p[f[:, 0]], p[f[:, 2]] - p[f[:, 0]])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    edges = np.sort(f[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    key = edges[:, 0] * (len(p) + 1) + edges[:, 1]
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    count = np.diff(first, append=len(order))
    face = order // 3
    pair = count == 2
    turn = np.abs(np.einsum("ij,ij->i", normal[face[first[pair]]], normal[face[first[pair] + 1]]))
    keep = np.ones(len(first), dtype=bool)
    keep[pair] = turn < np.cos(np.radians(angle_deg))
    picked: IntArray = edges[order[first[keep]]]
    return picked


def _welded(vertices: FloatArray, faces: IntArray) -> IntArray:
    """Return faces whose corners in the same millimetre are one: exporters repeat a vertex for every face normal."""
    cell = np.rint(vertices * 1e3).astype(np.int64).view(np.uint64)
    # one word a cell, by the odd multipliers of SplitMix64 (Steele, Lea, Flood 2014); a clash would cost one drawn edge
    key = cell[:, 0] * np.uint64(0x9E3779B97F4A7C15) ^ cell[:, 1] * np.uint64(0xBF58476D1CE4E5B9)
    key ^= cell[:, 2] * np.uint64(0x94D049BB133111EB)
    _, first, joined = np.unique(key, return_index=True, return_inverse=True)
    welded: IntArray = first[joined][faces]
    return welded


def _edge_mask(vertices: FloatArray, faces: IntArray, grid: _Grid) -> IntArray:
    """Return the (rows, columns) mask of pixels a feature edge runs through."""
    edges = feature_edges(vertices, faces)
    a, b = vertices[edges[:, 0], :2], vertices[edges[:, 1], :2]
    a, b = _clip(a, b, grid)
    steps = np.ceil(np.linalg.norm(b - a, axis=1) / (0.7 * grid.pitch)).astype(np.int64) + 1
    which = np.repeat(np.arange(len(a)), steps)
    place = np.arange(len(which)) - np.repeat(np.cumsum(steps) - steps, steps)
    along = (place / np.maximum(steps[which] - 1, 1))[:, None]
    index, _ = grid.flat(a[which] + along * (b - a)[which])
    mask = np.zeros(grid.rows * grid.columns, dtype=bool)
    mask[index] = True
    return mask.reshape(grid.rows, grid.columns)


def _clip(a: FloatArray, b: FloatArray, grid: _Grid) -> tuple[FloatArray, FloatArray]:
    """Cut segments to the window (Liang and Barsky 1984), so that long ones cost no more than they show."""
    low = np.array([grid.x0, -grid.half])
    high = np.array([grid.x0 + grid.rows * grid.pitch, grid.half])
    d = b - a
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = (low - a) / d, (high - a) / d
    enter = np.where(d == 0, np.where((a < low) | (a > high), np.inf, -np.inf), np.minimum(s, t)).max(axis=1)
    leave = np.where(d == 0, np.inf, np.maximum(s, t)).min(axis=1)
    enter, leave = np.maximum(enter, 0), np.minimum(leave, 1)
    keep = enter < leave
    a, d, enter, leave = a[keep], d[keep], enter[keep, None], leave[keep, None]
    return a + enter * d, a + leave * d
