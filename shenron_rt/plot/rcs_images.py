"""Where on a target its echo comes from: range profiles, range over aspect, inverse synthetic aperture images."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .._typing import ComplexArray, FloatArray
from ._style import CMAP, GRID, THRESHOLD, TRACE, new_figure
from .rcs import headline

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..turntable import IsarImage, RangeProfile

__all__ = ["isar_picture", "range_aspect", "range_profile_of_target"]

#: Shown below the strongest cell [dB].
_SPAN_DB = 50.0


def range_profile_of_target(
    profile: RangeProfile, *, depth_m: tuple[float, float] | None = None, label: str = "", title: str = ""
) -> Figure:
    """Draw RCS over down-range distance.

    Parameters
    ----------
    profile : RangeProfile
        Of one aspect: ``amplitude`` (m,).
    depth_m : (near, far), optional
        Where the target's geometry begins and ends along the line of sight, shaded [m].
    label, title : str

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure, axes = new_figure(9.0, 4.8)
    axes.set_position((0.085, 0.19, 0.895, 0.64))
    level = _dbsm(profile.amplitude)
    if depth_m is not None:
        axes.axvspan(*depth_m, color=GRID, alpha=0.6, lw=0, label="extent of the target")
    axes.plot(profile.range_m, level, color=TRACE, lw=1.2, label=label or "range profile")
    top = float(np.ceil(level.max()))
    axes.set_ylim(top - _SPAN_DB, top + 4)
    axes.set_xlim(*_shown(profile.range_m, profile.cell_m, depth_m))
    axes.axvline(0.0, color="#8a8f98", lw=0.8, ls=":")
    _sides(axes)
    axes.set_xlabel("down range from the target's origin [m], + away from the radar")
    axes.set_ylabel("RCS of a cell [dBsm]")
    axes.grid(color=GRID, lw=0.6)
    axes.legend(fontsize=8.5, loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=3, frameon=False)
    headline(figure, title, _resolution(profile))
    return figure


def range_aspect(
    profile: RangeProfile, azimuth_deg: FloatArray, *, depth_m: tuple[float, float] | None = None, title: str = ""
) -> Figure:
    """Draw RCS over down-range distance and azimuth.

    Parameters
    ----------
    profile : RangeProfile
        ``amplitude`` (m, n_az).
    azimuth_deg : (n_az,) float
    depth_m : (near, far), optional
        Part of the range axis that holds the target at all aspects [m].
    title : str

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure, axes = new_figure(9.0, 5.4)
    axes.set_position((0.085, 0.12, 0.80, 0.71))
    level = _dbsm(profile.amplitude)
    order = np.argsort(azimuth_deg)
    top = float(np.ceil(level.max()))
    image = axes.pcolormesh(
        azimuth_deg[order], profile.range_m, level[:, order], cmap=CMAP, vmin=top - _SPAN_DB, vmax=top,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    axes.set_ylim(*_shown(profile.range_m, profile.cell_m, depth_m))
    bar = figure.colorbar(image, ax=axes, fraction=0.04, pad=0.02)
    bar.set_label("RCS of a cell [dBsm]")
    axes.set_xlabel("azimuth of the radar seen from the target [deg], + left of the nose")
    axes.set_ylabel("down range [m], + away from the radar")
    axes.text(0.01, 0.015, "near side, towards the radar", transform=axes.transAxes, color="white", fontsize=8)
    axes.text(0.01, 0.985, "far side", transform=axes.transAxes, color="white", fontsize=8, va="top")
    headline(figure, title, _resolution(profile))
    return figure


def isar_picture(
    image: IsarImage, *, outline: FloatArray | None = None, polarization: str = "", title: str = ""
) -> Figure:
    """Draw an image in the target's own frame, x right and y up, with the direction to the radar.

    Parameters
    ----------
    image : IsarImage
    outline : (n, 2) float, optional
        Outline of the target in x, y, closed [m].
    polarization, title : str

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure, axes = new_figure(7.6, 7.0)
    axes.set_position((0.10, 0.08, 0.74, 0.80))
    level = _dbsm(image.amplitude)
    top = float(np.ceil(level.max()))
    half = 0.5 * float(image.x_m[1] - image.x_m[0])
    x, y = image.x_m, image.y_m
    shown = axes.imshow(
        level, origin="lower", cmap=CMAP, vmin=top - _SPAN_DB, vmax=top, interpolation="nearest",
        extent=(x[0] - half, x[-1] + half, y[0] - half, y[-1] + half),
    )  # fmt: skip
    if outline is not None:
        axes.plot(outline[:, 0], outline[:, 1], color="white", lw=0.8, ls=":", label="outline of the target")
        axes.legend(fontsize=8.5, loc="lower right", framealpha=0.6)
    _arrow(axes, image)
    axes.set_xlim(float(x[0]), float(x[-1]))
    axes.set_ylim(float(y[0]), float(y[-1]))
    axes.set_xlabel("x of the target [m], + nose")
    axes.set_ylabel("y of the target [m], + left")
    bar = figure.colorbar(shown, ax=axes, fraction=0.046, pad=0.03)
    bar.set_label(f"RCS of a point{f', {polarization}' if polarization else ''} [dBsm]")
    text = (
        f"cells {_length(image.down_cell_m)} down x {_length(image.cross_cell_m)} cross range, {image.window} window; "
        f"unambiguous {_length(image.down_extent_m)} x {_length(image.cross_extent_m)}"
    )
    headline(figure, title, text, x=0.10)
    return figure


def _arrow(axes: Axes, image: IsarImage) -> None:
    """Point from the rim towards the middle, the way the wave comes."""
    angle = np.radians(image.azimuth_deg)
    reach = 0.5 * float(np.ptp(image.x_m))
    way = np.array([np.cos(angle), np.sin(angle)])
    way = way / np.abs(way).max()  # to the frame of the square picture
    axes.annotate(
        "", xy=tuple(0.80 * reach * way), xytext=tuple(0.97 * reach * way),
        arrowprops={"arrowstyle": "-|>", "color": THRESHOLD, "lw": 2.0},
    )  # fmt: skip
    x, y = (0.74 * reach * way).tolist()
    axes.text(
        x, y, f"from the radar, {image.azimuth_deg:g} deg", color="white", fontsize=8, ha="center",
        va="center",
    )  # fmt: skip


def _shown(range_m: FloatArray, cell_m: float, depth_m: tuple[float, float] | None) -> tuple[float, float]:
    """Return limits of the range axis: the target with some cells about it, within what is unambiguous."""
    low, high = float(range_m[0]), float(range_m[-1])
    if depth_m is None:
        return low, high
    margin = max(4.0 * cell_m, 0.25 * (depth_m[1] - depth_m[0]))
    return max(low, depth_m[0] - margin), min(high, depth_m[1] + margin)


def _sides(axes: Axes) -> None:
    for x, text, side in ((0.01, "near side, towards the radar", "left"), (0.99, "far side", "right")):
        axes.text(x, 0.975, text, transform=axes.transAxes, fontsize=8.5, color="#555b66", ha=side, va="top")


def _resolution(profile: RangeProfile) -> str:
    return (
        f"cell c/2B {_length(profile.cell_m)}, {profile.window} window; unambiguous {_length(profile.extent_m)}; "
        "a point of sigma reads sigma at its range"
    )


def _length(metres: float) -> str:
    return f"{metres:.3g} m" if metres >= 1 else f"{100 * metres:.3g} cm"


def _dbsm(amplitude: ComplexArray) -> FloatArray:
    return np.asarray(20.0 * np.log10(np.maximum(np.abs(amplitude), 1e-6)))
