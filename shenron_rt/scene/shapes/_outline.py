"""Plan outlines given by their curvature, which is what a radar sees of a smooth body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._typing import FloatArray

__all__ = ["Outline", "half_outline"]

_STEPS = 7201


@dataclass(frozen=True, eq=False)
class Outline:
    """Left half of a convex plan outline, from the nose (+x) to the tail (-x).

    Parameters
    ----------
    azimuth : (n,) float
        Azimuth of the outward normal [rad], 0 to pi.
    radius : (n,) float
        Radius of curvature there [m].
    x, y : (n,) float
        Points [m].
    """

    azimuth: FloatArray
    radius: FloatArray
    x: FloatArray
    y: FloatArray

    @property
    def arc(self) -> FloatArray:
        """(n,) length along the outline [m], from the nose."""
        step = np.hypot(np.diff(self.x), np.diff(self.y))
        return np.concatenate([[0.0], np.cumsum(step)])

    def resampled(self, azimuth: FloatArray) -> Outline:
        """Return the outline at other azimuths of the normal [rad]."""
        radius, x, y = (np.interp(azimuth, self.azimuth, v) for v in (self.radius, self.x, self.y))
        return Outline(azimuth, radius, x, y)


def half_outline(length: float, width: float, corner: float, spread_deg: tuple[float, float, float]) -> Outline:
    """Return the outline of given size whose corners have one radius and whose nose, side and tail are flatter.

    Parameters
    ----------
    length, width : float
        Of the whole outline [m].
    corner : float
        Radius of curvature at the corners [m].
    spread_deg : (3,) tuple of float
        Half widths, in azimuth of the normal, of the flatter stretches at nose, side and tail [deg]; their radii of
        curvature follow from the size.

    Notes
    -----
    With the normal's azimuth p as parameter a convex curve is dx/dp = -rho sin p, dy/dp = rho cos p. Half length and
    half widths are linear in rho, so the three radii solve a linear system.
    """
    p = np.linspace(0.0, np.pi, _STEPS)
    bumps = np.stack(
        [
            1.0 / (1.0 + ((p - centre) / np.radians(half)) ** 6)
            for centre, half in zip((0.0, np.pi / 2.0, np.pi), spread_deg, strict=True)
        ]
    )
    basis = np.concatenate([bumps, np.full((1, p.size), corner)])
    front = p <= np.pi / 2.0 + 1e-12
    back = p >= np.pi / 2.0 - 1e-12
    sizes = np.stack(
        [
            np.trapezoid((basis * np.cos(p))[:, front], p[front], axis=1),
            -np.trapezoid((basis * np.cos(p))[:, back], p[back], axis=1),
            np.trapezoid(basis * np.sin(p), p, axis=1),
        ]
    )
    wanted = np.array([width / 2.0, width / 2.0, length]) - sizes[:, 3]
    radius = np.concatenate([np.linalg.solve(sizes[:, :3], wanted), [1.0]]) @ basis
    x = length / 2.0 - _running(radius * np.sin(p), p)
    y = _running(radius * np.cos(p), p)
    y[-1] = 0.0  # the two half widths agree; what is left is rounding
    return Outline(p, radius, x, y)


def _running(values: FloatArray, at: FloatArray) -> FloatArray:
    step = 0.5 * (values[1:] + values[:-1]) * np.diff(at)
    return np.concatenate([[0.0], np.cumsum(step)])
