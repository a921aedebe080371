"""The physical-optics integral over the footprint of one ray tube on a flat surface.

For a spherical wave from the radar, cos(theta) dA / r^2 is the solid angle, so that the integral over a tube's
footprint is I = integral of exp(-2jk(r - r_c)) dOmega over its cell, with r = h / (m . d) on a plane at distance h and
unit normal m pointing away from the radar.

In polar angles (theta, psi) about m, with c = cos(theta) and K = 2kh, Green's theorem turns it into a contour integral,
I = closed integral of F dpsi, F = integral from c to 1 of exp(-jK/c') dc' = [exp(-jK) - c^2 exp(-jK/c)] / (jK) to
leading order in 1/K, which is below 1e-2 at 0.1 m and 24 GHz. The first term counts only in the one cell that holds m.
Every straight edge is evaluated alike from both of its cells, so that the edges two cells share on one plane cancel: a
smooth road at grazing incidence returns nothing but its rim, although each footprint there is metres long. Where the
phase is nearly stationary the Fresnel integrals of a separable quadratic phase over the cell are used instead.
Where the cell is oblique as well, both terms of F are integrated by quadrature along its edges.
"""

from __future__ import annotations

import functools

import numpy as np

from .._typing import BoolArray, ComplexArray, FloatArray, IntArray

__all__ = ["interior", "tube_integral"]

#: Phase along half an edge, if the edge followed the gradient, from which the contour is accurate (1e-3 of the cell's
#: solid angle at this value, falling with its square) [rad].
_SETTLED = 16.0
#: Phase of the mixed term at the corner of a cell from which it counts [rad].
_OBLIQUE = 0.02
#: Range of phase over the corners of a cell that 24 nodes along an edge still follow [rad].
_QUADRATURE = 40.0


def tube_integral(
    direction: FloatArray,
    edges: FloatArray,
    normal: FloatArray,
    distance: FloatArray,
    wavenumber: float,
    joined: BoolArray | None = None,
) -> ComplexArray:
    """Integrate exp(-2jk(r - r_c)) over the solid angle of cells that hit planes.

    Parameters
    ----------
    direction : (n, 3) float
        Unit vectors of the cell centres.
    edges : (n, 2, 3) float
        Half edges of the cells; the corners are the directions d +- e_u +- e_v.
    normal : (n, 3) float
        Unit normals of the planes that were hit, either side.
    distance : (n,) float
        From the radar to the hit point r_c along ``direction`` [m].
    wavenumber : float
        k = 2 pi / lambda [rad/m].
    joined : (n, 4) bool, optional
        Edges (towards -v, +u, +v, -u) across which a neighbouring cell goes on in the same plane. Far from the
        stationary point they are left out, because the neighbour has the same with the other sign: the sum over the
        surface stays the same, and most cells of a flat surface give exactly zero.

    Returns
    -------
    (n,) complex
        [sr]. Its modulus is the cell's solid angle at normal incidence close to the radar.

    Notes
    -----
    A plate that fills all of the solid angle around its normal gives pi / (j k h), whose square in the radar equation
    is that of the mirror image, sigma = pi h^2.

    References
    ----------
    .. [1] W. B. Gordon, "Far-field approximations to the Kirchhoff-Helmholtz representations of scattered fields",
       IEEE Trans. Antennas Propag. 23(4), 1975.
    .. [2] J. S. Asvestas, "The physical optics integral and computer graphics", IEEE Trans. Antennas Propag. 43(12),
       1995.
    """
    result = np.zeros(len(distance), dtype=np.complex128)
    corners = _Corners(direction, edges, normal, distance, wavenumber)
    # A corner beyond the horizon of the plane has no phase: the contour does not exist, and nothing comes back.
    whole = np.all(corners.cosine > 0, axis=0)
    # An edge is seen alike from both of its cells, so they agree on which of them leave it out, and neither of those
    # is stationary.
    settled = corners.slope >= _SETTLED
    left_out = np.zeros_like(settled) if joined is None else settled & joined.T
    holds = np.all(corners.turn > 0, axis=0)  # the normal itself: the phase is stationary inside
    stationary = ~settled.any(axis=0) | (holds & ~left_out.any(axis=0))
    far = np.flatnonzero(whole & ~stationary)
    result[far] = _contour(corners, far, wavenumber, left_out[:, far], holds[far])
    skew = corners.skewed(wavenumber)
    near = np.flatnonzero(whole & stationary & ~skew)
    result[near] = _separable(direction[near], edges[near], normal[near], distance[near], wavenumber)
    near = np.flatnonzero(whole & stationary & skew)
    result[near] = _smooth_contour(corners, near, wavenumber)
    return result


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


def _triple(a: FloatArray, b: FloatArray, n: FloatArray) -> FloatArray:
    """Return (a x b) . n."""
    x = a[:, 1] * b[:, 2] - a[:, 2] * b[:, 1]
    y = a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]
    z = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return x * n[:, 0] + y * n[:, 1] + z * n[:, 2]


