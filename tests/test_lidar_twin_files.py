"""What a cast frame looks like on disk: CARLA's bytes, and that the readers give back what was written."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lidar_twin_tools import ROOF, street

import shenron_rt as srt
from shenron_rt.cli import main
from shenron_rt.errors import InputError
from shenron_rt.lidar import LidarFrame, lidar_scatterers, read_semantic_lidar, read_side_file
from shenron_rt.lidar.readers import read_points
from shenron_rt.lidar.side_writer import scene_side_file, write_side_file
from shenron_rt.lidar.writers import carla_records, write_semantic_lidar
from shenron_rt.runs import verify_manifest

HEADER = b"""ply
format ascii 1.0
element vertex %d
property float32 x
property float32 y
property float32 z
property float32 CosAngle
property uint32 ObjIdx
property uint32 ObjTag
end_header
"""


@pytest.fixture(scope="module")
def twin() -> LidarFrame:
    return srt.cast_lidar(street(), time=0.4)


def _back(path: Path, twin: LidarFrame, **options: object) -> LidarFrame:
    return read_semantic_lidar(path, tag_table="0.9.14", frame="carla", grid=twin.grid, **options)


# ---- points
def test_ply_is_what_save_to_disk_writes(tmp_path: Path, twin: LidarFrame) -> None:
    write_semantic_lidar(tmp_path / "f.ply", twin)
    content = (tmp_path / "f.ply").read_bytes()
    assert content.startswith(HEADER % len(twin))
    rows = content[len(HEADER % len(twin)) :].decode("ascii").splitlines()
    assert len(rows) == len(twin)
    x, y, z = twin.position[7].astype(np.float32)
    cos = np.float32(twin.cos_incidence[7])
    assert rows[7] == f"{x:.4f} {-y:.4f} {z:.4f} {cos:.4f} {twin.object_id[7]} {twin.tag[7]}"


def test_header_and_rows_have_the_form_of_a_stored_frame(shared_data: Path, tmp_path: Path) -> None:
    stored = shared_data / "semlidar_synth_town01/frame_town01_0916.ply"
    source = stored.with_suffix(".bin")
    frame = read_semantic_lidar(source, tag_table="0.9.14", frame="carla")
    write_semantic_lidar(tmp_path / "f.ply", frame)
    assert (tmp_path / "f.ply").read_bytes() == stored.read_bytes()
    write_semantic_lidar(tmp_path / "f.bin", frame)
    assert (tmp_path / "f.bin").read_bytes() == source.read_bytes()
    write_semantic_lidar(tmp_path / "f.npy", frame)
    written, given = np.load(tmp_path / "f.npy"), np.load(source.with_name("frame_town01_0916_struct.npy"))
    assert written.dtype == given.dtype
    np.testing.assert_array_equal(written, given)


@pytest.mark.parametrize("layout", ["bin", "npy"])
def test_records_come_back_to_the_bit(tmp_path: Path, twin: LidarFrame, layout: str) -> None:
    file = tmp_path / f"f.{layout}"
    write_semantic_lidar(file, twin)
    back = _back(file, twin)
    np.testing.assert_array_equal(carla_records(back), carla_records(twin))
    np.testing.assert_array_equal(back.position.astype(np.float32), twin.position.astype(np.float32))
    np.testing.assert_array_equal(back.object_id, twin.object_id)
    np.testing.assert_array_equal(back.tag, twin.tag)
    header = {"bin": 0, "npy": 192}[layout]  # NumPy pads its header to a multiple of 64 bytes
    assert file.stat().st_size == 24 * len(twin) + header


def test_ply_comes_back_to_its_four_decimals(tmp_path: Path, twin: LidarFrame) -> None:
    write_semantic_lidar(tmp_path / "f.ply", twin)
    back = _back(tmp_path / "f.ply", twin)
    # half of the last decimal, and half a float32 ulp at 64 m
    np.testing.assert_allclose(back.position, twin.position, rtol=0, atol=0.5e-4 + 4e-6)
    np.testing.assert_allclose(back.cos_incidence, twin.cos_incidence, rtol=0, atol=0.5e-4 + 1e-7)
    np.testing.assert_array_equal(back.object_id, twin.object_id)
    np.testing.assert_array_equal(back.tag, twin.tag)


def test_every_id_and_tag_survives(tmp_path: Path, twin: LidarFrame) -> None:
    ids = np.resize(np.array([0, 1, 2**24 + 1, 2**31, 2**32 - 1], dtype=np.uint32), len(twin))
    tags = np.resize(np.arange(1, 29, dtype=np.uint8), len(twin))
    for layout in ("ply", "bin", "npy"):
        file = tmp_path / f"f.{layout}"
        write_semantic_lidar(file, replace(twin, object_id=ids, tag=tags))
        raw = read_points(file)
        np.testing.assert_array_equal(raw.object_id, ids)
        np.testing.assert_array_equal(raw.tag, tags)


def test_an_unknown_ending_is_refused(tmp_path: Path, twin: LidarFrame) -> None:
    with pytest.raises(InputError, match=r"unknown ending '.las'.*\.ply, \.bin, \.npy"):
        write_semantic_lidar(tmp_path / "f.las", twin)


# ---- side files
@pytest.mark.parametrize("layout", ["own", "carla"])
def test_side_file_gives_back_velocities_and_poses(tmp_path: Path, twin: LidarFrame, layout: str) -> None:
    write_side_file(tmp_path / "f.yaml", scene_side_file(street(), ROOF, 0.4), layout=layout)
    write_semantic_lidar(tmp_path / "f.bin", twin)
    back = _back(tmp_path / "f.bin", twin, side_file=tmp_path / "f.yaml")
    assert back.sensor_pose is not None
    assert back.velocity is not None
    np.testing.assert_allclose(back.sensor_pose.rotation, ROOF.pose.rotation, atol=1e-12)
    np.testing.assert_allclose(back.sensor_pose.translation, ROOF.pose.translation, atol=1e-12)
    np.testing.assert_allclose(back.ego_velocity, twin.ego_velocity, atol=1e-12)
    assert back.ego_yaw_rate == pytest.approx(twin.ego_yaw_rate, rel=1e-12)
    # 0.35 rad/s times the float32 rounding of a coordinate of 60 m
    np.testing.assert_allclose(back.velocity, twin.velocity, atol=2e-6)
    assert back.names[101] == "oncoming"


def test_a_frame_from_disk_gives_the_scatterers_of_the_cast(tmp_path: Path, twin: LidarFrame) -> None:
    write_side_file(tmp_path / "f.yaml", scene_side_file(street(), ROOF, 0.4))
    write_semantic_lidar(tmp_path / "f.bin", twin)
    mount = street().radars[0].pose
    kept = lidar_scatterers(twin, None, mount).table()
    read = lidar_scatterers(_back(tmp_path / "f.bin", twin, side_file=tmp_path / "f.yaml"), None, mount).table()
    # float32 at 64 m: 4 um of place, and of range rate 20 m/s over a distance of more than 1 m
    np.testing.assert_allclose(read, kept, rtol=0, atol=2e-4)


def test_boxes_of_the_side_file_hold_their_actors(tmp_path: Path, twin: LidarFrame) -> None:
    write_side_file(tmp_path / "f.yaml", scene_side_file(street(), ROOF, 0.4), layout="carla")
    side = read_side_file(tmp_path / "f.yaml")
    center, half = side.actors[101].box  # type: ignore[misc]
    points = center.apply_inverse(ROOF.pose.apply(twin.position[twin.object_id == 101]))
    assert len(points) > 10
    assert np.all(np.abs(points) <= half + 1e-6)
    assert np.abs(points).max(axis=0)[2] > 0.5 * half[2]  # and they are no larger than they need be


def test_side_files_of_other_layouts_or_without_poses_are_refused(tmp_path: Path) -> None:
    side = scene_side_file(street(), ROOF)
    with pytest.raises(InputError, match="'own' or 'carla'"):
        write_side_file(tmp_path / "f.yaml", side, layout="kitti")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="sensor_world"):
        write_side_file(tmp_path / "f.yaml", replace(side, sensor_world=None), layout="carla")


# ---- command line
SCENE = """\
version: 1
seed: 5
frame_period_s: 0.1
ego: {velocity_mps: [10, 0, 0]}
static:
  - {shape: "ground:40x20", xyz_m: [10, 0, 0], tag: Roads, material: asphalt}
  - {name: plate, shape: "plate:2x2", xyz_m: [12, 3, 1], ypr_deg: [180, 0, 0], tag: Walls, id: 40}
