"""Trajectories: poses between keyframes, recordings, and what is refused."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import shenron_rt as srt
from shenron_rt.config.scene import Actor, Ego
from shenron_rt.errors import ConfigError, InputError
from shenron_rt.frames import Pose
from shenron_rt.scene.motion_of import ego_state, state_of
from shenron_rt.scene.rotations import left_of_exp, rotation_exp, rotation_log
from shenron_rt.scene.trajectory import Trajectory

CAR = {"id": 5, "shape": "box:4x2x1.5"}


def keyframes(times, xyz, ypr=None):
    ypr = np.zeros((len(times), 3)) if ypr is None else ypr
    return [
        {"t_s": float(t), "xyz_m": tuple(map(float, p)), "ypr_deg": tuple(map(float, a))}
        for t, p, a in zip(times, xyz, ypr, strict=True)
    ]


def wild(seed, n=7):
    """Return a trajectory with unequal steps, and turns of up to 70 degrees about any axis from one to the next."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.2, 1.5, n))
    rotation = [np.eye(3)]
    for v in rng.normal(size=(n - 1, 3)):
        rotation.append(rotation[-1] @ rotation_exp(v / np.linalg.norm(v) * rng.uniform(0, 1.2)))
    return Trajectory(time, np.cumsum(rng.normal(size=(n, 3)) * 4, axis=0), np.array(rotation))


# ---- rotations
@given(st.lists(st.floats(-1, 1), min_size=3, max_size=3), st.floats(0, np.pi - 1e-6))
def test_log_undoes_exp_up_to_half_a_turn(axis, angle):
    length = np.linalg.norm(axis)
    vector = np.zeros(3) if length < 1e-3 else np.array(axis) / length * angle
    R = rotation_exp(vector)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15 * 10)
    # near half a turn the angle's cosine is flat: its error is that of the trace over the sine of half the rest
    np.testing.assert_allclose(rotation_log(R), vector, atol=1e-9)


def test_half_a_turn_has_one_of_its_two_vectors():
    for axis in np.eye(3):
        R = rotation_exp(np.pi * axis)
        np.testing.assert_allclose(rotation_exp(rotation_log(R)), R, atol=1e-12)
        assert np.linalg.norm(rotation_log(R)) == pytest.approx(np.pi, abs=1e-9)


@pytest.mark.parametrize("size", [1e-6, 9.9e-3, 1.01e-2, 0.5, 3.0])
def test_left_jacobian_is_the_derivative_of_exp(size):
    rng = np.random.default_rng(3)
    v, dv = rng.normal(size=3), rng.normal(size=3)
    v *= size / np.linalg.norm(v)
    h = 1e-5
    change = (rotation_exp(v + h * dv) @ rotation_exp(v - h * dv).T - np.eye(3)) / (2 * h)
    skew = 0.5 * np.array([change[2, 1] - change[1, 2], change[0, 2] - change[2, 0], change[1, 0] - change[0, 1]])
    # central difference: h^2 times a third derivative of order 1 is 1e-10, rounding 1e-16 / h = 1e-11
    np.testing.assert_allclose(left_of_exp(v) @ dv, skew, atol=1e-8)


# ---- interpolation
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.floats(0, 1))
def test_velocity_and_spin_are_the_derivatives_of_the_pose(seed, share):
    path = wild(seed)
    t = float(path.time_s[0] + share * (path.time_s[-1] - path.time_s[0]))
    k = min(int(np.searchsorted(path.time_s, t, side="right")) - 1, len(path.time_s) - 2)
    # five points of one piece: its polynomials of degree 3 are differentiated without error of the formula; what is
    # left is rounding, 1e-16 * 40 m / h
    h = 2e-3 * float(path.time_s[k + 1] - path.time_s[k])
    t = float(np.clip(t, path.time_s[k] + 2 * h, path.time_s[k + 1] - 2 * h))
    at = [path.at(t + j * h) for j in (-2, -1, 0, 1, 2)]
    weight = np.array([1, -8, 0, 8, -1]) / (12 * h)
    velocity = sum(w * s.origin for w, s in zip(weight, at, strict=True))
    np.testing.assert_allclose(at[2].velocity, velocity, atol=1e-9 * 40)
    turning = sum(w * s.rotation for w, s in zip(weight, at, strict=True)) @ at[2].rotation.T
    spin = 0.5 * np.array([turning[2, 1] - turning[1, 2], turning[0, 2] - turning[2, 0], turning[1, 0] - turning[0, 1]])
    # the rotation is no polynomial: h^4 / 30 of its fifth derivative, (10 rad/s)^5, is 5e-8
    np.testing.assert_allclose(at[2].spin, spin, atol=1e-6)


