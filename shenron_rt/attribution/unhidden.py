"""What a trace did not hit: an object alone, with and without the antenna pattern, and what stands before it."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .._typing import FloatArray
from ..config.profile import RadarProfile
from ..config.scene import Actor, PointTarget, Scene, StaticPart
from ..returns import Returns, illuminate
from ..scatterers import Scatterers
from ..scene.world import World, build_world, load_bodies
from ..tracing import trace
from ..tracing.backend import choose_backend
from ..tracing.caster import RayCaster

__all__ = ["Blockers", "Surroundings", "Unhidden", "isotropic", "unhidden"]

#: Rays at an object that is looked at alone, and over the whole sphere where it surrounds the radar.
_AIM, _RAYS = 20_000, 20_000
#: A flat piece with less of an object's surface is a facet of something curved.
_FACET = 0.1
#: What stands less than this before a point is the point's own surface [m].
_SLACK_M = 0.02


@dataclass(frozen=True)
class Blockers:
    """What stands before an object: share of its unhidden area by name, largest first."""

    hidden_share: float
    by: tuple[tuple[str, float], ...]

    @property
    def first(self) -> str:
        """The name of what hides most of it; empty where nothing does."""
        return self.by[0][0] if self.by else ""


@dataclass(frozen=True)
class Unhidden:
    """An object alone in the scene.

    Parameters
    ----------
    scatterers : Scatterers
        Its rows, whatever stands before it and wherever the antenna looks.
    returns : Returns
        With the radar's own pattern.
    on_axis : Returns
        As if every direction had the gain of the axis.
    blockers : Blockers
    """

    scatterers: Scatterers
    returns: Returns
    on_axis: Returns
    blockers: Blockers

    @property
    def area_m2(self) -> float:
        """Surface that is turned towards the radar [m^2]."""
        return 0.0 if self.scatterers.area is None else float(self.scatterers.area.sum())

    @property
    def projected_m2(self) -> float:
        """That surface as the radar sees it [m^2]."""
        return projected_area(self.scatterers)

    @property
    def centre(self) -> FloatArray:
        """(3,) middle of the surface by projected area, or of the points [m]."""
        rows = self.scatterers
        weight = np.ones(len(rows)) if rows.area is None else rows.area * rows.cos_incidence
        if not weight.sum() > 0:
            weight = np.ones(len(rows))
        return np.asarray(np.average(rows.position, axis=0, weights=weight), dtype=np.float64)

    def facing_m2(self, wavelength_m: float) -> float:
        """Return what the largest flat piece would mirror if it faced the radar and were metal [m^2].

        Notes
        -----
        The smaller of 4 pi A^2 / lambda^2 and, once the plate is wider than a Fresnel zone, pi R^2. A piece smaller
        than a tenth of the surface is a facet of a curved one, and counts for nothing.
        """
        rows = self.scatterers
        if rows.patch is None or not self.area_m2 > 0:
            return 0.0
        flat = float(rows.patch.max())
        if flat < _FACET * self.area_m2:
            return 0.0
        return min(4 * np.pi * flat**2 / wavelength_m**2, np.pi * float(self.centre @ self.centre))

    def turn_deg(self) -> float | None:
        """Return the smallest angle by which a tenth of the projected area misses facing the radar [deg]."""
        rows = self.scatterers
        if rows.area is None or rows.normal is None or not rows.area.sum() > 0:
            return None
        order = np.argsort(-rows.cos_incidence)
        share = np.cumsum(rows.area[order]) / rows.area.sum()
        cos = float(rows.cos_incidence[order][np.searchsorted(share, 0.1)])
        return float(np.degrees(np.arccos(np.clip(cos, -1, 1))))


def projected_area(scatterers: Scatterers) -> float:
    """Return the area of some rows as the radar sees it: the sum of area times cosine [m^2]."""
    return 0.0 if scatterers.area is None else float(scatterers.area @ scatterers.cos_incidence)


def isotropic(profile: RadarProfile) -> RadarProfile:
    """Return the profile with the gain of its axis in every direction."""
    data = profile.model_dump()
    data["antenna"]["pattern"] = "isotropic"
    return RadarProfile.model_validate(data)  # built anew: a copy would keep the cached pattern


@dataclass(frozen=True)
class Surroundings:
    """A scene as one radar has it in one frame, with rays to cast through all of it.

    Parameters
    ----------
    scene : Scene
    profile : RadarProfile
        The radar's.
    radar : str
    time : float
        Scene seconds at the first chirp's start [s].
    """

    scene: Scene
    profile: RadarProfile
    radar: str
    time: float

    @cached_property
    def world(self) -> World:
        """All triangles at mid-frame."""
        bodies, materials = load_bodies(self.scene)
        middle = self.time + self.profile.frame_mid_s
        return build_world(self.scene, self.scene.radar(self.radar), middle, bodies, materials)

    @cached_property
    def caster(self) -> RayCaster:
        """Casts rays at them."""
        return RayCaster(self.world.vertices, self.world.faces, choose_backend("auto"))


def unhidden(around: Surroundings, object_id: int, *, seed: int, frame: int, model: str) -> Unhidden | None:
    """Look at one object alone.

    Parameters
    ----------
    around : Surroundings
    object_id : int
    seed, frame : int
        Of the random numbers.
    model : str
        Echo model.

    Returns
    -------
    Unhidden or None
        ``None`` where the scene has no such object, or no part of it is turned towards the radar.
    """
    scene, profile = around.scene, around.profile
    alone = _alone(scene, object_id)
    if alone is None:
        return None
    everywhere = isotropic(profile)
    quiet = logging.getLogger("shenron_rt.tracing.advice")
    level = quiet.level
    quiet.setLevel(logging.ERROR)  # advice on rays concerns the run's rays, not these
    try:
        rows = trace(alone, everywhere, radar=around.radar, time=around.time, seed=seed, frame=frame, rays=_RAYS)
    finally:
        quiet.setLevel(level)
    rows = rows.select(rows.object_id == object_id)
    if not len(rows):
        return None
    return Unhidden(
        scatterers=rows,
        returns=illuminate(rows, profile, model=model, materials=scene.materials),
        on_axis=illuminate(rows, everywhere, model=model, materials=scene.materials),
        blockers=_blockers(around, rows, object_id),
    )


def _alone(scene: Scene, object_id: int) -> Scene | None:
    """Return the scene with nothing in it but one object, that with rays of its own."""

    def mine(items: tuple[StaticPart, ...] | tuple[Actor, ...]) -> tuple[StaticPart | Actor, ...]:
        return tuple(i.model_copy(update={"aim": i.aim or _AIM}) for i in items if i.id == object_id)

    points: tuple[PointTarget, ...] = tuple(p for p in scene.point_targets if p.id == object_id)
    static, actors = mine(scene.static), mine(scene.actors)
    if not (static or actors or points):
        return None
    return scene.model_copy(update={"static": static, "actors": actors, "point_targets": points})


def _blockers(around: Surroundings, rows: Scatterers, object_id: int) -> Blockers:
    """Cast a ray to every row of an object through the whole scene."""
    world, caster = around.world, around.caster
    direction = rows.position / np.maximum(rows.range, 1e-12)[:, None]
    face = caster.cast(np.ascontiguousarray(direction.T, dtype=np.float32))
    weight = np.ones(len(rows)) if rows.area is None or not rows.area.sum() > 0 else rows.area
    hidden: dict[str, float] = {}
    if len(world.faces):
        along = np.abs(np.einsum("ij,ij->i", world.face_normal[face], direction))
        before = np.abs(world.face_offset[face]) < (rows.range - _SLACK_M) * along
        body = world.face_body[face]
        for b in np.unique(body[face >= 0]):
            item = world.bodies[int(b)]
            if item.object_id == object_id:
                continue
            name = item.source.name or f"object {item.object_id}"
            share = float(weight[(face >= 0) & before & (body == b)].sum() / weight.sum())
            hidden[name] = hidden.get(name, 0.0) + share
    order = sorted(((n, s) for n, s in hidden.items() if s > 0), key=lambda item: -item[1])
    return Blockers(float(sum(s for _, s in order)), tuple(order))
