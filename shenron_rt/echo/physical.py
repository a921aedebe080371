"""The ``physical`` echo model: physical optics of ray tubes, plus fully developed speckle.

Every tube has a coherent part, the physical-optics integral over its footprint weakened by roughness, and an
incoherent part, sigma0 times area with exponentially distributed power. Point targets have the RCS they were given.
Points without footprints, those of a LiDAR, have no coherent part; where they have normals, its power is that of
geometric optics, with a random phase.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .._parallel import map_blocks
from .._typing import ComplexArray, FloatArray, IntArray
from ..constants import FOUR_PI_CUBED, SPEED_OF_LIGHT
from ..errors import InputError
from ..physics.footprint import interior, tube_integral
from ..physics.fresnel import backscatter_reflection
from ..randomness import frame_generator
from ..returns import Returns
from ..scatterers import Scatterers
from .bounced import with_paths
from .glint import points_sigma0
from .link import link_amplitude
from .plane import across_share, swapped

if TYPE_CHECKING:
    from ..config.materials import MaterialTable
    from ..config.profile import RadarProfile

__all__ = ["physical_returns"]

#: Points of the table over which a material's curves are interpolated, linear in cos(theta).
_TABLE = 1025
#: A coherent echo this far below the mean of the same tube's own speckle is left out (power); the hundred or so tubes
#: of one Fresnel zone stay 20 dB below the speckle even when they all add in phase.
_NEGLIGIBLE = 1e-4
#: Phase at the rim of a tube up to which a bent surface echoes as one mirror [rad].
_ONE_MIRROR = 0.5 * math.pi
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
    index = _material_index(scatterers, materials)
    tables = _tables(scatterers, index, profile, materials)
    gauss = _speckle(scatterers)

    def block(rows: slice) -> list[_Echo]:
        part = replace(scatterers.select(rows), speckle=gauss[rows])
        return _echoes(part, index[rows], tables, profile, rows.start)

    blocks = map_blocks(block, len(scatterers)) or [block(slice(0, 0))]
    echoes = [e for kind in (True, False) for b in blocks for e in b if e.coherent == kind]
    return with_paths(_assemble(scatterers, echoes, profile), scatterers, profile, materials)


def _echoes(
    scatterers: Scatterers, index: IntArray, tables: Mapping[int, _Table], profile: RadarProfile, first: int
) -> list[_Echo]:
    """Return the echoes of a block of rows whose first is row ``first`` of the whole."""
    given = np.zeros(len(scatterers), dtype=bool) if scatterers.rcs is None else ~np.isnan(scatterers.rcs)
    light = _Light.of(scatterers, profile)
    surface = np.flatnonzero(~given)
    curves = _Curves.of(scatterers, light.direction, index, tables, surface)
    echoes = [_points(scatterers, np.flatnonzero(given), light, profile)]
    if scatterers.footprint is not None and scatterers.normal is not None:
        echoes.append(_coherent(scatterers, surface, light, curves, profile))
    echoes.append(_incoherent(scatterers, surface, light, curves, profile))
    return [e._replace(scatterer=e.scatterer + first) for e in echoes]


class _Light(NamedTuple):
    """What reaches each row of a block: link amplitude [sqrt(W)], distance [m] and direction from the radar."""

    link: FloatArray
    distance: FloatArray
    direction: FloatArray

    @classmethod
    def of(cls, scatterers: Scatterers, profile: RadarProfile) -> _Light:
        distance = scatterers.range
        direction = scatterers.position / np.maximum(distance, 1e-12)[:, None]
        return cls(link_amplitude(profile, scatterers.position, scatterers.weather), distance, direction)


class _Table(NamedTuple):
    """Curves of one material over ``_TABLE`` cosines from 0 to 1; sigma0 in the plane of incidence and across it."""

    te: ComplexArray
    tm: ComplexArray
    in_plane: FloatArray
    across: FloatArray
    roughness_m: float


def _tables(
    scatterers: Scatterers, index: IntArray, profile: RadarProfile, materials: MaterialTable
) -> dict[int, _Table]:
    rain = 0.0 if scatterers.weather is None else scatterers.weather.rain_mm_h
    names = _names(scatterers, materials)
    cos = np.maximum(np.linspace(0.0, 1.0, _TABLE), 1e-6)
    tables = {}
    for number in np.flatnonzero(np.bincount(index)):
        material = materials[materials.in_weather(names[number], rain)]
        te, tm = material.reflection(profile.center_hz, cos)
        # V of the antenna is the field in the plane of incidence on a road, but across it on a wall beside the road
        across = swapped(profile.antenna.polarization)
        in_plane, other = (
            np.asarray(material.sigma0(profile.center_hz, cos, p)) for p in (profile.antenna.polarization, across)
        )
        tables[int(number)] = _Table(np.asarray(te), np.asarray(tm), in_plane, other, material.roughness_rms_m)
    return tables


class _Curves(NamedTuple):
    """Reflection, sigma0 and roughness of some rows."""

    te: ComplexArray
    tm: ComplexArray
    sigma0: FloatArray
    roughness_m: FloatArray

    @classmethod
    def of(
        cls,
        scatterers: Scatterers,
        direction: FloatArray,
        index: IntArray,
        tables: Mapping[int, _Table],
        rows: IntArray,
    ) -> _Curves:
        n, cos = len(rows), scatterers.cos_incidence
        turned = across_share(scatterers, rows, direction[rows])
        te, tm = np.zeros(n, dtype=np.complex128), np.zeros(n, dtype=np.complex128)
        sigma0, roughness = np.zeros(n), np.zeros(n)
        place = np.clip(cos[rows], 0.0, 1.0) * (_TABLE - 1)
        cell = np.minimum(place.astype(np.int64), _TABLE - 2)
        weight = place - cell
        material = index[rows]
        for number in np.flatnonzero(np.bincount(material)) if n else ():
            here = np.flatnonzero(material == number)
            c, w = cell[here], weight[here]
            table = tables[int(number)]
            for target, curve in ((te, table.te), (tm, table.tm), (sigma0, table.in_plane)):
                target[here] = curve[c] * (1.0 - w) + curve[c + 1] * w
            if not np.array_equal(table.in_plane, table.across):
                other = table.across[c] * (1.0 - w) + table.across[c + 1] * w
                sigma0[here] += turned[here] * (other - sigma0[here])
            roughness[here] = table.roughness_m
        return cls(te, tm, sigma0, roughness)


def _names(scatterers: Scatterers, materials: MaterialTable) -> tuple[str, ...]:
    return scatterers.material_names if scatterers.material is not None else tuple(materials.materials)


def _material_index(scatterers: Scatterers, materials: MaterialTable) -> IntArray:
    """Return (n,) int64 index into the material names; without materials on the rows the tag decides."""
    from ..tags import SemanticTag

    if scatterers.material is not None:
        return scatterers.material.astype(np.int64)
    names = list(materials.materials)
    by_tag = np.full(256, -1, dtype=np.int64)
    for value in np.flatnonzero(np.bincount(scatterers.tag)) if len(scatterers) else ():
        by_tag[value] = names.index(materials.for_tag(SemanticTag(int(value)).name))
    return by_tag[scatterers.tag]


def _speckle(scatterers: Scatterers) -> ComplexArray:
    """Return (n,) unit-power circular Gaussian numbers: the tracer's, or fresh ones from the same seed."""
    if scatterers.speckle is not None:
        return scatterers.speckle
    generator = frame_generator(scatterers.seed, scatterers.frame, scatterers.radar, "speckle")
    return (generator.standard_normal((len(scatterers), 2)) * math.sqrt(0.5)).view(np.complex128)[:, 0]


