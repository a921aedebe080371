"""Range-azimuth map as a bird's-eye fan: forward up, left on the left."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .._typing import FloatArray
from ._style import CMAP, dbm, label, limits, new_figure, ring
from .truth import Truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..dsp import Detections, RadarCube

__all__ = ["birds_eye"]

_PIXELS = 520
_MAX_LABELS = 6


def birds_eye(
    cube: RadarCube, detections: Detections | None = None, *, truth: Sequence[Truth] = (), title: str = ""
) -> Figure:
    """Draw the range-azimuth map on the ground plane of the radar.

    Parameters
    ----------
    cube : RadarCube
        Its ``range_azimuth`` is resampled, bilinear in dB, onto square pixels.
    detections : Detections, optional
        Ringed at range and azimuth, ghosts in squares.
    truth : sequence of Truth
    title : str

    Returns
    -------
    matplotlib.figure.Figure
    """
    level, sine = _closed(dbm(cube.range_azimuth), cube.azimuth_sine)
    reach = float(cube.range_m[-1])
    side = reach * float(np.abs(sine).max())
    height = min(6.8 * reach / (2 * side), 6.5) + 1.3
    figure, axes = new_figure(8.6, height)
    axes.set_position((0.08, 0.6 / height, 0.79, 1 - 1.3 / height))
    low, high = limits(level, _noise_dbm(cube))
    half = reach / _PIXELS
    image = axes.imshow(
        _fan(level, sine, cube.range_step_m, reach, side), origin="lower", interpolation="nearest", cmap=CMAP,
        vmin=low, vmax=high, extent=(side + half, -side - half, -half, reach + half),
    )  # fmt: skip
    axes.set_facecolor("#f2f3f5")
    _rings(axes, reach)
    if detections is not None and len(detections):
        y, x = detections.range * np.sin(detections.azimuth), detections.range * np.cos(detections.azimuth)
        ring(axes, y, x, detections.ghost)
    axes.set_xlim(side * 1.02, -side * 1.02)
    axes.set_ylim(0, reach * 1.02)
    axes.set_aspect("equal")
    taken: list[tuple[float, float]] = []
    for item in truth[:_MAX_LABELS]:
        if item.range_m <= reach:
            y, x = item.range_m * np.sin(item.azimuth_rad), item.range_m * np.cos(item.azimuth_rad)
            axes.plot(y, x, marker="+", ms=9, mew=1.2, color="white")
            label(axes, taken, y, x, item.name, left=bool(y > 0))
    axes.set_xlabel("left  <-  y [m]  ->  right")
    axes.set_ylabel("x forward [m]")
    bar = figure.colorbar(image, cax=figure.add_axes((0.90, 0.6 / height, 0.022, 1 - 1.3 / height)))
    bar.set_label(f"beamformed power [dBm], {high - low:.0f} dB shown", fontsize=9)
    bar.ax.tick_params(labelsize=8)
    figure.text(0.08, 1 - 0.25 / height, title or "Range-azimuth", fontsize=11, weight="bold", va="center")
    return figure


def _noise_dbm(cube: RadarCube) -> float:
    """Return what noise reads in the map: the largest of n_velocity exponential cells, mean about ln n_velocity."""
    largest = max(1.0, float(np.log(cube.data.shape[1])))
    return float(dbm(cube.noise_power_w / len(cube.azimuth_channels) * largest))


def _closed(level: FloatArray, sine: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Repeat the first column at the far end of a grid whose ends are one direction (a half-wavelength array)."""
    step = sine[1] - sine[0]
    if abs(sine[-1] + step + sine[0]) > 1e-6 * step:
        return level, sine
    return np.concatenate([level, level[:, :1]], axis=1), np.append(sine, -sine[0])


def _fan(level: FloatArray, grid: FloatArray, step_m: float, reach: float, side: float) -> FloatArray:
    """Return the map on square pixels, left edge = +y; NaN outside the fan."""
    columns = max(2, int(_PIXELS * 2 * side / reach))
    x = np.linspace(0, reach, _PIXELS)[:, None]
    y = np.linspace(side, -side, columns)[None, :]
    r = np.hypot(x, y)
    sine = y / np.maximum(r, 1e-9)
    row = r / step_m
    column = (sine - grid[0]) / (grid[1] - grid[0])
    inside = (row <= len(level) - 1) & (column >= 0) & (column <= len(grid) - 1)
    i = np.clip(row.astype(int), 0, len(level) - 2)
    j = np.clip(column.astype(int), 0, len(grid) - 2)
    u, w = row - i, column - j
    near = level[i, j] * (1 - w) + level[i, j + 1] * w
    far = level[i + 1, j] * (1 - w) + level[i + 1, j + 1] * w
    return np.where(inside, near * (1 - u) + far * u, np.nan)


def _rings(axes: Axes, reach: float) -> None:
    """Range rings and the +-30 and +-60 degree spokes."""
    from matplotlib.ticker import MaxNLocator

    angle = np.linspace(-np.pi / 2, np.pi / 2, 121)
    for radius in MaxNLocator(5).tick_values(0, reach)[1:-1]:
        if radius < reach:
            axes.plot(radius * np.sin(angle), radius * np.cos(angle), color="white", lw=0.5, alpha=0.35)
    for degrees in (-60, -30, 0, 30, 60):
        a = np.radians(degrees)
        axes.plot([0, reach * np.sin(a)], [0, reach * np.cos(a)], color="white", lw=0.5, alpha=0.25)
        axes.annotate(
            f"{degrees:+d}\u00b0" if degrees else "0\u00b0", (reach * np.sin(a), reach * np.cos(a)),
            xytext=(10 * np.sin(-a), 6 * np.cos(a)), textcoords="offset points", fontsize=8, color="#555b66",
            ha="center", va="center",
        )  # fmt: skip
