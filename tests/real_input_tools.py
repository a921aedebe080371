"""The street of the synthetic LiDAR frame as a mesh scene: exported town, Chrono vehicles, MakeHuman walkers."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import shenron_rt as srt
from shenron_rt.frames import Pose, from_carla_points, from_carla_pose
from shenron_rt.run_summary import objects_summary
from shenron_rt.scene.mesh import TaggedMesh, concatenate
from shenron_rt.scene.readers import read_mesh
from shenron_rt.scene.resolver import resolve_tags

TOWN_OBJ = ("carla_exporter_style/Town01_patch.obj", "carla_exporter")
TOWN_GLB = ("carla_exporter_style/Town01_patch_ue_gltf_layout.glb", "ue_gltf")
#: README of the Chrono set: axles; the hub stands a tyre's radius above the ground, the track puts the tyres flush.
AXLE_X_M, HALF_TRACK_M, TYRE_RADIUS_M = 1.388, 0.80, 0.339


def placed_in_box(mesh: TaggedMesh, center: tuple[float, ...], extent: tuple[float, ...]) -> TaggedMesh:
    """Shift a mesh so that its bounding box is the blueprint's; sizes must agree to 1 cm."""
    low, high = mesh.bounds
    assert np.allclose((high - low) / 2, extent, atol=0.01), (low, high, extent)
    return mesh.transformed(Pose(tuple(np.asarray(center) - (low + high) / 2)))


@lru_cache(maxsize=4)
def chrono_sedan(data: Path, *, coarse: bool = False) -> TaggedMesh:
    """Return the Chrono sedan on its wheels, origin on the ground below the middle of its box (x forward)."""
    folder = data / "chrono_vehicles" / "sedan"
    chassis = resolve_tags(read_mesh(folder / f"sedan_chassis_{'col' if coarse else 'vis'}.obj"))
    chassis = placed_in_box(chassis, (0.0, 0.0, 0.733), (2.445, 0.925, 0.733))
    wheel = concatenate([resolve_tags(read_mesh(folder / f"sedan_{part}.obj")) for part in ("tire", "rim")])
    hubs = [Pose((x, y, TYRE_RADIUS_M)) for x in (AXLE_X_M, -AXLE_X_M) for y in (HALF_TRACK_M, -HALF_TRACK_M)]
    return concatenate([chassis, *(wheel.transformed(hub) for hub in hubs)])


@lru_cache(maxsize=1)
def frame_meta(data: Path) -> dict[str, Any]:
    """Return the description of the LiDAR frame."""
    return yaml.safe_load((data / "semlidar_synth_town01" / "frame_town01_0916.meta.yaml").read_text())


def _actor_mesh(data: Path, actor: dict[str, Any]) -> TaggedMesh:
    # the box is in the actor's CARLA axes, whose y points right
    center = tuple(from_carla_points(actor["bbox"]["center_local"]))
    extent = tuple(actor["bbox"]["extent"])
    if actor["label"] == "Car":
        return placed_in_box(chrono_sedan(data), center, extent)
    if actor["label"] == "Bus":
        bus = resolve_tags(read_mesh(data / "chrono_vehicles" / "citybus" / "CityBus_Vis.obj"))
        return placed_in_box(bus, center, extent)
    return placed_in_box(read_mesh(data / "makehuman_body" / "body.ply"), center, extent)


def _pose(transform: dict[str, Any]) -> Pose:
    turn = transform["rotation_deg"]
    return from_carla_pose(transform["location"], (turn["pitch"], turn["yaw"], turn["roll"]))


@lru_cache(maxsize=2)
def street_scene(data: Path, town: tuple[str, str] = TOWN_OBJ) -> srt.Scene:
    """Return the street with every actor where the description of the LiDAR frame has it."""
    meta = frame_meta(data)
    ego = _pose(meta["ego_transform"])
    actors = []
    for actor in meta["actors"]:
        pose = _pose(actor)
        velocity = ego.rotation @ from_carla_points(actor["velocity_in_ego_axes_m_s"])
        actors.append(
            {
                "id": actor["id"],
                "name": actor["type_id"],
                "mesh": _actor_mesh(data, actor),
                "xyz_m": pose.xyz,
                "ypr_deg": pose.ypr_deg,
                "velocity_mps": tuple(velocity),
                "tag": actor["label"],
                "aim": 20_000,
            }
        )
    file, frame = town
    return srt.Scene(
        name="town01_street",
        ego={"xyz_m": ego.xyz, "ypr_deg": ego.ypr_deg},
        static=[{"name": "town", "mesh": data / file, "mesh_frame": frame}],
        actors=actors,
        radars=[{"name": "front", "profile": "awrl1432", "xyz_m": (2.0, 0.0, 1.0)}],
    )


