"""One LiDAR frame: grid and area, side files, crops, merged sweeps, normals, files."""

from __future__ import annotations

import math
import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from lidar_tools import CAR, CAR_ID, GRID, HEIGHT_M, STEP_DEG, WALL_X, street, write_bin

import shenron_rt as srt
from shenron_rt.errors import InputError
from shenron_rt.lidar import merge_sweeps, read_side_file, sweep_motion
from shenron_rt.lidar.grid import MIN_AREA_COS, LidarGrid, estimate_grid

ROOF = srt.Pose((0.3, 0.0, HEIGHT_M))
META = """
sensor_transform: {{location: [100.0, 50.0, 2.4], rotation_deg: {{pitch: 0, yaw: {yaw}, roll: 0}}}}
ego_transform: {{location: [100.0, 50.0, 0.0], rotation_deg: {{pitch: 0, yaw: {yaw}, roll: 0}}}}
actors:
- id: 101
  type_id: vehicle.test
  location: {location}
  rotation_deg: {{pitch: 0, yaw: {yaw}, roll: 0}}
  velocity_in_ego_axes_m_s: [8.0, 1.0, 0.0]
  bbox: {{center_local: [0, 0, 0.75], extent: [2.0, 1.0, 0.75]}}
"""


@pytest.fixture(scope="module")
def frame(tmp_path_factory: pytest.TempPathFactory) -> srt.LidarFrame:
    path = write_bin(tmp_path_factory.mktemp("lidar") / "frame.bin", street())
    return srt.read_semantic_lidar(path, tag_table="0.9.14", frame="carla", sensor_pose=ROOF)


def _meta(folder: Path, yaw: float = 30.0, extra: str = "") -> Path:
    # the car's box, 14 m ahead and 3 m to the right of the ego, in a world that is turned by yaw
    c, s = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
    location = [100.0 + 14 * c - 3 * s, 50.0 + 14 * s + 3 * c, 0.0]
    path = folder / "frame.meta.yaml"
    path.write_text(META.format(yaw=yaw, location=location) + extra)
    return path


# ---- grid and area
def test_the_grid_is_found_in_the_points_and_reported(frame: srt.LidarFrame) -> None:
    g = frame.grid
    assert (g.channels, g.estimated) == (GRID[0], True)
    # float32 coordinates: a few 1e-6 rad
    assert (g.upper_deg, g.lower_deg, g.azimuth_step_deg) == pytest.approx(GRID[1:], abs=1e-3)
    assert "estimated" in frame.summary()["grid"]


def test_half_a_sweep_and_a_short_range_give_the_same_steps() -> None:
    records = street(reach_m=10.0)  # CARLA's default range
    half = records[records["y"] > 0]
    points = np.stack([half[a] for a in "xyz"], axis=1).astype(np.float64)
    grid = estimate_grid(points)
    assert grid.azimuth_step_deg == pytest.approx(STEP_DEG, abs=1e-3)
    assert grid.elevation_step_deg == pytest.approx(40 / 63, abs=1e-3)


def test_area_of_the_ground_is_that_of_its_ring(frame: srt.LidarFrame) -> None:
    # between the circles where the first and the last cell of the channels end, pi (r1^2 - r0^2)
    distance = np.hypot(frame.position[:, 0], frame.position[:, 1])
    elevation = np.degrees(np.arctan2(frame.position[:, 2], distance))
    step = frame.grid.elevation_step_deg
    behind = (frame.position[:, 0] < 0) & (frame.tag == 1) & (elevation < -6.0)
    low = -30.0 - step / 2
    high = np.round((elevation[behind].max() + 30.0) / step) * step - 30.0 + step / 2
    ring = (
        0.5 * np.pi * ((HEIGHT_M / math.tan(math.radians(high))) ** 2 - (HEIGHT_M / math.tan(math.radians(low))) ** 2)
    )
    # mid-point rule over cells of 0.63 deg at 6 deg and more: (step / el)^2 = 1 %; 1 of 360 azimuths on the border
    assert frame.area[behind].sum() == pytest.approx(abs(ring), rel=0.015)


