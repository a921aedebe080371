"""The recorder's pure parts: pairing by frame, layouts that read back, transforms as the official client has them."""

from __future__ import annotations

import importlib.util
import itertools
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shenron_rt.errors import InputError
from shenron_rt.frames import from_carla_points, from_carla_pose
from shenron_rt.io.carla_record import TickPairing, actor_record, side_record, transform_record, write_radar, write_tick
from shenron_rt.io.recorded import read_carla_radar
from shenron_rt.lidar import read_semantic_lidar, read_side_file

POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("cos", "<f4"), ("id", "<u4"), ("tag", "<u4")])


def vector(x: float, y: float, z: float) -> SimpleNamespace:
    return SimpleNamespace(x=x, y=y, z=z)


def transform(location: Any, pitch: float = 0.0, yaw: float = 0.0, roll: float = 0.0) -> SimpleNamespace:
    return SimpleNamespace(
        location=vector(*location), rotation=SimpleNamespace(pitch=pitch, yaw=yaw, roll=roll)
    )  # fmt: skip


def state(place: Any, velocity: Any = (0, 0, 0), spin: Any = (0, 0, 0)) -> SimpleNamespace:
    return SimpleNamespace(
        get_transform=lambda: place,
        get_velocity=lambda: vector(*velocity),
        get_angular_velocity=lambda: vector(*spin),
    )


def snapshot(frame: int, states: dict[int, Any]) -> SimpleNamespace:
    return SimpleNamespace(frame=frame, find=states.get)


def actor(number: int, kind: str = "vehicle.lincoln.mkz_2020") -> SimpleNamespace:
    box = SimpleNamespace(location=vector(0.1, 0.0, 0.75), extent=vector(2.4, 0.9, 0.75))
    return SimpleNamespace(id=number, type_id=kind, bounding_box=box)


def cloud(frame: int, place: Any, rows: list[Any], timestamp: float = 0.0) -> SimpleNamespace:
    raw = np.array(rows, dtype=POINT).tobytes()
    return SimpleNamespace(frame=frame, timestamp=timestamp, transform=place, raw_data=raw)


# ---- pairing
@settings(max_examples=60, deadline=None)
@given(order=st.permutations(range(18)))
def test_whatever_the_order_only_data_of_the_same_frame_are_paired(order: list[int]) -> None:
    # six frames, of each the state and two sensors
    events = list(itertools.product(range(100, 106), ("state", "lidar", "radar")))
    pairing, ticks = TickPairing(["lidar", "radar"]), []
    for frame, what in (events[i] for i in order):
        if what == "state":
            pairing.state(frame, ("state", frame))
        else:
            pairing.measurement(what, frame, (what, frame))
        ticks += pairing.complete()
    assert sorted(t.frame for t in ticks) == list(range(100, 106))
    assert all(t.state == ("state", t.frame) for t in ticks)
    assert all(t.data == {"lidar": ("lidar", t.frame), "radar": ("radar", t.frame)} for t in ticks)
    assert (pairing.incomplete, pairing.late) == (0, 0)


def test_a_frame_whose_data_never_come_is_given_up_and_counted_and_its_late_data_go_nowhere() -> None:
    pairing, done = TickPairing(["lidar", "radar"], patience=4), []
    for frame in range(10):
        pairing.state(frame, frame)
        pairing.measurement("lidar", frame, frame)
        if frame != 3:
            pairing.measurement("radar", frame, frame)
        done += [t.frame for t in pairing.complete()]
    assert done == [0, 1, 2, 4, 5, 6, 7, 8, 9]
    assert pairing.incomplete == 1
    pairing.measurement("radar", 3, 3)
    assert pairing.late == 1
    assert pairing.complete() == []


def test_ticks_between_those_of_a_sensor_are_no_loss_and_do_not_pile_up() -> None:
    pairing, done = TickPairing(["lidar"], patience=8), []
    for frame in range(400):
        pairing.state(frame, frame)
        if frame % 4 == 0:
            pairing.measurement("lidar", frame, frame)
        done += [t.frame for t in pairing.complete()]
    assert done == list(range(0, 400, 4))
    assert pairing.incomplete == 0
    assert len(pairing._states) <= 9


