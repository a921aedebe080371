"""Targets at a finite range: spherical waves there and back, apparent RCS by the radar equation at the distance."""

from __future__ import annotations

import functools
import math

import numpy as np

from shenron_rt._typing import FloatArray
from shenron_rt.physics import (
    infinite_plate_rcs,
    near_range_cylinder_rcs,
    near_range_plate_rcs,
    near_range_surface_amplitude,
    near_range_trihedral_matrix,
)
from shenron_rt.scene.mesh import TaggedMesh, build_mesh

from .bars import Bar, Cut, Limit, Run, dbsm
from .tables import columns, rows, wavelength

SHAPES = {
    "plate_100x100mm": "plate:0.1x0.1",
    "plate_300x300mm": "plate:0.3x0.3",
    "disc_r100mm": "disc:r=0.1",
}
#: A beam with the corrugation of a guard rail: depth and period of its wave, length, height [m]. Flat enough that
#: nothing of it hides anything from a radar before it.
DEPTH, PERIOD, LENGTH, HEIGHT = 0.02, 0.15, 1.0, 0.31


def table_rows(run: Run, name: str) -> list[Cut]:
    """Compare a plate or disc on boresight at the ranges of the table, 24 and 77 GHz."""
    table = rows(columns(run.shared / "reference/rcs/near_range_apparent_rcs.csv"), target=name)
    part = run.thin(3)
    pairs = list(zip(table["freq_ghz"][part], table["range_m"][part], strict=True))
    got = [
        run.sweep(SHAPES[name], frequency_hz=f * 1e9, azimuth_deg=0.0, distance_m=r, max_bounces=1).rcs_dbsm.item()
        for f, r in pairs
    ]
    return [Cut(np.array(got), table["apparent_dbsm"][part])]


def trihedral(run: Run, kind: str) -> list[Cut]:
    """Compare trihedrals off boresight with the exact near-range sum over bounces.

    The table's own rows are an aperture estimate, which lies 8.8 leg/R dB beside it.
    """
    got, want = [], []
    for ghz, leg in ((24.0, 0.2), (77.0, 0.1)):
        for distance in (3.0,) if run.quick else (1.0, 2.0, 5.0, 10.0, 30.0):
            for azimuth, elevation in ((8.0, -5.0),) if run.quick else ((0.0, 0.0), (8.0, -5.0)):
                got.append(
                    run.sweep(
                        f"trihedral:{kind},a={leg}", frequency_hz=ghz * 1e9, azimuth_deg=azimuth,
                        elevation_deg=elevation, distance_m=distance, polarization=("VV", "HH"),
                    ).rcs_dbsm[0, 0, 0]
                )  # fmt: skip
                exact = near_range_trihedral_matrix(
                    kind, leg, wavelength(ghz), distance, math.radians(azimuth), math.radians(elevation)
                )
                want.append(dbsm(np.diagonal(exact)))
    return [Cut(np.array(got).ravel(), np.array(want).ravel())]


def cylinder(run: Run) -> list[Cut]:
    """Compare cylinders and a pole from straight ahead and from a height."""
    got, want = [], []
    cases = [(0.05, 0.3, 77.0, 1.0, 0.0), (0.05, 0.3, 77.0, 3.0, 0.05), (0.08, 2.0, 24.0, 5.0, 0.3)]
    for radius, length, ghz, distance, height in cases if run.quick else [*cases, (0.08, 3.0, 24.0, 15.0, 0.5)]:
        target = f"cylinder:r={radius},l={length}"
        elevation = math.degrees(math.atan2(height, distance))
        sweep = run.sweep(
            target, frequency_hz=ghz * 1e9, azimuth_deg=3.0, elevation_deg=elevation,
            distance_m=math.hypot(distance, height), max_bounces=1,
        )  # fmt: skip
        got.append(sweep.rcs_dbsm.item())
        want.append(10.0 * math.log10(near_range_cylinder_rcs(radius, length, wavelength(ghz), distance, height)))
    return [Cut(np.array(got), np.array(want))]