def _coherent(scatterers: Scatterers, rows: IntArray, light: _Light, curves: _Curves, profile: RadarProfile) -> _Echo:
    assert scatterers.footprint is not None
    assert scatterers.normal is not None
    assert scatterers.area is not None
    wavenumber = 2.0 * math.pi * profile.center_hz / SPEED_OF_LIGHT
    cos, link, distance = scatterers.cos_incidence[rows], light.link[rows], light.distance[rows]
    rough = np.exp(-2.0 * (wavenumber * curves.roughness_m * cos) ** 2)
    # sqrt(Pt Gt Gr / L) lambda / (4 pi)^1.5 x 2 sqrt(pi) / lambda = sqrt(Pt Gt Gr / L) / (4 pi): with the solid angle
    # in place of cos dA / r^2 neither lambda nor R is left.
    scale = link * rough / (4.0 * math.pi)
    # |integral| cannot exceed the solid angle: rows that are negligible even then need no integral
    solid = scatterers.area[rows] * cos / distance**2
    speckle = curves.sigma0 * scatterers.area[rows] * (profile.wavelength_m * link / distance**2) ** 2 / FOUR_PI_CUBED
    reflect = np.maximum(np.abs(curves.te), np.abs(curves.tm))
    keep = (scale * reflect * solid) ** 2 > _NEGLIGIBLE * speckle
    joined = np.zeros((len(rows), 4), dtype=bool) if scatterers.joined is None else scatterers.joined[rows]
    resolved = _resolved(scatterers, rows, wavenumber)
    footprint = scatterers.footprint[rows] * resolved[:, None, None]
    geometry = (light.direction[rows], footprint, scatterers.normal[rows], distance)
    keep &= ~interior(*geometry, wavenumber, joined)
    kept = np.flatnonzero(keep)
    u, edges, normal, reach = (g[kept] for g in geometry)
    gamma = backscatter_reflection(curves.te[kept], curves.tm[kept], normal, u, profile.antenna.polarization)
    integral = tube_integral(u, edges, normal, reach, wavenumber, joined[kept]) / resolved[kept]
    # The one conjugation from e^{+jwt} echo phasors to the de-chirped signal conj(rx) tx.
    amplitude = np.conj(scale[kept] * gamma * integral)
    strong = np.flatnonzero(np.abs(amplitude) ** 2 > _NEGLIGIBLE * speckle[kept])
    source = rows[kept[strong]]
    return _Echo(amplitude[strong], scatterers.position[source], source, True)


