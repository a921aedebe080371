"""Radar cross section of a target: over aspect with its statistics, polar, and over both angles."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .._typing import FloatArray
from ._style import CMAP, GRID, THRESHOLD, TRACE, TRUTH, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..rcs import RcsSweep
    from ..turntable import AngularStatistics, Reference

__all__ = ["Cut", "cut_of", "rcs_cut", "rcs_map", "rcs_polar"]

#: Shown below the peak [dB].
SPAN_DB, MAP_SPAN_DB = 60.0, 50.0
_COLOURS = (TRACE, "#d07a00", "#7a3fa0", "#5f6b76")
#: Equal polarisations show through each other.
_DASHES = ("-", (0, (3, 2)), (0, (5, 1, 1, 1)), (0, (1, 1)))
#: Of the second line of a headline, in its size.
_LETTERS_AN_INCH = 13.0
_MEDIAN, _BAND = "#111111", "#9db7d1"


@dataclass(frozen=True, eq=False)
class Cut:
    """A line through a sweep.

    Parameters
    ----------
    axis : {"azimuth", "elevation", "frequency"}
        Along it.
    x : (n,) float
        Degrees, or GHz.
    rcs_dbsm : (n, n_pol) float
    index : tuple of slice or int
        Of frequency, elevation and azimuth in the sweep.
    """

    axis: str
    x: FloatArray
    rcs_dbsm: FloatArray
    index: tuple[Any, ...]


def cut_of(sweep: RcsSweep, axis: str | None = None) -> Cut:
    """Return the line along an axis, through the middle of the others.

    Parameters
    ----------
    sweep : RcsSweep
    axis : {"azimuth", "elevation", "frequency"}, optional
        Default: azimuth where it is swept, else elevation, else frequency.

    Notes
    -----
    The middle frequency, and the elevation and azimuth nearest to 0.
    """
    index: list[Any] = [
        len(sweep.frequency_hz) // 2,
        int(np.abs(sweep.elevation_deg).argmin()),
        int(np.abs(sweep.azimuth_deg).argmin()),
    ]
    lines = {
        "azimuth": (2, sweep.azimuth_deg),
        "elevation": (1, sweep.elevation_deg),
        "frequency": (0, sweep.frequency_hz / 1e9),
    }
    chosen = axis or next((name for name, (_, x) in lines.items() if len(x) > 1), "azimuth")
    number, x = lines[chosen]
    index[number] = slice(None)
    return Cut(chosen, x, sweep.rcs_dbsm[tuple(index)], tuple(index))


def rcs_cut(
    sweep: RcsSweep,
    *,
    cut: Cut | None = None,
    statistics: AngularStatistics | None = None,
    reference: Reference | None = None,
    title: str = "",
) -> Figure:
    """Draw dBsm over azimuth (or elevation, or frequency).

    Parameters
    ----------
    sweep : RcsSweep
    cut : Cut, optional
        Default: :func:`cut_of`.
    statistics : AngularStatistics, optional
        Of the cut's first polarisation: median and 10 to 90 % band.
    reference : Reference, optional
        Closed form, dashed.
    title : str

    Returns
    -------
    matplotlib.figure.Figure
    """
    line = cut_of(sweep) if cut is None else cut
    figure, axes = new_figure(9.0, 5.0)
    axes.set_position((0.085, 0.20, 0.895, 0.65))
    if statistics is not None:
        _statistics(axes, statistics, sweep.polarization[0])
    closed = None if reference is None else _dbsm(reference.rcs_m2[line.index])
    top = _top([line.rcs_dbsm, *([] if closed is None else [closed])])
    if closed is not None and reference is not None:
        axes.plot(
            line.x, closed[:, 0], color=THRESHOLD, lw=3.5, alpha=0.4,
            label=f"closed form, {sweep.polarization[0]}: {reference.formula}",
        )  # fmt: skip
    for number, name in enumerate(sweep.polarization):
        style = {"marker": "o", "ms": 5, "ls": "none"} if len(line.x) == 1 else {"lw": 1.1, "ls": _DASHES[number % 4]}
        axes.plot(line.x, line.rcs_dbsm[:, number], color=_COLOURS[number % 4], label=name, **style)
    axes.set_ylim(max(top - SPAN_DB, _bottom(line.rcs_dbsm)), top + 3)
    if len(line.x) > 1:
        axes.set_xlim(float(line.x.min()), float(line.x.max()))
    if line.axis == "azimuth" and np.ptp(line.x) > 120:
        axes.set_xticks(np.arange(np.ceil(line.x.min() / 30) * 30, line.x.max() + 1, 30))
    unit = "GHz" if line.axis == "frequency" else "deg"
    sign = {"azimuth": ", + left of the nose", "elevation": ", + up", "frequency": ""}[line.axis]
    axes.set_xlabel(f"{line.axis}{'' if unit == 'GHz' else ' of the radar seen from the target'} [{unit}]{sign}")
    axes.set_ylabel("RCS [dBsm]")
    axes.grid(color=GRID, lw=0.6)
    axes.legend(fontsize=8.5, loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=3, frameon=False)
    headline(figure, title or sweep.target, described(sweep, line))
    return figure


def _statistics(axes: Axes, found: AngularStatistics, polarization: str) -> None:
    width = f"{found.window_deg:g} deg window"
    axes.fill_between(
        found.angle_deg, _dbsm(found.p10_m2), _dbsm(found.p90_m2), color=_BAND, alpha=0.45, lw=0,
        label=f"10 to 90 %, {width} ({polarization})",
    )  # fmt: skip
    axes.plot(found.angle_deg, _dbsm(found.median_m2), color=_MEDIAN, lw=1.6, label=f"median, {width}", zorder=3)


def rcs_polar(
    sweep: RcsSweep, *, statistics: AngularStatistics | None = None, index: tuple[Any, ...] | None = None,
    title: str = "",
) -> Figure:  # fmt: skip
    """Draw dBsm over azimuth as seen from above, nose up: 0 degrees at the top, left (+90) on the left.

    Parameters
    ----------
    sweep : RcsSweep
    statistics : AngularStatistics, optional
        Of the first polarisation; its median is drawn.
    index : tuple, optional
        Frequency, elevation and slice of azimuth; default as :func:`cut_of`.
    title : str

    Returns
    -------
    matplotlib.figure.Figure
    """
    line = cut_of(sweep, "azimuth")
    values = line.rcs_dbsm if index is None else sweep.rcs_dbsm[index]
    figure, first = new_figure(7.0, 7.6)
    first.remove()
    axes: Any = figure.add_axes((0.09, 0.09, 0.82, 0.74), projection="polar")
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(1)
    top = 5.0 * np.ceil((_top([values]) + 1.0) / 5.0)
    low = _centre(values[:, 0], top)
    angle = np.radians(line.x)
    for number, name in enumerate(sweep.polarization):
        axes.plot(
            angle,
            np.maximum(values[:, number], low),
            color=_COLOURS[number % 4],
            ls=_DASHES[number % 4],
            lw=1.0,
            label=name,
        )
    if statistics is not None:
        x, y = statistics.angle_deg, np.maximum(_dbsm(statistics.median_m2), low)
        if statistics.circular:
            x, y = np.append(x, x[0]), np.append(y, y[0])
        label = f"median, {statistics.window_deg:g} deg window ({sweep.polarization[0]})"
        axes.plot(np.radians(x), y, color=_MEDIAN, lw=1.6, label=label)
    axes.set_ylim(low, top)
    rings = np.arange(10.0 * np.ceil((low + 1.0) / 10.0), top + 1.0, 10.0)
    axes.set_yticks(rings, [*(f"{r:g}" for r in rings[:-1]), f"{rings[-1]:g} dBsm"])
    axes.set_rlabel_position(-45)
    axes.tick_params(labelsize=8.5)
    degrees = np.arange(0, 360, 30)
    words = {0: "0 deg\nnose, +x", 90: "+90\nleft", 180: "180\ntail", 270: "-90\nright"}
    named = [words.get(int(d), f"{int(d) if d <= 180 else int(d) - 360:+d}") for d in degrees]
    axes.set_thetagrids(degrees, named)
    axes.grid(color=GRID, lw=0.7)
    axes.legend(fontsize=8.5, loc="upper center", bbox_to_anchor=(0.5, -0.06), ncols=3, frameon=False)
    where = described(sweep, line)
    headline(figure, title or sweep.target, f"RCS [dBsm] over azimuth of the radar; {where}", x=0.06)
    return figure


def rcs_map(sweep: RcsSweep, *, polarization: int = 0, frequency: int | None = None, title: str = "") -> Figure:
    """Draw dBsm over azimuth and elevation.

    Parameters
    ----------
    sweep : RcsSweep
        Two or more elevations and azimuths.
    polarization, frequency : int
        Which to show; default the first, and the middle one.
    title : str

    Returns
    -------
    matplotlib.figure.Figure
    """
    number = len(sweep.frequency_hz) // 2 if frequency is None else frequency
    values = sweep.rcs_dbsm[number, :, :, polarization]
    order_el, order_az = np.argsort(sweep.elevation_deg), np.argsort(sweep.azimuth_deg)
    figure, axes = new_figure(9.0, 5.2)
    axes.set_position((0.085, 0.12, 0.80, 0.72))
    top = float(np.ceil(values.max()))
    mesh = axes.pcolormesh(
        sweep.azimuth_deg[order_az], sweep.elevation_deg[order_el], values[np.ix_(order_el, order_az)],
        cmap=CMAP, vmin=top - MAP_SPAN_DB, vmax=top, shading="nearest", rasterized=True,
    )  # fmt: skip
    i, j = np.unravel_index(int(values.argmax()), values.shape)
    axes.plot(
        sweep.azimuth_deg[j], sweep.elevation_deg[i], ls="none", marker="o", ms=9, mfc="none", mec=TRUTH, mew=1.6,
        label=f"peak {values.max():.1f} dBsm",
    )  # fmt: skip
    bar = figure.colorbar(mesh, ax=axes, fraction=0.04, pad=0.02)
    bar.set_label(f"RCS, {sweep.polarization[polarization]} [dBsm]")
    axes.set_xlabel("azimuth of the radar seen from the target [deg], + left of the nose")
    axes.set_ylabel("elevation [deg], + up")
    axes.legend(fontsize=8.5, loc="lower right", framealpha=0.8)
    text = f"{sweep.frequency_hz[number] / 1e9:g} GHz, {_field(sweep)}"
    headline(figure, title or sweep.target, text)
    return figure


def described(sweep: RcsSweep, line: Cut) -> str:
    """Return the frequency and the angle that a cut stands at, and how the target is lit."""
    f, el, az = line.index
    words = []
    if line.axis != "frequency":
        words.append(f"{sweep.frequency_hz[f] / 1e9:g} GHz")
    if line.axis != "elevation":
        words.append(f"elevation {sweep.elevation_deg[el]:g} deg")
    if line.axis != "azimuth":
        words.append(f"azimuth {sweep.azimuth_deg[az]:g} deg")
    return ", ".join([*words, _field(sweep)])


def _field(sweep: RcsSweep) -> str:
    words = ["far field" if sweep.distance_m is None else f"apparent RCS at {sweep.distance_m:g} m"]
    if sweep.bistatic_deg is not None:
        words.append("bistatic, transmitter at azimuth {:g}, elevation {:g} deg".format(*sweep.bistatic_deg))
    bounces = f"{sweep.max_bounces} bounce{'s' * (sweep.max_bounces != 1)}"
    rays = f"{sweep.rays_per_wavelength:g} ray{'s' * (sweep.rays_per_wavelength != 1)} per wavelength"
    return ", ".join([*words, bounces, rays])


def headline(figure: Figure, title: str, text: str, *, x: float = 0.085) -> None:
    """Write a title and, below it, one or two lines of what is shown."""
    width, height = figure.get_size_inches().tolist()
    figure.text(x, 1 - 0.22 / height, title, fontsize=11.5, weight="bold", va="center")
    for number, line in enumerate(textwrap.wrap(text, int(_LETTERS_AN_INCH * width * (1.0 - x)))[:2]):
        figure.text(x, 1 - (0.46 + 0.18 * number) / height, line, fontsize=9, va="center", color="#555b66")


def _dbsm(rcs_m2: FloatArray) -> FloatArray:
    return np.asarray(10.0 * np.log10(np.maximum(rcs_m2, 1e-12)))


def _top(levels: list[FloatArray]) -> float:
    return float(np.ceil(max(np.nanmax(level) for level in levels)))


def _centre(level: FloatArray, top: float) -> float:
    """Return what stands at the centre of a polar picture: some decibels below nearly all, 40 to 70 below the rim."""
    return float(np.clip(10.0 * np.floor(np.percentile(level, 5) / 10.0) - 10.0, top - 70.0, top - 40.0))


def _bottom(level: FloatArray) -> float:
    return float(np.floor(level.min())) - 3.0