def test_an_unknown_sensor_is_refused() -> None:
    with pytest.raises(InputError, match=r"unknown sensor 'camera'; known: lidar"):
        TickPairing(["lidar"]).measurement("camera", 1, None)
    with pytest.raises(InputError, match="different names"):
        TickPairing(["lidar", "lidar"])


# ---- layouts
def a_turning_frame(frame: int = 7) -> tuple[Any, Any, list[Any]]:
    """Return an ego that heads to yaw 90 (+y), turns, and follows a car 10 m ahead."""
    ego_place = transform((200.0, 50.0, 0.0), yaw=90.0)
    states = {
        1: state(ego_place, velocity=(0.0, 12.0, 0.0), spin=(0.0, 0.0, 30.0)),
        2: state(transform((200.0, 60.0, 0.0), yaw=90.0), velocity=(0.0, 9.0, 0.0), spin=(0.0, 0.0, -10.0)),
    }
    lidar = transform((200.0, 50.0, 2.4), yaw=90.0)
    points = cloud(frame, lidar, [(10.0, -1.0, -2.0, 0.5, 2, 14), (5.0, 2.0, -2.4, 0.4, 0, 1)], timestamp=0.35)
    return points, snapshot(frame, states), [actor(1), actor(2), actor(3)]


def test_a_recorded_frame_reads_back_with_places_and_velocities_in_our_axes(tmp_path: Path) -> None:
    points, world, actors = a_turning_frame()
    side = side_record(points, world, 1, actors, {"carla_version": "0.9.16", "town": None})
    path = write_tick(tmp_path, "roof", points, side)
    assert sorted(f.name for f in tmp_path.iterdir()) == ["roof_00000007.bin", "roof_00000007.meta.yaml"]
    meta = read_side_file(path.with_suffix("").with_suffix(".meta.yaml"))
    assert meta.ego_velocity == pytest.approx([12.0, 0.0, 0.0], abs=1e-9)
    assert np.degrees(meta.ego_yaw_rate) == pytest.approx(-30.0)  # CARLA's yaw grows to the right
    assert sorted(meta.actors) == [1, 2]  # 3 is not in this frame's snapshot
    assert meta.actors[2].velocity == pytest.approx([9.0, 0.0, 0.0], abs=1e-9)
    assert meta.actors[2].origin == pytest.approx([10.0, 0.0, 0.0], abs=1e-6)
    assert meta.sensor_pose is not None
    assert meta.sensor_pose.xyz == pytest.approx((0.0, 0.0, 2.4), abs=1e-9)
    frame = read_semantic_lidar(
        path, tag_table="0.9.14", frame="carla", side_file=tmp_path / "roof_00000007.meta.yaml", grid=(64, 10, -30, 0.5)
    )
    assert frame.position == pytest.approx(np.array([[10.0, 1.0, -2.0], [5.0, -2.0, -2.4]]), abs=1e-6)
    assert frame.object_id.tolist() == [2, 0]


def test_a_cloud_is_never_written_with_the_state_of_another_frame() -> None:
    points, world, actors = a_turning_frame()
    world.frame = 8
    with pytest.raises(InputError, match="measurement of frame 7 with the state of frame 8"):
        side_record(points, world, 1, actors, {})
    world.frame = 7
    with pytest.raises(InputError, match="ego actor 5 is not in the snapshot"):
        side_record(points, world, 5, actors, {})


def test_bytes_that_are_not_whole_points_are_refused(tmp_path: Path) -> None:
    points, world, actors = a_turning_frame()
    side = side_record(points, world, 1, actors, {})
    points.raw_data = points.raw_data[:-1]
    with pytest.raises(InputError, match="47 bytes are not whole points"):
        write_tick(tmp_path, "roof", points, side)
    assert list(tmp_path.iterdir()) == []


def test_carlas_own_radar_reads_back(tmp_path: Path) -> None:
    rows = np.array([[-5.0, 0.3, 0.1, 20.0]], dtype="<f4")
    path = write_radar(tmp_path, "radar", SimpleNamespace(frame=12, raw_data=rows.tobytes()))
    found = read_carla_radar(path)
    assert found.azimuth == pytest.approx([-0.3], abs=1e-6)
    assert found.velocity == pytest.approx([-5.0])


