"""LiDAR points as scatterers of a radar: place, motion, incidence, echoes, and the chain behind them."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lidar_tools import CAR_ID, HEIGHT_M, WALL_X, street, write_bin

import shenron_rt as srt
from shenron_rt.config.scene import LidarMount
from shenron_rt.echo.glint import GLINT_SLOPE, cone_sigma0, glint_sigma0
from shenron_rt.errors import InputError
from shenron_rt.lidar import lidar_scatterers
from shenron_rt.lidar.door import door_counts
from shenron_rt.lidar.grid import LidarGrid
from shenron_rt.lidar.normals import estimate_normals
from shenron_rt.lidar.occlusion import hidden_from_radar

ROOF = srt.Pose((0.3, 0.0, HEIGHT_M))
BUMPER = srt.Pose((2.0, 0.0, 1.0))
#: Straight behind the car, whose flat rear sends nothing back to the middle of the ego.
BEHIND = srt.Pose((2.0, -3.0, 1.0))


@pytest.fixture(scope="module")
def profile() -> srt.RadarProfile:
    return srt.load_profile("awrl1432")


@pytest.fixture(scope="module")
def frame(tmp_path_factory: pytest.TempPathFactory) -> srt.LidarFrame:
    path = write_bin(tmp_path_factory.mktemp("lidar") / "frame.bin", street())
    return srt.read_semantic_lidar(path, tag_table="0.9.14", frame="carla", sensor_pose=ROOF)


# ---- place
def test_points_stand_where_the_radar_sees_them(frame: srt.LidarFrame) -> None:
    rows = lidar_scatterers(frame, mount=BUMPER)
    assert rows.door == "lidar"
    # the wall is 30 m ahead of the LiDAR, which is at x = 0.3; the radar is at x = 2; the road 1 m below it
    assert rows.position[rows.tag == 3][:, 0] == pytest.approx(WALL_X + 0.3 - 2.0, abs=1e-5)
    assert rows.position[rows.tag == 1][:, 2] == pytest.approx(-1.0, abs=1e-5)
    assert rows.position[rows.object_id == CAR_ID][:, 1].max() == pytest.approx(-2.0, abs=1e-5)  # to the right


def test_a_turned_mount_turns_the_points(frame: srt.LidarFrame) -> None:
    rows = lidar_scatterers(frame, mount=srt.Pose((2.0, 0.0, 1.0), (90.0, 0.0, 0.0)))
    wall = rows.position[rows.tag == 3]
    assert wall[:, 1] == pytest.approx(-(WALL_X + 0.3 - 2.0), abs=1e-5)  # looking left, the wall is on the right


def test_a_mount_without_the_sensor_pose_is_refused(frame: srt.LidarFrame, profile: srt.RadarProfile) -> None:
    bare = replace(frame, sensor_pose=None)
    with pytest.raises(ValueError, match="needs sensor_pose"):
        srt.simulate(bare, profile, mount=BUMPER)
    at_lidar = lidar_scatterers(bare)
    assert np.array_equal(at_lidar.position, frame.position)


def test_without_a_mount_the_radar_is_in_the_bumper(frame: srt.LidarFrame) -> None:
    assert np.array_equal(lidar_scatterers(frame).position, lidar_scatterers(frame, mount=BUMPER).position)


def test_points_at_the_radar_itself_are_left_out_and_counted(frame: srt.LidarFrame) -> None:
    inside = replace(frame, position=np.concatenate([[[1.7, 0.0, -1.4]], frame.position[1:]]))
    rows = lidar_scatterers(inside, mount=BUMPER)
    assert door_counts(inside, rows)["left_out_at_the_radar"] == 1
    assert np.all(np.isfinite(rows.range_rate))


# ---- motion
def test_static_points_close_in_at_the_speed_of_the_ego(frame: srt.LidarFrame) -> None:
    rows = lidar_scatterers(replace(frame, ego_velocity=np.array([27.7, 0.0, 0.0])), mount=BUMPER)
    ahead = np.argmin(np.linalg.norm(rows.position[:, 1:], axis=1) + 1e3 * (rows.tag != 3))
    u = rows.position / rows.range[:, None]
    assert rows.range_rate == pytest.approx(-27.7 * u[:, 0], abs=1e-12)
    assert rows.range_rate[ahead] == pytest.approx(-27.7, rel=1e-3)


def test_range_rates_are_the_change_of_range_while_the_ego_turns(frame: srt.LidarFrame) -> None:
    # finite difference of the geometry: everything over ground, seen from the moved and turned radar
    ego, rate, dt = np.array([12.0, 0.5, 0.0]), math.radians(30), 1e-5
    velocity = np.where((frame.object_id == CAR_ID)[:, None], (8.0, -1.0, 0.0), 0.0)
    moving = replace(frame, velocity=velocity, ego_velocity=ego, ego_yaw_rate=rate)
    mount = srt.Pose((2.0, 0.3, 1.0), (10.0, 0.0, 0.0))
    rows = lidar_scatterers(moving, mount=mount)
    ground = ROOF.apply(frame.position)  # the ego frame stands still for this
    for sign in (1, -1):
        x, y, z = sign * dt * ego
        later = srt.Pose((x, y, z), (math.degrees(sign * dt * rate), 0, 0)).compose(mount)
        seen = later.apply_inverse(ground + sign * dt * velocity)
        if sign > 0:
            after = seen
    assert rows.velocity is not None
    # central differences: error dt^2 / 6 times the third derivative, a few (rad/s)^3 x 80 m: 1e-9; rounding 1e-14 / dt
    assert rows.velocity == pytest.approx((after - seen) / (2 * dt), abs=1e-6)
    change = (np.linalg.norm(after, axis=1) - np.linalg.norm(seen, axis=1)) / (2 * dt)
    assert rows.range_rate == pytest.approx(change, abs=1e-6)


def test_the_recorded_column_is_used_where_nothing_else_is_known(frame: srt.LidarFrame) -> None:
    column = np.linspace(-5, 5, len(frame))
    rows = lidar_scatterers(replace(frame, range_rate=column), mount=BUMPER)
    assert np.array_equal(rows.range_rate, column)
    known = replace(frame, range_rate=column, velocity=np.zeros((len(frame), 3)))
    assert not np.any(lidar_scatterers(known, mount=BUMPER).range_rate)  # velocities that were given go before it


# ---- incidence
def test_the_road_is_seen_at_the_angle_of_the_radar_not_of_the_roof(frame: srt.LidarFrame) -> None:
    away = (np.abs(frame.position[:, 1]) < 1.0) & (frame.tag == 1) & (frame.position[:, 0] > 0)
    row = int(np.argmin(np.abs(np.linalg.norm(frame.position, axis=1) - 10.0) + 1e3 * ~away))
    recorded = lidar_scatterers(frame, mount=BUMPER).cos_incidence[row]
    seen = lidar_scatterers(frame.with_normals(), mount=BUMPER).cos_incidence[row]
    p = BUMPER.apply_inverse(ROOF.apply(frame.position[row : row + 1]))[0]
    assert recorded == pytest.approx(0.24, abs=0.01)
    assert seen == pytest.approx(1.0 / np.linalg.norm(p), abs=1e-6)  # about 0.12
    assert seen < 0.55 * recorded


def test_without_normals_the_recorded_column_goes_through_as_it_is(frame: srt.LidarFrame) -> None:
    for source in (frame, frame.without_normals()):
        rows = lidar_scatterers(source, mount=BUMPER)
        assert np.array_equal(rows.cos_incidence, frame.cos_incidence)
        counts = door_counts(source, rows)
        assert (counts["cosine_from_normal"], counts["cosine_recorded"]) == (0, len(frame))


def test_surfaces_that_face_away_from_the_radar_are_dark_and_counted(frame: srt.LidarFrame) -> None:
    low = lidar_scatterers(frame.with_normals(), mount=srt.Pose((2.0, 0.0, 0.5)))
    roof = (low.object_id == CAR_ID) & (np.abs(low.position[:, 2] - 1.0) < 1e-3)  # the car's roof, 1.5 m up
    assert roof.any()
    assert np.median(low.cos_incidence[roof]) == 0
    assert door_counts(frame, low)["facing_away_from_the_radar"] >= int(0.5 * roof.sum())


# ---- hidden from the radar
def _street_with_a_walker_behind_a_car() -> srt.Scene:
    return srt.Scene(
        static=[{"id": 1, "shape": "ground:80x30", "xyz_m": (42, 0, 0), "tag": "Roads", "material": "asphalt"}],
        actors=[
            {"id": 101, "shape": "car", "xyz_m": (14, 0, 0)},
            {"id": 201, "shape": "pedestrian", "xyz_m": (25, 0, 0)},
            {"id": 202, "shape": "pedestrian", "xyz_m": (25, 4, 0)},
        ],
        radars=[{"name": "r", "profile": "awrl1432", "xyz_m": (2.0, 0.0, 1.0)}],
    )


def test_what_a_car_hides_from_the_bumper_and_not_from_the_roof_is_left_out_on_request() -> None:
    roof = LidarMount(xyz_m=(0, 0, 2.5), channels=64, range_m=100, points_per_second=600_000)
    seen = srt.cast_lidar(_street_with_a_walker_behind_a_car(), roof)
    mount = srt.Pose((2.0, 0.0, 1.0))
    assert np.count_nonzero(seen.object_id == 201) >= 5  # head and shoulders, over the car's roof
    kept = seen.hide_occluded(mount)
    count = {i: (np.count_nonzero(kept.object_id == i), np.count_nonzero(seen.object_id == i)) for i in (1, 101, 202)}
    # a patch here and there covers no line of sight: of the hidden walker two points may stay, as may not of the rest
    assert np.count_nonzero(kept.object_id == 201) <= 2
    assert count[202][0] == count[202][1]  # beside the car
    # the car hides its own roof's far side, and 60 m of road behind itself: a strip of 2 in 30 m
    assert count[101][0] > 0.8 * count[101][1]
    assert 0.95 * count[1][1] < count[1][0] < count[1][1]
    assert "hidden from the radar by nearer points" in kept.notes[-1]
    # from the LiDAR's own place everything that it sees is in sight
    assert len(seen.hide_occluded(srt.Pose((0.0, 0.0, 2.5)))) == len(seen)


def test_a_road_at_grazing_incidence_hides_nothing_of_itself(frame: srt.LidarFrame) -> None:
    road = frame.select(frame.tag == 1)
    assert not np.any(hidden_from_radar(road, srt.Pose((2.0, 0.0, 0.3))))


# ---- echoes
def _mirror(points: np.ndarray, normal: np.ndarray, slope: np.ndarray | None = None) -> np.ndarray:
    n = len(points)
    u = points / np.linalg.norm(points, axis=1)[:, None]
    metal = np.full(n, -1.0 + 0j)
    return glint_sigma0(metal, -metal, normal, u, np.zeros(n), "VV", slope)


@pytest.mark.parametrize("slope_deg", [0.0, 2.0, 6.0])
def test_the_glint_of_an_infinite_plate_is_pi_h_squared(slope_deg: float) -> None:
    h, step = 10.0, 0.1
    y, z = (g.reshape(-1) for g in np.meshgrid(*[np.arange(-10, 10, step) + step / 2] * 2))
    points = np.column_stack([np.full(y.size, h), y, z])
    normal = np.broadcast_to([-1.0, 0.0, 0.0], points.shape)
    sigma0 = _mirror(points, normal, np.full(y.size, math.tan(math.radians(slope_deg))))
    distance = np.linalg.norm(points, axis=1)
    # cells of 0.1 m under a lobe of 0.35 m: the mid-point rule is exact to 1e-6; what is beyond 10 m, 7 slopes, to 1e-9
    assert np.sum(sigma0 * step**2 * (h / distance) ** 4) == pytest.approx(math.pi * h**2, rel=1e-4)


def test_the_glint_of_a_sphere_is_pi_a_squared() -> None:
    a, far = 0.5, 1e3
    theta, phi = np.meshgrid(
        np.linspace(0, 0.6, 1201)[:-1] + 0.00025, np.linspace(0, 2 * np.pi, 181)[:-1], indexing="ij"
    )
    out = np.stack([-np.cos(theta), np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)], -1).reshape(-1, 3)
    area = (a**2 * np.sin(theta) * (0.6 / 1200) * (2 * np.pi / 180)).reshape(-1)
    # sec^4 under the lobe adds of the order of s^2 = 1.2e-3
    assert np.sum(_mirror(out * a + [far, 0, 0], out) * area) == pytest.approx(math.pi * a**2, rel=4 * GLINT_SLOPE**2)


def _cone(points: np.ndarray, normal: np.ndarray, lidar: tuple[float, ...], slope: float = 0.01) -> np.ndarray:
    """Return sigma0 of metal whose normals nobody knows, seen from the radar at the origin and a LiDAR elsewhere."""
    line = points - np.asarray(lidar)
    line /= np.linalg.norm(line, axis=1)[:, None]
    u = points / np.linalg.norm(points, axis=1)[:, None]
    metal, n = np.full(len(points), -1.0 + 0j), len(points)
    cosine = np.clip(-np.einsum("ij,ij->i", normal, line), 0.0, 1.0)
    return cone_sigma0(metal, -metal, cosine, line, u, np.zeros(n), np.full(n, slope))


@pytest.mark.parametrize(
    ("lidar", "bound_db"),
    # from the radar's own place the cosine is all there is to know; from a roof the mean over the cone is not what the
    # plate is, and errs by 1.2 dB at 10 m
    [((0.0, 0.0, 0.0), 1e-3), ((-2.0, 0.0, 1.4), 1.5), ((-2.0, 0.0, 2.8), 0.5)],
)
def test_the_glint_of_a_plate_follows_from_its_cosines_alone(lidar: tuple[float, ...], bound_db: float) -> None:
    h, step = 10.0, 0.05
    y, z = (g.reshape(-1) for g in np.meshgrid(*[np.arange(-10, 10, step) + step / 2] * 2))
    points = np.column_stack([np.full(y.size, h), y, z])
    sigma0 = _cone(points, np.broadcast_to([-1.0, 0.0, 0.0], points.shape), lidar)
    sigma = np.sum(sigma0 * step**2 * (h / np.linalg.norm(points, axis=1)) ** 4)
    assert abs(10 * np.log10(sigma / (math.pi * h**2))) < bound_db


def test_a_pole_of_one_column_says_nothing_of_its_mirror_line_and_a_wall_that_goes_on_does() -> None:
    # 0.5 degrees of azimuth and of elevation; the same cosines, as if both faced the LiDAR
    column, row = np.radians(np.arange(-2, 3) * 0.5), np.radians(np.arange(-4, 5) * 0.5)
    for columns, expected in ((column[:1], 0), (column, 3 * 9)):
        az, el = (g.reshape(-1) for g in np.meshgrid(columns, row))
        points = 10 * np.column_stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])
        n = len(points)
        frame = srt.LidarFrame(
            position=points, cos_incidence=np.linspace(1.0, 0.2, n), object_id=np.ones(n, np.uint32),
            tag=np.full(n, srt.SemanticTag.Walls, np.uint8), area=np.ones(n), grid=LidarGrid(9, 2.0, -2.0, 0.5),
        )  # fmt: skip
        normal, slope = estimate_normals(frame, flatness=0.0)  # no plane is flat enough
        assert not normal.any()
        assert np.count_nonzero(slope) == expected


def test_a_metal_car_is_dark_without_normals_and_lit_with_them(
    frame: srt.LidarFrame, profile: srt.RadarProfile
) -> None:
    power = [
        srt.illuminate(lidar_scatterers(f, mount=BEHIND), profile).power_by_object()[CAR_ID]
        for f in (frame.without_normals(), frame.with_normals())
    ]
    assert 10 * np.log10(power[1] / power[0]) > 20


def test_nothing_of_the_lidar_door_is_coherent(frame: srt.LidarFrame, profile: srt.RadarProfile) -> None:
    rows = lidar_scatterers(frame.with_normals(), mount=BUMPER)
    assert not np.any(srt.illuminate(rows, profile).coherent)
    assert door_counts(frame, rows)["coherent"] is False


def test_power_does_not_depend_on_the_density_of_the_lidar(tmp_path: Path, profile: srt.RadarProfile) -> None:
    mean = []
    for k, (channels, step) in enumerate([(64, 0.5), (256, 0.125)]):
        path = write_bin(tmp_path / f"{k}.bin", street(channels, step))
        dense = srt.read_semantic_lidar(path, tag_table="0.9.14", frame="carla", sensor_pose=ROOF)
        rows = lidar_scatterers(dense.select(dense.tag == 3), mount=BUMPER)
        powers = [srt.illuminate(replace(rows, seed=s), profile).power_by_object()[0] for s in range(20)]
        mean.append(np.mean(powers))
    # a thousand rows of exponential power over 20 seeds: 0.7 % (0.03 dB); cells at the wall's border: 64 channels over
    # 8.6 m of height err by half a cell of 0.33 m, 0.2 dB
    assert abs(10 * np.log10(mean[0] / mean[1])) < 0.4


# ---- the chain
def test_simulate_takes_a_lidar_frame_through_the_same_chain(frame: srt.LidarFrame, profile: srt.RadarProfile) -> None:
    velocity = np.where((frame.object_id == CAR_ID)[:, None], (2.0, 0.0, 0.0), 0.0)
    moving = replace(frame, velocity=velocity)
    done = srt.simulate(moving, profile, mount=BEHIND, seed=3, frame=5)
    assert (done.radar, done.seed, done.frame, done.backend) == (profile.name, 3, 5, "")
    assert done.profile is profile
    mine = done.detections.table[done.detections.object_id == CAR_ID]
    rows = done.scatterers.select(done.scatterers.object_id == CAR_ID)
    assert len(mine)
    assert rows.range.min() - 0.4 < mine["range"][0] < rows.range.max() + 0.4  # one bin, c / 2B = 0.37 m
    assert mine["velocity"][0] == pytest.approx(2.0 * np.cos(mine["azimuth"][0]), abs=done.cube.velocity_step_mps)
    again = srt.simulate(moving, profile, mount=BEHIND, seed=3, frame=5)
    assert np.array_equal(done.adc.data, again.adc.data)


def test_a_lidar_frame_without_a_profile_is_refused(frame: srt.LidarFrame) -> None:
    with pytest.raises(InputError, match="give a profile"):
        srt.simulate(frame)
