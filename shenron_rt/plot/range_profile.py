"""Range profile: the strongest Doppler cell of every range, the CFAR threshold there, and where the objects are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .._typing import FloatArray
from ._style import DETECTION, GRID, THRESHOLD, TRACE, TRUTH, dbm, new_figure
from .truth import Truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..dsp import Detections, RadarCube

__all__ = ["range_profile"]

_MAX_LABELS = 8
#: Rows of labels, and the width of a character of them over that of the axes, on average.
_LABEL_ROWS, _CHARACTER = 3, 0.0078


def range_profile(
    cube: RadarCube,
    detections: Detections | None = None,
    *,
    threshold: FloatArray | None = None,
    truth: Sequence[Truth] = (),
    title: str = "",
) -> Figure:
    """Draw power over range.

    Parameters
    ----------
    cube : RadarCube
    detections : Detections, optional
        Marked at their range and at the level of the profile.
    threshold : (n_range, n_velocity) float, optional
        CFAR threshold of every range-Doppler cell, in the units of ``cube.range_doppler`` [W].
    truth : sequence of Truth
        Ticks along the top.
    title : str

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure, axes = new_figure(9.0, 4.6)
    axes.set_position((0.08, 0.19, 0.90, 0.62))
    rows = np.arange(len(cube.range_m))
    best = cube.range_doppler.argmax(axis=1)
    level = dbm(cube.range_doppler[rows, best])
    axes.plot(cube.range_m, level, color=TRACE, lw=1.1, label="strongest Doppler cell")
    if threshold is not None:
        limit = dbm(threshold[rows, best])
        axes.plot(cube.range_m, limit, color=THRESHOLD, lw=1.0, ls="--", label=f"CFAR threshold, Pfa {_pfa(cube)}")
    axes.axhline(
        float(dbm(cube.noise_power_w)), color="#8a8f98", lw=0.9, ls=":", label="thermal noise k T0 F of a cell"
    )
    if detections is not None and len(detections):
        index = np.clip(np.rint(detections.range / cube.range_step_m).astype(int), 0, len(rows) - 1)
        axes.plot(
            cube.range_m[index], level[index], ls="none", marker="o", ms=6, mfc=DETECTION, mec=TRACE, mew=0.8,
            label=f"{len(detections)} detections",
        )  # fmt: skip
    _ticks(axes, truth, float(cube.range_m[-1]))
    floor = float(dbm(cube.noise_power_w))
    axes.set_ylim(min(floor, float(np.percentile(level, 5))) - 6, max(float(level.max()), floor + 20) + 4)
    axes.set_xlim(0, float(cube.range_m[-1]))
    axes.set_xlabel("range [m]")
    axes.set_ylabel("power, mean of channels [dBm]")
    axes.grid(color=GRID, lw=0.6)
    axes.legend(fontsize=8.5, loc="upper center", bbox_to_anchor=(0.5, -0.15), ncols=4, frameon=False)
    figure.text(0.08, 0.955, title or "Range profile", fontsize=11, weight="bold", va="center")
    return figure


def _pfa(cube: RadarCube) -> str:
    return f"{cube.profile.processing.pfa:g}"


def _ticks(axes: Axes, truth: Sequence[Truth], last_m: float) -> None:
    """Mark true ranges along the top; labels of the strongest few, stacked where they would touch."""
    shown = sorted((t for t in truth[:_MAX_LABELS] if t.range_m <= last_m), key=lambda t: t.range_m)
    ends = [-np.inf] * _LABEL_ROWS
    for item in shown:
        at, half = item.range_m / last_m, _CHARACTER * (len(item.name) + 1) / 2
        step = next((row for row, end in enumerate(ends) if at - half >= end), int(np.argmin(ends)))
        ends[step] = at + half
        transform = axes.get_xaxis_transform()
        axes.plot(
            [item.range_m] * 2, [0.96, 1.0 + 0.055 * step], transform=transform, color=TRUTH, lw=1.6, clip_on=False
        )
        axes.text(
            item.range_m, 1.015 + 0.055 * step, item.name, transform=transform, color=TRUTH, fontsize=8,
            ha="center", va="bottom",
        )  # fmt: skip