# ---- the script, with a world that is late
def _script() -> ModuleType:
    path = Path(__file__).resolve().parents[1] / "examples" / "carla_recorder.py"
    spec = importlib.util.spec_from_file_location("carla_recorder", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class LateSensor:
    """Delivers each measurement two ticks after its own."""

    def __init__(self) -> None:
        self.queue: list[Any] = []
        self.callback: Any = None

    def listen(self, callback: Any) -> None:
        self.callback = callback

    def tick(self, measurement: Any) -> None:
        self.queue.append(measurement)
        if len(self.queue) > 2:
            self.callback(self.queue.pop(0))


def test_the_recorder_writes_each_cloud_with_the_pose_of_its_own_tick_though_it_comes_two_ticks_late(
    tmp_path: Path,
) -> None:
    sensor, ego = LateSensor(), actor(1)
    world = SimpleNamespace(get_actors=lambda: [ego, actor(2), actor(9, "spectator")])
    recorder = _script().Recorder(world, ego, {"roof": sensor}, tmp_path, {"town": "Town01"})
    for frame in range(20):
        yaw = 3.0 * frame  # 30 deg/s at 10 Hz
        place = transform((0.0, 0.0, 0.0), yaw=yaw)
        states = {1: state(place), 2: state(transform((float(frame), 0.0, 0.0)))}
        recorder.on_tick(snapshot(frame, states))
        mast = transform((0.0, 0.0, 2.5), yaw=yaw)
        sensor.tick(cloud(frame, mast, [(5.0, 0.0, -2.5, 0.5, 0, 1)], timestamp=0.1 * frame))
        recorder.write()
    assert recorder.written == 18
    assert recorder.pairing.incomplete == 0
    import yaml

    for frame in range(18):
        side = yaml.safe_load((tmp_path / f"roof_{frame:08d}.meta.yaml").read_text())
        assert (
            side["sensor_transform"]["rotation_deg"]["yaw"]
            == side["ego_transform"]["rotation_deg"]["yaw"]
            == 3.0 * frame
        )
        assert [a["location"][0] for a in side["actors"]] == [0.0, float(frame)]  # the spectator is no actor
        assert side["timestamp_s"] == pytest.approx(0.1 * frame)


def test_the_script_explains_itself_without_carla(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        _script().parse(["--help"])
    assert end.value.code == 0
    assert "--lidar-at" in capsys.readouterr().out


# ---- the official client as the oracle
angles = st.floats(-180, 180)
lengths = st.floats(-500, 500)


@settings(max_examples=40, deadline=None)
@given(
    place=st.tuples(lengths, lengths, lengths), turn=st.tuples(angles, angles, angles), point=st.tuples(*[lengths] * 3)
)
def test_transforms_are_those_of_the_official_client(place: Any, turn: Any, point: Any) -> None:
    carla = pytest.importorskip("carla", reason="the carla wheel is not installed")
    pitch, yaw, roll = turn
    theirs = carla.Transform(carla.Location(*place), carla.Rotation(pitch=pitch, yaw=yaw, roll=roll))
    world = theirs.transform(carla.Location(*point))
    record = transform_record(theirs)
    angles_deg = record["rotation_deg"]
    pose = from_carla_pose(record["location"], [angles_deg[k] for k in ("pitch", "yaw", "roll")])
    ours = pose.apply(from_carla_points([point]))[0] * [1, -1, 1]
    # float32 inside CARLA: 1e3 m at 2^-24, over a matrix of a few operations
    assert ours == pytest.approx([world.x, world.y, world.z], abs=2e-3)


def test_velocities_in_ego_axes_are_those_of_the_official_client() -> None:
    carla = pytest.importorskip("carla", reason="the carla wheel is not installed")
    ego = carla.Transform(carla.Location(3, 4, 0), carla.Rotation(pitch=4, yaw=70, roll=-3))
    speed = carla.Vector3D(3.0, -8.0, 0.5)
    axes = (ego.get_forward_vector(), ego.get_right_vector(), ego.get_up_vector())
    expected = [a.x * speed.x + a.y * speed.y + a.z * speed.z for a in axes]
    moving = SimpleNamespace(
        get_transform=lambda: ego, get_velocity=lambda: speed, get_angular_velocity=lambda: vector(0, 0, 0)
    )
    record = actor_record(actor(1), moving, moving)
    assert record["velocity_in_ego_axes_m_s"] == pytest.approx(expected, abs=1e-5)
