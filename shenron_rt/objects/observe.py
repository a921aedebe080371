"""One frame for the tracker: detections in the world, without the radar's own motion, and the truth beside them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from .._typing import BoolArray, FloatArray
from ..config.materials import load_materials
from ..config.profile import RadarProfile
from ..config.scene import Scene
from ..dsp import Detections, RadarCube
from ..returns import Returns
from ..scene.motion import BodyState
from ..scene.world import build_world
from .clusters import Clusters, ClusterSettings, cluster
from .tracker import Measurement, TrackerSettings

__all__ = ["Observation", "Truth", "measurements", "radar_state", "truths_of"]


@dataclass(frozen=True, eq=False)
class Truth:
    """Where an object is, as far as a radar can tell: the middle of its echoes by power, world frame.

    ``position`` (3,) [m], ``velocity`` (3,) [m/s], ``snr_db`` of its whole power on the centre of its cells.
    """

    position: FloatArray
    velocity: FloatArray
    snr_db: float


@dataclass(frozen=True, eq=False)
class Observation:
    """One frame of one radar.

    Parameters
    ----------
    frame : int
    time_s : float
        Mid-frame [s].
    detections : Detections
        Radar frame.
    radar : BodyState
        The radar in the world at mid-frame.
    profile : RadarProfile
    truths : mapping of int to Truth
        Objects that echo, by id.
    """

    frame: int
    time_s: float
    detections: Detections
    radar: BodyState
    profile: RadarProfile
    truths: Mapping[int, Truth] = field(default_factory=dict)


def radar_state(scene: Scene, radar: str, time_s: float) -> BodyState:
    """Return a radar's pose and motion in the world at a time [s], as the tracer has them."""
    return build_world(scene, scene.radar(radar), time_s, (), load_materials(scene.materials)).radar_state


def truths_of(returns: Returns, cube: RadarCube, radar: BodyState, ids: Iterable[int]) -> dict[int, Truth]:
    """Return where some objects are by their own echoes."""
    noise = cube.noise_power_w / cube.profile.n_virtual
    power = returns.power_by_object()
    found = {}
    for number in ids:
        mine = (returns.object_id == number) & ~returns.ghost
        weight = np.abs(returns.amplitude[mine]) ** 2
        if not weight.sum() > 0:
            continue
        position = np.average(returns.position[mine], axis=0, weights=weight)
        velocity = np.average(returns.velocity[mine], axis=0, weights=weight)
        arm = radar.rotation @ position
        turning = radar.yaw_rate * np.array([-arm[1], arm[0], 0.0])
        snr_db = 10 * float(np.log10(max(power[number], 1e-300) / noise))
        found[number] = Truth(radar.origin + arm, radar.rotation @ velocity + radar.velocity + turning, snr_db)
    return found


def measurements(
    seen: Observation, settings: TrackerSettings, grouping: ClusterSettings, *, min_speed_mps: float
) -> list[Measurement]:
    """Return the objects of a frame in the world frame's plane.

    Parameters
    ----------
    seen : Observation
    settings : TrackerSettings
    grouping : ClusterSettings
    min_speed_mps : float
        Detections whose range rate is within this of that of a thing at rest, modulo folding, are left out; 0 keeps
        all [m/s].
    """
    t, radar = seen.detections, seen.radar
    local = np.column_stack([t.x, t.y, t.z])
    unit = local / np.maximum(np.linalg.norm(local, axis=1), 1e-9)[:, None] @ radar.rotation.T
    world = local @ radar.rotation.T + radar.origin
    fold = 2 * seen.profile.max_velocity_mps
    rate = t.velocity + unit @ radar.velocity
    kept = _moves(rate, fold, min_speed_mps)
    # the plane's share of the line of sight; a detection overhead has none
    flat = np.maximum(np.linalg.norm(unit[:, :2], axis=1), 1e-3)
    groups = cluster(world[kept, :2], rate[kept], t.power[kept], grouping)
    ids = t.object_id[kept]
    return [
        _measured(
            groups, n, ids[groups.members(n)], radar, float(np.mean(flat[kept][groups.members(n)])), fold, settings
        )
        for n in range(len(groups))
    ]


def _moves(rate: FloatArray, fold: float, min_speed_mps: float) -> BoolArray:
    off = (rate + fold / 2) % fold - fold / 2
    return np.asarray(np.abs(off) >= min_speed_mps, dtype=bool)


def _measured(
    groups: Clusters, n: int, ids: FloatArray, radar: BodyState, flat: float, fold: float, settings: TrackerSettings
) -> Measurement:
    arm = groups.position[n] - radar.origin[:2]
    distance = max(float(np.linalg.norm(arm)), 1e-3)
    direction = arm / distance
    across = np.array([-direction[1], direction[0]])
    spread = distance * np.radians(settings.azimuth_std_deg)
    covariance = settings.range_std_m**2 * np.outer(direction, direction) + spread**2 * np.outer(across, across)
    known, count = np.unique(ids, return_counts=True)
    return Measurement(
        position=groups.position[n],
        covariance=covariance,
        direction=direction,
        range_rate=float(groups.range_rate[n]) / flat,
        range_rate_std=settings.range_rate_std_mps,
        fold_mps=fold / flat,
        object_id=int(known[np.argmax(count)]),
        size_m=(float(groups.size_m[n, 0]), float(groups.size_m[n, 1])),
        detections=int(groups.count[n]),
    )
