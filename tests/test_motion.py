"""Motion: range rates and velocity vectors against finite differences of the tracer's own geometry."""

from __future__ import annotations

import numpy as np
import pytest
from echo_tools import ISO

import shenron_rt as srt
from shenron_rt.scene.motion import body_state

DT = 1e-3


def points(scene, time):
    """Return position and velocity of a scene's point targets at a mid-frame time, by id."""
    scat = srt.trace(scene, rays=100, time=time - ISO.frame_mid_s)
    order = np.argsort(scat.object_id)
    return scat.position[order], scat.velocity[order], scat.range_rate[order]


def scene_with(ego, targets, mount=None):
    radar = {"name": "r", "profile": ISO, "xyz_m": (2, 0.4, 1), "ypr_deg": (10, 3, 0), **(mount or {})}
    given = [{"id": k + 1, "rcs_dbsm": 0, **t} for k, t in enumerate(targets)]
    return srt.Scene(ego=ego, point_targets=given, radars=[radar])


EGO = {"xyz_m": (3, -2, 0), "ypr_deg": (30, 0, 0), "velocity_mps": (12, 5, 0.3), "yaw_rate_deg_s": 25}
TARGETS = [
    {"xyz_m": (30, 4, 1)},
    {"xyz_m": (10, -12, 3), "velocity_mps": (-8, 2, 0.5)},
    {"xyz_m": (-15, 6, 0), "velocity_mps": (0, 20, 0)},
]


@pytest.mark.parametrize("time", [0.0, 0.7, -1.3])
def test_velocity_is_the_derivative_of_position_in_the_turning_frame(time):
    """Central differences over 2 ms: third derivative omega^2 v t^2/6 is below 1e-6 m/s, rounding 1e-11."""
    scene = scene_with(EGO, TARGETS)
    before, _, _ = points(scene, time - DT)
    after, _, _ = points(scene, time + DT)
    position, velocity, rate = points(scene, time)
    np.testing.assert_allclose((after - before) / (2 * DT), velocity, atol=3e-5)
    distance = [np.linalg.norm(p, axis=1) for p in (before, after)]
    np.testing.assert_allclose((distance[1] - distance[0]) / (2 * DT), rate, atol=3e-5)
    np.testing.assert_allclose(rate, np.sum(position * velocity, axis=1) / np.linalg.norm(position, axis=1), atol=1e-12)


def test_wall_ahead_of_a_moving_ego_approaches_at_its_speed():
    wall = {"shape": "plate:3x3", "xyz_m": (60, 0, 1), "aim": 500, "id": 7}
    scene = srt.Scene(ego={"velocity_mps": (27.7, 0, 0)}, static=[wall], radars=[{"name": "r", "profile": ISO}])
    scat = srt.trace(scene, rays=100)
    d = scat.position / scat.range[:, None]
    np.testing.assert_allclose(scat.velocity, np.tile([-27.7, 0, 0], (len(scat), 1)), atol=1e-12)
    np.testing.assert_allclose(scat.range_rate, -27.7 * d[:, 0], atol=1e-12)
    ahead = np.argmax(d[:, 0])
    assert scat.range_rate[ahead] == pytest.approx(-27.7, abs=1e-3)


def test_yaw_of_the_ego_changes_no_range_rate_of_a_post_when_the_radar_sits_on_the_axis():
    still = scene_with({"yaw_rate_deg_s": 0}, TARGETS[:1], {"xyz_m": (0, 0, 1)})
    turning = scene_with({"yaw_rate_deg_s": 30}, TARGETS[:1], {"xyz_m": (0, 0, 1)})
    mid = 0.0
    _, v_still, r_still = points(still, mid)
    p, v_turning, r_turning = points(turning, mid)
    np.testing.assert_allclose(r_still, 0, atol=1e-12)
    np.testing.assert_allclose(r_turning, 0, atol=1e-12)
    np.testing.assert_allclose(v_still, 0, atol=1e-12)
    # in the turning frame the post goes round the vertical axis of the radar's own tilted frame
    axis = scene_axis(turning)
    np.testing.assert_allclose(v_turning, -np.cross(np.radians(30) * axis, p), atol=1e-9)


