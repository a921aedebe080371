"""Echoes of paths with several bounces: fields along the chain, the current of the last hit, its integral."""

from __future__ import annotations

import functools
import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .._parallel import map_blocks
from .._typing import BoolArray, ComplexArray, FloatArray, IntArray
from ..chains import Chains
from ..constants import FOUR_PI_CUBED, SPEED_OF_LIGHT
from ..paths import Paths
from ..physics.roughness import coherent_factor
from ..returns import Returns
from ..sbr.fields import radiated, reflected_field
from ..scatterers import Scatterers, Weather
from .ghosts import apparent_cosines, appear_elsewhere
from .link import link_amplitude

if TYPE_CHECKING:
    from ..config.materials import Material, MaterialTable
    from ..config.profile import RadarProfile

__all__ = ["path_amplitude", "tube_phase_integral", "with_paths"]

#: Largest phase over a tube that is integrated; beyond it the stationary point alone counts [rad].
_INTEGRATED = 40.0
#: Nodes along each side of a tube: enough for that phase.
_NODES = 24
#: Nodes that are enough for the phase of a tube as narrow as the wavelength [rad].
_FEW_NODES, _NARROW = 8, 6.0


def with_paths(returns: Returns, scatterers: Scatterers, profile: RadarProfile, materials: MaterialTable) -> Returns:
    """Append the echoes of the ways over several surfaces to those of first surfaces, all in the radar frame."""
    paths = scatterers.paths
    if paths is None or not len(paths):
        return returns
    antenna = profile.antenna.polarization
    arguments = (scatterers.material_names, materials, profile, scatterers.weather)
    forth = path_amplitude(paths, *arguments, antenna)
    turned = np.flatnonzero(paths.two_way)
    back = path_amplitude(paths.select(turned), *arguments, antenna[::-1])
    row = np.concatenate([np.arange(len(paths)), turned])
    amplitude = np.concatenate([forth, back])
    paths = paths.select(row)
    reverse = (np.arange(len(row)) >= len(forth))[:, None]
    arrival = np.where(reverse, paths.departure, paths.arrival)
    departure = np.where(reverse, paths.arrival, paths.departure)
    place, velocity = _apparent(paths, reverse, arrival)
    outward, outward_velocity = _outward(paths, reverse, departure)
    object_id, tag = paths.owner
    shown = apparent_cosines(arrival, departure, profile)
    ghost = appear_elsewhere(scatterers, paths, 0.5 * paths.way, shown, profile)
    return replace(
        returns,
        amplitude=np.concatenate([returns.amplitude, amplitude]),
        position=np.concatenate([returns.position, place]),
        velocity=np.concatenate([returns.velocity, velocity]),
        object_id=np.concatenate([returns.object_id, object_id]),
        tag=np.concatenate([returns.tag, tag]),
        coherent=np.concatenate([returns.coherent, np.ones(len(row), dtype=bool)]),
        bounces=np.concatenate([returns.bounces, paths.count]),
        scatterer=np.concatenate([returns.scatterer, -1 - row]),
        departure=np.concatenate([returns.position, outward]),
        departure_velocity=np.concatenate([returns.velocity, outward_velocity]),
        chains=Chains.of(returns.object_id, paths, reverse[:, 0], ghost),
    )


