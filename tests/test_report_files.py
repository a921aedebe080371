"""What a page takes from other files, what it refuses, and how it is written."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from report_tools import FRAMES, Page, street_run

import shenron_rt as srt
from shenron_rt.cli import main
from shenron_rt.errors import InputError, NotFoundError
from shenron_rt.objects import observe_run, track


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return street_run(tmp_path_factory.mktemp("street"))


# ---- what other verbs found
def _track_file(folder: Path, run: Path) -> Path:
    names = (
        "frame", "time_s", "track", "coasting", "x_m", "y_m", "vx_mps", "vy_mps", "std_x_m", "std_y_m", "length_m",
        "width_m", "range_m", "azimuth_deg", "detections", "object_id",
    )  # fmt: skip
    file = folder / "tracks.csv"
    with file.open("w", encoding="utf-8", newline="") as text:
        writer = csv.DictWriter(text, names)
        writer.writeheader()
        for k, owner in enumerate((101, -1, 101)):
            row = dict.fromkeys(names, 0.5) | {"frame": k, "track": 3, "coasting": 0, "x_m": 30 + k, "object_id": owner}
            writer.writerow(row)
    (folder / "tracks.json").write_text('{"radar": "front", "ospa_m": 0.25, "tracks_of": {}}', encoding="utf-8")
    return file


def test_tracks_are_taken_from_their_table(run: Path, tmp_path: Path) -> None:
    _track_file(tmp_path, run)
    made = Page(srt.write_report(run, tmp_path / "a.html", tracks=tmp_path))
    (track,) = made.about["tracks"]["front"]["tracks"]
    assert (track["track"], track["object_id"]) == (3, 101)
    assert [row[:2] for row in track["rows"]] == [[0, 30], [1, 31], [2, 32]]
    assert made.about["tracks"]["front"]["figures"] == {"radar": "front", "ospa_m": 0.25}
    assert list(made.about["tracks"]) == ["front"]


def test_tracks_are_made_where_no_table_is_given(run: Path, tmp_path: Path) -> None:
    made = Page(srt.write_report(run, tmp_path / "a.html"))
    count = 0
    for radar in made.about["radars"]:
        name = radar["name"]
        expected = track(observe_run(run, radar=name), radar=name)
        tracks = made.about["tracks"][name]["tracks"]
        shown = {(t["track"], row[0]): row for t in tracks for row in t["rows"]}
        assert set(shown) == {(r.track, r.frame) for r in expected.rows}
        for r in expected.rows:
            assert shown[r.track, r.frame][1:3] == pytest.approx((r.x_m, r.y_m), abs=5.1e-5)  # four decimals
        count += len(shown)
    assert count > 0
    assert Page(srt.write_report(run, tmp_path / "b.html", track=False)).about["tracks"] == {}


def test_explanations_are_made_when_asked_for(run: Path, tmp_path: Path) -> None:
    copy = tmp_path / "run"
    shutil.copytree(run, copy, ignore=shutil.ignore_patterns("left"))
    summary = json.loads((copy / "summary.json").read_text(encoding="utf-8"))
    summary["radars"] = [summary["radars"][0] | {"frames": summary["radars"][0]["frames"][1:2]}]
    (copy / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    made = Page(srt.write_report(copy, explain=True))
    (told,) = srt.explain(copy).frames
    assert told.objects
    for item in told.objects:
        shown = made.json["r0.explain.0"]["objects"][str(item.object_id)]
        assert (shown["verdict"], shown["text"]) == (item.verdict.name, item.verdict.text)
    assert made.about["tracks"] == {}  # one frame


@pytest.mark.parametrize(
    ("option", "name", "text", "said"),
    [
        ("tracks", "tracks.csv", "frame,x\n1,2\n", "no column"),
        ("explained", "explain.json", "{", "not what shenron-rt explain writes"),
        ("explained", "explain.json", '{"frames": [{"radar": "front", "frame": 0, "objects": [{}]}]}', "not what"),
    ],
)
def test_files_of_another_kind_are_refused(
    run: Path, tmp_path: Path, option: str, name: str, text: str, said: str
) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        srt.write_report(run, tmp_path / "a.html", **{option: tmp_path})
    assert not (tmp_path / "a.html").exists()


def test_files_that_are_not_there_are_refused(run: Path, tmp_path: Path) -> None:
    with pytest.raises(NotFoundError, match=r"tracks\.csv"):
        srt.write_report(run, tmp_path / "a.html", tracks=tmp_path)


# ---- the command line
def test_the_command_writes_and_refuses_to_replace(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "page.html"
    assert main(["report", str(run), "-o", str(target), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said == {"path": str(target), "bytes": target.stat().st_size, "frames": 2 * FRAMES}
    before = target.read_bytes()
    assert main(["report", str(run), "-o", str(target)]) == 2
    err = capsys.readouterr().err
    assert "--overwrite" in err
    assert err.count("\n") == 1
    assert main(["report", str(run), "-o", str(target), "--overwrite"]) == 0
    assert target.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["page.html"]


def test_a_page_that_cannot_be_made_leaves_the_old_one(run: Path, tmp_path: Path) -> None:
    copy, target = tmp_path / "run", tmp_path / "page.html"
    shutil.copytree(run, copy)
    (copy / "radars/left/frame_000002/cube.npz").write_bytes(b"not an archive")
    target.write_text("old", encoding="utf-8")
    with pytest.raises(InputError, match=r"frame_000002/cube\.npz"):
        srt.write_report(copy, target, overwrite=True)
    assert target.read_text(encoding="utf-8") == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["page.html", "run"]


@pytest.mark.parametrize("kind", ["missing", "empty", "folder", "without radars", "without config"])
def test_what_is_no_run_is_told_in_one_line(
    kind: str, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "x"
    arguments = ["report", str(folder)]
    if kind == "empty":
        folder.mkdir()
    elif kind == "folder":
        arguments = ["report", str(run), "-o", str(tmp_path)]
    elif kind == "without radars":
        folder.mkdir()
        (folder / "summary.json").write_text('{"version": "0"}', encoding="utf-8")
    elif kind == "without config":
        shutil.copytree(run, folder, ignore=shutil.ignore_patterns("*.npz", "config.yaml"))
    assert main(arguments) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert {"folder": "is a folder", "without radars": "without frames", "without config": "config.yaml"}.get(
        kind, "not a run folder"
    ) in err


def test_runs_without_a_scene_have_a_page_too(run: Path, tmp_path: Path) -> None:
    adc = run / "radars/front/frame_000000/adc.npz"
    assert main(["process", str(adc), "-o", str(tmp_path / "processed"), "--no-pictures"]) == 0
    made = Page(srt.write_report(tmp_path / "processed"))
    (radar,) = made.about["radars"]
    assert radar["bodies"] == made.about["meshes"] == []
    assert "r0.rd.0" in made.arrays
    assert "r0.radar" not in made.arrays  # nobody knows how that radar moved
    assert len(made.detections("r0", 0)["range"]) > 0


def test_runs_of_lidar_frames_have_a_page_without_meshes(tmp_path: Path) -> None:
    assert main(["cast-lidar", "braking", "-o", str(tmp_path / "cast")]) == 0
    frame = tmp_path / "cast/frame_000000.ply"
    options = ["--tag-table", "0.9.14", "--frame", "carla", "--sensor-pose", "0,0,2.5", "--mount", "2,0,1,10,0,0"]
    run = tmp_path / "lidar"
    assert main(["lidar", str(frame), "-o", str(run), "--profile", "awrl1432", "--no-pictures", *options]) == 0
    made = Page(srt.write_report(run))
    (radar,) = made.about["radars"]
    assert radar["mount"] == {"xyz_m": [2, 0, 1], "ypr_deg": [10, 0, 0]}
    assert radar["bodies"] == []
    table = srt.Detections.from_csv(run / "radars/awrl1432/frame_000000/detections.csv").table
    np.testing.assert_allclose(made.detections("r0", 0)["range"], table["range"], rtol=1.2e-7)


def test_meshes_that_are_gone_are_left_out_with_a_warning(
    run: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    copy = tmp_path / "run"
    shutil.copytree(run, copy)
    config = (copy / "config.yaml").read_text(encoding="utf-8")
    gone = config.replace("shape: box:4x2x1.5", "mesh: /nowhere/car.obj")
    assert gone != config
    (copy / "config.yaml").write_text(gone, encoding="utf-8")
    made = Page(srt.write_report(copy))
    assert "/nowhere/car.obj" in caplog.text
    assert made.about["meshes"] == made.about["radars"][0]["bodies"] == []
    # how the radar moves is known without them: 10 m/s along 30 degrees
    eyes = made.arrays["r0.radar"]
    np.testing.assert_allclose(eyes[:, 12:], np.tile([8.66, 5.0, 0.0], (FRAMES, 1)), rtol=1e-6, atol=1e-6)


def test_runs_that_kept_no_cubes_have_a_page_without_maps(run: Path, tmp_path: Path) -> None:
    copy = tmp_path / "run"
    shutil.copytree(run, copy, ignore=shutil.ignore_patterns("*.npz"))
    made = Page(srt.write_report(copy))
    radar = made.about["radars"][0]
    assert radar["maps"] is None
    assert len(made.detections("r0", 0)["range"]) > 0
    # truth then is where the bodies are
    columns = {n: i for i, n in enumerate(made.about["columns"]["truth"])}
    row = [o["id"] for o in radar["objects"]].index(101)
    assert np.all(made.arrays["r0.truth"][row, columns["echoes"]] == 0)
    assert np.all(np.isfinite(made.arrays["r0.truth"][row, columns["range_m"]]))
