"""Show what each bundled scene's contract rests on: ``python examples/evidence_table.py``.

Prints the strongest cell of the range-azimuth map beyond 2 m, frame by frame, with the radar's antenna pattern and
without its azimuth part, how often it is the car, and every object's power. ``--car NAME=FILE`` puts another car's mesh
(ROS axes, metres) beside the bundled one, by its first bounce and by up to three, ``--rounded`` rounds it; ``--out
docs/evidence.md`` writes the page. About 0.5 s a frame and radar, some seconds where a car is rounded.
"""

from __future__ import annotations

import argparse
import logging
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import shenron_rt as srt
from shenron_rt.scene.mesh import TaggedMesh
from shenron_rt.scene.readers import read_mesh
from shenron_rt.scene.resolver import resolve_tags

SCENES = ["braking", "highway", "turning", "tree_wall", "clear_road"]
RADARS: dict[str, dict[str, Any]] = {
    "awrl1432": {},
    "awrl1432, no azimuth pattern": {"antenna.beamwidth_az_deg": 360},
    "awrl1432, isotropic": {"antenna.pattern": "isotropic"},
}
BLANKING_M = 2.0
OPTIONS: dict[str, Any] = {"rays": 60_000, "accuracy": 1e-3}
#: Surfaces along a path, for foreign cars a second time.
FURTHER_BOUNCES = 3
#: Facets of foreign cars that meet at less are rounded, in variants of their own.
ROUND_BELOW_DEG = 30.0
#: Half the bundled car's length: another car takes its place tail on tail.
HALF_LENGTH_M = 2.25

HEAD = """\
# What the scenes show, in numbers

(Made by `python examples/evidence_table.py`; the tests `test_contracts_*.py` hold the contracts behind it.
`shenron-rt explain RUN` prints the strongest peak of every frame of any run, and whose it is.)

Strongest cell of the range-azimuth map beyond 2 m. Each frame has its own seed and moves the first car by up to 2 m
along and across and 5 degrees of yaw. Beyond 60 degrees `braking` has walls, whose cells are speckle, and a bollard,
whose echo is the same in every frame to a decibel; the pattern takes 12.6 dB from it, from above the car to below. A
foreign car is one painted shell of flat facets: where these are longer than what its curvature and the wavelength
allow, its first bounce fades from aspect to aspect by more than that. What its recesses, and the road before it, send
back over several bounces fills these fades; with them some of the strongest cells are true ghosts of the car, in a
wall, and count as other. What rounding does to it (`--rounded`) is in [limits](limits.md).

"""
OBJECTS_HEAD = """

Power of every object with the scene's own radar and seed, over the noise left after integrating the whole cube, and
its strongest detection. Object `static` is everything without an id, spread over many cells.

"""


class Car(NamedTuple):
    """A car that stands in for a scene's first actor, and how it is looked at; without a mesh it is the scene's own."""

    name: str
    mesh: TaggedMesh | None = None
    bounces: int = 1
    round_below_deg: float | None = None


def variants(name: str, mesh: TaggedMesh, rounded: bool) -> list[Car]:
    """Return a foreign car as it is or rounded, by its first bounce and by several."""
    below = ROUND_BELOW_DEG if rounded else None
    name = f"{name}, rounded" if rounded else name
    return [
        Car(name, mesh, 1, below),
        Car(f"{name}, up to {FURTHER_BOUNCES} bounces", mesh, FURTHER_BOUNCES, below),
    ]


def car_mesh(file: Path) -> TaggedMesh:
    """Return a car's mesh with its origin on the ground below the middle of its box."""
    mesh = resolve_tags(read_mesh(file))
    low, high = mesh.bounds
    middle = (low + high) / 2
    return mesh.transformed(srt.Pose((-middle[0], -middle[1], -low[2])))


def swapped(scene: srt.Scene, other: Car) -> srt.Scene:
    """Return the scene with its first actor's shape replaced."""
    mesh = other.mesh
    if mesh is None or not scene.actors:
        return scene
    car = scene.actors[0]
    yaw = np.radians(car.ypr_deg[0])
    ahead = float(np.ptp(mesh.bounds[:, 0])) / 2 - HALF_LENGTH_M
    x, y, z = car.xyz_m
    place = (x + ahead * np.cos(yaw), y + ahead * np.sin(yaw), z)
    changed = {"shape": None, "mesh": mesh, "round_below_deg": other.round_below_deg, "xyz_m": place}
    return scene.model_copy(update={"actors": (type(car)(**{**car.model_dump(), **changed}), *scene.actors[1:])})


def perturbed(scene: srt.Scene, frame: int) -> srt.Scene:
    """Return the scene with its first actor moved by up to 2 m along and across and turned by up to 5 degrees."""
    if not scene.actors:
        return scene
    along, across, turn = np.random.default_rng(frame).uniform(-1, 1, 3)
    car = scene.actors[0]
    (x, y, z), (yaw, pitch, roll) = car.xyz_m, car.ypr_deg
    moved = {"xyz_m": (x + 2 * along, y + 2 * across, z), "ypr_deg": (yaw + 5 * turn, pitch, roll)}
    return scene.model_copy(update={"actors": (car.model_copy(update=moved), *scene.actors[1:])})