def test_area_does_not_depend_on_the_number_of_channels(tmp_path: Path) -> None:
    car = []
    for k, (channels, step) in enumerate([(64, 0.5), (128, 0.25), (256, 0.125)]):
        path = write_bin(tmp_path / f"{k}.bin", street(channels, step))
        dense = srt.read_semantic_lidar(path, tag_table="0.9.14", frame="carla")
        car.append(dense.area[dense.object_id == CAR_ID].sum())
    # visible faces: 2 x 1.5 m rear, 4 x 1.5 m side, 4 x 2 m roof seen at 5 deg; the edges of 64 channels are coarse
    assert car[2] == pytest.approx(2 * 1.5 + 4 * 1.5 + 4 * 2, rel=0.03)
    assert np.ptp(10 * np.log10(car)) < 0.5


def test_grazing_cosines_limit_the_area_and_are_counted(tmp_path: Path) -> None:
    records = street()
    records["CosAngle"][:3] = 0.0
    frame = srt.read_semantic_lidar(
        write_bin(tmp_path / "f.bin", records), tag_table="0.9.14", frame="carla", grid=GRID
    )
    assert np.all(np.isfinite(frame.area))
    r2 = np.sum(frame.position[0] ** 2)
    solid = frame.grid.solid_angle(np.arctan2(frame.position[:1, 2], np.hypot(*frame.position[:1, :2].T)))[0]
    assert frame.area[0] == pytest.approx(r2 * solid / MIN_AREA_COS, rel=1e-12)
    assert frame.summary()["areas_limited"] == 3


def test_a_single_channel_has_a_grid() -> None:
    azimuth = np.radians(np.arange(0, 90, 0.4))
    points = 10 * np.stack([np.cos(azimuth), np.sin(azimuth), np.zeros_like(azimuth)], axis=1)
    grid = estimate_grid(points)
    assert (grid.channels, grid.elevation_step_deg) == (1, pytest.approx(0.4))
    assert LidarGrid(1, 0, 0, 0.4).solid_angle(np.zeros(1))[0] == pytest.approx(math.radians(0.4) ** 2)


# ---- origin and side files
@pytest.mark.parametrize("origin", ["ego", "world"])
def test_points_of_any_origin_come_to_the_sensor(origin: str, tmp_path: Path, frame: srt.LidarFrame) -> None:
    side = _meta(tmp_path)
    read = read_side_file(side)
    assert read.sensor_pose is not None
    assert read.sensor_world is not None
    pose = read.sensor_pose if origin == "ego" else read.sensor_world
    moved = street()
    points = pose.apply(np.stack([moved["x"], -moved["y"], moved["z"]], axis=1).astype(np.float64))
    for axis, column in zip("xyz", (points * [1, -1, 1]).T, strict=True):
        moved[axis] = column
    path = write_bin(tmp_path / "frame.bin", moved)
    got = srt.read_semantic_lidar(path, tag_table="0.9.14", frame="carla", origin=origin, side_file=side)  # type: ignore[arg-type]
    assert np.abs(got.position - frame.position).max() < 2e-5  # float32 at 200 m


def test_velocities_of_the_meta_layout_are_carla_axes_whatever_the_points(tmp_path: Path) -> None:
    records = street()
    records["y"] *= -1
    path = write_bin(tmp_path / "frame.bin", records)
    frame = srt.read_semantic_lidar(path, tag_table="0.9.14", frame="ros", side_file=_meta(tmp_path))
    assert frame.velocity is not None
    car = frame.object_id == CAR_ID
    assert np.abs(frame.velocity[car] - (8.0, -1.0, 0.0)).max() < 1e-12  # 1 m/s to the right
    assert not np.any(frame.velocity[frame.object_id == 0])
    assert frame.names == {CAR_ID: "vehicle.test"}
    assert frame.sensor_pose is not None
    assert frame.sensor_pose.xyz == pytest.approx((0, 0, 2.4))


