"""The ``physical`` echo model: physical optics of ray tubes, plus fully developed speckle.

Every tube has a coherent part, the physical-optics integral over its footprint weakened by roughness, and an
incoherent part, sigma0 times area with exponentially distributed power. Point targets have the RCS they were given.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .._typing import ComplexArray, FloatArray, IntArray
from ..constants import FOUR_PI_CUBED, SPEED_OF_LIGHT
from ..errors import InputError
from ..physics.footprint import tube_integral
from ..physics.fresnel import backscatter_reflection
from ..randomness import frame_generator
from ..returns import Returns
from ..scatterers import Scatterers
from .link import link_amplitude

if TYPE_CHECKING:
    from ..config.materials import MaterialTable
    from ..config.profile import RadarProfile

__all__ = ["physical_returns"]

#: Points of the table over which a material's curves are interpolated, linear in cos(theta).
_TABLE = 1025
#: A coherent echo this far below the mean of the same tube's own speckle is left out (power); the hundred or so tubes
#: of one Fresnel zone stay 20 dB below the speckle even when they all add in phase.
_NEGLIGIBLE = 1e-4
#: Furthest an incoherent echo moves within its footprint, as a share of its range.
_MAX_SHIFT = 0.5


class _Echo(NamedTuple):
    """Some echoes: amplitude, where from, and the rows they came from."""

    amplitude: ComplexArray
    position: FloatArray
    scatterer: IntArray
    coherent: bool


def physical_returns(scatterers: Scatterers, profile: RadarProfile, materials: MaterialTable) -> Returns:
    """Apply the ``physical`` model.

    Parameters
    ----------
    scatterers : Scatterers
        With ``area``; without footprints there is no coherent part.
    profile : RadarProfile
    materials : MaterialTable

    Raises
    ------
    InputError
        Scatterers without area.
    """
    if scatterers.area is None:
        raise InputError(
            "the physical model needs Scatterers.area [m^2] for every row; a bare table has none: pass area= to "
            "Scatterers.from_table"
        )
    link = link_amplitude(profile, scatterers.position, scatterers.weather)
    given = np.zeros(len(scatterers), dtype=bool) if scatterers.rcs is None else ~np.isnan(scatterers.rcs)
    surface = np.flatnonzero(~given)
    curves = _Curves(scatterers, surface, profile, materials)
    speckle = _incoherent(scatterers, surface, link[surface], curves.sigma0, profile)
    echoes = [_points(scatterers, np.flatnonzero(given), link[given], profile)]
    if scatterers.footprint is not None and scatterers.normal is not None:
        echoes.append(_coherent(scatterers, surface, link[surface], curves, profile))
    echoes.append(speckle)
    return _assemble(scatterers, echoes, profile)


class _Curves:
    """Reflection, roughness and sigma0 of each row, interpolated from one table a material."""

    def __init__(
        self, scatterers: Scatterers, rows: IntArray, profile: RadarProfile, materials: MaterialTable
    ) -> None:
        self.cos = scatterers.cos_incidence[rows]
        self.te = np.zeros(len(rows), dtype=np.complex128)
        self.tm = np.zeros(len(rows), dtype=np.complex128)
        self.roughness_m = np.zeros(len(rows))
        self.sigma0 = np.zeros(len(rows))
        grid = np.linspace(0.0, 1.0, _TABLE)
        rain = 0.0 if scatterers.weather is None else scatterers.weather.rain_mm_h
        index = _material_index(scatterers, rows, materials)
        for number in np.unique(index):
            name = materials.in_weather(_names(scatterers, materials)[number], rain)
            material = materials.materials[name]
            here = np.flatnonzero(index == number)
            cell, weight = _interpolation(self.cos[here])
            te, tm = material.reflection(profile.center_hz, np.maximum(grid, 1e-6))
            sigma0 = material.sigma0(profile.center_hz, np.maximum(grid, 1e-6), profile.antenna.polarization)
            for target, curve in ((self.te, te), (self.tm, tm), (self.sigma0, sigma0)):
                curve = np.asarray(curve)
                target[here] = curve[cell] * (1.0 - weight) + curve[cell + 1] * weight
            self.roughness_m[here] = material.roughness_rms_m


def _interpolation(cos: FloatArray) -> tuple[IntArray, FloatArray]:
    place = np.clip(cos, 0.0, 1.0) * (_TABLE - 1)
    cell = np.minimum(place.astype(np.int64), _TABLE - 2)
    return cell, place - cell


def _names(scatterers: Scatterers, materials: MaterialTable) -> tuple[str, ...]:
    return scatterers.material_names if scatterers.material is not None else tuple(materials.materials)


def _material_index(scatterers: Scatterers, rows: IntArray, materials: MaterialTable) -> IntArray:
    """Return (len(rows),) index into the material names; without materials on the rows the tag decides."""
    from ..tags import SemanticTag

    if scatterers.material is not None:
        return scatterers.material[rows].astype(np.int64)
    names = list(materials.materials)
    by_tag = np.full(256, -1, dtype=np.int64)
    for value in np.unique(scatterers.tag[rows]):
        by_tag[value] = names.index(materials.for_tag(SemanticTag(int(value)).name))
    return by_tag[scatterers.tag[rows]]


def _coherent(
    scatterers: Scatterers, rows: IntArray, link: FloatArray, curves: _Curves, profile: RadarProfile
) -> _Echo:
    assert scatterers.footprint is not None
    assert scatterers.normal is not None
    assert scatterers.area is not None
    wavenumber = 2.0 * math.pi * profile.center_hz / SPEED_OF_LIGHT
    position = scatterers.position[rows]
    distance = np.linalg.norm(position, axis=1)
    rough = np.exp(-2.0 * (wavenumber * curves.roughness_m * curves.cos) ** 2)
    # sqrt(Pt Gt Gr / L) lambda / (4 pi)^1.5 x 2 sqrt(pi) / lambda = sqrt(Pt Gt Gr / L) / (4 pi): with the solid angle
    # in place of cos dA / r^2 neither lambda nor R is left.
    scale = link * rough / (4.0 * math.pi)
    # |integral| cannot exceed the solid angle: rows that are negligible even then need no integral
    solid = scatterers.area[rows] * curves.cos / distance**2
    speckle = curves.sigma0 * scatterers.area[rows] * (profile.wavelength_m * link / distance**2) ** 2 / FOUR_PI_CUBED
    reflect = np.maximum(np.abs(curves.te), np.abs(curves.tm))
    keep = np.flatnonzero((scale * reflect * solid) ** 2 > _NEGLIGIBLE * speckle)
    u = position[keep] / distance[keep, None]
    normal = scatterers.normal[rows[keep]]
    gamma = backscatter_reflection(curves.te[keep], curves.tm[keep], normal, u, profile.antenna.polarization)
    joined = None if scatterers.joined is None else scatterers.joined[rows[keep]]
    integral = tube_integral(u, scatterers.footprint[rows[keep]], normal, distance[keep], wavenumber, joined)
    # The one conjugation from e^{+jwt} echo phasors to the de-chirped signal conj(rx) tx.
    amplitude = np.conj(scale[keep] * gamma * integral)
    strong = np.abs(amplitude) ** 2 > _NEGLIGIBLE * speckle[keep]
    return _Echo(amplitude[strong], position[keep][strong], rows[keep][strong], True)


def _incoherent(
    scatterers: Scatterers, rows: IntArray, link: FloatArray, sigma0: FloatArray, profile: RadarProfile
) -> _Echo:
    assert scatterers.area is not None
    lit = np.flatnonzero(sigma0 > 0)
    picked = rows[lit]
    if scatterers.speckle is not None:
        gauss = scatterers.speckle[picked]
    else:
        generator = frame_generator(scatterers.seed, scatterers.frame, scatterers.radar, "speckle")
        every = generator.standard_normal((len(scatterers), 2)) * math.sqrt(0.5)
        gauss = every.view(np.complex128)[picked, 0]
    position = scatterers.position[picked]
    distance2 = np.einsum("ij,ij->i", position, position)
    sigma = sigma0[lit] * scatterers.area[picked]
    amplitude = link[lit] * profile.wavelength_m / math.sqrt(FOUR_PI_CUBED) * np.sqrt(sigma) / distance2 * gauss
    return _Echo(amplitude, _jittered(scatterers, picked), picked, False)


def _jittered(scatterers: Scatterers, rows: IntArray) -> FloatArray:
    """Return where in its footprint each incoherent echo sits: a point of its own, or coarse cells would be a comb."""
    position = scatterers.position[rows]
    if scatterers.footprint is None or scatterers.normal is None or scatterers.jitter is None:
        return position
    distance = np.linalg.norm(position, axis=1)
    offset = np.einsum("ij,ijk->ik", scatterers.jitter[rows], scatterers.footprint[rows])
    w = position / distance[:, None] + offset
    normal = scatterers.normal[rows]
    height = np.einsum("ij,ij->i", normal, position)
    along = np.einsum("ij,ij->i", normal, w)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = height / along
    inside = np.abs(reach - distance) < _MAX_SHIFT * distance
    return np.where(inside[:, None], w * np.where(inside, reach, 0.0)[:, None], position)


def _points(scatterers: Scatterers, rows: IntArray, link: FloatArray, profile: RadarProfile) -> _Echo:
    position = scatterers.position[rows]
    distance2 = np.einsum("ij,ij->i", position, position)
    sigma = np.zeros(0) if scatterers.rcs is None else scatterers.rcs[rows]
    amplitude = link * profile.wavelength_m * np.sqrt(sigma / FOUR_PI_CUBED) / distance2
    return _Echo(amplitude.astype(np.complex128), position, rows, True)


def _assemble(scatterers: Scatterers, echoes: list[_Echo], profile: RadarProfile) -> Returns:
    source = np.concatenate([e.scatterer for e in echoes])
    n = len(scatterers)
    if scatterers.velocity is not None:
        velocity = scatterers.velocity
    else:  # only the radial part is known
        along = scatterers.position / np.maximum(scatterers.range, 1e-12)[:, None]
        velocity = along * scatterers.range_rate[:, None]
    bounces = np.ones(n, dtype=np.uint8) if scatterers.bounces is None else scatterers.bounces
    return Returns(
        amplitude=np.concatenate([e.amplitude for e in echoes]),
        position=np.concatenate([e.position for e in echoes]),
        velocity=velocity[source],
        object_id=scatterers.object_id[source],
        tag=scatterers.tag[source],
        coherent=np.concatenate([np.full(len(e.scatterer), e.coherent) for e in echoes]),
        bounces=bounces[source],
        scatterer=source,
        center_hz=profile.center_hz,
        model="physical",
    )
