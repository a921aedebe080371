"""Range-Doppler map: velocity to the right, range up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ._style import CMAP, counted, dbm, label, limits, new_figure, ring
from .truth import Truth

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..dsp import Detections, RadarCube

__all__ = ["range_doppler"]

_MAX_LABELS = 6


def range_doppler(
    cube: RadarCube, detections: Detections | None = None, *, truth: Sequence[Truth] = (), title: str = ""
) -> Figure:
    """Draw power over range rate and range, detections and objects (as crosses) at their folded velocity.

    Parameters
    ----------
    cube : RadarCube
    detections : Detections, optional
        Ringed, ghosts in squares.
    truth : sequence of Truth
    title : str

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure, axes = new_figure(7.6, 6.0)
    axes.set_position((0.10, 0.10, 0.74, 0.80))
    level = dbm(cube.range_doppler)
    low, high = limits(level, float(dbm(cube.noise_power_w)))
    dv, dr = cube.velocity_step_mps, cube.range_step_m
    v, r = cube.velocity_mps, cube.range_m
    image = axes.imshow(
        level, origin="lower", aspect="auto", interpolation="nearest", cmap=CMAP, vmin=low, vmax=high,
        extent=(v[0] - dv / 2, v[-1] + dv / 2, -dr / 2, r[-1] + dr / 2),
    )  # fmt: skip
    if detections is not None and len(detections):
        span = len(v) * dv  # an unfolded velocity may lie beyond the axis
        ring(axes, (detections.velocity - v[0]) % span + v[0], detections.range, detections.ghost, size=10)
    axes.set_xlim(v[0] - dv / 2, v[-1] + dv / 2)
    axes.set_ylim(0, r[-1] + dr / 2)
    taken: list[tuple[float, float]] = []
    for item in truth[:_MAX_LABELS]:
        if item.range_m <= r[-1]:
            x = item.folded(cube.profile.max_velocity_mps)
            axes.plot(x, item.range_m, marker="+", ms=9, mew=1.2, color="white")
            label(axes, taken, x, item.range_m, item.name, left=bool(x > v[0] + 0.75 * (v[-1] - v[0])))
    axes.set_xlabel("range rate [m/s], positive = receding")
    axes.set_ylabel("range [m]")
    bar = figure.colorbar(image, cax=figure.add_axes((0.86, 0.10, 0.025, 0.80)))
    bar.set_label(f"power, mean of channels [dBm], {high - low:.0f} dB shown", fontsize=9)
    bar.ax.tick_params(labelsize=8)
    marked = "o 0 detections" if detections is None else counted(detections.ghost)
    figure.text(0.10, 0.955, title or "Range-Doppler", fontsize=11, weight="bold", va="center")
    figure.text(0.84, 0.925, f"{marked}   + truth", fontsize=8, ha="right", va="center", color="#555b66")
    return figure
