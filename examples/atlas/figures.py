"""Pictures of docs/rcs-atlas.md: a circle in both bands for every target, and apparent RCS against distance."""

from __future__ import annotations

import io
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from shenron_rt._typing import FloatArray
from shenron_rt.io.npz import atomic_write
from shenron_rt.turntable import AngularStatistics, angular_statistics

from . import distance
from .cases import BANDS_GHZ, NEAR_M, STEP_DEG
from .levels import WINDOW_DEG, Circle, dbsm
from .page import Curves
from .published import BICYCLIST, KIND, SIGMA_DB, car_range_law, pattern_dbsm

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NEAR, FAR, BAND, MEDIAN, PUBLISHED, GRID = "#7aa0c4", "#d07a00", "#9db7d1", "#111111", "#1a8f5a", "#d5d9de"
#: Levels shown [dBsm].
SPAN_DBSM = {"car": (-10, 35), "truck": (-10, 45), "pedestrian": (-35, 10), "bicycle": (-45, 15), "pole": (0, 45)}
_DPI, _COLOURS = 80, 64


def write(folder: Path, found: Curves) -> None:
    """Draw every picture whose curves are there."""
    import matplotlib as mpl

    mpl.use("Agg")
    for shape in STEP_DEG:
        near = {ghz: found.get(f"{shape}-{ghz:g}-25m") for ghz in BANDS_GHZ}
        if all(near.values()):
            far = {ghz: found.get(f"{shape}-{ghz:g}-far") for ghz in BANDS_GHZ}
            _save(_circles(shape, near, far), folder / f"rcs_atlas_{shape}.png")
    if all(f"distance-{name}-{ghz:g}" in found for name in distance.FORMULAS for ghz in BANDS_GHZ):
        _save(_distances(found), folder / "rcs_atlas_distance.png")


def _save(figure: Figure, path: Path) -> None:
    """Write a PNG of few colours."""
    from PIL import Image

    raw = io.BytesIO()
    figure.savefig(raw, format="png", dpi=_DPI)

    def put(file: IO[bytes]) -> None:
        with Image.open(raw) as picture:
            picture.convert("RGB").quantize(_COLOURS).save(file, format="PNG", optimize=True)

    atomic_write(path, put)


