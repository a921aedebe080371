"""MCAP files, read back with the mcap library and the schemas inside them."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export_tools import (
    EPOCH_NS,
    STREET,
    columns_of,
    distance_to_mesh,
    in_world,
    matrices,
    moved,
    read_mcap,
    run_scene,
    unpack,
)

import shenron_rt as srt
from shenron_rt.cli import main

pytest.importorskip("foxglove", reason="foxglove-sdk is not installed (extra mcap)")
pytest.importorskip("mcap_protobuf", reason="mcap-protobuf-support is not installed (extra test)")

CAR = 101
Messages = dict[str, list[Any]]


@pytest.fixture(scope="module")
def drive(street_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mcap") / "drive.mcap"
    assert main(["export", str(street_run), "--to", "mcap", "-o", str(path), "--lidar"]) == 0
    return path


@pytest.fixture(scope="module")
def read(drive: Path) -> Messages:
    return read_mcap(drive)


def _frames(run: Path, radar: str = "front") -> list[Path]:
    return sorted((run / "radars" / radar).iterdir())


def test_every_topic_has_a_message_a_frame_and_a_schema_that_decodes(read: Messages) -> None:
    assert {topic: (len(m), m[0].schema) for topic, m in read.items()} == {
        "/tf": (3, "foxglove.FrameTransforms"),
        "/scene": (1, "foxglove.SceneUpdate"),
        "/radar/front/points": (3, "foxglove.PointCloud"),
        "/radar/front/range_doppler": (3, "foxglove.CompressedImage"),
        "/radar/front/range_azimuth": (3, "foxglove.CompressedImage"),
        "/radar/front/objects": (3, "shenron_rt.Objects"),
        "/radar/front/strongest": (3, "shenron_rt.Strongest"),
        "/link_budget": (3, "foxglove.Log"),
        "/lidar/roof/points": (3, "foxglove.PointCloud"),
    }


def test_time_stamps_are_scene_seconds_of_mid_frame_after_the_fixed_epoch(read: Messages) -> None:
    mid = srt.load_profile("awrl1432").frame_mid_s
    wanted = [EPOCH_NS + round((0.1 * k + mid) * 1e9) for k in range(3)]
    for topic, messages in read.items():
        assert [m.time for m in messages] == (wanted if len(messages) == 3 else wanted[:1]), topic
    cloud = read["/radar/front/points"][1].message
    assert cloud.timestamp.ToNanoseconds() == wanted[1]
    assert {t.timestamp.ToNanoseconds() for t in read["/tf"][2].message.transforms} == {wanted[2]}


def test_radar_clouds_hold_the_detections_of_the_run(street_run: Path, read: Messages) -> None:
    for folder, entry in zip(_frames(street_run), read["/radar/front/points"], strict=True):
        assert entry.message.frame_id == "radar/front"
        columns, table = unpack(entry.message), columns_of(folder / "detections.csv")
        assert list(columns) == ["x", "y", "z", "velocity", "snr_db", "rcs_dbsm", "object_id", "tag", "ghost"]
        for name, column in columns.items():
            # coordinates and levels are float32 in the file
            np.testing.assert_array_equal(column, table[name].astype(column.dtype), err_msg=name)
        assert len(columns["x"]) > 0
        assert CAR in columns["object_id"]


def test_transforms_put_hit_points_on_the_mesh_and_detections_within_a_range_cell(
    street_run: Path, read: Messages
) -> None:
    (car,) = [e for e in read["/scene"][0].message.entities if e.id == "lead"]
    assert (car.frame_id, car.frame_locked) == ("body/lead", True)
    for k, folder in enumerate(_frames(street_run)):
        tree = matrices(read["/tf"][k].message)
        to_car = np.linalg.inv(in_world(tree, "body/lead")) @ in_world(tree, "radar/front")
        hits = srt.Scatterers.load(folder / "scatterers.npz")
        own = hits.position[hits.object_id == CAR]
        # positions are hit points on triangles in float64, vertices and poses doubles in the file
        assert distance_to_mesh(car, moved(to_car, own[:: len(own) // 50])).max() < 1e-6
        columns = unpack(read["/radar/front/points"][k].message)
        points = np.column_stack([columns[a] for a in "xyz"]).astype(float)[columns["object_id"] == CAR]
        cell = srt.load_profile("awrl1432").range_resolution_m
        assert len(points) > 0
        assert distance_to_mesh(car, moved(to_car, points)).max() < cell


def test_the_ego_vehicle_and_the_car_move_and_static_bodies_do_not(read: Messages) -> None:
    mid = srt.load_profile("awrl1432").frame_mid_s
    for k, entry in enumerate(read["/tf"]):
        tree, t = matrices(entry.message), 0.1 * k + mid
        np.testing.assert_allclose(in_world(tree, "ego")[:3, 3], [15 * t, 0, 0], atol=1e-9)
        np.testing.assert_allclose(in_world(tree, "body/lead")[:3, 3], [29.25 + 10 * t, 0, 0], atol=1e-9)
        np.testing.assert_allclose(in_world(tree, "radar/front")[:3, 3], [15 * t + 2, 0, 1], atol=1e-9)
        np.testing.assert_allclose(in_world(tree, "lidar/roof")[:3, 3], [15 * t, 0, 2.5], atol=1e-9)
        assert set(tree) == {"ego", "radar/front", "lidar/roof", "body/lead"}
    entities = {e.id: e for e in read["/scene"][0].message.entities}
    assert set(entities) == {"road", "left_wall", "right_wall", "lead"}
    assert {e.frame_id for name, e in entities.items() if name != "lead"} == {"world"}
    # the face of a wall of 0.3 m at y = 4.15 m
    on_wall = distance_to_mesh(entities["left_wall"], np.array([[10.0, 4.0, 1.0], [80.0, 4.3, 2.0]]))
    np.testing.assert_allclose(on_wall, 0, atol=1e-9)


def test_lidar_points_lie_on_the_scene(read: Messages) -> None:
    entities = {e.id: e for e in read["/scene"][0].message.entities}
    entry, tree = read["/lidar/roof/points"][2].message, matrices(read["/tf"][2].message)
    columns = unpack(entry)
    assert entry.frame_id == "lidar/roof"
    world = moved(in_world(tree, "lidar/roof"), np.column_stack([columns[a] for a in "xyz"]).astype(float))
    on_car = columns["object_id"] == CAR
    to_car = np.linalg.inv(in_world(tree, "body/lead"))
    # coordinates up to 100 m are float32: half an ulp is 4 um, and the tracer's own hits are float32 too
    assert distance_to_mesh(entities["lead"], moved(to_car, world[on_car])).max() < 1e-4
    road = columns["tag"] == int(srt.SemanticTag.Roads)
    assert np.abs(world[road, 2]).max() < 1e-4
    assert min(on_car.sum(), road.sum()) > 20


def test_pictures_are_png_of_the_size_that_plot_draws(read: Messages) -> None:
    from matplotlib.image import imread

    for name, shape in (("range_doppler", (660, 836)), ("range_azimuth", None)):
        message = read[f"/radar/front/{name}"][0].message
        assert message.format == "png"
        pixels = imread(io.BytesIO(message.data), format="png")
        assert shape is None or pixels.shape[:2] == shape
        assert pixels[..., :3].std() > 0.05  # something is drawn


def test_link_budget_adds_up_and_is_that_of_the_run(street_run: Path, read: Messages) -> None:
    summary = json.loads((street_run / "summary.json").read_text())["radars"][0]["frames"]
    for record, entry, text in zip(summary, read["/radar/front/objects"], read["/link_budget"], strict=True):
        objects = {o["id"]: o for o in entry.message["objects"]}
        assert set(objects) == {o["id"] for o in record["objects"] if o["id"]}
        for told in record["objects"]:
            if not told["id"]:
                continue
            o = objects[told["id"]]
            terms = ("tx_power_dbm", "gain_db", "pattern_db", "spreading_db", "loss_db", "rcs_dbsm")
            assert sum(o[t] for t in terms) == pytest.approx(o["power_dbm"], abs=1e-9)
            assert o["power_dbm"] == pytest.approx(told["power_dbw"] + 30, abs=1e-9)
            assert (o["snr_db"], o["detected"], o["name"]) == (told["snr_db"], told["detected"], told["name"])
            assert f"{told['name']} ({told['id']}, {told['tag']})" in text.message.message
        assert f"SNR {record['strongest']['snr_db']:.1f} dB" in text.message.message
        assert text.message.name == "front"
    car = {o["id"]: o for o in read["/radar/front/objects"][0].message["objects"]}[CAR]
    # 25 m ahead and 5 m/s slower: lambda^2/((4 pi)^3 R^4) for 3.9 mm
    assert car["range_m"] == pytest.approx(25.0, abs=0.3)
    assert car["spreading_db"] == pytest.approx(20 * np.log10(299792458 / 77.2e9) - 32.98 - 40 * np.log10(25), abs=0.3)
    assert (car["gain_db"], car["tx_power_dbm"]) == (12.0, 10.0)


def test_strongest_is_that_of_the_summary(street_run: Path, read: Messages) -> None:
    summary = json.loads((street_run / "summary.json").read_text())["radars"][0]["frames"]
    for record, entry in zip(summary, read["/radar/front/strongest"], strict=True):
        number = record["strongest"]["object_id"]
        known = {"frame": record["frame"], "chain": str(number), "ghost": False}
        assert entry.message == known | record["strongest"]


TURN = """
version: 1
name: turn
ego: {xyz_m: [3, -2, 0], ypr_deg: [20, 0, 0], velocity_mps: [8, 3, 0], yaw_rate_deg_s: 30}
static:
  - {name: post, shape: "pole:h=3,r=0.3", xyz_m: [22, 12, 0], ypr_deg: [15, 0, 0], id: 60, aim: 4000}
