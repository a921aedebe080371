"""The page of a comparison: both maps on one colour scale, their difference, objects in dB, errors."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._typing import FloatArray
from ._style import CMAP, DETECTION, GRID, THRESHOLD, TRACE, TRUTH, dbm, limits, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    # the comparison stands above the pictures in the order of the layers; only its type is needed here
    from ..comparison import Comparison

__all__ = ["comparison_page"]

_DIVERGING = "RdBu_r"
#: The difference picture saturates here [dB].
_SPAN_DIFFERENCE = 20.0
_MAX_OBJECTS = 12
_MAX_NAME = 22
_WIDTH = 15.0
_MAP_NAMES = {"range_doppler": "range-Doppler", "range_azimuth": "range-azimuth"}


def comparison_page(comparison: Comparison, path: Path) -> Path:
    """Draw the page and write it as PNG.

    Parameters
    ----------
    comparison : Comparison
    path : path

    Returns
    -------
    Path
    """
    rows = len(comparison.map_pairs) + 1
    height = 4.6 * rows + 0.8
    figure, first = new_figure(_WIDTH, height)
    first.remove()
    grid = figure.add_gridspec(
        rows, 3, left=0.10, right=0.94, bottom=0.6 / height + 0.02, top=1 - 1.1 / height, hspace=0.34, wspace=0.26
    )
    for row, pair in enumerate(comparison.map_pairs):
        _maps(figure, [figure.add_subplot(grid[row, k]) for k in range(3)], comparison, pair)
    _objects(figure.add_subplot(grid[rows - 1, :2]), comparison)
    _errors(figure, grid[rows - 1, 2].subgridspec(3, 1, hspace=0.75), comparison)
    names = (
        n if n.startswith(f"{s}:") else f"{s}: {n}"
        for s, n in zip("AB", (comparison.name_a, comparison.name_b), strict=True)
    )
    title = "      ".join([*names, "differences are B minus A"])
    figure.text(0.10, 1 - 0.35 / height, title, fontsize=13, weight="bold", va="center")
    several = [f"mean of {len(comparison.frames)} frames"] if len(comparison.frames) > 1 else []
    notes = "; ".join([*several, *comparison.notes]) or "same radar, same axes"
    figure.text(0.10, 1 - 0.65 / height, textwrap.shorten(notes, 200), fontsize=9, va="center", color="#555b66")
    return save(figure, path)


def _maps(figure: Figure, axes: list[Axes], comparison: Comparison, pair: Any) -> None:
    cube_a, cube_b = (side.cube for side in comparison.sides)
    assert cube_a is not None
    assert cube_b is not None
    level_a, level_b = dbm(pair.a), dbm(pair.b)
    low, high = limits(np.concatenate([level_a, level_b]), float(dbm(pair.floor)))
    doppler = pair.name == "range_doppler"
    x = cube_a.velocity_mps if doppler else cube_a.azimuth_sine
    label = "range rate [m/s]" if doppler else "sine of azimuth, + left"
    half, dr = (x[1] - x[0]) / 2 if len(x) > 1 else 0.5, cube_a.range_step_m
    extent = (x[0] - half, x[-1] + half, -dr / 2, cube_a.range_m[-1] + dr / 2)
    shared: dict[str, Any] = {"origin": "lower", "aspect": "auto", "interpolation": "nearest", "extent": extent}
    record = comparison.maps[pair.name]
    for ax, level, name in ((axes[0], level_a, "A"), (axes[1], level_b, "B")):
        image = ax.imshow(level, cmap=CMAP, vmin=low, vmax=high, **shared)
        ax.set_title(f"{name}: {_MAP_NAMES[pair.name]}", fontsize=10, loc="left")
    _bar(figure, image, axes[1], "dBm")
    floor = float(dbm(pair.floor))
    difference = np.maximum(level_b, floor) - np.maximum(level_a, floor)
    image = axes[2].imshow(difference, cmap=_DIVERGING, vmin=-_SPAN_DIFFERENCE, vmax=_SPAN_DIFFERENCE, **shared)
    _bar(figure, image, axes[2], "B - A [dB]")
    correlation = record["correlation"]
    text = f"B - A    r = {correlation:.2f}" if correlation is not None else "B - A"
    axes[2].set_title(f"{text}, LSD {record['log_spectral_distance_db']:.1f} dB", fontsize=10, loc="left")
    _points(axes, comparison, doppler)
    for ax in axes:
        ax.set_xlim(extent[:2] if doppler else extent[1::-1])  # left on the left; no strip for a mark on the edge
        ax.set_xlabel(label, fontsize=9)
        ax.tick_params(labelsize=8)
        ax.set_ylim(0, extent[3])
    axes[0].set_ylabel("range [m]", fontsize=9)


def _points(axes: list[Axes], comparison: Comparison, doppler: bool) -> None:
    """Ring the detections of each side; on the difference, those that the other side misses."""
    for sides in (comparison.sides, *comparison.later_sides):
        for ax, side in zip(axes, sides, strict=False):
            found = side.detections
            x = found.velocity if doppler else np.sin(found.azimuth)
            ax.plot(x, found.range, ls="none", marker="o", ms=6, mfc="none", mec=DETECTION, mew=0.9)
    key = "velocity_mps" if doppler else "azimuth_deg"
    for records, colour, label in (
        (comparison.detections["missed"], THRESHOLD, "A only"), (comparison.detections["extra"], TRACE, "B only")
    ):  # fmt: skip
        x = np.array([r[key] for r in records])
        y = [r["range_m"] for r in records]
        axes[2].plot(
            x if doppler else np.sin(np.radians(x)), y, ls="none", marker="o", ms=6, mfc="none", mec=colour, label=label
        )
    axes[2].legend(fontsize=7, loc="upper right", framealpha=0.8)


def _bar(figure: Figure, image: Any, ax: Axes, text: str) -> None:
    bar = figure.colorbar(image, ax=ax, fraction=0.05, pad=0.02)
    bar.set_label(text, fontsize=8)
    bar.ax.tick_params(labelsize=7)


def _objects(ax: Axes, comparison: Comparison) -> None:
    """Two bars an object, and in words what makes them differ."""
    records = comparison.objects[:_MAX_OBJECTS]
    ax.set_title("power of each object, and the cause of its difference", fontsize=10, loc="left")
    if not records:
        ax.text(0.5, 0.5, "no objects: a side without echoes", ha="center", va="center", transform=ax.transAxes)
        ax.set_axis_off()
        return
    levels = [30 + r[k] for r in records for k in ("power_db_a", "power_db_b") if r[k] is not None]
    base = min(levels) - 5
    for row, record in enumerate(records):
        for side, offset, colour in (("a", -0.2, TRACE), ("b", 0.2, TRUTH)):
            power = record[f"power_db_{side}"]
            if power is not None:
                ax.barh(row + offset, power + 30 - base, left=base, height=0.36, color=colour)
        top = 30 + max(v for v in (record["power_db_a"], record["power_db_b"]) if v is not None)
        delta = "only " + record["seen_by"].upper() if record["delta_db"] is None else f"{record['delta_db']:+.1f} dB"
        ax.text(top + 0.4, row, f"{delta}: {', '.join([record['cause'], *record['also']])}", fontsize=8, va="center")
    # the end of a long name tells more: vehicle.lincoln.mkz_2020
    ax.set_yticks(
        range(len(records)), [f"{r['name'][-_MAX_NAME:]}\n{r['tag']}, id {r['id']}" for r in records], fontsize=8
    )
    ax.set_xlim(base, max(levels) + 0.6 * (max(levels) - base))
    ax.set_ylim(len(records) - 0.4, -0.6)
    ax.set_xlabel("received power [dBm]    blue: A, green: B", fontsize=9)
    ax.grid(axis="x", color=GRID, lw=0.6)
    ax.set_axisbelow(True)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)


def _errors(figure: Figure, grid: Any, comparison: Comparison) -> None:
    found = comparison.detections
    names = (
        ("range_m_error", "range [m]"),
        ("velocity_mps_error", "velocity [m/s]"),
        ("azimuth_deg_error", "azimuth [deg]"),
    )
    for row, (key, label) in enumerate(names):
        ax = figure.add_subplot(grid[row, 0])
        values: FloatArray = np.array([m[key] for m in found["matched"]], dtype=np.float64)
        if len(values):
            ax.hist(values, bins=min(21, max(5, len(values))), color=TRACE)
            ax.axvline(0, color=THRESHOLD, lw=0.8)
        ax.set_xlabel(f"{label}, B - A", fontsize=8, labelpad=1)
        ax.tick_params(labelsize=7)
        if row == 0:
            counts = f"{len(found['matched'])} matched, {len(found['missed'])} missed, {len(found['extra'])} extra"
            ax.set_title(f"detections: {counts}", fontsize=10, loc="left")
