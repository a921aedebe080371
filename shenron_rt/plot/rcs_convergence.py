"""A convergence study: the sweeps over each other, and what changes between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..turntable.convergence import WITHIN_DB
from ._style import GRID, THRESHOLD, TRACE, new_figure
from .rcs import SPAN_DB, cut_of, described, headline

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..turntable import Convergence

__all__ = ["convergence_picture"]


def convergence_picture(study: Convergence, *, title: str = "") -> Figure:
    """Draw the last two densities over the main axis, and their difference below.

    Parameters
    ----------
    study : Convergence
    title : str

    Returns
    -------
    matplotlib.figure.Figure
    """
    coarse, fine = study.sweeps[-2:]
    lines = [cut_of(sweep) for sweep in (coarse, fine)]
    figure, upper = new_figure(9.0, 6.2)
    upper.set_position((0.085, 0.40, 0.895, 0.47))
    lower = figure.add_axes((0.085, 0.10, 0.895, 0.24))
    x, change = lines[1].x, lines[0].rcs_dbsm[:, 0] - lines[1].rcs_dbsm[:, 0]
    marker = "o" if len(x) == 1 else None
    for line, sweep, colour, style in ((lines[0], coarse, THRESHOLD, "--"), (lines[1], fine, TRACE, "-")):
        upper.plot(
            x, line.rcs_dbsm[:, 0], color=colour, ls=style, lw=1.1, marker=marker,
            label=f"rays per wavelength: {sweep.rays_per_wavelength:g}",
        )  # fmt: skip
    top = float(np.ceil(fine.rcs_dbsm.max()))
    upper.set_ylim(max(top - SPAN_DB, float(lines[1].rcs_dbsm[:, 0].min()) - 3), top + 3)
    upper.axhline(top - WITHIN_DB, color="#8a8f98", lw=0.8, ls=":")
    upper.text(0.995, top - WITHIN_DB + 0.5, f"{WITHIN_DB:g} dB below the peak", fontsize=8, color="#555b66",
               ha="right", transform=upper.get_yaxis_transform())  # fmt: skip
    upper.set_ylabel(f"RCS, {fine.polarization[0]} [dBsm]")
    upper.legend(fontsize=8.5, loc="upper right", frameon=False)
    peak = fine.rcs_dbsm[lines[1].index[0]].max()
    strong = lines[1].rcs_dbsm[:, 0] >= peak - WITHIN_DB
    lower.plot(x, change, color="#c3c9d1", lw=0.9, marker=marker, label="all samples")
    lower.plot(
        x, np.where(strong, change, np.nan), color=TRACE, lw=1.2, marker=marker or ".", ms=3,
        label=f"within {WITHIN_DB:g} dB of the peak",
    )  # fmt: skip
    reach = max(1.5 * float(np.abs(change[strong]).max(initial=0.0)), 0.05)
    lower.set_ylim(-reach, reach)
    lower.set_ylabel("coarse - fine [dB]")
    unit = "GHz" if lines[1].axis == "frequency" else "deg"
    lower.set_xlabel(f"{lines[1].axis} [{unit}]")
    lower.legend(fontsize=8, loc="upper right", frameon=False, ncols=2)
    for axes in (upper, lower):
        axes.grid(color=GRID, lw=0.6)
        if len(x) > 1:
            axes.set_xlim(float(x.min()), float(x.max()))
    last = study.steps[-1]
    text = (
        f"{described(fine, lines[1])}; median change {last.median_db:.3f} dB, 90 % {last.p90_db:.3f} dB, "
        f"at most {last.max_db:.2f} dB"
    )
    headline(figure, title or f"{fine.target}: convergence", text)
    return figure
