"""Echoes of paths with several bounces: fields along the chain, the current of the last hit, its integral."""

from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

import numpy as np

from .._parallel import map_blocks
from .._typing import ComplexArray, FloatArray, IntArray
from ..constants import FOUR_PI_CUBED, SPEED_OF_LIGHT
from ..paths import Paths
from ..physics.roughness import coherent_factor
from ..sbr.fields import radiated, reflected_field
from ..scatterers import Weather
from .link import link_amplitude

if TYPE_CHECKING:
    from ..config.materials import Material, MaterialTable
    from ..config.profile import RadarProfile

__all__ = ["path_amplitude", "tube_phase_integral"]

#: Largest phase over a tube that is integrated; beyond it the stationary point alone counts [rad].
_INTEGRATED = 40.0
#: Nodes along each side of a tube: enough for that phase.
_NODES = 24
#: Nodes that are enough for the phase of a tube as narrow as the wavelength [rad].
_FEW_NODES, _NARROW = 8, 6.0


def path_amplitude(
    paths: Paths, names: tuple[str, ...], materials: MaterialTable, profile: RadarProfile, weather: Weather | None
) -> ComplexArray:
    """Return the de-chirped amplitudes of paths, without the carrier phase of their way.

    Parameters
    ----------
    paths : Paths
    names : tuple of str
        Materials by the numbers in the paths.
    materials : MaterialTable
    profile : RadarProfile
    weather : Weather or None

    Returns
    -------
    (n,) complex
        [sqrt(W)].
    """
    rain = 0.0 if weather is None else weather.rain_mm_h
    worn = [materials[materials.in_weather(name, rain)] for name in names]
    wavenumber = 2.0 * math.pi * profile.center_hz / SPEED_OF_LIGHT

    def block(rows: slice) -> ComplexArray:
        part = paths.select(rows)
        legs = part.legs
        length = np.linalg.norm(legs, axis=2)
        back = np.linalg.norm(part.last, axis=1)
        there = length.sum(axis=1) - back
        strength = _strength(part, legs / np.maximum(length, 1e-12)[:, :, None], worn, profile)
        integral = tube_phase_integral(part.slope, part.curvature, wavenumber)
        link = link_amplitude(profile, 0.5 * part.way[:, None] * part.arrival, weather, departure=part.departure)
        sigma_root = wavenumber / (2.0 * math.sqrt(math.pi)) * strength * integral
        # the one conjugation from e^{+jwt} echo phasors to the de-chirped signal conj(rx) tx
        return np.asarray(np.conj(link * profile.wavelength_m / math.sqrt(FOUR_PI_CUBED) * sigma_root / (there * back)))

    return np.concatenate(map_blocks(block, len(paths), 4096) or [np.zeros(0, dtype=np.complex128)])


def _strength(paths: Paths, unit: FloatArray, materials: list[Material], profile: RadarProfile) -> ComplexArray:
    """Return (n,) what the last footprint sends back for a unit of u and v [m^2]."""
    send, receive = ("VH".index(p) for p in reversed(profile.antenna.polarization))
    field = _basis(unit[:, 0])[:, [send]].astype(np.complex128)
    result = np.zeros(len(paths), dtype=np.complex128)
    toward = -paths.arrival
    basis = _basis(paths.arrival)
    for order in range(paths.object_id.shape[1]):
        rows = np.flatnonzero(paths.hit[:, order])
        arriving, d, n = field[rows], unit[rows, order], paths.normal[rows, order]
        leaving = _reflected(arriving, d, n, paths.material[rows, order], materials, profile)
        field[rows] = leaving
        ends = np.flatnonzero(paths.count[rows] == order + 1)
        at = rows[ends]
        both = [np.repeat(f[ends], 2, axis=1) for f in (arriving, leaving)]  # transmitted V and H alike
        matrix = radiated(both[0], both[1], d[ends], n[ends], paths.area[at], toward[at], basis[at])
        result[at] = matrix[:, receive, 0]
    return result


