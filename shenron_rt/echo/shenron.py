"""The ``shenron`` echo model: the formulas of the public C-Shenron code, and what its users corrected in them.

Every correction is a switch of :class:`ShenronModel`; all off is the released code, all on is ``corrected``. The power
of a point is, before and after,

    P = [link] lambda^2 / (4 pi)^3 * (scattered + specular) * projected area * spreading.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from .._typing import BoolArray, ComplexArray, FloatArray, IntArray
from ..constants import FOUR_PI_CUBED
from ..errors import InputError, did_you_mean
from ..frames import spherical
from ..randomness import frame_generator
from ..returns import Returns
from ..scatterers import Scatterers
from ._shenron_lobe import SPECULAR_SOLID_ANGLE, lobe_solid_angle
from ._shenron_loss import (
    GAIN,
    K_SQUARED,
    LIGHT_SPEED,
    SCATTER_GAIN,
    SPECULAR_GAIN,
    SPECULAR_HALF_ANGLE,
    VOXEL,
    coherent_share,
    lobe,
    reflectance,
)
from ._shenron_tables import (
    HUMAN,
    HUMAN_PERMITTIVITY,
    PERMITTIVITY,
    ROUGHNESS_M,
    UNLABELLED,
    corrected_material,
    released_material_of_tag,
)

if TYPE_CHECKING:
    from ..config.profile import RadarProfile

__all__ = ["ShenronModel", "shenron_returns"]


@dataclass(frozen=True, kw_only=True)
class ShenronModel:
    """Which corrections of the released model are on; all of them by default.

    Parameters
    ----------
    true_angle : bool
        The recorded cosine is one. Off: it is taken for the angle in radians, which inverts the incidence.
    specular : bool
        Mirror-like power of surfaces that face the radar within 2 degrees. Off: scattered power alone.
    tm : bool
        Mean of the TE and TM reflectances, since a LiDAR point does not tell its plane of incidence. Off: TE.
    roughness_power : bool
        Power share exp(-(4 pi s cos/lambda)^2) of the coherent part. Off: its square root, an amplitude.
    lobe_power : bool
        The lobe is the power pattern. Off: it is squared once more.
    azimuth_pattern, elevation_pattern : bool
        The profile's antenna pattern, both ways, -3 dB each way at half the half-power width. Off: none.
    r4 : bool
        1/R^4 of a fixed projected area. Off: 1/R^2, and ``reference_range_m`` stands for the other leg.
    density : bool
        Projected area of each point from ``Scatterers.area``. Off: 2 by 2 degrees for every point, as it looks from
        ``reference_range_m``, however dense the points are.
    calibrated : bool
        Watts: the lobes hold the reflected power, and the link is the profile's Pt Gt Gr, radome and weather. Off:
        the released constants, 105 dB of gain, ADC counts.
    velocity : bool
        Scatterers move. Off: all stand still.
    tag_table_fixed : bool
        Buildings and fences have their own material, and every CARLA tag has one. Off: the released table.
    pedestrians : bool
        The human body has permittivity 15. Off: 1, which returns nothing.
    random_phase : bool
        Every point has a random phase, so that powers add and speckle does not hang on the rounding of coordinates.
        Off: the phase of the point's position alone, coherent.
    noise_per_chirp : bool
        Noise, new on every chirp; for :class:`~shenron_rt.cshenron.ShenronRadarModel`, since noise belongs to the
        synthesis. Off: none.
    mount : bool
        The radar is where it is mounted; for :class:`~shenron_rt.cshenron.ShenronRadarModel`, since scatterers are
        already in the radar's frame. Off: on the ground under the vehicle's centre.
    reference_range_m : float
        For one of ``r4`` and ``density`` without the other; without both it cancels [m].
    """

    true_angle: bool = True
    specular: bool = True
    tm: bool = True
    roughness_power: bool = True
    lobe_power: bool = True
    azimuth_pattern: bool = True
    elevation_pattern: bool = True
    r4: bool = True
    density: bool = True
    calibrated: bool = True
    velocity: bool = True
    tag_table_fixed: bool = True
    pedestrians: bool = True
    random_phase: bool = True
    noise_per_chirp: bool = True
    mount: bool = True
    reference_range_m: float = 20.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.reference_range_m) and self.reference_range_m > 0):
            raise InputError(f"reference_range_m is {self.reference_range_m}; a length above 0 m is needed")

    @classmethod
    def corrected(cls) -> Self:
        """Return the model with every correction."""
        return cls()

    @classmethod
    def as_released(cls) -> Self:
        """Return the model of the public code, no correction at all."""
        return cls(**dict.fromkeys(cls.switches(), False))

    @classmethod
    def switches(cls) -> tuple[str, ...]:
        """Return the names of the corrections."""
        return tuple(f.name for f in fields(cls) if isinstance(f.default, bool))

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read a model from its name.

        Parameters
        ----------
        text : str
            ``"shenron"`` and ``"shenron:corrected"``, ``"shenron:as_released"``, and with switches turned on or off
            ``"shenron:as_released+true_angle+specular"``, ``"shenron:corrected-r4"``. ``"shenron:"`` may be absent.

        Raises
        ------
        InputError
            An unknown preset or switch.

        Examples
        --------
        >>> ShenronModel.parse("shenron:as_released+true_angle").true_angle
        True
        """
        preset, *changes = re.split(r"(?=[+-])", text.removeprefix("shenron").removeprefix(":") or "corrected")
        presets = {"corrected": cls.corrected, "as_released": cls.as_released}
        if preset not in presets:
            raise InputError(f"unknown preset of the shenron model {preset!r}; {did_you_mean(preset, presets)}")
        values = {}
        for change in changes:
            name = change[1:]
            if name not in cls.switches():
                raise InputError(f"{text}: unknown switch {name!r}; {did_you_mean(name, cls.switches())}")
            values[name] = change[0] == "+"
        return replace(presets[preset](), **values)

    @property
    def name(self) -> str:
        """What :meth:`parse` reads; the shorter of the two ways to say it."""
        on = [s for s in self.switches() if getattr(self, s)]
        off = [s for s in self.switches() if not getattr(self, s)]
        if len(off) <= len(on):
            return "shenron:corrected" + "".join(f"-{s}" for s in off)
        return "shenron:as_released" + "".join(f"+{s}" for s in on)


