"""Physical optics of a curved surface at a finite range, by direct integration: for poles, guard rails and the like."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from ..._typing import ArrayLike, FloatArray
from ...errors import InputError

__all__ = ["SurfacePatch", "near_range_cylinder_rcs", "near_range_surface_amplitude"]

#: (u, v) -> points (..., 3) [m] and area vectors (..., 3), the outward normal times |dr/du x dr/dv|.
SurfacePatch = Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]

#: Two-way cycles on a panel of twelve Gauss-Legendre nodes: J_24(2 pi) = 1e-12 bounds the error of the phasor.
_CYCLES_PER_PANEL = 2.0
_NODES = 12
#: Points of each parameter at which the phase rate is looked up, and nodes held in memory at once.
_SURVEY = 129
_CHUNK = 500_000


def gauss_panels(low: float, high: float, cycles: float) -> tuple[FloatArray, FloatArray]:
    """Return Gauss-Legendre nodes and weights on equal panels of (low, high) for a phase of that many cycles."""
    x, weight = np.polynomial.legendre.leggauss(_NODES)
    panels = 1 + math.ceil(cycles / _CYCLES_PER_PANEL)
    width = (high - low) / panels
    nodes = low + (np.arange(panels)[:, None] + 0.5 * (x + 1.0)) * width
    return nodes.ravel(), np.tile(0.5 * width * weight, panels)


def _survey(patch: SurfacePatch, u: tuple[float, float], v: tuple[float, float], radar: FloatArray) -> list[float]:
    """Return the largest rate of the distance along u and v, each times the parameter's length, in metres."""
    points, _ = patch(*np.meshgrid(np.linspace(*u, _SURVEY), np.linspace(*v, _SURVEY), indexing="ij"))
    distance = np.linalg.norm(points - radar, axis=-1)
    return [float(np.max(np.abs(np.diff(distance, axis=axis)))) * (_SURVEY - 1) for axis in (0, 1)]


def _chunks(nodes: FloatArray, weights: FloatArray, other: int) -> Iterator[tuple[FloatArray, FloatArray]]:
    step = max(1, _CHUNK // other)
    for start in range(0, len(nodes), step):
        yield nodes[start : start + step, None], weights[start : start + step, None]


def near_range_surface_amplitude(
    patch: SurfacePatch, u: tuple[float, float], v: tuple[float, float], wavelength: float, radar: ArrayLike
) -> complex:
    """Return the apparent amplitude of a metal surface seen from a radar at a finite range.

    Parameters
    ----------
    patch : callable
        The surface over two parameters: arrays u, v of one shape to points (..., 3) [m] and area vectors (..., 3),
        the outward normal times |dr/du x dr/dv|.
    u, v : (low, high)
        Range of the parameters.
    wavelength : float
        Wavelength. [m]
    radar : (3,) array_like
        Position of the (isotropic) radar in the surface's frame, R from its origin. [m]

    Returns
    -------
    complex [m]
        (2 sqrt(pi)/lambda) R^2 integral of cos(alpha) e^{-2jk(rho - R)}/rho^2 dA over what faces the radar; VV and HH
        alike, |amplitude|^2 = apparent RCS for the radar equation at R. Several patches add up.

    Notes
    -----
    Single bounce; a surface that hides parts of itself needs limits that leave them out. Twelve Gauss-Legendre nodes
    for two cycles of the two-way phase at its fastest: below 1e-9 where the patch is smooth and faces the radar all
    over. Where the lit part ends inside the patch the kink costs some 1e-3 (a sphere of k a = 48): end the patch there.
    """
    at = np.asarray(radar, dtype=np.float64)
    reference = float(np.linalg.norm(at))
    if not reference > 0.0:
        raise InputError("near_range_surface_amplitude: the radar stands at the origin; place it at a range above 0 m")
    rate_u, rate_v = _survey(patch, u, v, at)
    # the survey sees a rate of the mean over an interval; the margin covers the fastest point within it
    (nodes_u, weights_u), (nodes_v, weights_v) = (
        gauss_panels(*limits, 1.05 * 2.0 * rate / wavelength) for limits, rate in ((u, rate_u), (v, rate_v))
    )
    total = 0.0 + 0.0j
    for some_u, some_weights in _chunks(nodes_u, weights_u, len(nodes_v)):
        points, area = patch(*np.broadcast_arrays(some_u, nodes_v))
        ray = at - points
        rho = np.linalg.norm(ray, axis=-1)
        facing = np.maximum(np.einsum("...i,...i->...", ray, area), 0.0)
        # rho - R without cancellation
        extra = np.einsum("...i,...i->...", points, points - 2.0 * at) / (rho + reference)
        phasor = np.exp(-4j * math.pi / wavelength * extra)
        total += complex(np.sum(some_weights * weights_v * facing / rho**3 * phasor))
    return 2.0 * math.sqrt(math.pi) / wavelength * reference**2 * total


def near_range_cylinder_rcs(
    radius: float, length: float, wavelength: float, range_m: float, height_m: float = 0.0
) -> float:
    """Return the apparent RCS of the side of a metal cylinder, a pole, at a finite range.

    Parameters
    ----------
    radius, length, wavelength : float
        Radius, length, wavelength. [m]
    range_m : float
        Distance of the radar from the axis, > radius. [m]
    height_m : float
        How far the radar stands along the axis from the cylinder's middle. [m]

    Returns
    -------
    float [m^2]
        For the radar equation at the distance to the middle, hypot(range_m, height_m).

    Notes
    -----
    :func:`near_range_surface_amplitude` over the lit part, |phi| < arccos(radius/range_m), without the ends. With the
    edge of the lit part goes the spurious echo of physical optics there, as in :func:`cylinder_amplitude`. A long pole
    swings about pi R^3 a/(R - a)^2, R = range_m, geometric optics of an endless one.
    """
    if not range_m > radius:
        raise InputError(f"range to the axis is {range_m} m, the cylinder's radius {radius} m; stand outside of it")
    edge = math.acos(radius / range_m)

    def side(phi: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        out = np.stack([np.cos(phi), np.sin(phi), np.zeros_like(phi)], axis=-1)
        up = np.stack([np.zeros_like(z), np.zeros_like(z), z], axis=-1)
        return radius * out + up, radius * out

    ends = (-0.5 * length, 0.5 * length)
    amplitude = near_range_surface_amplitude(side, (-edge, edge), ends, wavelength, (range_m, 0.0, height_m))
    return abs(amplitude) ** 2
