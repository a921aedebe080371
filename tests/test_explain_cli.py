"""``shenron-rt explain`` on run folders: tables, card, files, exit codes."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import shenron_rt as srt
from shenron_rt.cli import main
from shenron_rt.runs import verify_manifest

SCENE = """\
version: 1
seed: 5
frame_period_s: 0.5
actors:
  - {id: 3, name: van, shape: "box:4x2x2", xyz_m: [13, -5, 1], ypr_deg: [-24.4, 0, 0], tag: Truck,
     material: metal, aim: 2000}
  - {id: 4, name: walker, shape: pedestrian, xyz_m: [18, -6.6, 0], aim: 2000}
point_targets:
  - {id: 900, name: drone, xyz_m: [27, 5, 1], rcs_dbsm: 20}
radars:
  - {name: front, profile: awrl1432, xyz_m: [2.0, 0, 1.0]}
  - {name: side, profile: awrl1432, xyz_m: [2.0, 0, 1.0], ypr_deg: [90, 0, 0]}
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("explain")
    (folder / "street.yaml").write_text(SCENE)
    options = ["--rays", "3000", "--no-pictures", "--frames", "0:2", "-o", str(folder / "run")]
    assert main(["run", str(folder / "street.yaml"), *options]) == 0
    return folder / "run"


def test_explain_prints_a_line_an_object_and_what_would_help(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["explain", str(run), "--frame", "1", "--radar", "front"]) == 0
    out = capsys.readouterr().out
    walker = next(line for line in out.splitlines() if " walker " in line)
    assert "occluded by van" in walker
    assert "take van away" in out
    assert "Strongest peak" in out


def test_explain_of_one_object_prints_its_waterfall_and_its_cell(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["explain", str(run), "--object", "900", "--frame", "0", "--radar", "front"]) == 0
    out = capsys.readouterr().out
    assert re.search(r"apparent cross section +\+20\.00 ", out)
    assert "closes" in out
    assert "together, measured" in out
    assert "Verdict: detected" in out


def test_all_frames_are_summed_up_by_verdict(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["explain", str(run), "--radar", "front"]) == 0
    assert "2 x occluded by van" in capsys.readouterr().out


def test_json_is_what_python_returns_for_every_radar_and_frame(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["explain", str(run), "--json", "--object", "900"]) == 0
    told = json.loads(capsys.readouterr().out)
    found = srt.explain(run, object_id=900)
    assert [(f["radar"], f["frame"]) for f in told["frames"]] == [(f.radar, f.frame) for f in found]
    assert [f["objects"][0]["verdict"]["name"] for f in told["frames"]] == [f.objects[0].verdict.name for f in found]
    first = told["frames"][0]["objects"][0]["waterfall"]
    assert first["measured_snr_db"] == found.frames[0].objects[0].waterfall.measured_snr_db
    assert {row["radar"] for row in told["evidence"]} == {"front", "side"}


def test_output_holds_the_json_and_a_picture_of_each_echoing_object(run: Path, tmp_path: Path) -> None:
    out = tmp_path / "why"
    assert main(["explain", str(run), "--frame", "0", "--radar", "front", "-o", str(out)]) == 0
    pictures = {p.name for p in out.glob("*.png")}
    assert pictures == {"explain_front_000000_3.png", "explain_front_000000_900.png"}  # the walker has no echo
    assert json.loads((out / "explain.json").read_text())["frames"][0]["radar"] == "front"
    assert verify_manifest(out) == []
    assert main(["explain", str(run), "--frame", "0", "-o", str(out)]) == 2  # not empty


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--object", "77"], "no object 77 in frame 0; there are 3 (van), 4 (walker), 900 (drone)"),
        (["--frame", "9"], "has no frame 9; it has [0, 1]"),
        (["--radar", "rear"], "no radar 'rear' in this run; it has front, side"),
    ],
)
def test_what_is_not_there_is_refused_in_one_line(
    run: Path, capsys: pytest.CaptureFixture[str], options: list[str], message: str
) -> None:
    capsys.readouterr()
    assert main(["explain", str(run), *options]) == 2
    said = capsys.readouterr()
    assert message in said.err
    assert said.out == ""


def test_a_folder_that_is_no_run_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", str(tmp_path)]) == 2
    assert "not a run folder" in capsys.readouterr().err
