"""The ray stage beside bare Mitsuba: the same rays, the same triangles, in turn, in one process.

    python benchmarks/bench_rays.py

The stage is nearest hit, float64 normal and material of every ray, as NumPy arrays. Bare Mitsuba is
``scene.ray_intersect`` with distance, normal and triangle evaluated and left in Dr.Jit: what a program cannot do
without. The ratio is bare time over stage time.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "2")

from typing import Any

import numpy as np
from common import Row, main, side_by_side

import shenron_rt as srt
from shenron_rt.tracing.backend import choose_backend, use_backend
from shenron_rt.tracing.caster import RayCaster
from shenron_rt.tracing.launches import launch_directions
from shenron_rt.tracing.trace import _launch_pattern, _prepared

RAYS = 300_000


def street(speed: float) -> srt.Scene:
    """Return a street with more than 100 k triangles: cars, parked or moving, trees and a sphere between walls."""
    cars = [
        {"id": 100 + k, "shape": "car", "xyz_m": (x, y, 0), "velocity_mps": (speed, 0, 0)}
        for k, (x, y) in enumerate([(12, 0), (20, 3), (20, -3), (28, 0), (36, 3), (36, -3)])
    ]
    ball = {"id": 99, "shape": "sphere:r=0.5", "xyz_m": (8, 2, 1), "material": "metal", "tag": "Other"}
    walls = [{"shape": "box:80x0.3x3", "xyz_m": (43, y, 1.5), "tag": "Walls", "material": "concrete"} for y in (-6, 6)]
    ground = {"shape": "ground:220x40", "xyz_m": (116, 0, 0), "tag": "Roads", "material": "asphalt"}
    trees = [{"shape": "tree:h=9", "xyz_m": (x, y, 0)} for x in (15, 30, 45) for y in (-9, 9)]
    return srt.Scene(actors=[*cars, ball], static=[ground, *walls, *trees])


def measure() -> list[Row]:
    """Return the table's rows for parked cars, and the first for cars that move, each with a tree of its own."""
    moving = compared(10.0)[0]
    return [*compared(0.0), Row(f"- with six cars that move: {moving.what}", "", "", moving.measured)]


def compared(speed: float) -> list[Row]:
    """Time both."""
    scene, profile = street(speed), srt.load_profile("awrl1432")
    mount = scene.radar()
    world, caster = _prepared(scene, mount, profile.frame_mid_s, choose_backend("auto"))
    rays = launch_directions([_launch_pattern(profile, RAYS, 0, 0, mount.name)])
    normals = np.vstack([world.face_normal, np.zeros((1, 3))])  # a miss, -1, reads the last
    materials = np.append(world.face_material, np.uint16(0))
    one = RayCaster(world.vertices, world.faces, choose_backend("auto"))  # all triangles in one Mitsuba scene
    with use_backend(one.backend) as mi:
        import drjit as dr

        ray = mi.Ray3f(mi.Point3f(0, 0, 0), mi.Vector3f(*(np.ascontiguousarray(c) for c in rays)))
        dr.eval(ray)
        dr.sync_thread()

        def bare() -> Any:
            hit = one._scene.ray_intersect(ray)
            dr.eval(hit.t, hit.n, hit.prim_index)
            dr.sync_thread()
            return hit

        def everything() -> None:
            dr.eval(one._scene.ray_intersect(ray))
            dr.sync_thread()

        def stage() -> Any:
            face = caster.cast(rays, coherent=True)
            return face, normals[face], materials[face]

        _same_hits(bare(), stage())
        works = {
            "stage": stage,
            "bare": bare,
            "everything": everything,
            "cast": lambda: caster.cast(rays, coherent=True),
        }
        times = side_by_side(works, times=15, warm=3)
        whole = side_by_side({"trace": lambda: srt.trace(scene, profile, rays=RAYS)}, times=7)["trace"]
    n = rays.shape[1]
    ratio = times["bare"].median / times["stage"].median
    what = f"ray stage against bare `ray_intersect`, {len(world.faces)} triangles, {n} rays"
    row = Row(what, ">= 70 %", "90 %", f"{100 * ratio:.0f} %", ratio >= 0.7)
    full = 100 * times["everything"].median / times["stage"].median
    detail = ", ".join(f"{k} {1e3 * t.median:.1f} ms ({n / t.median / 1e6:.1f} Mray/s)" for k, t in times.items())
    return [
        row,
        Row("- against `ray_intersect` with its whole record", "", "", f"{full:.0f} %"),
        Row("- medians", "", "", detail),
        Row("- whole `trace` of these rays, rows included", "", "", f"{1e3 * whole.median:.0f} ms"),
    ]


def _same_hits(hit: Any, stage: tuple[Any, ...]) -> None:
    prim = np.where(np.isfinite(hit.t.numpy()), hit.prim_index.numpy().astype(np.int64), -1)
    if np.mean(prim == stage[0]) < 0.9999:
        raise RuntimeError("the two do not hit the same triangles; their times cannot be compared")


if __name__ == "__main__":
    main(measure)
