"""Tracks from above, in the world: where objects were and went, and what the detections said."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ._style import GRID, THRESHOLD, TRUTH, new_figure

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from ..objects import Observation, Tracking

__all__ = ["track_view"]

_COLOURS = ("#1f4e79", "#c0392b", "#8e44ad", "#d68910", "#117a65", "#2e86c1", "#af601a", "#6c3483")
#: Points drawn of all detections; beyond, every n-th.
_MOST_POINTS = 20_000


def track_view(tracking: Tracking, observations: Sequence[Observation], *, title: str = "") -> Figure:
    """Draw tracks, truth and detections from above, and the OSPA distance over time.

    Parameters
    ----------
    tracking : Tracking
    observations : sequence of Observation
        What was tracked.
    title : str

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure, upper = new_figure(9.6, 6.4)
    upper.set_position((0.08, 0.42, 0.89, 0.49))
    lower = figure.add_axes((0.08, 0.09, 0.89, 0.22))
    points = np.concatenate([_points(o) for o in observations]) if observations else np.zeros((0, 2))
    step = max(1, len(points) // _MOST_POINTS)
    upper.plot(*points[::step].T, ls="none", marker=".", ms=1.5, color="#b8bec6", label="detections", zorder=1)
    eye = np.array([o.radar.origin[:2] for o in observations]).reshape(-1, 2)
    upper.plot(*eye.T, color="#5b6470", lw=1.0, ls=":", label="radar")
    for k, number in enumerate(sorted({i for o in observations for i in o.truths})):
        there = [o.truths[number].position[:2] for o in observations if number in o.truths]
        upper.plot(*np.array(there).T, color=TRUTH, lw=4.0, alpha=0.35, label="truth" if k == 0 else None)
    for k, number in enumerate(sorted({r.track for r in tracking.rows})):
        rows = [r for r in tracking.rows if r.track == number]
        x, y = [r.x_m for r in rows], [r.y_m for r in rows]
        upper.plot(x, y, color=_COLOURS[k % len(_COLOURS)], lw=1.4, label=f"track {number}" if k < 6 else None)
        upper.text(x[-1], y[-1], f" {number}", fontsize=8, color=_COLOURS[k % len(_COLOURS)], va="center")
    _view(upper, eye, tracking)
    times = [o.time_s for o in observations]
    lower.plot(times, [o.total for o in tracking.ospa], color=THRESHOLD, lw=1.2, label="total")
    lower.plot(times, [o.place for o in tracking.ospa], color=TRUTH, lw=1.0, label="place")
    lower.set_ylim(0, tracking.cutoff_m * 1.05)
    lower.set_xlabel("time [s]")
    lower.set_ylabel("OSPA [m]")
    for axes in (upper, lower):
        axes.grid(color=GRID, lw=0.6)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(fontsize=8, ncols=8, frameon=False, loc="upper left")
    figure.text(0.08, 0.955, title or "Tracks", fontsize=11, weight="bold", va="center")
    return figure


def _points(seen: Observation) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    t = seen.detections
    local = np.column_stack([t.x, t.y, t.z])
    world: np.ndarray[tuple[int, int], np.dtype[np.float64]] = local @ seen.radar.rotation.T + seen.radar.origin
    return world[:, :2]


def _view(axes: object, eye: np.ndarray[tuple[int, int], np.dtype[np.float64]], tracking: Tracking) -> None:
    """Frame the tracks and the radar; detections beyond are cut."""
    from matplotlib.axes import Axes

    assert isinstance(axes, Axes)
    places = np.concatenate([eye, np.array([[r.x_m, r.y_m] for r in tracking.rows]).reshape(-1, 2)])
    if len(places):
        low, high = places.min(axis=0), places.max(axis=0)
        room = np.maximum(0.06 * (high - low), 6.0)
        axes.set_xlim(low[0] - room[0], high[0] + room[0])
        axes.set_ylim(low[1] - room[1], high[1] + room[1])
    axes.set_xlabel("x, world [m]")
    axes.set_ylabel("y, world [m]")
