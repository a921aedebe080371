"""Apparent RCS against distance: what is swept, and the closed forms beside it."""

from __future__ import annotations

import math

import numpy as np

import shenron_rt as srt
from shenron_rt._typing import FloatArray
from shenron_rt.constants import SPEED_OF_LIGHT
from shenron_rt.physics import near_range_cylinder_rcs

from .cases import BANDS_GHZ, RADAR_HEIGHT_M, RAYS, Case

POLE_RADIUS_M, POLE_HEIGHT_M = 0.08, 6.0
#: Depth of the rail's wave and the phase that it runs through over its height: y = -depth/2 (1 - cos(4 pi z/height)).
RAIL_DEPTH_M, RAIL_HEIGHT_M, RAIL_TOP_M = 0.081, 0.312, 0.75
#: Radii of the car's side, and of its back: docs/car-rcs.md.
CAR_RADII_M = {"side": (7.3, 6.5), "back": (1.4, 6.5)}
FORMULAS = {
    "car-side": "pi R1 R/(R1 + R) · R2 R/(R2 + R), radii 7.3, 6.5 m",
    "car-back": "the same, radii 1.4, 6.5 m",
    "truck-back": "pi R², an endless wall",
    "pole": "pi R² a/(a + R), an endless pole",
    "guard_rail": "3 crests and valleys, each pi R² r/(r + R), r = 15 mm",
    "wall": "pi R² times the reflectivity of concrete",
}
TITLES = {
    "car-side": "car, left side",
    "car-back": "car, back",
    "truck-back": "truck, back",
    "pole": "pole, 6 m, 160 mm across",
    "guard_rail": "guard rail, 8 m",
    "wall": "concrete wall, 6 x 3 m",
}


def _distances(count: int) -> tuple[float, ...]:
    return tuple(np.round(np.geomspace(5.0, 50.0, count), 3).tolist())


def _about(centre: float) -> tuple[float, ...]:
    return tuple((centre + np.array([-2.0, 0.1, 1.8])).tolist())


def distance_cases() -> list[Case]:
    """Return the curves; a distance counts from the point of the target that is nearest to the radar.

    Vehicles: mean power of three aspects within 2 deg, since single ones fade.
    """
    spots: dict[str, tuple[str, tuple[float, float, float], tuple[float, ...], int]] = {
        "car-side": ("car", (0.0, 0.9, RADAR_HEIGHT_M), _about(90.0), 10),
        "car-back": ("car", (-2.25, 0.0, RADAR_HEIGHT_M), _about(180.0), 10),
        "truck-back": ("truck", (-4.0, 0.0, RADAR_HEIGHT_M), _about(180.0), 10),
        "pole": ("pole", (POLE_RADIUS_M, 0.0, RADAR_HEIGHT_M), (0.0,), 31),
        "guard_rail": (
            "guard_rail:l=8", (0.0, -RAIL_DEPTH_M, RAIL_TOP_M - 0.5 * RAIL_HEIGHT_M), (-90.0,), 25,
        ),
        "wall": ("wall:6x3", (0.0, -0.15, 1.5), (-90.0,), 25),
    }  # fmt: skip
    return [
        Case(f"distance-{name}-{ghz:g}", "distance_m", _distances(n), shape, ghz, None, azimuth, point,
             rays_per_wavelength=RAYS.get((shape, ghz), 1.0))
        for name, (shape, point, azimuth, n) in spots.items() for ghz in BANDS_GHZ
    ]  # fmt: skip


def glint(range_m: FloatArray, *radii_m: float) -> FloatArray:
    """Return pi prod R_i R/(R_i + R), geometric optics of a smooth patch [m^2]; an infinite radius is flat."""
    return np.asarray(math.pi * np.prod([range_m / (1.0 + range_m / r) for r in radii_m], axis=0))


def closed_form(name: str, range_m: FloatArray, ghz: float) -> FloatArray:
    """Return the apparent RCS of the formula in :data:`FORMULAS` [m^2]."""
    if name.startswith("car-"):
        return glint(range_m, *CAR_RADII_M[name.removeprefix("car-")])
    if name == "pole":
        return glint(range_m, POLE_RADIUS_M, math.inf)
    if name == "guard_rail":
        sharpest = 0.5 * RAIL_DEPTH_M * (4.0 * math.pi / RAIL_HEIGHT_M) ** 2
        return 3.0 * glint(range_m, 1.0 / sharpest, math.inf)
    endless = glint(range_m, math.inf, math.inf)
    if name == "truck-back":
        return endless
    return endless * wall_reflectivity(ghz)


def wall_reflectivity(ghz: float) -> float:
    """Return the share of the power that concrete mirrors coherently at normal incidence, its roughness included."""
    concrete = srt.load_materials()["concrete"]
    te, _ = concrete.reflection(ghz * 1e9, 1.0)
    phase = 4.0 * math.pi / (SPEED_OF_LIGHT / (ghz * 1e9)) * concrete.roughness_rms_m
    return float(abs(np.asarray(te).item()) ** 2 * math.exp(-(phase**2)))


def pole_on_turntable(range_m: float) -> float:
    """Return pi R^3 a/(R - a)^2, an endless pole whose axis, not surface, stands at a range [m^2]."""
    return math.pi * range_m**3 * POLE_RADIUS_M / (range_m - POLE_RADIUS_M) ** 2


def pole_integral(range_m: FloatArray, ghz: float) -> FloatArray:
    """Return the surface integral over the bundled pole, both ends included [m^2]; distances count to its surface."""
    above = RADAR_HEIGHT_M - 0.5 * POLE_HEIGHT_M
    lam = SPEED_OF_LIGHT / (ghz * 1e9)
    found = [
        near_range_cylinder_rcs(POLE_RADIUS_M, POLE_HEIGHT_M, lam, r + POLE_RADIUS_M, above)
        * (r / math.hypot(r + POLE_RADIUS_M, above)) ** 4
        for r in range_m.tolist()
    ]
    return np.array(found)