def test_derivatives_hold_to_1e_9_on_a_drive():
    """A second apart at 15 m/s and 20 deg/s: rounding of 1e-14 m over 1e-3 s, and h^4 w^5 / 30 = 1e-15."""
    angle = np.radians(20) * np.arange(6)
    xyz = np.column_stack([43 * np.sin(angle), 43 * (1 - np.cos(angle)), 0 * angle])
    ypr = np.column_stack([np.degrees(angle), 0 * angle, 0 * angle])
    actor = Actor(**CAR, trajectory=keyframes(range(6), xyz, ypr))
    h = 1e-3
    for t in (0.4, 1.5, 3.7):
        b2, b1, now, a1, a2 = (state_of(actor, None, t + j * h) for j in (-2, -1, 0, 1, 2))
        np.testing.assert_allclose((8 * (a1.origin - b1.origin) - (a2.origin - b2.origin)) / (12 * h), now.velocity,
                                   atol=1e-9)  # fmt: skip
        yaw = [np.arctan2(s.rotation[1, 0], s.rotation[0, 0]) for s in (b2, b1, a1, a2)]
        assert (8 * (yaw[2] - yaw[1]) - (yaw[3] - yaw[0])) / (12 * h) == pytest.approx(now.yaw_rate, abs=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_pose_velocity_and_spin_are_continuous_and_meet_the_keyframes(seed):
    path = wild(seed)
    for k, t in enumerate(path.time_s):
        here = path.at(float(t))
        np.testing.assert_allclose(here.origin, path.position[k], atol=1e-12)
        np.testing.assert_allclose(here.rotation, path.rotation[k], atol=1e-12)
        for side in (-1e-9, 1e-9):
            near = path.at(float(t) + side)
            np.testing.assert_allclose(near.velocity, here.velocity, atol=1e-6)
            np.testing.assert_allclose(near.spin, here.spin, atol=1e-6)


def test_constant_acceleration_is_exact():
    times = np.array([0.0, 0.7, 1.0, 2.5, 3.0])
    path = Trajectory(
        times, np.column_stack([20 * times - 2 * times**2, 0 * times, 0 * times]), np.tile(np.eye(3), (5, 1, 1))
    )
    for t in np.linspace(0, 3, 13):
        assert path.at(t).origin[0] == pytest.approx(20 * t - 2 * t**2, abs=1e-12)
        assert path.at(t).velocity[0] == pytest.approx(20 - 4 * t, abs=1e-12)


def test_circle_of_ten_keyframes_a_second_keeps_its_speed():
    angle = np.radians(30) * np.arange(0, 3, 0.1)
    xyz = np.column_stack([20 * np.cos(angle), 20 * np.sin(angle), 0 * angle])
    ypr = np.column_stack([np.degrees(angle) + 90, 0 * angle, 0 * angle])
    actor = Actor(**CAR, trajectory=keyframes(np.arange(0, 3, 0.1), xyz, ypr))
    # h^2 / 6 of the third derivative, r w^3: 0.01 / 6 * 20 * 0.144 = 4.8 mm/s
    for t in np.linspace(0.2, 2.7, 21):
        state = state_of(actor, None, t)
        assert np.linalg.norm(state.velocity) == pytest.approx(20 * np.radians(30), abs=6e-3)
        assert state.yaw_rate == pytest.approx(np.radians(30), abs=1e-9)
        assert np.linalg.norm(state.origin) == pytest.approx(20, abs=1e-3)


def test_car_that_stops_does_not_roll_back():
    xyz = [(0, 0, 0), (8, 0, 0), (12, 0, 0), (13, 0, 0), (13, 0, 0), (13, 0, 0)]
    actor = Actor(**CAR, trajectory=keyframes(range(6), xyz))
    x = np.array([state_of(actor, None, t).origin[0] for t in np.linspace(0, 5, 101)])
    assert np.all(np.diff(x) >= -1e-12)
    assert x.max() == pytest.approx(13.0, abs=1e-12)


def test_turn_takes_the_short_way():
    actor = Actor(**CAR, trajectory=keyframes([0, 1], [(0, 0, 0)] * 2, [(170, 0, 0), (-170, 0, 0)]))
    middle = state_of(actor, None, 0.5)
    np.testing.assert_allclose(middle.rotation, Pose((0, 0, 0), (180, 0, 0)).rotation, atol=1e-12)
    assert middle.yaw_rate == pytest.approx(np.radians(20))


def test_pose_of_the_actor_is_the_frame_of_its_keyframes():
    moved = keyframes([0, 2], [(0, 0, 0), (10, 0, 0)])
    actor = Actor(**CAR, xyz_m=(5, 1, 0), ypr_deg=(90, 0, 0), trajectory=moved)
    state = state_of(actor, None, 1.0)
    np.testing.assert_allclose(state.origin, (5, 6, 0), atol=1e-12)
    np.testing.assert_allclose(state.velocity, (0, 5, 0), atol=1e-12)


def test_velocity_beside_a_trajectory_is_that_of_its_first_keyframe():
    ego = Ego(velocity_mps=(15, 0, 0), trajectory=keyframes([0, 1, 2], [(0, 0, 0), (14, 0, 0), (26, 0, 0)]))
    assert state_of(ego, None, 0.0).velocity[0] == 15.0
    assert state_of(ego, None, 1.0).velocity[0] == pytest.approx(13.0)


def test_steady_motion_is_what_it_was():
    ego = Ego(xyz_m=(1, 2, 0), velocity_mps=(8, 3, 0), yaw_rate_deg_s=20)
    assert ego_state(srt.Scene(ego=ego), 2.0).yaw_rate == pytest.approx(np.radians(20))
    assert not ego.has_trajectory
    assert ego.moves


# ---- ends
def test_beyond_its_keyframes_a_body_goes_on_for_one_interval_then_is_an_error():
    actor = Actor(**CAR, name="lead", trajectory=keyframes([0, 1, 2], [(0, 0, 0), (10, 0, 0), (20, 0, 0)]))
    assert state_of(actor, None, 2.9).origin[0] == pytest.approx(29)
    assert state_of(actor, None, -0.5).origin[0] == pytest.approx(-5)
    with pytest.raises(InputError, match=r"lead.*3.2 s is outside its keyframes, 0 to 2 s.*trajectory_outside: hold"):
        state_of(actor, None, 3.2)


def test_hold_stands_still_outside():
    actor = Actor(**CAR, trajectory=keyframes([0, 1], [(0, 0, 0), (10, 0, 0)]), trajectory_outside="hold")
    state = state_of(actor, None, 7.0)
    np.testing.assert_allclose(state.origin, (10, 0, 0))
    np.testing.assert_allclose(state.velocity, 0)


# ---- refusals
@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("trajectory: [{t_s: 0, xyz_m: [0, 0, 0]}]", "at least two keyframes"),
        ("trajectory: [{t_s: 1, xyz_m: [0, 0, 0]}, {t_s: 0.5, xyz_m: [1, 0, 0]}]", "sort them by time"),
        ("trajectory: [{t_s: 1, xyz_m: [0, 0, 0]}, {t_s: 1, xyz_m: [1, 0, 0]}]", "does not follow"),
        ("trajectory: [{t_s: 0, xyz_m: [0, 0]}, {t_s: 1, xyz_m: [1, 0, 0]}]", "three numbers"),
        ("trajectory: [{t_s: 0, xyz_m: [0, 0, 0]}, {t: 1, xyz_m: [1, 0, 0]}]", "t_s"),
        ("yaw_rate_deg_s: 3, trajectory: [{t_s: 0}, {t_s: 1}]", "contradict"),
        ("trajectory_file: a.csv", "needs trajectory_frame"),
        ("trajectory_file: a.csv, trajectory_frame: ros, trajectory: [{t_s: 0}, {t_s: 1}]", "not both"),
    ],
)
def test_bad_trajectories_name_the_line_and_what_is_wrong(tmp_path, entry, words):
    file = tmp_path / "s.yaml"
    file.write_text(f"version: 1\nego: {{{entry}}}\n")
    with pytest.raises(ConfigError, match=words) as error:
        srt.load_scene(file)
    assert f"{file}:2" in str(error.value)