def beam_surface(y: FloatArray, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return points and area vectors of the corrugated beam that faces +x."""
    wave = 2.0 * math.pi / PERIOD
    zero = np.zeros_like(z)
    points = np.stack([zero + DEPTH * np.cos(wave * z), y, z], axis=-1)
    return points, np.stack([zero + 1.0, zero, DEPTH * wave * np.sin(wave * z)], axis=-1)


def beam_mesh(ghz: float) -> TaggedMesh:
    """Return the beam cut so finely that the sagitta of its facets is lambda/2400."""
    sharpest = 1.0 / (DEPTH * (2.0 * math.pi / PERIOD) ** 2)
    n = math.ceil(HEIGHT / math.sqrt(8.0 * sharpest * wavelength(ghz) / 2400.0))
    z = np.linspace(-0.5 * HEIGHT, 0.5 * HEIGHT, n + 1)
    y = np.array([-0.5 * LENGTH, 0.5 * LENGTH])
    points, _ = beam_surface(*np.meshgrid(y, z, indexing="ij"))
    low, high = np.arange(n), np.arange(n) + n + 1
    faces = np.concatenate([np.stack([low, high, high + 1], axis=1), np.stack([low, high + 1, low + 1], axis=1)])
    return build_mesh(points.reshape(-1, 3), faces)


def beam(run: Run) -> list[Cut]:
    """Compare the corrugated beam at ranges from 3 m, one bounce, with the integral over its surface."""
    got, want = [], []
    mesh = beam_mesh(24.0)
    for distance in (3.0, 10.0) if run.quick else (3.0, 5.0, 10.0, 20.0, 50.0):
        for azimuth in (0.0, 4.0):
            a = math.radians(azimuth)
            radar = (distance * math.cos(a), distance * math.sin(a), 0.0)
            sides = (-0.5 * LENGTH, 0.5 * LENGTH), (-0.5 * HEIGHT, 0.5 * HEIGHT)
            want.append(float(dbsm(near_range_surface_amplitude(beam_surface, *sides, wavelength(24.0), radar))))
            sweep = run.sweep(mesh, frequency_hz=24e9, azimuth_deg=azimuth, distance_m=distance, max_bounces=1)
            got.append(sweep.rcs_dbsm.item())
    return [Cut(np.array(got), np.array(want))]


def wall(run: Run, reference: str) -> list[Cut]:
    """Compare a wall of 5 m at 2 to 3 m: with the finite plate at each range, or its mean level with pi R^2.

    The rim's Fresnel ripple swings with the range; over 24 ranges it averages out to sqrt(2/24) of some 0.3 dB.
    """
    distance = np.linspace(2.0, 3.0, 24)[run.thin(24) if reference == "plate" else run.thin(1)]
    got = np.array(
        [
            run.sweep("plate:5x5", frequency_hz=24e9, azimuth_deg=0.0, distance_m=r, max_bounces=1).rcs_dbsm.item()
            for r in distance
        ]
    )
    if reference == "plate":
        return [
            Cut(
                got,
                np.array([10.0 * math.log10(near_range_plate_rcs(5.0, 5.0, wavelength(24.0), r)) for r in distance]),
            )
        ]
    over = got - 10.0 * np.log10(infinite_plate_rcs(distance))
    return [Cut(np.array([10.0 * math.log10(np.mean(10.0 ** (over / 10.0)))]), np.zeros(1))]


OWN = (Limit("max", 0.2),)
BARS = (
    *(Bar(f"near-{name}", f"{name.replace('_', ' ')}, 24 and 77 GHz, 1 to 100 m", "direct sum, own table",
          functools.partial(table_rows, name=name), OWN) for name in SHAPES),
    *(Bar(f"near-trihedral-{kind}", f"{kind} trihedral, 24 and 77 GHz, 1 to 30 m, on and off boresight",
          "exact 1+2+3 bounces", functools.partial(trihedral, kind=kind), OWN, needs=None)
      for kind in ("triangular", "square")),
    Bar("near-cylinder", "cylinder and pole, 24 and 77 GHz, 1 to 15 m", "surface integral", cylinder, OWN, needs=None),
    Bar("near-beam", "corrugated beam 1 x 0.31 m, 24 GHz, 3 to 50 m", "surface integral", beam, OWN, needs=None),
    Bar("near-wall-plate", "wall 5 x 5 m, 24 GHz, 2 to 3 m, each range", "surface integral",
        functools.partial(wall, reference="plate"), OWN, needs=None),
    Bar("near-wall", "wall 5 x 5 m, 24 GHz, mean power over 2 to 3 m", "pi R²",
        functools.partial(wall, reference="infinite"), OWN, needs=None, slow=True),
)  # fmt: skip