def shenron_returns(scatterers: Scatterers, profile: RadarProfile, model: ShenronModel) -> Returns:
    """Apply the ``shenron`` model.

    Parameters
    ----------
    scatterers : Scatterers
        From either door; ``area`` is needed with the ``density`` switch.
    profile : RadarProfile
    model : ShenronModel

    Returns
    -------
    echoes : Returns
        One echo for every row with a material and a power, and for every point target, in the order of the rows; in
        sqrt(W) where ``calibrated``, else in ADC counts of the released code.

    Raises
    ------
    InputError
        ``density`` without ``Scatterers.area``.
    """
    given = np.zeros(len(scatterers), dtype=bool) if scatterers.rcs is None else ~np.isnan(scatterers.rcs)
    equivalent = np.zeros(len(scatterers))  # RCS over R^4 [1/m^2]
    surface = np.flatnonzero(~given & (scatterers.range > 0))
    equivalent[surface] = _surface(scatterers.select(surface), profile, model)
    if scatterers.rcs is not None:
        equivalent[given] = scatterers.rcs[given] / scatterers.range[given] ** 4
    rows = np.flatnonzero(equivalent > 0)
    lit, coherent = scatterers.select(rows), given[rows] | (not model.random_phase)
    amplitude = _link(lit, profile, model) * np.sqrt(equivalent[rows] / FOUR_PI_CUBED)
    return Returns(
        amplitude=amplitude * _phase(scatterers, rows, coherent),
        position=lit.position,
        velocity=_velocity(lit, model),
        object_id=lit.object_id,
        tag=lit.tag,
        coherent=coherent,
        bounces=np.ones(len(rows), dtype=np.uint8) if lit.bounces is None else lit.bounces,
        scatterer=rows,
        center_hz=profile.center_hz,
        model=model.name,
        weather=scatterers.weather if model.calibrated else None,
    )


def _surface(scatterers: Scatterers, profile: RadarProfile, model: ShenronModel) -> FloatArray:
    """Return RCS over R^4 of points on surfaces, (n,) [1/m^2]; in released units where not calibrated."""
    table = corrected_material if model.tag_table_fixed else released_material_of_tag
    material, cos = table(scatterers.tag), _cosine(scatterers)
    angle = np.arccos(cos) if model.true_angle else scatterers.cos_incidence
    scattered, specular = _shares(material, angle, profile.waveform.carrier_hz, model)
    if model.calibrated:
        lobe_sum = lobe_solid_angle(np.clip(np.abs(angle), 0.0, np.pi / 2), 1 if model.lobe_power else 2)
        scattered, specular = scattered * 4 * np.pi / lobe_sum, specular * 4 * np.pi / SPECULAR_SOLID_ANGLE
    else:
        scattered, specular = scattered * K_SQUARED * SCATTER_GAIN, specular * K_SQUARED * SPECULAR_GAIN
    total = (scattered + specular) * _area_over_r4(scatterers, cos, model)
    return np.where(material == UNLABELLED, 0.0, total)