def interior(
    direction: FloatArray,
    edges: FloatArray,
    normal: FloatArray,
    distance: FloatArray,
    wavenumber: float,
    joined: BoolArray,
) -> BoolArray:
    """Return which cells give exactly zero because all their edges are joined and far from stationary.

    Parameters are those of :func:`tube_integral`; a cheap test that may miss some of them.

    Returns
    -------
    (n,) bool
    """
    cos = np.abs(_dot(direction, normal))
    half = np.sqrt(np.minimum(_dot(edges[:, 0], edges[:, 0]), _dot(edges[:, 1], edges[:, 1])))
    sine = np.sqrt(np.maximum(1.0 - cos**2, 0.0))
    # from the centre of a cell to its edge r tan(theta) changes by less than this factor
    with np.errstate(divide="ignore"):
        margin = 1.0 + 3.0 * half * (1.0 / cos + 1.0 / sine)
    slope = 2.0 * wavenumber * distance * sine * half
    zero: BoolArray = joined.all(axis=1) & (slope > margin * _SETTLED * cos)
    return zero


class _Corners:
    """The four corner directions w of each cell, in the order (-,-), (+,-), (+,+), (-,+) of (u, v).

    ``cosine`` is m . w and ``square`` is w . w, both (4, n), for w not of unit length; ``phase`` is 2k(r - r_c) [rad];
    ``turn`` is m . (w_i x w_i+1) of the edges and ``slope`` the phase along half of each, k r tan(theta) times its
    angle, did it follow the gradient [rad]; it does not depend on the lengths of the w.
    """

    def __init__(
        self, direction: FloatArray, edges: FloatArray, normal: FloatArray, distance: FloatArray, wavenumber: float
    ) -> None:
        along = _dot(normal, direction)
        away = np.where(along < 0, -1.0, 1.0)[:, None] * normal
        e_u, e_v = edges[:, 0], edges[:, 1]
        center = np.abs(along)
        nu, nv = _dot(away, e_u), _dot(away, e_v)
        du, dv = 2.0 * _dot(direction, e_u), 2.0 * _dot(direction, e_v)
        uv = 2.0 * _dot(e_u, e_v)
        uu, vv = _dot(e_u, e_u), _dot(e_v, e_v)
        sides = 1.0 + uu + vv
        self.cosine = np.stack([center - nu - nv, center + nu - nv, center + nu + nv, center - nu + nv])
        self.square = np.stack([sides - du - dv + uv, sides + du - dv - uv, sides + du + dv + uv, sides - du + dv - uv])
        cross_u, cross_v = _triple(direction, e_u, away), _triple(direction, e_v, away)
        cross_uv = _triple(e_u, e_v, away)
        self.turn = 2.0 * np.stack([cross_u + cross_uv, cross_v + cross_uv, cross_uv - cross_u, cross_uv - cross_v])
        self.distance = distance
        self.height = distance * center
        with np.errstate(divide="ignore", invalid="ignore"):
            self.phase = 2.0 * wavenumber * (self.height * np.sqrt(self.square) / self.cosine - distance)
            self.tangential = np.sqrt(np.maximum(self.square - self.cosine**2, 1e-300))
            ratio = np.sqrt(self.tangential) / self.cosine
            self.half_square = np.stack([uu, vv])
            length = 2.0 * np.sqrt(np.stack([uu, vv, uu, vv]))
            self.slope = wavenumber * self.height * length * ratio * np.roll(ratio, -1, axis=0)
        self.cross = 0.5 * uv - nu * nv - 0.25 * du * dv

    def along(
        self, i: int, rows: IntArray, t: FloatArray, wavenumber: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return m . w, w . w and the phase [rad] at ``t`` in [-1, 1] along edge ``i`` of some cells."""
        j = (i + 1) % 4
        cos = 0.5 * ((1.0 - t) * self.cosine[i, rows] + (1.0 + t) * self.cosine[j, rows])
        square = 0.5 * ((1.0 - t) * self.square[i, rows] + (1.0 + t) * self.square[j, rows])
        square = square - (1.0 - t * t) * self.half_square[i % 2, rows]
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = self.height[rows] * np.sqrt(square) / cos
        return cos, square, 2.0 * wavenumber * (reach - self.distance[rows])

    def skewed(self, wavenumber: float) -> BoolArray:
        """Return which cells have edges so oblique that the phase is no sum of one along u and one along v.

        Those whose phase is too large for a quadrature along the edges stay out.
        """
        cross = 2.0 * wavenumber * self.height * np.abs(self.cross)
        with np.errstate(invalid="ignore"):
            span = np.max(self.phase, axis=0) - np.min(self.phase, axis=0)
        return np.asarray((cross > _OBLIQUE) & (span < _QUADRATURE))


def _contour(
    corners: _Corners, rows: IntArray, wavenumber: float, left_out: BoolArray, holds: BoolArray
) -> ComplexArray:
    height = corners.height[rows]
    total = np.zeros(len(rows), dtype=np.complex128)
    for i in range(4):
        kept = np.flatnonzero(~left_out[i])
        total[kept] += _edge(corners, rows[kept], i, wavenumber)
    pole = 2.0 * np.pi * np.exp(2j * wavenumber * (corners.distance[rows] - height))
    return 1j / (2.0 * wavenumber * height) * (total - np.where(holds, pole, 0.0))


def _edge(corners: _Corners, rows: IntArray, i: int, wavenumber: float) -> ComplexArray:
    """Return the integral of c^2 exp(-j phase) dpsi along edge ``i`` of some cells.

    Phase quadratic and amplitude constant along the edge, or quadrature where either would be too coarse: beside the
    stationary point the edges of a contour do not cancel, and a mirror whose Fresnel zone is as wide as a cell would
    err by 3 dB.
    """
    ends = np.array([i, (i + 1) % 4])[:, None]
    cosine, square, phase = corners.cosine[ends, rows], corners.square[ends, rows], corners.phase[ends, rows]
    turn, half_square = corners.turn[i, rows], corners.half_square[i % 2, rows]
    psi = np.arctan2(turn, square.mean(axis=0) - 2.0 * half_square - cosine[0] * cosine[1])

    _, _, middle = corners.along(i, rows, np.zeros(1), wavenumber)
    linear, bend = 0.5 * (phase[1] - phase[0]), phase.mean(axis=0) - middle
    bent = np.where(np.abs(linear) < 200.0 * np.abs(bend), bend, 0.0)  # beyond that rounding would show
    mean = 0.5 * np.exp(-1j * (phase.mean(axis=0) - bent)) * _quadratic_phase(linear, bent)
    value: ComplexArray = cosine.prod(axis=0) / np.sqrt(square.prod(axis=0)) * psi * mean

    uneven = (np.abs(bend) > 0.01) | (np.abs(psi) > 0.3)
    fine = np.flatnonzero(uneven & (np.abs(linear) + np.abs(bend) < 20.0) & (np.abs(psi) < 2.5))
    nodes, weights = _gauss()
    cos, sq, exact = corners.along(i, rows[fine], nodes[:, None], wavenumber)
    density = 0.5 * turn[fine] / (sq - cos**2) * cos**2 / sq
    value[fine] = _over_nodes(weights, density * np.exp(-1j * exact))
    return value


def _over_nodes(weights: FloatArray, values: ComplexArray) -> ComplexArray:
    """Return the weighted sum over the first axis; by ``@`` its last bit would depend on the number of BLAS threads."""
    total: ComplexArray = np.einsum("k,kn->n", weights, values)
    return total


def _smooth_contour(corners: _Corners, rows: IntArray, wavenumber: float) -> ComplexArray:
    """Return the contour integral of F dpsi with both terms of F, which has no pole at the normal."""
    nodes, weights = _gauss()
    height = corners.height[rows]
    at_normal = np.exp(2j * wavenumber * (corners.distance[rows] - height))
    total = np.zeros(len(rows), dtype=np.complex128)
    for i in range(4):
        cos, square, phase = corners.along(i, rows, nodes[:, None], wavenumber)
        d_psi = 0.5 * corners.turn[i, rows] / np.maximum(square - cos**2, 1e-14)
        total += _over_nodes(weights, d_psi * (at_normal - cos**2 / square * np.exp(-1j * phase)))
    return total / (2j * wavenumber * height)


@functools.cache
def _gauss() -> tuple[FloatArray, FloatArray]:
    """Return nodes and weights that integrate an edge of up to 20 rad of phase."""
    return np.polynomial.legendre.leggauss(24)


def _separable(
    direction: FloatArray, edges: FloatArray, normal: FloatArray, distance: FloatArray, wavenumber: float
) -> ComplexArray:
    along = _dot(normal, direction)
    result = np.ones(len(distance), dtype=np.complex128)
    for axis in range(2):
        e = edges[:, axis]
        half = _dot(normal, e)
        square = 1.0 + _dot(e, e)
        shift = 2.0 * _dot(direction, e)
        ends = [np.sqrt(square + s * shift) * along / (along + s * half) - 1.0 for s in (1.0, -1.0)]
        plus, minus = (2.0 * wavenumber * distance * end for end in ends)
        result *= _quadratic_phase((plus - minus) / 2, (plus + minus) / 2)
    return result * np.abs(_triple(edges[:, 0], edges[:, 1], direction))


def _quadratic_phase(linear: FloatArray, quadratic: FloatArray) -> ComplexArray:
    """Return the integral of exp(-j(a u + c u^2)) over u in [-1, 1]."""
    from scipy.special import fresnel

    result: ComplexArray = (2.0 * np.sinc(linear / np.pi)).astype(np.complex128)
    bent: BoolArray = np.abs(quadratic) > 1e-3
    if np.any(bent):
        a, c = linear[bent], quadratic[bent]
        flip = c < 0  # conjugate symmetry: the integral for -c is the conjugate of that for (-a, c)
        a, c = np.where(flip, -a, a), np.abs(c)
        scale, center = np.sqrt(2.0 * c / np.pi), a / (2.0 * c)
        s1, c1 = fresnel(scale * (center + 1.0))
        s0, c0 = fresnel(scale * (center - 1.0))
        value = np.exp(1j * a * center / 2.0) * ((c1 - c0) - 1j * (s1 - s0)) / scale
        result[bent] = np.where(flip, np.conj(value), value)
    return result
