"""Vehicles and a pedestrian: real meshes have no closed form, but what the rays' spacing changes can be measured."""

from __future__ import annotations

import functools
from pathlib import Path

import numpy as np

import shenron_rt as srt
from shenron_rt.frames import Pose
from shenron_rt.rcs import DEFAULT_RAYS_PER_WAVELENGTH
from shenron_rt.scene.mesh import TaggedMesh, concatenate
from shenron_rt.scene.readers import read_mesh

from .bars import Bar, Cut, Limit, Run
from .invariants import split_in_four


@functools.cache
def vehicle(name: str, shared: Path) -> TaggedMesh:
    """Return the sedan on its wheels, the truck or the pedestrian, origin in the middle of its box."""
    data = shared / "data"
    if name == "pedestrian":
        mesh = read_mesh(data / "makehuman_body/body.ply")
    elif name == "truck":
        mesh = read_mesh(data / "chrono_vehicles/truck/truck_chassis.obj")
    else:
        folder = data / "chrono_vehicles/sedan"
        body = read_mesh(folder / "sedan_chassis_vis.obj")
        # README of the set: axles 1.388 m before and behind, tyres of 0.339 m flush with the body
        body = body.transformed(Pose(tuple(np.array([0.0, 0.0, 0.733]) - body.bounds.mean(axis=0))))
        wheel = concatenate([read_mesh(folder / f"sedan_{part}.obj") for part in ("tire", "rim")])
        hubs = [Pose((x, y, 0.339)) for x in (1.388, -1.388) for y in (0.8, -0.8)]
        mesh = concatenate([body, *(wheel.transformed(hub) for hub in hubs)])
    return mesh.transformed(Pose(tuple(-mesh.bounds.mean(axis=0))))


def vehicle_median(run: Run, name: str, density: float | None, step_deg: float, ghz: float = 77.0) -> list[Cut]:
    """Compare levels round the circle with those at another density of rays, or without one on the mesh cut in four."""
    mesh = vehicle(name, run.shared)
    options = {"frequency_hz": ghz * 1e9, "azimuth_deg": np.arange(0.5, 360.0, 60.0 if run.quick else step_deg)}
    got = srt.sweep_rcs(mesh, **options)
    if density is None:
        other = srt.sweep_rcs(split_in_four(mesh), **options)
    else:
        other = srt.sweep_rcs(mesh, **options, rays_per_wavelength=density)
    return [Cut(got.rcs_dbsm[0, 0, :, 0], other.rcs_dbsm[0, 0, :, 0])]


BARS = (
    *(Bar(f"median-{name}", f"{name}, 77 GHz, 3 bounces, median over {360 / step:g} aspects", "half the ray spacing",
          functools.partial(vehicle_median, name=name, density=2.0 * DEFAULT_RAYS_PER_WAVELENGTH, step_deg=step),
          (Limit("median", 0.3),), rays=False, slow=True, needs="data")
      for name, step in (("sedan", 10.0), ("truck", 30.0), ("pedestrian", 10.0))),
    Bar("median-sedan-10", "sedan, 24 GHz, 3 bounces, median over 36 aspects", "10 rays per wavelength",
        functools.partial(vehicle_median, name="sedan", density=10.0, step_deg=10.0, ghz=24.0), (Limit("median", 1.0),),
        rays=False, slow=True, needs="data"),
    Bar("split-sedan", "sedan, 77 GHz, 3 bounces, median over 36 aspects, each triangle cut in four", "uncut mesh",
        functools.partial(vehicle_median, name="sedan", density=None, step_deg=10.0), (Limit("median", 0.1),),
        rays=False, slow=True, needs="data"),
)  # fmt: skip
