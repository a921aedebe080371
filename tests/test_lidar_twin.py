"""The LiDAR twin of a scene: CARLA's pattern and order, what its columns mean, poses of its own time, refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lidar_twin_tools import ROOF, street

import shenron_rt as srt
from shenron_rt.config.scene import LidarMount
from shenron_rt.errors import InputError
from shenron_rt.frames import Pose, direction
from shenron_rt.lidar import lidar_scatterers, merge_sweeps, read_semantic_lidar
from shenron_rt.scene.motion import body_state
from shenron_rt.tracing.backend import backend_status
from shenron_rt.tracing.lidar import cast_at_radar, scan_pattern

needs_llvm = pytest.mark.skipif(not backend_status("llvm").usable, reason="no usable LLVM on this machine")
LEVEL = LidarMount(
    xyz_m=(0, 0, 2.4), channels=64, upper_deg=10, lower_deg=-30, range_m=80, points_per_second=64 * 720 * 10
)


@pytest.fixture(scope="module")
def twin():
    return srt.cast_lidar(street(), time=0.4)


# ---- where it looks
def test_channels_run_down_and_azimuths_clockwise_from_behind():
    pattern = scan_pattern(LEVEL)
    rays = pattern.direction.reshape(64, 720, 3)
    elevation = np.degrees(np.arcsin(rays[..., 2]))
    np.testing.assert_allclose(elevation, np.linspace(10, -30, 64)[:, None] * np.ones(720), atol=1e-9)
    right_handed = np.degrees(np.arctan2(rays[..., 1], rays[..., 0]))
    # yaw of CARLA, clockwise, from -180: straight behind first, then behind to the left, where y of CARLA is negative
    yaw = (-right_handed + 180) % 360
    np.testing.assert_allclose((yaw - np.arange(720) * 0.5 + 180) % 360 - 180, 0, atol=1e-9)
    assert rays[0, 100, 1] > 0
    assert (pattern.grid.channels, pattern.grid.azimuth_step_deg, pattern.points_per_channel) == (64, 0.5, 720)


def test_points_a_channel_are_rounded_half_away_from_zero():
    # 100.5, 100.4375, 100.5625 points a channel in a revolution of 0.1 s
    for rate, points in ((8040, 101), (8035, 100), (8045, 101)):
        assert scan_pattern(LidarMount(channels=8, points_per_second=rate)).points_per_channel == points


def test_a_stored_carla_frame_lies_on_the_pattern_in_its_order(shared_data: Path):
    stored = read_semantic_lidar(
        shared_data / "semlidar_synth_town01/frame_town01_0916.bin", tag_table="0.9.14", frame="carla"
    )
    rays = scan_pattern(LEVEL).direction
    unit = stored.position / np.linalg.norm(stored.position, axis=1)[:, None]
    row = np.rint((10 - np.degrees(np.arcsin(unit[:, 2]))) * 63 / 40).astype(int)
    column = np.rint((180 - np.degrees(np.arctan2(unit[:, 1], unit[:, 0]))) * 2).astype(int) % 720
    index = row * 720 + column
    # float32 coordinates and a cast of its own: 1e-5 rad is a fiftieth of a percent of a channel
    np.testing.assert_allclose(unit, rays[index], atol=1e-5)
    assert np.all(np.diff(index) > 0)


def test_ticks_of_half_a_revolution_make_one_sweep():
    still = street(ego={}, actors=[])
    whole = srt.cast_lidar(still, frame=0)
    halves = [srt.cast_lidar(still, frame=k, tick_s=0.05) for k in (0, 1)]
    assert all(h.position[:, 1].max() < 1e-6 or h.position[:, 1].min() > -1e-6 for h in halves)
    assert len(whole) == sum(len(h) for h in halves)
    together = np.concatenate([h.position for h in halves])
    for points in (together, whole.position):
        points[:] = points[np.lexsort(points.round(6).T)]
    np.testing.assert_allclose(together, whole.position, atol=1e-9)
    third = srt.cast_lidar(still, frame=2, tick_s=0.05)
    np.testing.assert_allclose(third.position, halves[0].position, atol=1e-9)


# ---- what its columns mean
def test_level_ground_has_the_closed_form_of_position_cosine_and_area():
    scene = srt.Scene(static=[{"shape": "ground:400x400", "tag": "Roads", "material": "asphalt"}])
    frame = srt.cast_lidar(scene, LEVEL)
    distance = np.linalg.norm(frame.position, axis=1)
    np.testing.assert_allclose(frame.position[:, 2], -2.4, atol=1e-9)
    np.testing.assert_allclose(frame.cos_incidence, 2.4 / distance, atol=1e-12)
    assert distance.max() <= 80
    # rings from channel k to channel m tile the ground between half a channel above and below, to second order of it
    elevation = np.radians(np.linspace(10, -30, 64))
    below = np.flatnonzero(elevation < -2.4 / 80)
    half = np.radians(40 / 63 / 2)
    rims = 2.4 / np.tan(-(elevation[[below[8], below[-1]]] + [half, -half]))
    seen = np.isin(np.rint((np.radians(10) - np.arcsin(frame.position[:, 2] / distance)) / (2 * half)), below[8:])
    assert frame.area[seen].sum() == pytest.approx(np.pi * (rims[0] ** 2 - rims[1] ** 2), rel=0.01)


def test_order_of_points_is_that_of_the_rays(twin):
    u = twin.position / np.linalg.norm(twin.position, axis=1)[:, None]
    row = np.rint((10 - np.degrees(np.arcsin(u[:, 2]))) * 31 / 50).astype(int)
    column = np.rint(180 - np.degrees(np.arctan2(u[:, 1], u[:, 0]))).astype(int) % 360
    assert np.all(np.diff(row * 360 + column) > 0)


def test_range_limits_and_nothing_else():
    near, far = (srt.cast_lidar(street(lidars=[ROOF.model_copy(update={"range_m": r})])) for r in (15.0, 60.0))
    kept = np.linalg.norm(far.position, axis=1) <= 15
    assert 0 < kept.sum() < len(far)
    np.testing.assert_array_equal(near.position, far.position[kept])


def test_ids_tags_and_names_are_those_of_the_scene(twin):
    tags = {int(i): {srt.SemanticTag(int(t)).name for t in twin.tag[twin.object_id == i]} for i in (0, 40, 41, 101)}
    assert tags == {0: {"Roads"}, 40: {"Walls"}, 41: {"Poles"}, 101: {"Car"}}
    assert twin.names == {40: "object 40", 41: "post", 101: "oncoming"}


def test_poses_are_those_of_the_frames_own_time_and_a_post_stays_put_in_a_turn():
    scene = street()
    for time in (0.0, 0.7, 1.5):
        frame = srt.cast_lidar(scene, time=time)
        ego = body_state(scene.ego.pose, scene.ego.velocity_mps, scene.ego.yaw_rate_deg_s, time)
        world = ROOF.pose.apply(frame.position) @ ego.rotation.T + ego.origin
        post = world[frame.object_id == 41]
        assert len(post) > 3
        # facets of the cylinder lie within 2 % of its radius
        np.testing.assert_allclose(np.linalg.norm(post[:, :2] - [17, -2], axis=1), 0.15, atol=0.003)
        car = body_state(scene.actors[0].pose, (-7, -2, 0), -20, time)
        own = (world[frame.object_id == 101] - car.origin) @ car.rotation
        assert len(own) > 3
        assert np.all(np.abs(own) < [2.6, 1.1, 1.7])


def test_velocities_over_ground_are_finite_differences_of_the_scene(twin):
    scene, dt = street(), 1e-5
    for object_id in (0, 41, 101):
        rows = np.flatnonzero(twin.object_id == object_id)
        ego = body_state(scene.ego.pose, scene.ego.velocity_mps, scene.ego.yaw_rate_deg_s, 0.4)
        world = ROOF.pose.apply(twin.position[rows]) @ ego.rotation.T + ego.origin
        if object_id == 101:
            a, b = (body_state(scene.actors[0].pose, (-7, -2, 0), -20, t) for t in (0.4 - dt, 0.4 + dt))
            now = body_state(scene.actors[0].pose, (-7, -2, 0), -20, 0.4)
            own = (world - now.origin) @ now.rotation
            velocity = ((own @ b.rotation.T + b.origin) - (own @ a.rotation.T + a.origin)) / (2 * dt)
        else:
            velocity = np.zeros_like(world)
        # the second difference of a turn of 20 deg/s over 1e-5 s is far below 1e-8
        np.testing.assert_allclose(twin.velocity[rows], velocity @ ego.rotation @ ROOF.pose.rotation, atol=1e-8)
    assert twin.ego_yaw_rate == pytest.approx(np.radians(30))
    np.testing.assert_allclose(twin.ego_velocity, direction(np.arctan2(3, 9) - np.radians(20), 0.0) * np.hypot(9, 3))


def test_half_sweeps_of_a_moving_sensor_merge_onto_the_surfaces_they_hit():
    scene, tick = street(lidars=[ROOF.model_copy(update={"points_per_second": 4 * 32 * 360 * 10})]), 0.05
    earlier, now = (srt.cast_lidar(scene, time=k * tick, tick_s=tick, frame=k) for k in (1, 2))
    then, here = (body_state(scene.ego.pose, (9, 3, 0), 30, k * tick) for k in (1, 2))
    motion = Pose.from_matrix(here.rotation.T @ then.rotation, here.rotation.T @ (then.origin - here.origin))
    merged = merge_sweeps(now, earlier, motion, elapsed_s=tick)
    world = ROOF.pose.apply(merged.position) @ here.rotation.T + here.origin
    assert set(np.unique(earlier.object_id)) | set(np.unique(now.object_id)) == {0, 40, 41, 101}
    np.testing.assert_allclose(world[merged.object_id == 0][:, 2], 0, atol=1e-9)
    assert np.hypot(*(world[merged.object_id == 41][:, :2] - [17, -2]).T) == pytest.approx(0.15, abs=0.003)
    # a car that turns by 1 deg in the tick: its points move along their tangents, off by half the turn squared
    car = body_state(scene.actors[0].pose, (-7, -2, 0), -20, 2 * tick)
    own = (world[merged.object_id == 101] - car.origin) @ car.rotation
    assert np.all(np.abs(own) < [2.6, 1.1, 1.7])


# ---- the two doors with the same rays
def test_same_rays_from_the_radar_give_the_same_seven_columns():
    scene = street()
    mesh = srt.trace(scene, rays=20_000, time=0.3, frame=4)
    frame = cast_at_radar(scene, rays=20_000, time=0.3, frame=4, normals=True, materials=True)
    through = lidar_scatterers(frame, None, scene.radars[0].pose)
    assert len(mesh) > 5_000
    assert set(np.unique(mesh.object_id)) == {0, 40, 41, 101}
    # float64 rounding of a change of frame at 100 m and 20 m/s
    np.testing.assert_allclose(through.table(), mesh.table(), rtol=0, atol=1e-11)
    np.testing.assert_allclose(through.velocity, mesh.velocity, rtol=0, atol=1e-11)
    np.testing.assert_allclose(through.area, mesh.area, rtol=1e-12)
    np.testing.assert_allclose(through.normal, mesh.normal, atol=1e-12)
    np.testing.assert_array_equal(through.material, mesh.material)
    assert through.material_names == mesh.material_names


def test_a_lidar_knows_tags_where_the_mesh_knows_materials(twin):
    known = srt.cast_lidar(street(), time=0.4, materials=True)
    assert twin.material is None
    parts = {known.material_names[m] for m in known.material[known.object_id == 101]}
    assert len(parts) > 1  # one tag, Car
    assert {known.material_names[m] for m in known.material[known.object_id == 40]} == {"concrete"}


# ---- options
def test_dropoff_and_noise_are_as_large_as_asked_and_repeat_with_the_seed(twin):
    lossy = srt.cast_lidar(street(), time=0.4, dropoff=0.3, seed=5)
    n = len(twin)
    assert abs(len(lossy) - 0.7 * n) < 5 * np.sqrt(0.21 * n)  # five standard deviations of a binomial
    noisy = srt.cast_lidar(street(), time=0.4, noise_stddev_m=0.02, seed=5)
    moved = np.linalg.norm(noisy.position, axis=1) - np.linalg.norm(twin.position, axis=1)
    assert moved.std() == pytest.approx(0.02, rel=5 / np.sqrt(2 * n))
    np.testing.assert_allclose(np.cross(noisy.position, twin.position), 0, atol=1e-9)  # along the ray
    again = srt.cast_lidar(street(), time=0.4, noise_stddev_m=0.02, seed=5)
    np.testing.assert_array_equal(noisy.position, again.position)
    assert np.any(srt.cast_lidar(street(), time=0.4, noise_stddev_m=0.02, seed=6).position != noisy.position)


@needs_llvm
def test_scalar_and_llvm_see_the_same(twin):
    scalar = srt.cast_lidar(street(), time=0.4, backend="scalar")
    llvm = srt.cast_lidar(street(), time=0.4, backend="llvm")
    assert abs(len(scalar) - len(llvm)) <= 2  # a ray in 10,000 may take the other side of an edge
    if len(scalar) == len(llvm):
        assert np.mean(scalar.object_id == llvm.object_id) > 0.9999


def test_a_scene_without_surfaces_gives_no_points():
    scene = srt.Scene(point_targets=[{"id": 1, "xyz_m": (30, 0, 1), "rcs_dbsm": 10}], lidars=[ROOF])
    frame = srt.cast_lidar(scene)
    assert len(frame) == 0
    assert frame.position.shape == (0, 3)


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        ({"lidars": []}, {}, "has no lidars"),
        ({"lidars": [ROOF, ROOF.model_copy(update={"name": "nose"})]}, {}, r"2 lidars, say which.*'roof', 'nose'"),
        ({}, {"lidar": "rof"}, "did you mean 'roof'"),
        ({}, {"tick_s": 0.0}, "tick_s: a positive time"),
        ({}, {"tick_s": 1e-6}, "less than one point a channel"),
        ({}, {"dropoff": 1.5}, "dropoff: a share from 0 to 1"),
        ({}, {"noise_stddev_m": -1.0}, "noise_stddev_m"),
        ({"lidars": [ROOF.model_copy(update={"upper_deg": -50.0})]}, {}, "lower <= upper"),
    ],
)
def test_what_cannot_be_cast_is_refused(change, options, message):
    with pytest.raises(InputError, match=message):
        srt.cast_lidar(street(**change), **options)