# ---- recordings
ROWS = [
    (0.0, 1.0, 2.0, 0.0, 10.0, 0.0, 0.0),
    (1.0, 3.0, 2.5, 0.0, 20.0, 1.0, 0.0),
    (2.0, 6.0, 4.0, 0.0, 30.0, 0.0, 0.0),
]
HEADER = "t_s,x_m,y_m,z_m,yaw_deg,pitch_deg,roll_deg"


def write_csv(path, rows=ROWS, header=HEADER):
    path.write_text("\n".join([header, *(",".join(map(str, r)) for r in rows)]) + "\n")


@pytest.mark.parametrize(("frame", "sign"), [("ros", 1.0), ("carla", -1.0)])
def test_csv_and_json_recordings_are_read_in_the_axes_that_are_named(tmp_path, frame, sign):
    write_csv(tmp_path / "a.csv")
    items = [{"t_s": r[0], "xyz_m": r[1:4], "ypr_deg": r[4:]} for r in ROWS]
    (tmp_path / "b.json").write_text(json.dumps(items))
    (tmp_path / "c.json").write_text(json.dumps({"7": items, "5": items[:2]}))
    for file, extra in (("a.csv", {}), ("b.json", {}), ("c.json", {"trajectory_id": 7})):
        actor = Actor(**CAR, trajectory_file=file, trajectory_frame=frame, **extra)
        state = state_of(actor, tmp_path, 1.0)
        np.testing.assert_allclose(state.origin, (3.0, sign * 2.5, 0.0), atol=1e-12)
        expected = Pose((0, 0, 0), (sign * 20, 1, 0)).rotation
        np.testing.assert_allclose(state.rotation, expected, atol=1e-12)