def test_an_explicit_pose_and_a_recorded_column_are_said_to_clash(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    records = street()
    table = np.stack([records[n].astype(np.float64) for n in records.dtype.names or ()], axis=1)
    np.save(tmp_path / "frame.npy", np.insert(table, 3, 0.5, axis=1))
    higher = srt.Pose((0.0, 0.0, 2.6))
    frame = srt.read_semantic_lidar(
        tmp_path / "frame.npy", tag_table="0.9.14", frame="carla", side_file=_meta(tmp_path), sensor_pose=higher
    )
    assert frame.sensor_pose == higher
    assert "sensor_pose (0.0, 0.0, 2.6) is used" in caplog.text
    assert "the recorded column is kept, not used" in frame.notes[-1]
    assert frame.velocity is not None


def test_turning_actors_move_faster_on_the_outside(tmp_path: Path) -> None:
    # 30 deg/s to the right in CARLA: -30 deg/s about z here
    side = tmp_path / "side.yaml"
    side.write_text(
        "version: 1\naxes: carla\nego: {velocity_mps: [5, 1, 0], yaw_rate_deg_s: 10}\n"
        "sensor: {xyz_m: [0.3, 0, 2.4], ypr_deg: [90, 0, 0]}\n"
        f"actors:\n- {{id: {CAR_ID}, xyz_m: [1, 2, 0], velocity_mps: [3, 0, 0], yaw_rate_deg_s: 30}}\n"
    )
    read = read_side_file(side)
    point = np.array([[2.0, -2.0, 1.0]])  # 1 m ahead of its origin (1, -2)
    rate = math.radians(30)
    assert read.velocity(point, np.array([CAR_ID])) == pytest.approx(np.array([[3.0, -rate, 0.0]]))
    assert read.ego_velocity == pytest.approx((5.0, -1.0, 0.0))
    assert read.ego_yaw_rate == pytest.approx(-math.radians(10))
    assert read.sensor_pose is not None
    assert read.sensor_pose.ypr_deg[0] == -90  # CARLA's yaw grows to the right


def test_a_mirrored_frame_is_refused_where_the_boxes_show_it(tmp_path: Path) -> None:
    path = write_bin(tmp_path / "frame.bin", street())
    with pytest.raises(InputError, match=r"frame 'ros' puts 0 of \d+ actor points .* 'carla' \d+: y is mirrored"):
        srt.read_semantic_lidar(path, tag_table="0.9.14", frame="ros", side_file=_meta(tmp_path))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("version: 2\naxes: ros\n", "version"),
        ("version: 1\naxes: enu\n", "axes: ros"),
        ("version: 1\naxes: ros\nspeed: 3\n", "speed"),
        ("version: 1\naxes: ros\nactors: [{id: 1, velocity_mps: [1, 2]}]\n", "three finite numbers"),
        ("version: 1\naxes: ros\nactors: [{velocity_mps: [1, 2, 3]}]\n", "id"),
        ("version: 1\naxes: ros\nactors: 7\n", "not a side file"),
    ],
)
def test_side_files_that_are_none_are_refused(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "side.yaml"
    path.write_text(text)
    with pytest.raises(srt.ConfigError, match=said):
        read_side_file(path)


# ---- crops, thinning, sweeps
def test_ego_points_are_left_out_on_request_and_said_so(tmp_path: Path) -> None:
    records = street()
    records[:40] = records[0]
    records["x"][:40], records["y"][:40], records["z"][:40] = 1.2, 0.4, -1.2  # its own bonnet
    records["ObjTag"][:40] = CAR
    path = write_bin(tmp_path / "frame.bin", records)
    read = srt.read_semantic_lidar(path, tag_table="0.9.14", frame="carla", sensor_pose=ROOF, grid=GRID)
    cropped = read.crop_ego(4.8, 2.0, 1.6)
    assert len(read) - len(cropped) == 40
    assert "ego box 4.8 x 2 x 1.6 m left out: 40 points" in cropped.summary()["notes"]
    assert cropped.summary()["points_read"] == len(read)
    bare = srt.read_semantic_lidar(path, tag_table="0.9.14", frame="carla", grid=GRID)
    with pytest.raises(InputError, match="sensor_pose"):
        bare.crop_ego()


def test_nothing_is_cropped_unless_asked(frame: srt.LidarFrame) -> None:
    assert len(frame) == frame.n_read
    old = frame.crop_old_pipeline()
    x, y, z = old.position.T
    assert x.min() > 0.5
    assert np.abs(y).max() < 30
    assert z.min() > -2.2
    assert len(old) < 0.3 * len(frame)  # the road itself was below its limit
    assert "z > -2.2" in old.notes[-1]


def test_thinning_keeps_the_area_of_every_object(frame: srt.LidarFrame) -> None:
    thin = frame.thin(0.5)
    assert len(thin) < 0.8 * len(frame)
    for number in (0, CAR_ID):
        before, after = (f.area[f.object_id == number].sum() for f in (frame, thin))
        assert after == pytest.approx(before, rel=1e-12)
    assert set(np.unique(thin.tag)) == set(np.unique(frame.tag))
    with pytest.raises(InputError, match="voxel"):
        frame.thin(0.0)


def test_two_half_sweeps_meet_after_ego_motion(frame: srt.LidarFrame) -> None:
    left = frame.position[:, 1] > 0
    now, then = frame.select(left), frame.select(~left)
    # between the sweeps the ego drove 0.8 m and turned 2 degrees to the left: what the earlier one saw from there
    motion = srt.Pose((-0.8, 0.02, 0.0), (-2.0, 0.0, 0.0))
    seen = ROOF.apply_inverse(motion.apply_inverse(ROOF.apply(then.position)))
    earlier = srt.LidarFrame(seen, then.cos_incidence, then.object_id, then.tag, then.area, then.grid, ROOF)
    whole = merge_sweeps(now, earlier, motion)
    assert whole.position == pytest.approx(np.concatenate([now.position, then.position]), abs=1e-9)
    assert whole.area.sum() == pytest.approx(frame.area.sum())  # each point keeps what its own sweep saw
    assert "merged" in whole.notes[-1]


def test_moving_actors_are_carried_to_the_later_sweep(tmp_path: Path) -> None:
    path = write_bin(tmp_path / "frame.bin", street())
    now = srt.read_semantic_lidar(path, tag_table="0.9.14", frame="carla", side_file=_meta(tmp_path))
    whole = merge_sweeps(now, now, srt.Pose(), elapsed_s=0.05)
    shift = whole.position[len(now) :] - now.position
    car = now.object_id == CAR_ID
    assert shift[car] == pytest.approx(np.broadcast_to([0.4, -0.05, 0.0], (car.sum(), 3)))  # 8 and -1 m/s
    assert np.abs(shift[~car]).max() < 1e-12  # there and back through the ego frame


def test_the_motion_between_sweeps_is_that_of_velocity_and_turn_or_of_the_poses(frame: srt.LidarFrame) -> None:
    elapsed, turn, speed = 0.05, math.radians(30.0), np.array([16.0, 0.5, 0.0])
    moving = replace(frame, ego_velocity=speed, ego_yaw_rate=turn)
    # the path integrated in 10,000 steps
    place, heading, steps = np.zeros(2), 0.0, 10_000
    for _ in range(steps):
        middle = heading + turn * elapsed / steps / 2
        c, s = math.cos(middle), math.sin(middle)
        place += np.array([[c, -s], [s, c]]) @ speed[:2] * elapsed / steps
        heading += turn * elapsed / steps
    ahead = srt.Pose((*place, 0.0), (math.degrees(heading), 0.0, 0.0))
    motion = sweep_motion(moving, elapsed)
    corners = np.vstack([np.zeros(3), np.eye(3)])
    assert motion.apply(ahead.apply(corners)) == pytest.approx(corners, abs=1e-9)
    # the same from the sensor's poses in a world, whatever the velocities say
    world = srt.Pose((100.0, 50.0, 0.2), (40.0, 3.0, 0.0))
    earlier, now = world.compose(ROOF), world.compose(ahead).compose(ROOF)
    assert sweep_motion(frame, elapsed, now, earlier).apply(corners) == pytest.approx(motion.apply(corners), abs=1e-9)
    with pytest.raises(InputError, match="how the ego vehicle moved"):
        sweep_motion(frame, elapsed)


def test_sweeps_that_do_not_belong_together_are_refused(frame: srt.LidarFrame) -> None:
    with pytest.raises(InputError, match="only one of the sweeps has normal"):
        merge_sweeps(frame, frame.with_normals(), srt.Pose())


# ---- normals
def test_normals_of_road_wall_and_car_are_found(frame: srt.LidarFrame) -> None:
    found = frame.with_normals()
    assert found.normal is not None
    known = np.any(found.normal != 0, axis=1)
    assert known.mean() > 0.97
    assert np.linalg.norm(found.normal[known], axis=1) == pytest.approx(1.0)
    p = frame.position
    rear = (frame.object_id == CAR_ID) & (np.abs(p[:, 0] - 12.0) < 1e-3)
    side = (frame.object_id == CAR_ID) & (np.abs(p[:, 1] + 2.0) < 1e-3)
    wall = np.abs(p[:, 0] - WALL_X) < 1e-3
    for rows, truth in ((frame.tag == 1, (0, 0, 1)), (wall, (-1, 0, 0)), (rear, (-1, 0, 0)), (side, (0, 1, 0))):
        off = np.degrees(np.arccos(np.clip(found.normal[rows & known] @ np.array(truth, dtype=float), -1, 1)))
        assert np.median(off) < 0.1  # planes, and cosines of float32
        assert np.percentile(off, 90) < 12.0  # neighbours across the car's edges
        assert (rows & known).sum() > 0.8 * rows.sum()


def test_normals_face_the_sensor_at_the_recorded_angle(frame: srt.LidarFrame) -> None:
    found = frame.with_normals()
    assert found.normal is not None
    known = np.any(found.normal != 0, axis=1)
    u = frame.position / np.linalg.norm(frame.position, axis=1)[:, None]
    seen = -np.einsum("ij,ij->i", found.normal, u)[known]
    assert seen == pytest.approx(frame.cos_incidence[known], abs=1e-9)


def test_too_few_points_have_no_normals(frame: srt.LidarFrame) -> None:
    few = frame.select(np.arange(5)).with_normals()
    assert few.normal is not None
    assert not np.any(few.normal)
    with pytest.raises(InputError, match="neighbours >= 3"):
        frame.with_normals(neighbours=2)


# ---- files
def test_a_frame_survives_its_file(frame: srt.LidarFrame, tmp_path: Path) -> None:
    before = frame.with_normals()
    before.save(tmp_path / "frame.npz")
    after = srt.LidarFrame.load(tmp_path / "frame.npz")
    for f in fields(srt.LidarFrame):
        a, b = getattr(before, f.name), getattr(after, f.name)
        assert np.array_equal(a, b) if isinstance(a, np.ndarray) else a == b, f.name


def test_the_summary_counts_tags_actors_and_the_untagged(tmp_path: Path) -> None:
    records = street()
    records["ObjTag"][:100] = 0
    frame = srt.read_semantic_lidar(write_bin(tmp_path / "f.bin", records), tag_table="0.9.14", frame="carla")
    summary = frame.summary()
    assert sum(summary["tags"].values()) == len(records)
    assert summary["untagged_share"] == pytest.approx(100 / len(records))
    assert summary["points_per_actor"] == {CAR_ID: int(np.sum(records["ObjIdx"] == CAR_ID))}  # 0 is not one object
    assert summary["velocity"].startswith("none")


def test_side_files_of_the_docs_are_read(tmp_path: Path) -> None:
    page = (Path(__file__).parents[1] / "docs" / "lidar.md").read_text(encoding="utf-8")
    carla, own = re.findall(r"^```text\n(.*?)^```$", page, flags=re.MULTILINE | re.DOTALL)
    for text in (carla, own):
        (tmp_path / "side.yaml").write_text(text)
        side = read_side_file(tmp_path / "side.yaml")
        assert side.actors[101].velocity.tolist() == [8.0, 0.0, 0.0]
        assert side.actors[101].origin == pytest.approx((18.0, 0.0, 0.0))
        assert side.ego_velocity is not None
        assert side.ego_velocity.tolist() == [10.0, 0.0, 0.0]
        assert side.sensor_pose is not None
        assert side.sensor_pose.xyz == pytest.approx((0, 0, 2.4))
