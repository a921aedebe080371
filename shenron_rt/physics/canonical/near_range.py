"""Apparent RCS at a finite range: what the radar equation reads off a flat target that is not in the far field."""

from __future__ import annotations

import math

import numpy as np

from ..._typing import ArrayLike, FloatArray

__all__ = ["infinite_plate_rcs", "near_range_disc_rcs", "near_range_plate_rcs"]


def infinite_plate_rcs(range_m: ArrayLike) -> FloatArray:
    """Return pi R^2, the apparent RCS of an unbounded mirror at range R: its image stands at 2 R."""
    return np.asarray(math.pi * np.asarray(range_m, dtype=np.float64) ** 2)


def _composite_rule(length: float, panels: int) -> tuple[FloatArray, FloatArray]:
    """Return nodes and weights of twelve-point Gauss-Legendre on equal panels of (0, length)."""
    x, weight = np.polynomial.legendre.leggauss(12)
    width = length / panels
    nodes = (np.arange(panels)[:, None] + 0.5 * (x + 1.0)) * width
    return nodes.ravel(), np.tile(0.5 * width * weight, panels)


def near_range_plate_rcs(a: float, b: float, wavelength: float, range_m: float) -> float:
    """Return the apparent RCS of a rectangular plate on boresight at a finite range.

    Parameters
    ----------
    a, b : float
        Sides. [m]
    wavelength : float
        Wavelength. [m]
    range_m : float
        Range from the (isotropic) radar to the plate's centre, > 0. [m]

    Returns
    -------
    float
        4 pi R^4 |(k/2 pi) integral of cos(alpha) e^{-2jk(rho - R)}/rho^2 dA|^2 [m^2].

    Notes
    -----
    Gauss-Legendre over a quarter of the plate, twelve nodes for each cycle of the two-way phase or less, so the result
    is converged to better than 1e-6.
    """
    k = 2.0 * math.pi / wavelength

    def rule(half: float) -> tuple[FloatArray, FloatArray]:
        # the phase runs fastest at the edge: 2/lambda times the sine of the angle cycles per metre
        cycles = 2.0 * half**2 / (math.hypot(half, range_m) * wavelength)
        return _composite_rule(half, 1 + math.ceil(cycles))

    (y, wy), (z, wz) = rule(0.5 * a), rule(0.5 * b)
    across = y[:, None] ** 2 + z[None, :] ** 2
    rho = np.sqrt(range_m**2 + across)
    extra = across / (rho + range_m)  # rho - R without cancellation
    field = 4.0 * np.einsum("i,j,ij->", wy, wz, range_m / rho**3 * np.exp(-2j * k * extra))
    return float(4.0 * math.pi * range_m**4 * abs(k / (2.0 * math.pi) * field) ** 2)


def near_range_disc_rcs(radius: float, wavelength: float, range_m: float) -> float:
    """Return the apparent RCS [m^2] of a disc on boresight at a finite range; see :func:`near_range_plate_rcs`.

    Notes
    -----
    With rho the distance to a ring, dA = 2 pi rho d(rho): a one-dimensional integral of R e^{-2jk(rho - R)}/rho^2.
    """
    k = 2.0 * math.pi / wavelength
    depth = math.hypot(radius, range_m) - range_m
    extra, weight = _composite_rule(depth, 1 + math.ceil(2.0 * depth / wavelength))
    ring = 2.0 * math.pi * range_m / (range_m + extra) ** 2 * np.exp(-2j * k * extra)
    field = np.sum(weight * ring)
    return float(4.0 * math.pi * range_m**4 * abs(k / (2.0 * math.pi) * field) ** 2)