def test_csv_with_ids_gives_each_actor_its_own_rows(tmp_path):
    rows = [(*r, number) for number in (5, 6) for r in ROWS]
    rows[3] = (0.0, 50.0, *rows[3][2:])
    write_csv(tmp_path / "all.csv", rows, HEADER + ",id")
    options = {"shape": "box:1x1x1", "trajectory_file": "all.csv", "trajectory_frame": "ros"}
    assert state_of(Actor(id=5, **options), tmp_path, 0.0).origin[0] == 1.0
    assert state_of(Actor(id=6, **options), tmp_path, 0.0).origin[0] == 50.0
    with pytest.raises(ConfigError, match=r"no vehicle 9; ids in it: 5, 6; say which by trajectory_id"):
        state_of(Actor(id=9, **options), tmp_path, 0.0)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", "t_s,x_m\n0,1\n", r"a.csv:1: columns .*y_m.* are missing"),
        ("a.csv", HEADER + "\n0,1,2,x,0,0,0\n", r"a.csv:2: z_m: a number is needed, got 'x'"),
        ("a.csv", HEADER + "\n0,1,2,nan,0,0,0\n", r"a.csv:2: .*finite"),
        ("a.csv", HEADER + "\n", "no rows"),
        ("a.csv", HEADER + "\n1,0,0,0,0,0,0\n0,0,0,0,0,0,0\n", "sort them by time"),
        ("a.json", "{", "not valid JSON"),
        ("a.json", '[{"t_s": 0, "pos": [0, 0, 0]}]', "keyframe 0: keys t_s, xyz_m and ypr_deg"),
        ("a.json", '[{"t_s": 0, "xyz_m": [0, 0]}]', "three numbers"),
        ("a.txt", "", "is .csv, .json or a folder"),
    ],
)
def test_broken_recordings_are_refused_with_their_place(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    actor = Actor(**CAR, trajectory_file=name, trajectory_frame="ros")
    with pytest.raises(ConfigError, match=words):
        state_of(actor, tmp_path, 0.0)


def carla_vector(x, y, z):
    return SimpleNamespace(x=x, y=y, z=z)


def carla_state(x, y, z, yaw):
    turn = SimpleNamespace(pitch=0.0, yaw=yaw, roll=0.0)
    place = SimpleNamespace(location=carla_vector(x, y, z), rotation=turn)
    zero = carla_vector(0.0, 0.0, 0.0)
    return SimpleNamespace(get_transform=lambda: place, get_velocity=lambda: zero, get_angular_velocity=lambda: zero)


def test_what_the_carla_recorder_writes_is_replayed(tmp_path):
    from shenron_rt.io.carla_record import side_record, write_tick

    box = SimpleNamespace(location=carla_vector(0.0, 0.0, 0.0), extent=carla_vector(0.2, 0.2, 0.93))
    walker = SimpleNamespace(id=88, type_id="walker.pedestrian.0001", bounding_box=box)
    for k in range(4):
        states = {24: carla_state(100 + k, 50.0, 0.0, 0.0), 88: carla_state(120.0, 48 + 0.15 * k, 0.93, 90.0)}
        snapshot = SimpleNamespace(frame=300 + k, find=states.get)
        place = states[24].get_transform()
        cloud = SimpleNamespace(frame=300 + k, timestamp=33.0 + 0.1 * k, transform=place, raw_data=b"")
        write_tick(tmp_path / "drive", "roof", cloud, side_record(cloud, snapshot, 24, [walker], {}))
    options = {"trajectory_file": "drive", "trajectory_frame": "carla"}
    ego = state_of(Ego(**options), tmp_path, 0.2)
    np.testing.assert_allclose(ego.origin, (102, -50, 0), atol=1e-9)
    np.testing.assert_allclose(ego.velocity, (10, 0, 0), atol=1e-6)
    feet = state_of(Actor(id=88, shape="pedestrian", **options), tmp_path, 0.1)
    np.testing.assert_allclose(feet.origin, (120, -48.15, 0), atol=1e-9)
    np.testing.assert_allclose(feet.velocity, (0, -1.5, 0), atol=1e-6)
    assert np.degrees(np.arctan2(feet.rotation[1, 0], feet.rotation[0, 0])) == pytest.approx(-90)
    mesh = srt.Scene().folder / "own.obj"
    assert state_of(Actor(id=88, mesh=mesh, **options), tmp_path, 0.1).origin[2] == pytest.approx(0.93)
    with pytest.raises(ConfigError, match="trajectory_frame: carla"):
        state_of(Ego(trajectory_file="drive", trajectory_frame="ros"), tmp_path, 0.0)


def test_scene_with_a_trajectory_survives_its_own_config(tmp_path):
    scene = srt.Scene(
        ego={"velocity_mps": (15, 0, 0), "trajectory": keyframes([0, 1, 2], [(0, 0, 0), (15, 0, 0), (28, 0, 0)])},
        actors=[{**CAR, "trajectory": keyframes([0, 2], [(30, 0, 0), (40, 0, 0)])}],
    )
    again = srt.Scene(**scene.model_dump())
    for t in (0.0, 0.3, 1.7):
        for a, b in ((scene.ego, again.ego), (scene.actors[0], again.actors[0])):
            np.testing.assert_array_equal(state_of(a, None, t).velocity, state_of(b, None, t).velocity)


def test_validate_finds_a_recording_that_cannot_be_replayed(tmp_path, capsys):
    from shenron_rt.cli import main

    write_csv(tmp_path / "drive.csv", ROWS[::-1])
    (tmp_path / "s.yaml").write_text("version: 1\nego: {trajectory_file: drive.csv, trajectory_frame: ros}\n")
    assert main(["validate", str(tmp_path / "s.yaml")]) == 2
    assert "sort them by time" in capsys.readouterr().err