def _apparent(paths: Paths, reverse: BoolArray, arrival: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where echoes appear to receivers, at half their way, and how that point moves [m, m/s]."""
    half = 0.5 * paths.way[:, None]
    back = np.where(reverse, paths.there[:, None], (paths.way - paths.there)[:, None])
    image = np.where(reverse, *paths.image_velocity)
    across = image - np.einsum("ni,ni->n", image, arrival)[:, None] * arrival
    return half * arrival, paths.range_rate[:, None] * arrival + half / back * across


def _outward(paths: Paths, reverse: BoolArray, departure: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return where transmitters see the sources of echoes, and how those images move [m, m/s]."""
    there = np.where(reverse, (paths.way - paths.there)[:, None], paths.there[:, None])
    return there * departure, np.where(reverse, *paths.image_velocity[::-1])


def path_amplitude(
    paths: Paths,
    names: tuple[str, ...],
    materials: MaterialTable,
    profile: RadarProfile,
    weather: Weather | None,
    polarization: str,
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
    polarization : {"VV", "HH", "HV", "VH"}
        Receive letter first.

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
        there, back = part.there, part.way - part.there
        unit = legs / np.maximum(length, 1e-12)[:, :, None]
        strength = _strength(part, unit, worn, profile.center_hz, polarization)
        integral = tube_phase_integral(part.slope, part.curvature, wavenumber)
        link = link_amplitude(profile, 0.5 * part.way[:, None] * part.arrival, weather, departure=part.departure)
        # a metal plate has Gamma = -1, and its current the sign of what arrives
        sigma_root = -wavenumber / (2.0 * math.sqrt(math.pi)) * strength * integral
        sigma_root = np.where(np.isnan(part.rcs), sigma_root, np.sqrt(part.rcs) * strength)
        # the one conjugation from e^{+jwt} echo phasors to the de-chirped signal conj(rx) tx
        return np.asarray(np.conj(link * profile.wavelength_m / math.sqrt(FOUR_PI_CUBED) * sigma_root / (there * back)))

    return np.concatenate(map_blocks(block, len(paths), 4096) or [np.zeros(0, dtype=np.complex128)])


def _strength(
    paths: Paths, unit: FloatArray, materials: list[Material], frequency_hz: float, polarization: str
) -> ComplexArray:
    """Return (n,) what the footprint that radiates sends back for a unit of u and v [m^2].

    Of a point target: the share of its sqrt(RCS) that mirrors and polarisation leave.
    """
    receive, send = ("VH".index(letter) for letter in polarization)
    row = np.arange(len(paths))
    ends, last = paths.radiates.astype(np.int64), paths.count.astype(np.int64) - 1
    field = _basis(unit[:, 0])[:, [send]].astype(np.complex128)
    arriving, leaving = field.copy(), field.copy()
    for order in range(paths.object_id.shape[1]):
        rows = np.flatnonzero(order <= ends)
        arriving[rows] = field[rows]
        field[rows] = _reflected(paths, rows, order, field[rows], unit[rows, order], materials, frequency_hz)
        leaving[rows] = field[rows]
    # by reciprocity the receiver's vector is carried backwards over the mirrors behind the radiating hit
    ear = _basis(paths.arrival)[:, [receive]].astype(np.complex128)
    for order in reversed(range(paths.object_id.shape[1])):
        rows = np.flatnonzero((order > ends) & (order <= last))
        ear[rows] = _reflected(paths, rows, order, ear[rows], -unit[rows, order + 1], materials, frequency_hz)
    pair = [np.repeat(f, 2, axis=1) for f in (arriving, leaving, ear)]  # radiated() takes V and H
    toward, d, n = unit[row, ends + 1], unit[row, ends], paths.normal[row, ends]
    strength = radiated(pair[0], pair[1], d, n, paths.area, toward, pair[2])[:, 0, 0]
    # a point target returns V of each direction as V of any other, and H as H
    there, back = _basis(d), _basis(-toward)
    alike = np.einsum("ni,npi,nj,npj->n", arriving[:, 0], there, ear[:, 0], back)
    return np.where(np.isnan(paths.rcs), strength, alike)


def _reflected(
    paths: Paths,
    rows: IntArray,
    order: int,
    field: ComplexArray,
    direction: FloatArray,
    materials: list[Material],
    frequency_hz: float,
) -> ComplexArray:
    """Return fields (m, 1, 3) after their reflection at one of the hits of some paths."""
    result = np.empty_like(field)
    normal, material = paths.normal[rows, order], paths.material[rows, order]
    cos = np.clip(-np.einsum("ij,ij->i", direction, normal), 0.0, 1.0)
    wavenumber = 2.0 * math.pi * frequency_hz / SPEED_OF_LIGHT
    for number in np.flatnonzero(np.bincount(material)) if len(material) else ():
        here = np.flatnonzero(material == number)
        te, tm = materials[number].reflection(frequency_hz, cos[here])
        rough = coherent_factor(wavenumber, materials[number].roughness_rms_m, cos[here])
        result[here] = reflected_field(field[here], direction[here], normal[here], te * rough, tm * rough)
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
