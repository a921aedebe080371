"""The two doors of one scene: incoherent power per object converges, and density carries no brightness."""

from __future__ import annotations

import numpy as np
import pytest
from lidar_twin_tools import decibels, incoherent_power, mean_power

import shenron_rt as srt
from shenron_rt.config.scene import LidarMount
from shenron_rt.lidar import lidar_scatterers

PROFILE = srt.load_profile("awrl1432")
RADAR = srt.Pose((2.0, 0.0, 1.0))
ROOF = srt.Pose((0.0, 0.0, 2.5))
GROUND = {"id": 1, "shape": "ground:80x30", "xyz_m": (42, 0, 0), "tag": "Roads", "material": "asphalt"}
#: Faces the radar, so that its plane of incidence is vertical nearly everywhere, which a LiDAR door assumes.
BLOCK = {
    "id": 2,
    "shape": "box:4x3x3",
    "xyz_m": (16, -5, 1.5),
    "ypr_deg": (-15, 0, 0),
    "tag": "Buildings",
    "material": "concrete",
}
WALKER = {"id": 102, "shape": "pedestrian", "xyz_m": (9, 2, 0), "aim": 3_000}
CAR = {"id": 101, "shape": "car", "xyz_m": (14, 0, 0), "aim": 20_000}
SIDE_WALL = {"id": 3, "shape": "box:30x0.3x3", "xyz_m": (25, 6, 1.5), "tag": "Walls", "material": "concrete"}


def _scene(*static: dict, actors: tuple[dict, ...] = ()) -> srt.Scene:
    return srt.Scene(static=static, actors=actors, radars=[{"name": "r", "profile": PROFILE, "xyz_m": RADAR.xyz}])


def _mount(
    pose: srt.Pose, channels: int, upper: float, lower: float, seed: int, step: float | None = None
) -> LidarMount:
    """Return a LiDAR, with square cells unless told, its grid turned by a random part of a cell as the radar's is."""
    height = (upper - lower) / (channels - 1)
    cell = step or height
    yaw, pitch = np.random.default_rng(seed).uniform(-0.5, 0.5, 2) * (cell, height)
    return LidarMount(
        xyz_m=pose.xyz, ypr_deg=(yaw, pitch, 0), channels=channels, upper_deg=upper, lower_deg=lower, range_m=200,
        points_per_second=round(360 / cell) * channels * 10,
    )  # fmt: skip


def _mesh(scene: srt.Scene, rays: int = 40_000, seeds: int = 20) -> dict[int, float]:
    return mean_power(lambda s: incoherent_power(srt.trace(scene, PROFILE, seed=s, rays=rays), PROFILE), seeds)


def _lidar(scene: srt.Scene, density: float, seeds: int = 20, **carried: bool) -> dict[int, float]:
    """Return powers through a LiDAR at the radar; 1x is 64 channels from +40 to -60 degrees, all of the pattern."""

    def power(seed: int) -> dict[int, float]:
        mount = _mount(RADAR, round(64 * np.sqrt(density)), 40.0, -60.0, seed)
        frame = srt.cast_lidar(scene, mount, time=PROFILE.frame_mid_s, **carried)
        return incoherent_power(lidar_scatterers(frame, PROFILE, RADAR, seed=seed), PROFILE)

    return mean_power(power, seeds)


def test_power_per_object_converges_to_that_of_the_mesh_door():
    scene = _scene(GROUND, BLOCK, actors=(WALKER,))
    mesh = _mesh(scene)
    off = {d: decibels(_lidar(scene, d, materials=True), mesh) for d in (1, 10)}
    assert set(off[10]) == {1, 2, 102}
    # 20 seeds of exponential speckle over more than 60 points leave 0.12 dB
    assert max(abs(v) for v in off[10].values()) < 0.5, off
    assert abs(off[1][102]) < 1.5, off  # a walker has ten points at 1x


@pytest.mark.slow
def test_power_per_object_converges_within_half_a_decibel_from_1x_to_100x():
    scene = _scene(GROUND, SIDE_WALL, actors=(CAR, WALKER))
    mesh = _mesh(scene, rays=100_000)
    off = {d: decibels(_lidar(scene, d, materials=True), mesh) for d in (1, 10, 100)}
    assert all(abs(v) < 0.5 for v in off[100].values()), off
    rms = {d: np.sqrt(np.mean(np.square(list(v.values())))) for d, v in off.items()}
    assert rms[100] <= rms[1] + 0.05, off


def test_what_is_left_on_a_wall_beside_the_road_is_its_plane_of_incidence():
    scene = _scene(SIDE_WALL)
    mesh = _mesh(scene)
    without, known = (decibels(_lidar(scene, 4, materials=True, normals=n), mesh)[3] for n in (False, True))
    # V lies across the plane of incidence of an upright wall; without a normal it is taken to lie in it
    assert without < known - 0.2
    # 500 points over 20 seeds leave 0.05 dB, the mesh door as much; the wall has no mirror point
    assert abs(known) < 0.2


def test_tags_alone_cannot_tell_the_parts_of_a_car():
    scene = _scene(actors=(CAR,))
    mesh = _mesh(scene, seeds=3)
    assert decibels(_lidar(scene, 4, seeds=3), mesh)[101] < -10  # nothing but paint: tyres and plastic are missing


def test_brightness_does_not_depend_on_the_number_of_channels():
    scene = _scene(GROUND, {**BLOCK, "xyz_m": (12, -5, 1.5)}, actors=({**WALKER, "xyz_m": (6, 2, 0)},))
    powers, points = {}, {}
    for channels in (64, 128, 512):
        frames = {s: srt.cast_lidar(scene, _mount(ROOF, channels, 10.0, -30.0, s, 0.4)) for s in range(4)}
        rows = {s: lidar_scatterers(f, PROFILE, RADAR, seed=s) for s, f in frames.items()}
        # four grids, five speckles each
        powers[channels] = mean_power(
            lambda s, rows=rows: incoherent_power(_reseeded(rows[s % 4], s), PROFILE)  # type: ignore[misc]
        )
        points[channels] = {i: int(np.sum(frames[0].object_id == i)) for i in powers[channels]}
    assert min(points[64].values()) >= 100
    assert points[512][2] > 7 * points[64][2]
    for channels in (64, 128):
        assert all(abs(v) < 0.5 for v in decibels(powers[channels], powers[512]).values()), powers


def _reseeded(scatterers: srt.Scatterers, seed: int) -> srt.Scatterers:
    from dataclasses import replace

    return replace(scatterers, seed=seed)
