"""``run`` and ``process`` end to end, on a scene small enough for the slowest backend."""

from __future__ import annotations

import hashlib
import json
import math
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from shenron_rt.cli import main
from shenron_rt.config.profile import load_profile
from shenron_rt.dsp import Detections
from shenron_rt.io.captures import write_dca1000
from shenron_rt.runs import verify_manifest
from shenron_rt.synthesis import AdcCube

SCENE = """\
version: 1
seed: 5
frame_period_s: 0.5
ego: {velocity_mps: [2, 0, 0]}
static:
  - {name: plate, shape: "plate:1x1", xyz_m: [12, 3, 1], ypr_deg: [180, 0, 0], tag: Walls, material: metal, id: 40}
point_targets:
  - {id: 900, name: drone, xyz_m: [27, 5, 1], velocity_mps: [0, 0, 0], rcs_dbsm: 20, tag: Other}
radars:
  - {name: front, profile: awrl1432, xyz_m: [2.0, 0, 1.0]}
"""
FAST = ("--rays", "3000", "--backend", "scalar", "--no-pictures")


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("street.yaml").write_text(SCENE)


def _run(*argv: str) -> dict[str, Any]:
    assert main(["run", "street.yaml", *FAST, *argv]) == 0
    folder = argv[argv.index("-o") + 1]
    return dict(json.loads((Path(folder) / "summary.json").read_text()))


def _hash(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def test_run_writes_the_run_folder_and_finds_the_target(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "street.yaml", "--rays", "3000", "--backend", "scalar"]) == 0
    out = capsys.readouterr().out
    folder = Path("out/street-awrl1432")
    frame = folder / "radars" / "front" / "frame_000000"
    assert {p.name for p in folder.iterdir()} == {"config.yaml", "summary.json", "manifest.json", "radars"}
    assert {p.name for p in frame.iterdir()} == {
        "scatterers.npz", "returns.npz", "adc.npz", "cube.npz", "detections.csv", "range_profile.png",
        "range_doppler.png", "range_azimuth.png", "top_view.png", "antenna.png",
    }  # fmt: skip
    assert verify_manifest(folder) == []
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["backend"] == "scalar"
    assert summary["seed"] == 5
    assert summary["version"]
    (radar,) = summary["radars"]
    (record,) = radar["frames"]
    assert (radar["name"], record["frame"], record["time_s"]) == ("front", 0, 0.0)
    objects = {o["id"]: o for o in record["objects"]}
    assert objects[900]["detected"] is True
    assert objects[900]["name"] == "drone"
    # the target is at (25, 5, 0) in the radar frame, closing at 2 m/s; mid-frame is 1.2 ms later
    found = Detections.from_csv(frame / "detections.csv")
    row = found.table[found.object_id == 900][0]
    profile = load_profile("awrl1432")
    assert row["range"] == pytest.approx(math.hypot(25, 5), abs=profile.range_resolution_m / 2)
    assert math.degrees(row["azimuth"]) == pytest.approx(math.degrees(math.atan2(5, 25)), abs=2)
    assert row["velocity"] == pytest.approx(-2 * 25 / math.hypot(25, 5), abs=profile.velocity_resolution_mps / 2)
    assert row["rcs_dbsm"] == pytest.approx(20, abs=1.5)
    assert "Strongest return" in out
    assert "drone" in out
    assert str(folder) in out


def test_json_is_the_summary_and_nothing_else(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "street.yaml", *FAST, "--json", "-o", "x"]) == 0
    out = capsys.readouterr().out
    assert json.loads(out) == json.loads(Path("x/summary.json").read_text())


