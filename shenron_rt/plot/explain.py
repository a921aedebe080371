"""The link budget of one object as a waterfall: from transmit power to the noise, and from there to its cell."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ._style import DETECTION, GRID, THRESHOLD, TRACE, TRUTH, new_figure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..attribution import ObjectExplanation, Stage

__all__ = ["explain_waterfall"]

_SUM = "#5b6470"
_WIDTH, _ROW = 10.8, 0.285


def explain_waterfall(item: ObjectExplanation, *, title: str = "") -> Figure:
    """Draw the waterfall of one object.

    Parameters
    ----------
    item : ObjectExplanation
        With a waterfall.
    title : str
        What the frame is; stands before the object's name.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    ValueError
        The object has no echo.
    """
    if item.waterfall is None:
        raise ValueError(f"{item.name} has no echo, and so no waterfall")
    stages = item.waterfall.stages
    link = [s for s in stages if s.unit == "dBm"]
    chain = [s for s in stages if s.unit == "dB"][1:]  # the first is the noise itself, where the unit changes
    rows = len(link) + len(chain) + 3
    height = 1.55 + _ROW * rows + 0.35
    figure, upper = new_figure(_WIDTH, height)
    lower = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    for side in ("top", "right"):
        lower.spines[side].set_visible(False)
    lower.tick_params(labelsize=9)
    tall, low = _ROW * (len(link) + 1) / height, _ROW * (len(chain) + 2) / height
    lower.set_position((0.235, 0.55 / height, 0.44, low))
    upper.set_position((0.235, 0.55 / height + low + 0.62 / height, 0.44, tall))
    _bars(upper, link, 0.0, [("received power a channel", item.waterfall.received_dbm)], "dBm")
    first = ("per-sample SNR", item.waterfall.sample_snr_db)
    _bars(lower, chain, first[1], [("measured cell SNR", item.waterfall.measured_snr_db)], "dB", head=first)
    lower.axvline(0.0, color=THRESHOLD, lw=0.9, ls=":")
    lower.text(0.0, 1.01, "noise", transform=lower.get_xaxis_transform(), fontsize=8, color=THRESHOLD, ha="center")
    for x, text in ((1.09, "gain [dB]"), (1.235, "level")):
        upper.text(x, 1.0, text, transform=upper.transAxes, ha="right", va="bottom", fontsize=8, color=_SUM)
    upper.set_xlabel("level [dBm]", fontsize=9, labelpad=1)
    lower.set_xlabel("over the noise at that step [dB]", fontsize=9, labelpad=1)
    head = f"{title} \u2013 " if title else ""
    figure.text(0.02, 1 - 0.24 / height, f"{head}{item.name}", fontsize=11, weight="bold", va="center")
    figure.text(0.02, 1 - 0.48 / height, _wrapped(item.verdict.text), fontsize=9.5, va="center")
    return figure


def _wrapped(text: str, width: int = 125) -> str:
    return text if len(text) <= width else text[: width - 1].rsplit(" ", 1)[0] + " \u2026"


def _bars(
    axes: Axes,
    stages: Sequence[Stage],
    start: float,
    total: Sequence[tuple[str, float]],
    unit: str,
    *,
    head: tuple[str, float] | None = None,
) -> None:
    """Draw floating bars from each level to the next, top to bottom, with gain and level beside them."""
    names = [head[0]] if head else []
    names += [s.name for s in stages] + [name for name, _ in total]
    y = 0
    if head:
        axes.barh(y, head[1], color=_SUM, height=0.62)
        _numbers(axes, y, "", f"{head[1]:z.2f} {unit}", bold=True)
        y += 1
    level = start
    for stage in stages:
        colour = TRUTH if stage.gain_db > 0 else TRACE
        axes.barh(y, stage.gain_db, left=level, color=colour, height=0.62, alpha=0.85)
        after = level + stage.gain_db
        axes.plot([after, after], [y - 0.31, y + 1.31], color=_SUM, lw=0.8)
        level = after
        _numbers(axes, y, f"{stage.gain_db:+z.2f}", f"{level:z.2f}", note=stage.note)
        y += 1
    for _, value in total:
        axes.barh(y, value, color=_SUM, height=0.62)
        axes.plot([value], [y], marker="D", color=DETECTION, mec=TRACE, ms=5)
        _numbers(axes, y, "", f"{value:z.2f} {unit}", bold=True)
        y += 1
    axes.set_yticks(np.arange(len(names)), names, fontsize=9)
    axes.set_ylim(y - 0.4, -0.6)
    ends = [start, 0.0, *(s.level for s in stages), *(value for _, value in total)]
    room = 0.04 * (max(ends) - min(ends))
    axes.set_xlim(min(ends) - room, max(ends) + room)
    axes.grid(axis="x", color=GRID, lw=0.6)
    axes.set_axisbelow(True)


def _numbers(axes: Axes, y: int, gain: str, level: str, *, note: str = "", bold: bool = False) -> None:
    """Write what a stage adds, and the level after it, to the right of the axes."""
    place = axes.get_yaxis_transform()
    weight = "bold" if bold else "normal"
    axes.text(1.09, y, gain, transform=place, ha="right", va="center", fontsize=8.5, color=TRACE)
    axes.text(1.235, y, level, transform=place, ha="right", va="center", fontsize=8.5, weight=weight)
    axes.text(1.26, y, note, transform=place, ha="left", va="center", fontsize=7, color=_SUM)
