"""What the atlas sweeps: bundled targets over aspect, from above, over distance, and with something taken away."""

from __future__ import annotations

import functools
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

import shenron_rt as srt
from shenron_rt._typing import FloatArray
from shenron_rt.scene.mesh import TaggedMesh
from shenron_rt.scene.shapes import make_shape

#: Height of the radar, and of the turntable's centre, above the ground [m]: behind a bumper.
RADAR_HEIGHT_M = 0.65
NEAR_M = 25.0
BANDS_GHZ = (24.0, 77.0)
BOUNCES = 3
#: Step of the aspect at 25 m, twice that in the far field [deg]. Car and truck mirror, so that half a circle
#: is swept.
STEP_DEG = {"car": 1.0, "truck": 2.0, "pedestrian": 2.0, "bicycle": 2.0, "pole": 5.0}
MIRRORED = ("car", "truck")
#: Of the trials that say why: off the axes of the body.
TRIAL_STEP_DEG, TRIAL_FIRST_DEG = 10.0, 5.0
#: Turntables in the far field too; that of a truck begins kilometres away.
FAR = ("car", "pedestrian", "bicycle", "pole")
#: Fewer where an aspect has millions of cells; docs/rcs-atlas.md has what that changes.
RAYS = {("truck", 77.0): 0.5, ("wall:6x3", 77.0): 0.5}


@dataclass(frozen=True)
class Case:
    """A curve: RCS of one target over azimuth, elevation or distance.

    Parameters
    ----------
    name : str
        Key in the results.
    axis : {"azimuth_deg", "elevation_deg", "distance_m"}
        What ``x`` is.
    x : tuple of float
    shape : str
    ghz : float
    distance_m : float or None
        None is the far field; along a distance unused.
    azimuth_deg : tuple of float
        Elsewhere than along azimuth: the aspects whose mean power is taken.
    point_m : (3,)
        Of the shape's own frame; the turntable's centre, to which distances count.
    max_bounces : int
    rays_per_wavelength : float
    material : str or None
        None: what the parts say.
    without : tuple of str
        Groups of parts that turn into air: they hide what is behind them, and reflect nothing.
    """

    name: str
    axis: str
    x: tuple[float, ...]
    shape: str
    ghz: float
    distance_m: float | None = None
    azimuth_deg: tuple[float, ...] = (0.0,)
    point_m: tuple[float, float, float] = (0.0, 0.0, RADAR_HEIGHT_M)
    max_bounces: int = BOUNCES
    rays_per_wavelength: float = 1.0
    material: str | None = None
    without: tuple[str, ...] = ()

    def settings(self) -> dict[str, Any]:
        """Return everything but the axis' values, as JSON has it."""
        fields = asdict(self)
        fields.pop("x")
        return {k: list(v) if isinstance(v, tuple) else v for k, v in fields.items()}

    def sweep(self, x: FloatArray) -> FloatArray:
        """Return the RCS [m^2] at some values of the axis."""
        common: dict[str, Any] = {
            "frequency_hz": self.ghz * 1e9,
            "max_bounces": self.max_bounces,
            "rays_per_wavelength": self.rays_per_wavelength,
            "material": self.material,
        }
        mesh = mesh_of(self.shape, self.point_m, self.without)
        if self.axis == "azimuth_deg":
            got = srt.sweep_rcs(mesh, azimuth_deg=x, distance_m=self.distance_m, **common)
            return np.asarray(got.rcs_m2[0, 0, :, 0])
        if self.axis == "elevation_deg":
            around = srt.sweep_rcs(
                mesh, azimuth_deg=self.azimuth_deg, elevation_deg=x, distance_m=self.distance_m, **common
            )
            return np.asarray(around.rcs_m2[0, :, :, 0].mean(axis=1))
        return np.array(
            [srt.sweep_rcs(mesh, azimuth_deg=self.azimuth_deg, distance_m=r, **common).rcs_m2.mean() for r in x]
        )


@functools.lru_cache(maxsize=8)
def mesh_of(shape: str, point_m: tuple[float, float, float], without: tuple[str, ...]) -> TaggedMesh:
    """Return a shape moved so that a point of it is the origin, some groups of its parts being air."""
    mesh = make_shape(shape)
    absent = [any(word in p.group for word in without) for p in mesh.parts]
    parts = tuple(replace(p, em_material="air") if gone else p for p, gone in zip(mesh.parts, absent, strict=True))
    return replace(mesh, vertices=mesh.vertices - np.asarray(point_m), parts=parts)


def aspects(shape: str, step_deg: float) -> tuple[float, ...]:
    """Return the azimuths to sweep: the left half of the circle for what is its own mirror image."""
    if shape in MIRRORED:
        return tuple(np.arange(0.0, 180.0 + 1e-9, step_deg).tolist())
    return tuple(np.arange(-180.0, 180.0 - 1e-9, step_deg).tolist())