def scene_axis(scene):
    """Return the world's z axis in the radar frame; the mount's tilt is about a horizontal axis of the ego."""
    return scene.radars[0].pose.rotation.T @ [0.0, 0.0, 1.0]


def test_lever_arm_of_the_mount_counts_in_a_turn():
    """A radar 2 m ahead of the axis moves sideways at omega x 2 m: a post at 90 deg left shows it."""
    scene = scene_with({"yaw_rate_deg_s": 30}, [{"xyz_m": (2, 20, 1)}], {"xyz_m": (2, 0, 1), "ypr_deg": (90, 0, 0)})
    _, _, rate = points(scene, 0.0)
    assert rate[0] == pytest.approx(-np.radians(30) * 2, rel=1e-9)


def world_at(scene, time):
    from shenron_rt.scene.world import build_world, load_bodies

    bodies, materials = load_bodies(scene)
    return build_world(scene, scene.radars[0], time, bodies, materials)


@pytest.mark.parametrize("time", [0.0, 1.1])
def test_points_of_a_turning_actor_move_as_its_rigid_body(time):
    """drift + turn x p at every vertex equals the finite difference of that vertex, radar turning as well."""
    actor = {
        "id": 5, "shape": "box:4x2x1.5", "xyz_m": (20, 3, 0), "ypr_deg": (40, 5, 0),
        "velocity_mps": (9, -4, 0), "yaw_rate_deg_s": -40,
    }  # fmt: skip
    radar = {"name": "r", "profile": ISO, "xyz_m": (2, 0.4, 1), "ypr_deg": (10, 3, 0)}
    scene = srt.Scene(ego=EGO, actors=[actor], radars=[radar])
    before, after = (world_at(scene, time + dt).vertices for dt in (-DT, DT))
    world = world_at(scene, time)
    now = world.vertices
    velocity = world.drift[0] + np.cross(world.turn[0], now)
    np.testing.assert_allclose((after - before) / (2 * DT), velocity, atol=5e-5)
    scat = srt.trace(scene, rays=50_000, time=time - ISO.frame_mid_s)
    np.testing.assert_allclose(scat.velocity, world.drift[0] + np.cross(world.turn[0], scat.position), atol=1e-9)
    assert np.ptp(scat.range_rate) > 0.5


def test_poses_are_those_of_mid_frame():
    scene = scene_with(
        {"velocity_mps": (10, 0, 0)}, [{"xyz_m": (30, 0, 1), "velocity_mps": (-20, 0, 0)}], {"ypr_deg": (0, 0, 0)}
    )
    for start in (0.0, 0.25):
        scat = srt.trace(scene, rays=100, time=start)
        mid = start + ISO.frame_mid_s
        assert scat.position[0, 0] == pytest.approx(30 - 20 * mid - (2 + 10 * mid), abs=1e-12)


def test_steady_turn_is_a_circle():
    pose, v, rate = srt.Pose((1, 2, 0), (15, 0, 0)), (8.0, 3.0, 0.0), 20.0
    speed = np.hypot(8, 3)
    radius = speed / np.radians(rate)
    center = np.array([1, 2, 0]) + np.array([-3, 8, 0]) / np.radians(rate)
    for time in np.linspace(-5, 20, 11):
        state = body_state(pose, v, rate, time)
        assert np.linalg.norm(state.origin - center) == pytest.approx(radius, rel=1e-12)
        assert np.linalg.norm(state.velocity) == pytest.approx(speed, rel=1e-12)
        assert abs(state.velocity @ (state.origin - center)) < 1e-9
        # the body keeps its angle to its velocity
        heading = state.rotation[:, 0] @ state.velocity
        assert heading == pytest.approx(srt.Pose((0, 0, 0), (15, 0, 0)).rotation[:, 0] @ np.array(v), rel=1e-9)


def test_turn_rate_zero_is_the_limit_of_a_small_one():
    pose, v = srt.Pose((1, 2, 0)), (8.0, 3.0, 1.0)
    straight, nearly = body_state(pose, v, 0.0, 3.0), body_state(pose, v, 1e-9, 3.0)
    np.testing.assert_allclose(straight.origin, [25, 11, 3], atol=1e-12)
    np.testing.assert_allclose(nearly.origin, straight.origin, atol=1e-8)
    assert np.isfinite(nearly.velocity).all()
