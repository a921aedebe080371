"""The physical-optics integral over the footprint of one ray tube on a flat surface.

For a spherical wave from the radar, cos(theta) dA / r^2 is the solid angle, so that the integral over a tube's
footprint is I = integral of exp(-2jk(r - r_c)) dOmega over its cell, with r = h / (m . d) on a plane at distance h and
unit normal m pointing away from the radar.

In polar angles (theta, psi) about m, with c = cos(theta) and K = 2kh, Green's theorem turns it into a contour integral,
I = closed integral of F dpsi, F = integral from c to 1 of exp(-jK/c') dc' = [exp(-jK) - c^2 exp(-jK/c)] / (jK) to
leading order in 1/K, which is below 1e-3 at 0.1 m and 24 GHz. The first term counts only in the one cell that holds m.
Every straight edge is evaluated from its two end points with the phase exact there and linear between, so that the
edges two cells share on one plane cancel to rounding: a smooth road at grazing incidence returns nothing but its rim,
although each footprint there is metres long. Where the phase is nearly stationary the amplitude of dpsi changes too
fast along an edge, and the Fresnel integrals of a separable quadratic phase are used instead.
"""

from __future__ import annotations

import numpy as np

from .._typing import BoolArray, ComplexArray, FloatArray

__all__ = ["tube_integral"]

#: Phase across half a cell below which it counts as nearly stationary [rad].
_STATIONARY = 16.0


def tube_integral(
    direction: FloatArray, edges: FloatArray, normal: FloatArray, distance: FloatArray, wavenumber: float
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
    geometry = _Geometry(direction, edges, normal)
    corner_phase = geometry.phase_at_corners(distance, wavenumber)
    across_u = np.abs(corner_phase[1] + corner_phase[2] - corner_phase[0] - corner_phase[3]) / 4
    across_v = np.abs(corner_phase[2] + corner_phase[3] - corner_phase[0] - corner_phase[1]) / 4
    # A corner beyond the horizon of the plane has no phase: the contour does not exist, and nothing comes back.
    whole = np.all(geometry.cosine > 0, axis=0)
    stationary = np.hypot(across_u, across_v) < _STATIONARY
    result = np.zeros(len(distance), dtype=np.complex128)
    far = np.flatnonzero(whole & ~stationary)
    result[far] = _contour(geometry.rows(far), corner_phase[:, far], distance[far], wavenumber)
    near = np.flatnonzero(whole & stationary)
    result[near] = _separable(direction[near], edges[near], normal[near], distance[near], wavenumber)
    return result


class _Geometry:
    """Dot products of the four corner directions, in the order (-,-), (+,-), (+,+), (-,+) of (u, v)."""

    _U = np.array([-1.0, 1.0, 1.0, -1.0])[:, None]
    _V = np.array([-1.0, -1.0, 1.0, 1.0])[:, None]

    def __init__(self, direction: FloatArray, edges: FloatArray, normal: FloatArray) -> None:
        along = np.einsum("ij,ij->i", normal, direction)
        side = np.where(along < 0, -1.0, 1.0)
        e_u, e_v = edges[:, 0], edges[:, 1]
        self.center_cosine = np.abs(along)
        nu = np.einsum("ij,ij->i", normal, e_u) * side
        nv = np.einsum("ij,ij->i", normal, e_v) * side
        #: (4, n) m . w of the corner directions w, which are not of unit length
        self.cosine = self.center_cosine + self._U * nu + self._V * nv
        du = np.einsum("ij,ij->i", direction, e_u)
        dv = np.einsum("ij,ij->i", direction, e_v)
        uv = np.einsum("ij,ij->i", e_u, e_v)
        uu = np.einsum("ij,ij->i", e_u, e_u)
        vv = np.einsum("ij,ij->i", e_v, e_v)
        #: (4, n) |w|^2
        self.square = 1.0 + uu + vv + 2.0 * (self._U * du + self._V * dv + self._U * self._V * uv)
        # m . (w_i x w_i+1) of the four edges, from three triple products
        cross_u = np.einsum("ij,ij->i", np.cross(direction, e_u), normal) * side
        cross_v = np.einsum("ij,ij->i", np.cross(direction, e_v), normal) * side
        cross_uv = np.einsum("ij,ij->i", np.cross(e_u, e_v), normal) * side
        self.turn = 2.0 * np.stack([cross_u + cross_uv, cross_v + cross_uv, cross_uv - cross_u, cross_uv - cross_v])

    def rows(self, index: np.ndarray) -> _Geometry:  # type: ignore[type-arg]
        """Return the same for some of the cells."""
        picked = object.__new__(_Geometry)
        picked.center_cosine = self.center_cosine[index]
        picked.cosine, picked.square, picked.turn = (a[:, index] for a in (self.cosine, self.square, self.turn))
        return picked

    def phase_at_corners(self, distance: FloatArray, wavenumber: float) -> FloatArray:
        """Return (4, n) 2k(r - r_c) [rad]."""
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.sqrt(self.square) * self.center_cosine / self.cosine
        phase: FloatArray = 2.0 * wavenumber * distance * (reach - 1.0)
        return phase


def _contour(geometry: _Geometry, phase: FloatArray, distance: FloatArray, wavenumber: float) -> ComplexArray:
    # c = cosine of the corner from the normal, t = |tangential part of w|
    root = np.sqrt(geometry.square)
    c = geometry.cosine / root
    tangential = np.sqrt(np.maximum(geometry.square - geometry.cosine**2, 1e-300))
    phasor = np.exp(-1j * phase)
    total = np.zeros(len(distance), dtype=np.complex128)
    for i in range(4):
        j = (i + 1) % 4
        d_psi = geometry.turn[i] / (tangential[i] * tangential[j])
        step = phase[j] - phase[i]
        flat = np.abs(step) < 1e-4
        mean = (phasor[i] - phasor[j]) / (1j * np.where(flat, 1.0, step))
        mean = np.where(flat, 0.5 * (phasor[i] + phasor[j]), mean)
        total += c[i] * c[j] * d_psi * mean
    height = distance * geometry.center_cosine
    return 1j / (2.0 * wavenumber * height) * total


def _separable(
    direction: FloatArray, edges: FloatArray, normal: FloatArray, distance: FloatArray, wavenumber: float
) -> ComplexArray:
    along = np.einsum("ij,ij->i", normal, direction)
    result = np.ones(len(distance), dtype=np.complex128)
    for axis in range(2):
        e = edges[:, axis]
        half = np.einsum("ij,ij->i", normal, e)
        square = 1.0 + np.einsum("ij,ij->i", e, e)
        shift = 2.0 * np.einsum("ij,ij->i", direction, e)
        ends = [np.sqrt(square + s * shift) * along / (along + s * half) - 1.0 for s in (1.0, -1.0)]
        plus, minus = (2.0 * wavenumber * distance * end for end in ends)
        result *= _quadratic_phase((plus - minus) / 2, (plus + minus) / 2)
    solid = np.einsum("ij,ij->i", np.cross(edges[:, 0], edges[:, 1]), direction)
    return result * np.abs(solid)


def _quadratic_phase(linear: FloatArray, quadratic: FloatArray) -> ComplexArray:
    """Return the integral of exp(-j(a u + c u^2)) over u in [-1, 1]."""
    from scipy.special import fresnel

    result: ComplexArray = 2.0 * np.sinc(linear / np.pi) + 0j
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