def full_circle(shape: str, azimuth_deg: FloatArray, rcs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return azimuths in [-180, 180), ascending, and the RCS there; the right half from the left where they mirror."""
    if shape in MIRRORED:
        inner = (azimuth_deg > 0.0) & (azimuth_deg < 180.0)
        azimuth_deg = np.concatenate([azimuth_deg, -azimuth_deg[inner]])
        rcs = np.concatenate([rcs, rcs[inner]])
    turned = np.where(azimuth_deg >= 180.0, azimuth_deg - 360.0, azimuth_deg)
    order = np.argsort(turned)
    return turned[order], rcs[order]


def turntable_cases() -> list[Case]:
    """Return the circles: every target in both bands, at 25 m and, of most, in the far field."""
    return [
        Case(f"{shape}-{ghz:g}-{place}", "azimuth_deg", aspects(shape, factor * step), shape, ghz, distance,
             rays_per_wavelength=RAYS.get((shape, ghz), 1.0))
        for place, distance, factor in ((f"{NEAR_M:g}m", NEAR_M, 1.0), ("far", None, 2.0))
        for shape, step in STEP_DEG.items() for ghz in BANDS_GHZ
        if distance is not None or shape in FAR
    ]  # fmt: skip


def roof_cases() -> list[Case]:
    """Return the view from above the vehicles, from 70 deg of elevation to the zenith."""
    return [
        Case(f"{shape}-{ghz:g}-roof", "elevation_deg", tuple(np.arange(70.0, 90.1, 2.0).tolist()), shape, ghz, NEAR_M,
             rays_per_wavelength=RAYS.get((shape, ghz), 1.0))
        for shape in MIRRORED for ghz in BANDS_GHZ
    ]  # fmt: skip


#: Windows that are fully sampled, lambda/2L for a width L: first and last aspect, step, and coarser steps [deg].
SAMPLED = {"car": (40.0, 50.0, 0.1, (1.0, 2.0)), "pedestrian": (30.0, 50.0, 0.4, (2.0, 4.0))}
TRIAL_RAYS = (0.5, 1.0)
#: Label, and what differs from the circle.
VARIANTS: dict[str, dict[str, tuple[str, dict[str, Any]]]] = {
    "car": {
        "one": ("first bounce only", {"max_bounces": 1}),
        "rays": ("twice the rays per wavelength", {"rays_per_wavelength": 2.0}),
        "metal": ("all of it metal", {"material": "metal"}),
        "body": ("body and pillars absorb", {"without": ("body", "pillars")}),
        "wheels": ("wheels absorb", {"without": ("tyre", "rim")}),
    },
    "truck": {
        "one": ("first bounce only", {"max_bounces": 1}),
        "rays": ("twice the rays per wavelength", {"rays_per_wavelength": 2.0}),
        "metal": ("all of it metal", {"material": "metal"}),
        "box": ("cargo box absorbs", {"without": ("cargo box",)}),
        "frame": ("frame and wheels absorb", {"without": ("frame", "wheel")}),
        "cab": ("cab and its windows absorb", {"without": ("cab", "windscreen", "door windows")}),
    },
    "pedestrian": {
        "at-77": ("77 GHz", {"ghz": 77.0}),
        "metal-at-77": ("77 GHz, all of it metal", {"ghz": 77.0, "material": "metal"}),
        "one": ("first bounce only", {"max_bounces": 1}),
        "rays": ("twice the rays per wavelength", {"rays_per_wavelength": 2.0}),
        "metal": ("all of it metal", {"material": "metal"}),
        "skin": ("skin absorbs", {"without": ("skin",)}),
    },
    "bicycle": {
        "one": ("first bounce only", {"max_bounces": 1}),
        "rays": ("twice the rays per wavelength", {"rays_per_wavelength": 2.0}),
        "metal": ("all of it metal", {"material": "metal"}),
        "frame": ("frame absorbs", {"without": ("frame",)}),
    },
}


def why_cases(ghz: float = 24.0) -> list[Case]:
    """Return the trials that say where an echo comes from, 25 m, aspects of their own."""
    found = []
    for shape, variants in VARIANTS.items():
        first = TRIAL_FIRST_DEG - (0.0 if shape in MIRRORED else 180.0)
        step = TRIAL_STEP_DEG if shape in MIRRORED else 2.0 * TRIAL_STEP_DEG
        x = tuple(np.arange(first, 180.0, step).tolist())
        base = Case(f"why-{shape}-as-it-is", "azimuth_deg", x, shape, ghz, NEAR_M)
        found.append(base)
        found += [replace(base, name=f"why-{shape}-{key}", **change) for key, (_, change) in variants.items()]
    coarse = Case("", "azimuth_deg", tuple(np.arange(5.0, 180.0, 40.0).tolist()), "truck", 77.0, NEAR_M)
    return [
        *found,
        *(replace(coarse, name=f"rays-truck-77-{rays:g}", rays_per_wavelength=rays) for rays in TRIAL_RAYS),
    ]


def sampling_cases() -> list[Case]:
    """Return windows at a step that a full sampling asks for, 24 GHz, 25 m."""
    return [
        Case(
            f"sampling-{shape}-24",
            "azimuth_deg",
            tuple(np.arange(low, high, fine).round(6).tolist()),
            shape,
            24.0,
            NEAR_M,
        )
        for shape, (low, high, fine, _) in SAMPLED.items()
    ]