@dataclass(frozen=True)
class Lock:
    """How a frame's detections lie on one object."""

    object_id: int
    snr_db: float
    range_m: tuple[float, float]
    azimuth_rad: tuple[float, float]
    velocity_mps: tuple[float, float]
    found: np.ndarray

    def __str__(self) -> str:
        lo, hi = np.degrees(self.azimuth_rad)
        head = (
            f"{self.object_id}: SNR {self.snr_db:.1f} dB, range {self.range_m[0]:.2f}..{self.range_m[1]:.2f} m, "
            f"azimuth {lo:.1f}..{hi:.1f} deg, {self.velocity_mps[0]:.2f}..{self.velocity_mps[1]:.2f} m/s"
        )
        rows = [
            f"{d['range']:.2f} m {np.degrees(d['azimuth']):.1f} deg {d['velocity']:.2f} m/s "
            f"SNR {d['snr_db']:.1f} dB id {d['object_id']}"
            for d in self.found
        ]
        return f"{head}; on it: {rows or 'nothing'}"


def _alone(frame: srt.Frame, mine: np.ndarray) -> srt.RadarCube:
    """Return the noise-free cube of some of the echoes."""
    returns = frame.returns
    rows = {f.name: getattr(returns, f.name)[mine] for f in fields(returns) if np.ndim(getattr(returns, f.name))}
    return srt.process(srt.synthesize(replace(returns, **rows), frame.profile, noise=None, accuracy=1e-3))


def own_snr_db(frame: srt.Frame, object_id: int) -> float:
    """Return an object's own SNR as the command line prints it and ``summary.json`` has it.

    The power of the whole object, as a point on the centre of its cells would have it. In its strongest cell an object
    of several cells has less, and in a frame whose speckle cancels there, much less.
    """
    records = objects_summary(frame.returns, frame.cube, frame.detections)
    return float(next(r["snr_db"] for r in records if r["id"] == object_id))


def rival_db(frame: srt.Frame, object_id: int) -> float:
    """Return the strongest echo of everything else within the main lobe of an object's peak cell, over that peak [dB].

    Two echoes less than a Hann main lobe apart (2 bins) and of like level are one peak, whichever processing.
    """
    mine = frame.returns.object_id == object_id
    own, other = _alone(frame, mine).range_doppler, _alone(frame, ~mine).range_doppler
    r, v = np.unravel_index(own.argmax(), own.shape)
    near = other[max(r - 2, 0) : r + 3, np.arange(v - 2, v + 3) % own.shape[1]]
    return float(10 * np.log10(near.max() / own[r, v]))


def lock_on(frame: srt.Frame, object_id: int) -> Lock:
    """Return what was detected on an object that rays have met.

    A detection lies on an object when its range is within one bin of the ranges, its velocity within one bin of the
    range rates (folded), and its azimuth within the beam, 2/M in sine, of the azimuths that the object's visible
    surface spans.
    """
    p, rows, table = frame.profile, frame.scatterers, frame.detections.table
    beam, v_span = 2 / len(frame.cube.azimuth_channels), 2 * p.max_velocity_mps
    mine = rows.object_id == object_id
    distance, rate = rows.range[mine], rows.range_rate[mine]
    sine = rows.position[mine, 1] / distance
    on = (table["range"] > distance.min() - frame.cube.range_step_m) & (
        table["range"] < distance.max() + frame.cube.range_step_m
    )
    on &= (np.sin(table["azimuth"]) > sine.min() - beam) & (np.sin(table["azimuth"]) < sine.max() + beam)
    middle, half = (rate.min() + rate.max()) / 2, (rate.max() - rate.min()) / 2
    off = (table["velocity"] - middle + v_span / 2) % v_span - v_span / 2
    on &= np.abs(off) < half + frame.cube.velocity_step_mps
    return Lock(
        object_id,
        own_snr_db(frame, object_id),
        (float(distance.min()), float(distance.max())),
        (float(np.arcsin(sine.min())), float(np.arcsin(sine.max()))),
        (float(rate.min()), float(rate.max())),
        table[on],
    )


def locks(frame: srt.Frame) -> dict[int, Lock]:
    """Return for every object with an id of its own, that rays have met, what was detected on it."""
    met = [k for k in frame.returns.power_by_object() if k and np.any(frame.scatterers.object_id == k)]
    return {k: lock_on(frame, k) for k in met}