lidars:
  - {name: roof, xyz_m: [0, 0, 2.5], channels: 16, range_m: 40, points_per_second: 57600}
"""


def test_cast_lidar_writes_frames_side_files_and_a_summary(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("street.yaml").write_text(SCENE)
    command = ["cast-lidar", "street.yaml", "--frames", "1:3", "--layout", "ply", "--layout", "bin"]
    assert main([*command, "--json", "--backend", "scalar"]) == 0
    summary = json.loads(capsys.readouterr().out)
    folder = Path("out/street-roof")
    assert {p.name for p in folder.iterdir()} == {
        *(f"frame_00000{k}.{end}" for k in (1, 2) for end in ("ply", "bin", "yaml")), "summary.json", "manifest.json",
    }  # fmt: skip
    assert verify_manifest(folder) == []
    assert [f["time_s"] for f in summary["frames"]] == [0.1, 0.2]
    for record in summary["frames"]:
        back = read_semantic_lidar(
            folder / record["files"][0], tag_table="0.9.14", frame="carla", side_file=folder / record["side_file"]
        )
        assert len(back) == record["points"]
        plate = back.position[back.object_id == 40]
        # the ego vehicle comes nearer by 10 m/s; the plate stays
        np.testing.assert_allclose(plate[:, 0], 12 - 10 * record["time_s"], atol=1e-3)
        np.testing.assert_allclose(back.ego_velocity, [10, 0, 0])
    assert main(command) == 0
    assert "Roads" in capsys.readouterr().out
    assert Path("out/street-roof-2").is_dir()


def test_cast_lidar_refuses_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("street.yaml").write_text(SCENE)
    for argv, message in (
        (["--lidar", "rof"], "no lidar 'rof'"),
        (["--set", "profile.receiver.noise_figure_db=1"], "cast-lidar has no radar"),
        (["--frames", "3:1"], "--frames 3:1"),
        (["--layout", "las"], "las"),
    ):
        assert main(["cast-lidar", "street.yaml", *argv]) == 2
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        assert message in err
    assert not Path("out").exists() or not list(Path("out").iterdir())