def _reflected(
    field: ComplexArray,
    d: FloatArray,
    n: FloatArray,
    material: IntArray,
    materials: list[Material],
    profile: RadarProfile,
) -> ComplexArray:
    result = np.empty_like(field)
    cos = np.clip(-np.einsum("ij,ij->i", d, n), 0.0, 1.0)
    for number in np.flatnonzero(np.bincount(material)) if len(material) else ():
        rows = np.flatnonzero(material == number)
        te, tm = materials[number].reflection(profile.center_hz, cos[rows])
        rough = coherent_factor(
            2.0 * math.pi * profile.center_hz / SPEED_OF_LIGHT, materials[number].roughness_rms_m, cos[rows]
        )
        result[rows] = reflected_field(field[rows], d[rows], n[rows], te * rough, tm * rough)
    return result


def _basis(direction: FloatArray) -> FloatArray:
    """Return (n, 2, 3) V and H, the unit vectors of increasing elevation and azimuth of directions from the radar."""
    x, y, z = direction.T
    across = np.hypot(x, y)
    flat = across > 0
    cos, sin = (
        np.where(flat, x / np.where(flat, across, 1.0), 1.0),
        np.where(flat, y / np.where(flat, across, 1.0), 0.0),
    )
    zero = np.zeros_like(x)
    return np.stack([np.stack([-z * cos, -z * sin, across], axis=1), np.stack([-sin, cos, zero], axis=1)], axis=1)


def tube_phase_integral(slope: FloatArray, curvature: FloatArray, wavenumber: float) -> ComplexArray:
    """Integrate exp(-jk(a u + b v + (c u^2 + d v^2)/2 + e u v)) over u and v from -1 to 1.

    Parameters
    ----------
    slope : (n, 2) float
        a, b [m].
    curvature : (n, 3) float
        c, d, e [m].
    wavenumber : float
        k [rad/m].

    Returns
    -------
    (n,) complex
        4 where there is no phase. By quadrature up to 40 rad over half the tube; beyond, the stationary point's
        (2 pi/k) / sqrt(|c d - e^2|) where it lies in the tube, else zero.
    """
    a, b, c, d, e = wavenumber * np.concatenate([slope, curvature], axis=1).T
    span = np.abs(a) + np.abs(b) + 0.5 * (np.abs(c) + np.abs(d)) + np.abs(e)
    result = np.zeros(len(a), dtype=np.complex128)
    few = span <= _NARROW
    for rows, count in ((few, _FEW_NODES), (~few & (span <= _INTEGRATED), _NODES)):
        x, w = _gauss(count)
        at = np.flatnonzero(rows)
        if not len(at):
            continue
        inner = np.zeros(len(at), dtype=np.complex128)
        for v, weight in zip(x, w, strict=True):
            line = (a[at] + e[at] * v)[:, None] * x + 0.5 * c[at][:, None] * x**2
            rest = b[at] * v + 0.5 * d[at] * v * v
            inner += weight * np.exp(-1j * rest) * np.einsum("nk,k->n", np.exp(-1j * line), w)
        result[at] = inner
    wide = np.flatnonzero(span > _INTEGRATED)
    det = c[wide] * d[wide] - e[wide] ** 2
    safe = np.where(np.abs(det) > 0, det, np.inf)
    u = (e[wide] * b[wide] - d[wide] * a[wide]) / safe
    v = (e[wide] * a[wide] - c[wide] * b[wide]) / safe
    inside = (np.abs(u) <= 1) & (np.abs(v) <= 1) & (det != 0)
    phase = 0.5 * (a[wide] * u + b[wide] * v)
    # exp(-j pi/4) for every positive eigenvalue, exp(+j pi/4) for every negative one
    turn = np.where(det > 0, -0.5 * np.pi * np.sign(c[wide]), 0.0)
    value = 2.0 * np.pi / np.sqrt(np.abs(safe)) * np.exp(1j * (turn - phase))
    result[wide] = np.where(inside, value, 0.0)
    return result


@functools.cache
def _gauss(count: int) -> tuple[FloatArray, FloatArray]:
    return np.polynomial.legendre.leggauss(count)
