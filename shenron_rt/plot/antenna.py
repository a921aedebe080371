"""Antenna cuts in azimuth and elevation, with the half-power marks and the loss far off boresight."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ._style import GRID, TRACE, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..config.profile import RadarProfile

__all__ = ["antenna_cuts", "loss_table"]

_FLOOR_DB = -40.0
_ELEVATION = "#b8621b"
_OFF_BORESIGHT_DEG = (60, 80, 90)


def loss_table(profile: RadarProfile) -> dict[str, dict[int, float]]:
    """Return the one-way loss at 60, 80 and 90 degrees off boresight by cut [dB, positive]."""
    angle = np.radians(_OFF_BORESIGHT_DEG)
    zero = np.zeros_like(angle)
    cuts = {"azimuth": profile.pattern(angle, zero), "elevation": profile.pattern(zero, angle)}
    return {
        name: {d: float(-10 * np.log10(max(g, 1e-30))) for d, g in zip(_OFF_BORESIGHT_DEG, gain, strict=True)}
        for name, gain in cuts.items()
    }


def antenna_cuts(profile: RadarProfile) -> Figure:
    """Draw both one-way cuts relative to their peak.

    Parameters
    ----------
    profile : RadarProfile

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure, axes = new_figure(8.4, 4.6)
    axes.set_position((0.085, 0.12, 0.885, 0.72))
    degrees = np.linspace(-90, 90, 721)
    angle, zero = np.radians(degrees), np.zeros(721)
    a, losses = profile.antenna, loss_table(profile)
    for name, gain, colour, width in (
        ("azimuth", profile.pattern(angle, zero), TRACE, a.beamwidth_az_deg),
        ("elevation", profile.pattern(zero, angle), _ELEVATION, a.beamwidth_el_deg),
    ):
        level = 10 * np.log10(np.maximum(gain, 1e-30))
        wide = f", {width:g}\u00b0 at -3 dB" if width and a.pattern in ("gaussian", "cosn") else ""
        at = " / ".join(f"{losses[name][d]:.1f}" for d in _OFF_BORESIGHT_DEG)
        axes.plot(degrees, level, color=colour, lw=1.6, label=f"{name}{wide}; loss at 60 / 80 / 90\u00b0: {at} dB")
        for side in (-1, 1):
            half = np.abs(degrees[level >= -3.0103 - 1e-9]).max()
            if half < 90:
                axes.plot(side * half, -3.01, marker="o", ms=5, color=colour)
    axes.axhline(-3.01, color="#8a8f98", lw=0.8, ls=":")
    axes.text(-89, -2.6, "-3 dB", fontsize=8, color="#666c76")
    axes.set_xlim(-90, 90)
    axes.set_xticks(range(-90, 91, 15))
    axes.set_ylim(_FLOOR_DB, 1)
    axes.set_xlabel("angle off boresight [deg], azimuth positive left, elevation positive up")
    axes.set_ylabel("one-way gain relative to the peak [dB]")
    axes.grid(color=GRID, lw=0.6)
    axes.legend(fontsize=8.5, loc="lower center", framealpha=0.95)
    figure.text(0.085, 0.945, f"Antenna of {profile.name}: {a.pattern}, {a.polarization}", fontsize=11, weight="bold")
    figure.text(
        0.085, 0.885, f"gain {a.gain_tx_dbi:g} dBi transmit, {a.gain_rx_dbi:g} dBi receive, "
        f"{a.radome_loss_db:g} dB two-way radome loss; two-way losses are twice those shown",
        fontsize=8.5, color="#555b66",
    )  # fmt: skip
    return figure
