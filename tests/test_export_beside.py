"""What stands beside our radars in an MCAP file: LiDARs, recorded radars, runs of other sources."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from export_tools import export_mcap_and_read, in_world, matrices, moved, run_scene, unpack

import shenron_rt as srt
from shenron_rt.cli import main
from shenron_rt.io.recorded import PointCloud, write_ti_tlv

pytest.importorskip("foxglove", reason="foxglove-sdk is not installed (extra mcap)")

AHEAD = np.array([1.0, 0.0, 0.0])


def test_carlas_radar_stands_beside_ours_frame_by_frame(street_run: Path, tmp_path: Path) -> None:
    # velocity, azimuth (+ right), altitude, depth
    rows = np.array([[-5.0, 0.1, 0.02, 25.0], [1.0, -0.3, 0.0, 12.0]], dtype=np.float32)
    for k in range(2):
        np.save(tmp_path / f"radar_{k:08d}.npy", rows + np.array([0, 0, 0, k]))
    files = [str(tmp_path / f"radar_{k:08d}.npy") for k in range(2)]
    options = [w for f in files for w in ("--recorded", f)]
    found = export_mcap_and_read(street_run, tmp_path / "a.mcap", *options, "--recorded-mount", "1,0.5,0.8,10,0,0")
    assert len(found["/recorded/radar/points"]) == 2  # the recording ends before the run
    for k, entry in enumerate(found["/recorded/radar/points"]):
        columns, depth = unpack(entry.message), rows[:, 3].astype(float) + k
        azimuth, altitude = -rows[:, 1].astype(float), rows[:, 2].astype(float)
        assert entry.time == found["/radar/front/points"][k].time
        wanted = depth * [np.cos(altitude) * np.cos(azimuth), np.cos(altitude) * np.sin(azimuth), np.sin(altitude)]
        np.testing.assert_allclose([columns[a] for a in "xyz"], wanted, rtol=1e-6)
        np.testing.assert_array_equal(columns["velocity"], rows[:, 0])
        assert np.isnan(columns["snr_db"]).all()
    tree = matrices(found["/tf"][0].message)
    mount = np.linalg.inv(in_world(tree, "ego")) @ in_world(tree, "recorded/radar")
    np.testing.assert_allclose(mount[:3, 3], [1, 0.5, 0.8], atol=1e-12)
    assert np.degrees(np.arctan2(mount[1, 0], mount[0, 0])) == pytest.approx(10)


def test_a_log_of_tis_demo_stands_beside_ours(street_run: Path, tmp_path: Path) -> None:
    position = np.array([[20.0, 3.0, 0.5], [8.0, -1.0, 0.0]])
    clouds = [
        PointCloud(position + k * AHEAD, np.array([-3.0, 0.5]), np.array([20.0, 15.0]), np.full(2, 10.0), frame=k)
        for k in range(3)
    ]
    write_ti_tlv(tmp_path / "board.dat", clouds)
    found = export_mcap_and_read(
        street_run, tmp_path / "a.mcap", "--recorded", str(tmp_path / "board.dat"), "--frames", "1:3"
    )
    entries = found["/recorded/board/points"]
    assert len(entries) == 2
    for k, entry in enumerate(entries):
        columns = unpack(entry.message)
        np.testing.assert_allclose(np.column_stack([columns[a] for a in "xyz"]), position + k * AHEAD, atol=1e-5)
        np.testing.assert_array_equal(columns["snr_db"], [20, 15])


def test_a_lidar_run_brings_its_own_points_and_default_mounts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["cast-lidar", "braking", "-o", str(tmp_path / "cast"), "--layout", "ply", "--frames", "0:2"]) == 0
    files = [str(tmp_path / f"cast/frame_{k:06d}.ply") for k in range(2)]
    words = ["lidar", *files, "--tag-table", "0.9.14", "--frame", "carla", "--side-file", str(tmp_path / "cast")]
    assert main([*words, "-o", str(tmp_path / "run"), "--no-pictures"]) == 0
    found = export_mcap_and_read(tmp_path / "run", tmp_path / "a.mcap")
    times = [m.time for m in found["/radar/awrl1432/points"]]
    assert times[1] - times[0] == 100_000_000  # LiDAR files do not say when they were: a tenth of a second apart
    tree = matrices(found["/tf"][0].message)
    np.testing.assert_allclose(in_world(tree, "radar/awrl1432")[:3, 3], [2, 0, 1])
    entry = found["/lidar/points/points"][0].message
    columns = unpack(entry)
    points = moved(in_world(tree, entry.frame_id), np.column_stack([columns[a] for a in "xyz"]).astype(float))
    road = columns["tag"] == int(srt.SemanticTag.Roads)
    assert road.sum() > 100
    # a LiDAR 2.5 m above the road: its points lie on it in the ego frame, in CARLA's float32
    assert np.abs(points[road, 2]).max() < 1e-4
    # CARLA's radar of tick 1, and of a tick that the LiDAR run has not: paired by number, not by order
    for number, depth in ((1, 11.0), (7, 77.0)):
        np.save(tmp_path / f"native_radar_{number:08d}.npy", np.array([[0, 0, 0, depth]], dtype=np.float32))
    found = export_mcap_and_read(tmp_path / "run", tmp_path / "b.mcap", "--recorded", str(tmp_path))
    (entry,) = found["/recorded/native_radar/points"]
    assert entry.time == times[1]
    assert unpack(entry.message)["x"].tolist() == [11.0]
    (tmp_path / "native_radar_00000001.npy").unlink()
    assert main(["export", str(tmp_path / "run"), "--to", "mcap", "--recorded", str(tmp_path)]) == 2
    assert "frames 7 to 7 of the recording are none of the run's, 0 to 1" in capsys.readouterr().err


def test_a_run_of_adc_data_has_clouds_and_maps_and_no_scene(
    street_run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    adc = street_run / "radars/front/frame_000000/adc.npz"
    assert main(["process", str(adc), "-o", str(tmp_path / "run"), "--no-pictures"]) == 0
    found = export_mcap_and_read(tmp_path / "run", tmp_path / "a.mcap")
    radar = "/radar/awrl1432"
    assert {topic for topic in found if topic.startswith(radar)} == {
        f"{radar}/{name}" for name in ("points", "range_doppler", "range_azimuth", "objects", "strongest")
    }
    assert "/scene" not in found
    tree = matrices(found["/tf"][0].message)
    assert set(tree) == {"ego", "radar/awrl1432"}
    np.testing.assert_allclose(in_world(tree, "radar/awrl1432")[:3, 3], [2, 0, 1])
    assert main(["export", str(tmp_path / "run"), "--to", "mcap", "-o", str(tmp_path / "b.mcap"), "--lidar"]) == 2
    assert "there is no scene to cast a LiDAR over" in capsys.readouterr().err


def test_two_radars_share_transforms_and_meshes(tmp_path: Path) -> None:
    run = run_scene(tmp_path / "run", "clear_road", "--profile", "awrl1432", "--profile", "awrl1432_137mhz", rays=2_000)
    found = export_mcap_and_read(run, tmp_path / "a.mcap", "--lidar")
    for name in ("front_awrl1432", "front_awrl1432_137mhz"):
        (entry,) = found[f"/radar/{name}/points"]
        at = [i for i, m in enumerate(found["/tf"]) if m.time == entry.time]
        assert at  # each radar has transforms of its own mid-frame
        assert f"radar/{name}" in matrices(found["/tf"][at[0]].message)
    assert (len(found["/tf"]), len(found["/scene"]), len(found["/lidar/roof/points"])) == (2, 1, 1)