def _circles(shape: str, near: dict[float, Any], far: dict[float, Any]) -> Figure:
    """Draw polar pictures above, the same over azimuth below; one column a band."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.5, 8.6))
    for column, ghz in enumerate(BANDS_GHZ):
        circle = Circle.of(near[ghz])
        beyond = None if far[ghz] is None else Circle.of(far[ghz])
        left = 0.06 + 0.49 * column
        polar: Any = figure.add_axes((left + 0.03, 0.535, 0.38, 0.37), projection="polar")
        flat: Any = figure.add_axes((left, 0.125, 0.43, 0.335))
        polar.set_title(f"{shape}, {ghz:g} GHz", fontsize=11, weight="bold", pad=14)
        _polar(polar, shape, circle, beyond)
        _flat(flat, shape, circle, beyond)
        if column == 0:
            flat.set_ylabel("RCS [dBsm]")
            handles, labels = flat.get_legend_handles_labels()
            figure.legend(handles, labels, loc="lower center", ncols=3, fontsize=8.5, frameon=False)
    return figure


def _statistics(circle: Circle) -> AngularStatistics:
    return angular_statistics(circle.azimuth_deg, circle.rcs_m2, WINDOW_DEG)


def _closed(angle: FloatArray, level: FloatArray) -> tuple[FloatArray, FloatArray]:
    return np.radians(np.append(angle, angle[0])), np.append(level, level[0])


def _polar(axes: Any, shape: str, circle: Circle, far: Circle | None) -> None:
    low, top = SPAN_DBSM[shape]
    axes.set_theta_zero_location("N")
    found = _statistics(circle)
    angle = circle.azimuth_deg
    axes.plot(*_closed(angle, np.maximum(dbsm(circle.rcs_m2), low)), color=NEAR, lw=0.7)
    if far is not None:
        beyond = _statistics(far)
        level = np.maximum(dbsm(beyond.median_m2), low)
        axes.plot(*_closed(beyond.angle_deg, level), color=FAR, lw=1.2, ls="--")
    axes.plot(*_closed(angle, np.maximum(dbsm(found.median_m2), low)), color=MEDIAN, lw=1.5)
    if shape in KIND:
        fine = np.arange(-180.0, 180.0)
        axes.plot(*_closed(fine, np.maximum(pattern_dbsm(KIND[shape], fine), low)), color=PUBLISHED, lw=1.3)
    axes.set_ylim(low, top)
    axes.set_yticks(np.arange(10 * np.ceil((low + 1) / 10), top + 0.1, 10))
    axes.set_thetagrids(np.arange(0, 360, 45), ["front", "45", "left", "135", "back", "-135", "right", "-45"])
    axes.set_rlabel_position(-22)
    axes.tick_params(labelsize=8)
    axes.grid(color=GRID, lw=0.6)


def _flat(axes: Any, shape: str, circle: Circle, far: Circle | None) -> None:
    found, angle = _statistics(circle), circle.azimuth_deg
    window = f"{WINDOW_DEG:g} deg window"
    near = f"{NEAR_M:g} m"
    axes.fill_between(angle, dbsm(found.p10_m2), dbsm(found.p90_m2), color=BAND, alpha=0.5, lw=0,
                      label=f"{near}: 10 to 90 %, {window}")  # fmt: skip
    axes.plot(angle, dbsm(circle.rcs_m2), color=NEAR, lw=0.7, label=f"{near}: every aspect")
    if far is not None:
        beyond = _statistics(far)
        label = f"far field: median, {window}"
        axes.plot(beyond.angle_deg, dbsm(beyond.median_m2), color=FAR, lw=1.2, ls="--", label=label)
    axes.plot(angle, dbsm(found.median_m2), color=MEDIAN, lw=1.5, label=f"{near}: median, {window}")
    if shape in KIND:
        _pattern(axes, KIND[shape])
    if shape == "bicycle":
        for number, (low, high, level) in enumerate(BICYCLIST.values()):
            for sign in (-1.0, 1.0):
                label = "bicyclist, mean of sector, 77 GHz (with rider)" if number == 0 and sign > 0 else None
                axes.plot([sign * low, sign * high], [level, level], color=PUBLISHED, lw=2.0, label=label)
    if shape == "pole":
        law = float(dbsm(distance.pole_on_turntable(NEAR_M)))
        axes.axhline(law, color=PUBLISHED, lw=1.3, label="25 m: closed form of an endless pole")
    axes.set(xlim=(-180, 180), ylim=SPAN_DBSM[shape], xticks=np.arange(-180, 181, 60))
    axes.set_xlabel("azimuth of the radar seen from the target [deg], + left", fontsize=9)
    axes.tick_params(labelsize=8.5)
    axes.grid(color=GRID, lw=0.6)


def _pattern(axes: Any, kind: str) -> None:
    fine = np.arange(-180.0, 180.1)
    level, sigma = pattern_dbsm(kind, fine), SIGMA_DB[kind]
    axes.plot(fine, level, color=PUBLISHED, lw=1.3, label=f"3GPP TR 38.901: {kind}, level radar")
    axes.fill_between(fine, level - sigma, level + sigma, color=PUBLISHED, alpha=0.15, lw=0, label=f"± {sigma} dB")


def _distances(found: Curves) -> Figure:
    """Draw a panel for each target over a logarithmic distance."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 6.4))
    axes = figure.subplots(2, 3, sharex=True)
    figure.subplots_adjust(0.055, 0.085, 0.99, 0.94, wspace=0.17, hspace=0.2)
    for panel, name in zip(axes.flat, distance.FORMULAS, strict=True):
        for ghz, colour in zip(BANDS_GHZ, ("#1f4e79", FAR), strict=True):
            curve = found[f"distance-{name}-{ghz:g}"]
            panel.semilogx(curve.x, curve.rcs_dbsm, color=colour, lw=1.2, marker="o", ms=2.5, label=f"{ghz:g} GHz")
            if name == "pole":
                fine = np.geomspace(5.0, 50.0, 120)
                panel.plot(fine, dbsm(distance.pole_integral(fine, ghz)), color=colour, lw=0.6, ls=":",
                           label=f"surface integral, {ghz:g} GHz")  # fmt: skip
        for ghz in BANDS_GHZ if name == "wall" else BANDS_GHZ[:1]:
            fine = np.geomspace(5.0, 50.0, 60)
            label = f"closed form, {ghz:g} GHz" if name == "wall" else "closed form"
            style = "--" if ghz == BANDS_GHZ[0] else ":"
            panel.plot(
                fine, dbsm(distance.closed_form(name, fine, ghz)), color=PUBLISHED, lw=1.5, ls=style, label=label
            )
        if name == "car-back":
            panel.plot(fine, dbsm(car_range_law(fine)), color="#7a3fa0", lw=1.2, label="10 lg R + 5, Kärnfelt 2009")
        panel.set_title(distance.TITLES[name], fontsize=10, weight="bold")
        panel.set_xticks([5, 10, 20, 50], ["5", "10", "20", "50"])
        panel.minorticks_off()
        panel.tick_params(labelsize=8.5)
        panel.grid(color=GRID, lw=0.6)
        panel.legend(fontsize=7.5, framealpha=0.7)
    for panel in axes[:, 0]:
        panel.set_ylabel("apparent RCS [dBsm]", fontsize=9)
    for panel in axes[1]:
        panel.set_xlabel("distance to the nearest point [m]", fontsize=9)
    return figure