actors:
  - {id: 101, shape: car, xyz_m: [24, 5, 0], ypr_deg: [70, 0, 0], velocity_mps: [2, 6, 0], yaw_rate_deg_s: -25}
radars:
  - {name: left, profile: radarbook, xyz_m: [2.0, 0.5, 1.0], ypr_deg: [10, 2, 1]}
"""


def test_a_turning_ego_keeps_points_on_turning_and_static_bodies(tmp_path: Path) -> None:
    (tmp_path / "turn.yaml").write_text(TURN)
    run = run_scene(tmp_path / "run", str(tmp_path / "turn.yaml"), "--frames", "1:3")
    assert main(["export", str(run), "--to", "mcap"]) == 0
    found = read_mcap(tmp_path / "run.mcap")
    entities = {e.metadata[0].value: e for e in found["/scene"][0].message.entities}
    assert {i: (e.id, e.frame_id) for i, e in entities.items()} == {
        "60": ("post", "world"), "101": ("object_101", "body/object_101"),
    }  # fmt: skip
    mid = srt.load_profile("radarbook").frame_mid_s
    for k, folder in enumerate(_frames(run, "left")):
        tree = matrices(found["/tf"][k].message)
        heading = np.degrees(np.arctan2(*in_world(tree, "ego")[[1, 0], 0]))
        assert heading == pytest.approx(20 + 30 * (0.1 * (k + 1) + mid), abs=1e-6)
        hits = srt.Scatterers.load(folder / "scatterers.npz")
        for number, entity in entities.items():
            own = hits.position[hits.object_id == int(number)]
            assert len(own) > 50
            pose = np.eye(4) if entity.frame_id == "world" else in_world(tree, entity.frame_id)
            to_body = np.linalg.inv(pose) @ in_world(tree, "radar/left")
            # without the turn during the 0.1 s between frames a point at 20 m would be off by a metre
            assert distance_to_mesh(entity, moved(to_body, own[:: len(own) // 20])).max() < 1e-6


def test_wheels_turn_in_frames_of_their_own(tmp_path: Path) -> None:
    scene = STREET.replace("shape: car,", "shape: car, articulation: auto,")
    (tmp_path / "street.yaml").write_text(scene)
    run = run_scene(tmp_path / "run", str(tmp_path / "street.yaml"), "--frames", "1:2")
    assert main(["export", str(run), "--to", "mcap", "--no-pictures"]) == 0
    found = read_mcap(tmp_path / "run.mcap")
    tree = matrices(found["/tf"][0].message)
    parts = [e for e in found["/scene"][0].message.entities if e.id.split("/")[0] == "lead"]
    assert len(parts) == 5  # the body and four wheels
    hits = srt.Scatterers.load(run / "radars/front/frame_000001/scatterers.npz")
    own = hits.position[hits.object_id == CAR]
    own = own[:: max(1, len(own) // 100)]
    to_world = in_world(tree, "radar/front")
    nearest = [distance_to_mesh(e, moved(np.linalg.inv(in_world(tree, e.frame_id)) @ to_world, own)) for e in parts]
    assert np.min(nearest, axis=0).max() < 1e-6


def test_the_same_run_gives_the_same_bytes(street_run: Path, tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert (
            main(["export", str(street_run), "--to", "mcap", "--frames", "0:1", "-o", str(tmp_path / f"{name}.mcap")])
            == 0
        )
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()