def _shares(
    material: IntArray, angle: FloatArray, frequency_hz: float, model: ShenronModel
) -> tuple[FloatArray, FloatArray]:
    """Return the shares of the incident power: scattered times lobe, and specular."""
    permittivity = PERMITTIVITY.copy()
    if model.pedestrians:
        permittivity[HUMAN] = HUMAN_PERMITTIVITY
    te, tm = reflectance(permittivity[material], angle)
    reflected = (te + tm) / 2 if model.tm else te
    coherent = coherent_share(ROUGHNESS_M[material], angle, frequency_hz) ** (2 if model.roughness_power else 1)
    pattern = lobe(angle) ** (1 if model.lobe_power else 2)
    facing = (np.abs(angle) < SPECULAR_HALF_ANGLE) & model.specular
    return reflected * (1 - coherent) * pattern, reflected * coherent * facing


def _cosine(scatterers: Scatterers) -> FloatArray:
    """Return the cosine of incidence at the radar where there is a normal, else the recorded one; (n,) in [0, 1]."""
    if scatterers.normal is None:
        return scatterers.cos_incidence
    towards = -np.einsum("ij,ij->i", scatterers.position, scatterers.normal) / scatterers.range
    return np.where(np.isnan(towards), scatterers.cos_incidence, np.clip(towards, 0.0, 1.0))


def _area_over_r4(scatterers: Scatterers, cos: FloatArray, model: ShenronModel) -> FloatArray:
    """Return projected area times spreading, (n,) [1/m^2]."""
    distance, reference = scatterers.range, model.reference_range_m
    if model.density:
        if scatterers.area is None:
            raise InputError(
                "the shenron model needs Scatterers.area [m^2] for its switch 'density'; pass area= to "
                "Scatterers.from_table, or take the model 'shenron:corrected-density'"
            )
        area = scatterers.area * cos
    else:
        _, _, elevation = spherical(scatterers.position)
        area = np.cos(elevation) * (VOXEL * reference) ** 2
    spreading = distance**-4 if model.r4 else (reference * distance) ** -2.0
    return np.asarray(area * spreading)


def _link(scatterers: Scatterers, profile: RadarProfile, model: ShenronModel) -> FloatArray:
    """Return lambda sqrt(Pt Gt Gr / losses), or lambda sqrt(gain) of the released code, times the patterns."""
    distance, azimuth, elevation = spherical(scatterers.position)
    still = np.zeros(len(scatterers))
    one_way = np.ones(len(scatterers))
    if model.azimuth_pattern or model.elevation_pattern:
        one_way = profile.pattern(
            azimuth if model.azimuth_pattern else still, elevation if model.elevation_pattern else still
        )
    if not model.calibrated:
        return one_way * math.sqrt(GAIN) * LIGHT_SPEED / profile.waveform.carrier_hz
    antenna = profile.antenna
    gain_db = antenna.gain_tx_dbi + antenna.gain_rx_dbi - antenna.radome_loss_db
    amplitude = one_way * profile.wavelength_m * math.sqrt(profile.tx_power_w * 10 ** (gain_db / 10))
    if scatterers.weather is not None:
        loss = scatterers.weather.two_way_loss(distance, profile.center_hz, antenna.polarization)
        amplitude = amplitude / np.sqrt(loss)
    return np.asarray(amplitude)


def _phase(scatterers: Scatterers, rows: IntArray, coherent: BoolArray) -> ComplexArray:
    """Return unit phasors, 1 for coherent rows; a row's phase depends on its place in the list, not on the others."""
    generator = frame_generator(scatterers.seed, scatterers.frame, scatterers.radar, "shenron")
    turn = generator.random(len(scatterers))[rows]
    return np.asarray(np.where(coherent, 1.0, np.exp(2j * np.pi * turn)), dtype=np.complex128)


def _velocity(scatterers: Scatterers, model: ShenronModel) -> FloatArray:
    if not model.velocity:
        return np.zeros((len(scatterers), 3))
    if scatterers.velocity is not None:
        return scatterers.velocity
    along = scatterers.position / np.maximum(scatterers.range, 1e-12)[:, None]  # only the radial part is known
    return np.asarray(along * scatterers.range_rate[:, None])
