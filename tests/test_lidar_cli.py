"""``shenron-rt lidar``: frames in, a run folder out; bad input is one line and exit code 2."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from lidar_tools import CAR_ID, WALL_X, ply_text, street, write_bin

import shenron_rt as srt
from shenron_rt.cli import main

SIDE = (
    "version: 1\naxes: ros\nego: {{velocity_mps: [{ego}, 0, 0]}}\nsensor: {{xyz_m: [0.3, 0, 2.4]}}\n"
    f"actors: [{{{{id: {CAR_ID}, name: lead, velocity_mps: [2, 0, 0]}}}}]\n"
)
BEHIND = "2,-3,1"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder with a frame, as the working directory."""
    write_bin(tmp_path / "frame.bin", street())
    (tmp_path / "side.yaml").write_text(SIDE.format(ego=0))
    (tmp_path / "moving.yaml").write_text(SIDE.format(ego=10))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _run(*more: str, file: str = "frame.bin") -> int:
    return main(["lidar", file, "--tag-table", "0.9.14", "--frame", "carla", *more])


def test_a_run_folder_like_that_of_a_scene_is_written(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _run("--side-file", "side.yaml", "--mount", BEHIND, "--seed", "3") == 0
    out = capsys.readouterr().out
    root = folder / "out" / "frame-awrl1432"
    made = {p.name for p in (root / "radars" / "awrl1432" / "frame_000000").iterdir()}
    arrays = {"scatterers.npz", "returns.npz", "adc.npz", "cube.npz", "detections.csv"}
    assert made == arrays | {"range_profile.png", "range_doppler.png", "range_azimuth.png", "top_view.png"}
    summary = json.loads((root / "summary.json").read_text())
    assert (summary["seed"], summary["backend"]) == (3, None)
    (item,) = [o for o in summary["radars"][0]["frames"][0]["objects"] if o["id"] == CAR_ID]
    assert (item["name"], item["tag"], item["detected"]) == ("lead", "Car", True)
    config = yaml.safe_load((root / "config.yaml").read_text())
    assert config["lidar"]["tag_table"] == "0.9.14"
    assert Path(config["lidar"]["files"][0]).is_file()
    assert config["profiles"][0]["name"] == "awrl1432"
    # the printed summary: histogram, points per actor, untagged share, grid, incidence
    for said in (
        "Roads",
        "lead",
        "untagged 0.0 %",
        "64 channels",
        "from estimated normals",
        "face away",
        str(root.name),
    ):
        assert said in out


def test_the_same_numbers_as_in_python(folder: Path) -> None:
    options = (
        "--side-file",
        "moving.yaml",
        "--mount",
        BEHIND,
        "--profile",
        "awrl1432_137mhz",
        "--no-pictures",
        "-o",
        "run",
    )
    assert _run(*options) == 0
    lidar = srt.read_semantic_lidar("frame.bin", tag_table="0.9.14", frame="carla", side_file="moving.yaml")
    done = srt.simulate(lidar, srt.load_profile("awrl1432_137mhz"), mount=srt.Pose((2.0, -3.0, 1.0)))
    rows = srt.Scatterers.load(folder / "run" / "radars" / "awrl1432_137mhz" / "frame_000000" / "scatterers.npz")
    assert np.array_equal(rows.table(), done.scatterers.table())
    assert rows.slope is not None
    assert np.array_equal(rows.slope, done.scatterers.slope)
    adc = srt.AdcCube.load(folder / "run" / "radars" / "awrl1432_137mhz" / "frame_000000" / "adc.npz")
    assert np.array_equal(adc.data, done.adc.data)
    assert adc.profile.name == "awrl1432_137mhz"


def test_several_files_are_frames_with_a_side_file_each(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "second.ply").write_bytes(ply_text(street()))
    argv = ["lidar", "frame.bin", "second.ply", "--tag-table", "0.9.14", "--frame", "carla", "--no-pictures", "--json"]
    argv += [
        "--side-file",
        "side.yaml",
        "--side-file",
        "moving.yaml",
        "--profile",
        "awrl1432",
        "--profile",
        "awrl1432_137mhz",
    ]
    assert main([*argv, "-o", "run"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert [r["name"] for r in summary["radars"]] == ["awrl1432", "awrl1432_137mhz"]
    assert [f["frame"] for f in summary["radars"][0]["frames"]] == [0, 1]
    rates = [
        srt.Scatterers.load(folder / "run" / "radars" / "awrl1432" / f"frame_00000{k}" / "scatterers.npz").range_rate
        for k in (0, 1)
    ]
    assert rates[0].min() == pytest.approx(0, abs=0.1)  # standing ego, a car that drives away
    assert rates[1].min() == pytest.approx(-10, abs=0.1)
    assert main([*argv, "--frames", "1:2", "-o", "one"]) == 0
    assert [f["frame"] for f in json.loads(capsys.readouterr().out)["radars"][0]["frames"]] == [1]


def test_short_ranges_and_half_sweeps_are_pointed_out(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _run("--sensor-pose", "0,0,2.4", "--no-pictures") == 0
    whole = capsys.readouterr().out
    assert "of 360 deg\n" in whole
    assert "default range" not in whole
    records = street(reach_m=10.0)
    write_bin(folder / "frame.bin", records[records["y"] > 0])
    assert _run("--sensor-pose", "0,0,2.4", "--no-pictures") == 0
    short = capsys.readouterr().out
    assert "over 180 of 360 deg; a part of a sweep" in short
    assert "10 m is CARLA's default range" in short


def test_crops_thinning_and_normals_are_named_options(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--sensor-pose", "0.3,0,2.4", "--crop-ego", "4.8,2,1.6", "--crop-old-pipeline", "--thin", "0.4"]
    assert _run(*options, "--no-normals", "--grid", "64,10,-30,0.5", "--no-pictures", "--json") == 0
    (item,) = json.loads(capsys.readouterr().out)["lidar"]
    assert item["points"] < 0.3 * item["points_read"]
    assert item["grid"].endswith("given")
    assert item["door"]["cosine_from_normal"] == 0
    assert [n.split(" ")[0] for n in item["notes"]] == ["ego", "crop", "thinned", "no"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--mount", "2,0,1"], "needs sensor_pose"),
        (["--sensor-pose", "0,0"], "--sensor-pose 0,0: 3 or 6 numbers"),
        (["--sensor-pose", "0,0,2.4", "--mount", "2,a,1"], "--mount 2,a,1: 3 or 6 numbers"),
        (["--sensor-pose", "0,0,2.4", "--profile", "awrl"], "awrl1432"),
        (["--sensor-pose", "0,0,2.4", "--model", "magic"], "unknown echo model 'magic'"),
        (["--side-file", "side.yaml", "--side-file", "moving.yaml"], "one for all frames or one each"),
        (["--side-file", "."], "--side-file .: no frame.meta.yaml or frame.yaml for frame.bin"),
        (["--frames", "0:2"], "1 files are given"),
        (["--seed", "-1"], "--seed -1"),
        (["--set", "scene.seed=3"], "lidar has no scene"),
    ],
)
def test_bad_options_are_one_line_and_exit_code_2(
    options: list[str], said: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _run(*options) == 2
    got = capsys.readouterr()
    assert said in got.err
    assert got.out == ""
    assert not (folder / "out").exists() or not any((folder / "out").iterdir())


def test_a_tag_table_and_axes_must_be_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lidar", "frame.bin", "--frame", "carla"]) == 2
    assert "tag-table" in capsys.readouterr().err
    assert main(["lidar", "frame.bin", "--tag-table", "0.9.14"]) == 2
    assert "frame" in capsys.readouterr().err
    assert main(["lidar", "frame.bin", "--tag-table", "auto", "--frame", "carla"]) == 2
    assert "suggest '0.9.14'" in capsys.readouterr().err
    assert main(["lidar", "--tag-table", "0.9.14", "--frame", "carla"]) == 2
    assert "at least one file" in capsys.readouterr().err
    assert _run(file="absent.ply") == 2
    assert "no such file" in capsys.readouterr().err


def test_a_folder_of_side_files_has_one_for_each_frame_by_its_name(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recorded = folder / "recorded"
    recorded.mkdir()
    for name, ego in (("roof_7.meta.yaml", 0), ("roof_8.yaml", 10)):
        (recorded / name).write_text(SIDE.format(ego=ego))
    for name in ("roof_7.bin", "roof_8.bin"):
        write_bin(recorded / name, street())
    files = ["recorded/roof_7.bin", "recorded/roof_8.bin"]
    argv = ["lidar", *files, "--tag-table", "0.9.14", "--frame", "carla", "--side-file", "recorded"]
    assert main([*argv, "--mount", BEHIND, "--no-pictures", "--json", "-o", "run"]) == 0
    capsys.readouterr()
    rows = [
        srt.Scatterers.load(folder / "run" / "radars" / "awrl1432" / f"frame_00000{k}" / "scatterers.npz")
        for k in (0, 1)
    ]
    # the car drives 2 m/s; behind it stands the ego vehicle, then it drives 10 m/s
    assert [np.sign(np.median(r.range_rate[r.object_id == CAR_ID])) for r in rows] == [1, -1]


def test_counts_of_the_released_model_are_said_to_be_no_watts(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for model, warned in (("shenron:as_released", True), ("shenron", False)):
        assert _run("--sensor-pose", "0.3,0,2.4", "--model", model, "--no-pictures", "--overwrite", "-o", "run") == 0
        assert ("counts of the released code, not watts" in capsys.readouterr().err) == warned


def test_half_sweeps_are_joined_by_the_motion_of_the_ego(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    records = street()
    ahead = records.copy()
    ahead["x"] -= 0.8  # 16 m/s for 50 ms
    write_bin(folder / "half_0.bin", records[records["y"] > 0])
    write_bin(folder / "half_1.bin", ahead[ahead["y"] <= 0])
    (folder / "drives.yaml").write_text(SIDE.format(ego=16))
    argv = ["lidar", "half_0.bin", "half_1.bin", "--tag-table", "0.9.14", "--frame", "carla", "--no-pictures"]
    argv += ["--grid", "64,10,-30,0.5"]  # the points of a shifted cloud are on none
    more = ["--side-file", "drives.yaml", "--mount", "0.3,0,2.4", "--json", "-o", "run"]  # at the sensor
    assert main([*argv, *more, "--merge-sweeps", "0.05"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert [f["frame"] for f in summary["radars"][0]["frames"]] == [1]  # the first file has none before it
    assert summary["lidar"][0]["points"] == len(records)
    rows = srt.Scatterers.load(folder / "run" / "radars" / "awrl1432" / "frame_000001" / "scatterers.npz")
    wall = rows.position[rows.tag == srt.SemanticTag.Buildings]
    assert np.ptp(np.sign(wall[:, 1])) == 2  # both halves
    assert wall[:, 0] == pytest.approx(np.full(len(wall), WALL_X - 0.8), abs=1e-5)
    assert main([*argv, "--sensor-pose", "0.3,0,2.4", "--merge-sweeps", "0.05"]) == 2
    assert "how the ego vehicle moved" in capsys.readouterr().err
    assert _run("--side-file", "drives.yaml", "--merge-sweeps", "0.05") == 2
    assert "give at least two" in capsys.readouterr().err


def test_points_hidden_from_the_radar_are_left_out_on_request(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    more = ("--side-file", "side.yaml", "--mount", "2,-3,0.5", "--no-pictures", "--json")
    assert _run(*more, "-o", "all") == 0
    every = json.loads(capsys.readouterr().out)["lidar"][0]
    assert _run(*more, "--hide-occluded", "-o", "seen") == 0
    seen = json.loads(capsys.readouterr().out)["lidar"][0]
    assert seen["points"] < every["points"] == every["points_read"] == seen["points_read"]
    # the car is a box straight ahead: the radar, below its roof, sees neither that nor the road and the wall behind
    assert seen["tags"]["Buildings"] < every["tags"]["Buildings"]
    left_out = every["points"] - seen["points"]
    assert any(f"nearer points: {left_out} points left out" in note for note in seen["notes"])


# ---- validate
def test_validate_says_what_the_points_suggest_for_every_word_that_lidar_needs(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    records = street()
    (folder / "frame.ply").write_bytes(ply_text(records))
    np.save(folder / "struct.npy", records)
    np.save(folder / "bits.npy", records.view(np.float32).reshape(-1, 6))
    left = records.copy()
    left["y"] *= -1
    np.savez(folder / "simbev.npz", data=left)
    columns = [records[k].astype(float) for k in ("x", "y", "z", "CosAngle", "ObjIdx", "ObjTag")]
    np.savetxt(folder / "table.csv", np.column_stack([*columns[:3], 0 * columns[0], *columns[3:]]), delimiter=",")
    files = ["frame.bin", "frame.ply", "struct.npy", "bits.npy", "simbev.npz", "table.csv"]
    assert main(["validate", *files, "side.yaml", "--json"]) == 0
    *frames, side = json.loads(capsys.readouterr().out)
    for verdict in frames:
        assert verdict["kind"] == "semantic LiDAR", verdict
        axes = "ros" if "simbev" in verdict["path"] else "carla"
        for said in (f"{len(records)} points, 1 actors", "--tag-table 0.9.14", f"--frame {axes}", "64 channels"):
            assert said in verdict["what"], verdict
    assert side["kind"] == "side file of a LiDAR frame"
    assert "sensor at (0.3, 0.0, 2.4)" in side["what"]


def test_validate_refuses_what_no_table_makes_semantic_lidar(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    records = street()
    flushed, angle = records.copy(), records.copy()
    flushed["ObjTag"], angle["CosAngle"] = 0, 1.2
    np.save(folder / "flushed.npy", flushed)
    np.save(folder / "angle.npy", angle)
    (folder / "short.bin").write_bytes(records.tobytes()[:-5])
    (folder / "plain.ply").write_bytes(
        b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float32 x\nproperty float32 y\nproperty float32 z\n"
        b"property float32 I\nend_header\n1 2 3 0.5\n"
    )
    assert main(["validate", "flushed.npy", "angle.npy", "short.bin", "plain.ply", "--json"]) == 2
    problems = [v["problems"][0] for v in json.loads(capsys.readouterr().out)]
    for problem, said in zip(problems, ("tags are 0", "CosAngle reaches 1.2", "--profile", "plain LiDAR"), strict=True):
        assert said in problem