def strongest(frame: srt.Frame) -> tuple[float, float, float, str]:
    """Return range [m], azimuth [deg] and power [dBm] of the strongest cell, and whose it is."""
    cube = frame.cube
    power = np.where(cube.range_m[:, None] < BLANKING_M, 0.0, cube.range_azimuth)
    row, column = np.unravel_index(power.argmax(), power.shape)
    distance, azimuth = float(cube.range_m[row]), float(np.degrees(cube.azimuth_rad[column]))
    rows = frame.scatterers
    car = rows.position[rows.object_id == 101]
    whose = "beyond 60 deg" if abs(azimuth) > 60 else "other"
    if len(car):
        away, margin = np.linalg.norm(car, axis=1), 1.5 * cube.range_step_m
        aside = np.degrees(np.arctan2(car[:, 1], car[:, 0])).mean()
        if away.min() - margin < distance < away.max() + margin and abs(azimuth - aside) < 10:
            whose = "car"
    return distance, azimuth, float(10 * np.log10(power.max())) + 30, whose


def found_by(scene: srt.Scene, frame: int, bounces: int) -> dict[str, tuple[float, float, float, str]]:
    """Return what each radar finds strongest in one frame of a perturbed scene; the frame's number is its seed."""
    moved = perturbed(scene, frame)  # one scene for all radars: its search trees are built once
    profiles = {radar: srt.load_profile("awrl1432", keys) for radar, keys in RADARS.items()}
    return {
        radar: strongest(srt.simulate(moved, profile, seed=frame, max_bounces=bounces, **OPTIONS))
        for radar, profile in profiles.items()
    }


def strongest_rows(name: str, car: Car, shown: int, frames: int) -> Iterator[str]:
    """Yield the rows of the first frames, and the rates over all."""
    rates, scene = [], swapped(srt.load_scene(name), car)
    found = [found_by(scene, k, car.bounces) for k in range(frames)]
    for radar in RADARS:
        for k, (distance, azimuth, level, whose) in enumerate(f[radar] for f in found[:shown]):
            cell = f"{distance:.2f} | {azimuth:.1f} | {level:.1f} | {whose}"
            yield f"| {scene.name} | {car.name} | {k} | {radar} | {cell} |"
        count = {w: sum(f[radar][3] == w for f in found) for w in ("car", "beyond 60 deg")}
        rates.append(f"{count['car']} car, {count['beyond 60 deg']} beyond 60 deg with {radar}")
    yield f"| {scene.name} | {car.name} | all {frames} | | | | | {'; '.join(rates)} |"


def object_rows(scene: srt.Scene, car: Car) -> Iterator[str]:
    """Yield a row an object: its power, SNR after the whole cube's integration, and what was detected of it."""
    frame = srt.simulate(scene, max_bounces=car.bounces, **OPTIONS)
    p, table, names = frame.profile, frame.detections.table, scene.object_names()
    noise = p.noise_power_w / (p.waveform.samples * p.waveform.chirps * p.n_virtual)
    for key, power in frame.returns.power_by_object().items():
        level, snr = 10 * np.log10(power) + 30, 10 * np.log10(power / noise)
        mine = table[table["object_id"] == key]
        seen = "none"
        if len(mine):
            d = mine[0]
            seen = f"{d['range']:.2f} m, {np.degrees(d['azimuth']):.1f} deg, {d['velocity']:.2f} m/s"
            seen += ", folded" if d["ambiguous"] else ""
        yield f"| {scene.name} | {car.name} | {names.get(key, key)} | {level:.1f} | {snr:.1f} | {seen} |"


def page(cars: list[Car], shown: int, frames: int) -> Iterator[str]:
    """Yield the lines of the page."""
    yield from HEAD.splitlines()
    yield "| scene | car | frame | radar | range m | azimuth deg | level dBm | whose |"
    yield "|---|---|---|---|---|---|---|---|"
    for name in ("braking", "tree_wall"):
        for car in cars:
            yield from strongest_rows(name, car, shown, frames)
    yield from OBJECTS_HEAD.splitlines()
    yield "| scene | car | object | power dBm | SNR dB | strongest detection |"
    yield "|---|---|---|---|---|---|"
    for name in SCENES:
        scene = srt.load_scene(name)
        for car in cars:
            if car.mesh is None or scene.actors:
                yield from object_rows(swapped(scene, car), car)


def main() -> None:
    """Parse, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--car", action="append", default=[], metavar="NAME=FILE", help="mesh of another car")
    parser.add_argument("--rounded", action="store_true", help="round these meshes; takes an hour")
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--shown", type=int, default=4, help="frames with a row of their own")
    parser.add_argument("--out", type=Path, help="write here instead of printing")
    asked = parser.parse_args()
    logging.disable(logging.WARNING)
    cars = [Car("bundled")]
    for name, _, file in (text.partition("=") for text in asked.car):
        cars += variants(name, car_mesh(Path(file)), asked.rounded)
    lines = []
    for line in page(cars, asked.shown, asked.frames):
        lines.append(line)
        if not asked.out:
            print(line, flush=True)
    if asked.out:
        asked.out.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