def test_default_folders_are_numbered_and_overwrite_needs_to_be_said(capsys: pytest.CaptureFixture[str]) -> None:
    for _ in range(2):
        assert main(["run", "street.yaml", *FAST]) == 0
    assert sorted(p.name for p in Path("out").iterdir()) == ["street-awrl1432", "street-awrl1432-2"]
    capsys.readouterr()
    before = _hash(Path("out/street-awrl1432/manifest.json"))
    assert main(["run", "street.yaml", *FAST, "--seed", "6", "-o", "out/street-awrl1432"]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert _hash(Path("out/street-awrl1432/manifest.json")) == before
    summary = _run("--seed", "6", "-o", "out/street-awrl1432", "--overwrite")
    assert summary["seed"] == 6
    assert sorted(p.name for p in Path("out").iterdir()) == ["street-awrl1432", "street-awrl1432-2"]


def test_the_written_config_runs_again_to_the_same_bytes() -> None:
    _run("-o", "a", "--seed", "11", "--set", "profile.receiver.noise_figure_db=12", "--frames", "1:2")
    Path("elsewhere").mkdir()
    os.chdir("elsewhere")
    assert main(["run", "../a/config.yaml", "--no-pictures", "-o", "../b"]) == 0
    os.chdir("..")
    frame = Path("radars/front/frame_000001")
    for name in ("scatterers.npz", "returns.npz", "adc.npz", "cube.npz", "detections.csv"):
        one, two = Path("a") / frame / name, Path("b") / frame / name
        if name.endswith(".csv"):
            assert one.read_bytes() == two.read_bytes()
            continue
        with np.load(one) as x, np.load(two) as y:  # the zip around the arrays holds the time of day
            assert x.files == y.files
            for key in x.files:
                np.testing.assert_array_equal(x[key], y[key], err_msg=f"{name}: {key}")
    config = yaml.safe_load(Path("b/config.yaml").read_text())
    assert config["seed"] == 11
    assert config["run"] == {
        "frames": "1:2", "rays": 3000, "max_bounces": 1, "backend": "scalar", "accuracy": 1e-5, "model": "physical",
    }  # fmt: skip
    assert config["radars"][0]["profile"]["receiver"]["noise_figure_db"] == 12


def test_overrides_reach_the_data() -> None:
    _run("-o", "a", "--set", "profile.waveform.chirps=16", "--set", "scene.weather.rain_mm_h=50")
    cube = AdcCube.load("a/radars/front/frame_000000/adc.npz")
    assert cube.data.shape == (16, 6, 256)
    with np.load("a/radars/front/frame_000000/scatterers.npz") as arrays:
        assert arrays["weather"][0] == 50


def test_frames_step_by_the_frame_period() -> None:
    summary = _run("-o", "a", "--frames", "0:3")
    frames = summary["radars"][0]["frames"]
    assert [f["frame"] for f in frames] == [0, 1, 2]
    assert [f["time_s"] for f in frames] == [0.0, 0.5, 1.0]
    ranges = []
    for index in range(3):
        found = Detections.from_csv(f"a/radars/front/frame_{index:06d}/detections.csv")
        ranges.append(found.range[found.object_id == 900][0])
    # 2 m/s for 0.5 s from one frame to the next, towards a target 11 degrees off: 0.98 m, to a tenth of a bin each
    np.testing.assert_allclose(np.diff(ranges), -0.98, atol=0.1)


def test_profiles_replace_one_by_one_or_side_by_side() -> None:
    summary = _run("-o", "a", "--profile", "radarbook")
    assert [(r["name"], r["profile"]) for r in summary["radars"]] == [("front", "radarbook")]
    summary = _run("-o", "b", "--profile", "awrl1432", "--profile", "awrl1432boost")
    assert [(r["name"], r["profile"]) for r in summary["radars"]] == [
        ("front_awrl1432", "awrl1432"), ("front_awrl1432boost", "awrl1432boost"),
    ]  # fmt: skip
    # the profile asked for is the profile used, and is written into the output
    for radar in summary["radars"]:
        cube = AdcCube.load(Path("b/radars") / radar["name"] / "frame_000000" / "adc.npz")
        assert cube.profile.name == radar["profile"]
    assert np.all(cube.data.imag == 0)


def test_a_crash_in_the_middle_leaves_the_old_run_intact(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    _run("-o", "a")
    before = {p: _hash(p) for p in sorted(Path("a").rglob("*")) if p.is_file()}

    def broken(*_: Any, **__: Any) -> dict[str, Any]:
        raise RuntimeError("planted")

    monkeypatch.setattr("shenron_rt.runs.frame_summary", broken)
    assert main(["run", "street.yaml", *FAST, "-o", "a", "--overwrite"]) == 1
    assert {p: _hash(p) for p in sorted(Path("a").rglob("*")) if p.is_file()} == before
    assert sorted(p.name for p in Path().iterdir()) == ["a", "street.yaml"]
    assert "planted" in capsys.readouterr().err


def test_a_scene_without_radars_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    Path("blind.yaml").write_text("version: 1\nradars: []\n")
    assert main(["run", "blind.yaml"]) == 2
    assert "no radars" in capsys.readouterr().err


# ---- process
def test_process_of_an_own_cube_gives_the_detections_of_the_run(capsys: pytest.CaptureFixture[str]) -> None:
    _run("-o", "a")
    capsys.readouterr()
    adc = "a/radars/front/frame_000000/adc.npz"
    assert main(["process", adc, "-o", "p", "--json", "--no-pictures"]) == 0
    summary = json.loads(capsys.readouterr().out)
    folder = Path("p/radars/awrl1432/frame_000000")
    assert (folder / "detections.csv").read_bytes() == Path("a/radars/front/frame_000000/detections.csv").read_bytes()
    assert {o["id"] for o in summary["radars"][0]["frames"][0]["objects"]} == {40, 900}
    assert verify_manifest(Path("p")) == []
    assert main(["validate", "p", "a", "a/config.yaml", "p/config.yaml", adc]) == 0
    capsys.readouterr()
    assert main(["process", adc, "--profile", "mmwcas"]) == 2
    assert "was made by 'awrl1432'" in capsys.readouterr().err


def test_process_reads_npy_and_dca1000_captures(capsys: pytest.CaptureFixture[str]) -> None:
    _run("-o", "a", "--profile", "awrl1432boost")
    cube = AdcCube.load("a/radars/front/frame_000000/adc.npz")
    np.save("plain.npy", cube.data)
    step = math.sqrt(cube.noise_power_w) / 20  # noise of 20 counts, as a receiver with some gain would have
    write_dca1000("adc_data.bin", [cube, cube], scale=step)
    capsys.readouterr()
    for name, frames in (("plain.npy", 1), ("adc_data.bin", 2)):
        assert main(["process", name]) == 2
        assert "--profile is needed" in capsys.readouterr().err
        assert main(["process", name, "--profile", "awrl1432boost", "-o", f"p_{name}", "--json", "--no-pictures"]) == 0
        summary = json.loads(capsys.readouterr().out)
        assert len(summary["radars"][0]["frames"]) == frames
    own = Detections.from_csv("a/radars/front/frame_000000/detections.csv")
    plain = Detections.from_csv("p_plain.npy/radars/awrl1432boost/frame_000000/detections.csv")
    np.testing.assert_array_equal(own.range, plain.range)
    capture = Detections.from_csv("p_adc_data.bin/radars/awrl1432boost/frame_000001/detections.csv")
    # without a full scale the floor is set to its nominal level, from 98304 cells: 0.4 % or 0.02 dB, plus the targets
    assert capture.range[0] == pytest.approx(own.range[0], abs=0.02)
    assert capture.snr_db[0] == pytest.approx(own.snr_db[0], abs=0.2)
    assert main(["process", "adc_data.bin", "--profile", "awrl1432boost", "--frames", "1:3"]) == 2
    assert "has 2 frames" in capsys.readouterr().err


def test_process_refuses_a_capture_of_another_radar(capsys: pytest.CaptureFixture[str]) -> None:
    np.savez("old.npz", data=np.zeros((1, 1, 4), complex), profile='{"name": "old"}')
    assert main(["process", "old.npz"]) == 2
    assert "old.npz: not an ADC cube that this version can read" in capsys.readouterr().err
    Path("adc.bin").write_bytes(bytes(1000))
    assert main(["process", "adc.bin", "--profile", "mmwcas"]) == 2
    assert "no whole number of frames" in capsys.readouterr().err
    Path("adc.mat").write_bytes(b"x")
    assert main(["process", "adc.mat"]) == 2
    assert "(DCA1000 capture)" in capsys.readouterr().err


@pytest.mark.parametrize("method", ["staggered", "two_frame"])
def test_processing_ambiguity_unfolds_in_run_and_process(method: str) -> None:
    profile = {"staggered": "awrl1432_staggered", "two_frame": "awrl1432"}[method]
    Path("fast.yaml").write_text(
        "version: 1\nego: {velocity_mps: [27.7, 0, 0]}\n"
        "point_targets: [{id: 9, xyz_m: [60, 0, 1], rcs_dbsm: 20}]\nradars: [{name: front, profile: awrl1432}]\n"
    )
    options = ["--set", f"processing.ambiguity={method}", "--frames", "0:2", "--json"]
    assert main(["run", "fast.yaml", *FAST, "--profile", profile, "-o", "fast", *options]) == 0
    strongest = [f["strongest"] for f in json.loads(Path("fast/summary.json").read_text())["radars"][0]["frames"]]
    assert strongest[1]["velocity_mps"] == pytest.approx(-27.7, abs=0.05)
    assert strongest[1]["range_m"] == pytest.approx(58.0 - 2.77 - 27.7 * load_profile(profile).frame_mid_s, abs=0.01)
    # what was recorded, processed again
    frames = [np.load(f"fast/radars/front/frame_00000{k}/adc.npz")["data"] for k in range(2)]
    np.save("frames.npy", np.stack(frames))
    again = ["process", "frames.npy", "--profile", profile, "-o", "again", "--no-pictures", *options]
    if method == "two_frame":
        assert main([*again]) == 2
        again += ["--frame-period-s", "0.1"]
    assert main(again) == 0
    summary = json.loads(Path("again/summary.json").read_text())
    assert summary["radars"][0]["frames"][1]["strongest"]["velocity_mps"] == pytest.approx(-27.7, abs=0.05)