def _resolved(scatterers: Scatterers, rows: IntArray, wavenumber: float) -> FloatArray:
    """Return the share, up to 1, of the sides of a tube's footprint over which the surface is one mirror.

    A tube wider than the facets of a curved mesh lights n = 1 / share^2 of them, of like size, tilt and reflection.
    Where the surface bends by less than a fraction of the wavelength over the tube they echo as one mirror, as wide as
    the tube. Where it bends by more, their phases are independent and only one is known: its integral, over its own
    size, times sqrt(n), has the mean power of all; extended over the tube it would be a mirror that the body has not.
    """
    if scatterers.patch is None or scatterers.bend is None or scatterers.area is None:
        return np.ones(len(rows))
    area = scatterers.area[rows]
    share = np.sqrt(np.minimum(scatterers.patch[rows] / area, 1.0))
    # phase by which the surface leaves its tangent plane at the tube's rim, 2k (side / 2) (bend / 4)
    departure = 0.25 * wavenumber * np.sqrt(area) * scatterers.bend[rows]
    resolved: FloatArray = share ** -np.expm1(-((departure / _ONE_MIRROR) ** 2))
    return resolved


def _incoherent(scatterers: Scatterers, rows: IntArray, light: _Light, curves: _Curves, profile: RadarProfile) -> _Echo:
    assert scatterers.area is not None
    assert scatterers.speckle is not None
    sigma0 = curves.sigma0
    if scatterers.footprint is None and scatterers.normal is not None:  # points of a LiDAR: no tubes to integrate over
        height_phase = 2.0 * math.pi * profile.center_hz / SPEED_OF_LIGHT * curves.roughness_m
        polarization = profile.antenna.polarization
        sigma0 = sigma0 + points_sigma0(scatterers, rows, curves.te, curves.tm, height_phase, polarization)
    lit = np.flatnonzero(sigma0 > 0)
    source = rows[lit]
    root = np.sqrt(sigma0[lit] * scatterers.area[source])
    scale = light.link[source] * (profile.wavelength_m / math.sqrt(FOUR_PI_CUBED)) * root / light.distance[source] ** 2
    return _Echo(scale * scatterers.speckle[source], _jittered(scatterers, source, light), source, False)


def _jittered(scatterers: Scatterers, rows: IntArray, light: _Light) -> FloatArray:
    """Return where in its footprint each incoherent echo sits: a point of its own, or coarse cells would be a comb."""
    position = scatterers.position[rows]
    if scatterers.footprint is None or scatterers.normal is None or scatterers.jitter is None:
        return position
    distance, normal = light.distance[rows], scatterers.normal[rows]
    edges, place = scatterers.footprint[rows], scatterers.jitter[rows]
    w = light.direction[rows] + edges[:, 0] * place[:, :1] + edges[:, 1] * place[:, 1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.einsum("ij,ij->i", normal, position) / np.einsum("ij,ij->i", normal, w)
    inside = np.abs(reach - distance) < _MAX_SHIFT * distance
    return np.where(inside[:, None], w * np.where(inside, reach, 0.0)[:, None], position)


def _points(scatterers: Scatterers, rows: IntArray, light: _Light, profile: RadarProfile) -> _Echo:
    sigma = np.zeros(0) if scatterers.rcs is None else scatterers.rcs[rows]
    amplitude = light.link[rows] * profile.wavelength_m * np.sqrt(sigma / FOUR_PI_CUBED) / light.distance[rows] ** 2
    return _Echo(amplitude.astype(np.complex128), scatterers.position[rows], rows, True)


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
        weather=scatterers.weather,
    )
