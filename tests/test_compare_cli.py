"""``shenron-rt compare`` on run folders: tables, files, exit codes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from compare_tools import frame_of, patch, scatterers_of
from run_tools import hand_made_frame

from shenron_rt import runs
from shenron_rt.cli import main
from shenron_rt.io.recorded import PointCloud, write_ti_tlv

AT = (20.0, 0.0, 0.0)


def write_run(root: Path, frame: Any, settings: dict[str, Any]) -> Path:
    return write_runs(root, [frame], settings)


def write_runs(root: Path, frames: list[Any], settings: dict[str, Any]) -> Path:
    with runs.write_run(root) as place:
        for frame in frames:
            runs.write_frame(runs.frame_folder(place.partial, "front", frame.frame), frame)
        records = [runs.frame_summary(frame, {7: "parked"}) for frame in frames]
        radar = {"name": "front", "profile": frames[0].profile.name, "frames": records}
        runs.write_json(place.partial / "summary.json", {"version": "0", "radars": [radar]})
        (place.partial / "config.yaml").write_text(yaml.safe_dump(settings, sort_keys=False))
    return root


@pytest.fixture(scope="module")
def two_runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("runs")
    a = frame_of(scatterers_of(patch(7, AT, cosine=0.95, area=200.0)))
    b = frame_of(scatterers_of(patch(7, AT, cosine=0.1, area=200.0), door="lidar", origin=(-2.0, 0.0, 1.5)))
    actors = [{"id": 7, "xyz_m": [1, 2, 3]}, {"id": 8, "xyz_m": [0, 0, 0]}]
    moved = [actors[1], {"id": 7, "xyz_m": [1, 2, 4]}]
    return (
        write_run(folder / "mesh", a, {"seed": 7, "actors": actors, "materials": "automotive"}),
        write_run(folder / "lidar", b, {"seed": 9, "actors": moved, "materials": "automotive", "ego": [1, 2]}),
    )


def test_two_runs_print_their_differences_and_write_page_and_json(
    two_runs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["compare", *map(str, two_runs), "-o", str(tmp_path / "out")]) == 0
    text = capsys.readouterr().out
    assert "parked" in text
    assert "incidence" in text
    data = json.loads((tmp_path / "out" / "compare.json").read_text())
    # list items are known by their id, so that another order is no change
    assert [(s["key"], s["a"], s["b"]) for s in data["settings"]] == [
        ("ego", None, "2 entries"),
        ("seed", 7, 9),
        ("actors.7.xyz_m", [1, 2, 3], [1, 2, 4]),
    ]
    assert (data["results"]["a"]["door"], data["results"]["b"]["door"]) == ("mesh", "lidar")
    assert data["objects"][0]["name"] == "parked"
    assert (tmp_path / "out" / "compare.png").stat().st_size > 10_000
    assert runs.verify_manifest(tmp_path / "out") == []


def test_json_is_all_that_stands_on_stdout(
    two_runs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["compare", *map(str, two_runs), "--json", "-o", str(tmp_path / "out")]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["objects"][0]["cause"] == "incidence"
    assert data == json.loads((tmp_path / "out" / "compare.json").read_text())


def test_a_ti_log_and_carlas_radar_stand_beside_a_run(
    two_runs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # one point on the object, one far from everything; the second frame is empty
    nothing = np.full(2, 20.0)
    cloud = PointCloud(np.array([[20.05, 0.0, 0.0], [33.0, 10.0, 0.0]]), np.zeros(2), nothing, nothing)
    empty = PointCloud(np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0), frame=1)
    log = write_ti_tlv(tmp_path / "demo.dat", [cloud, empty])
    rows = tmp_path / "radar.npy"
    np.save(rows, np.array([[0.0, 0.0, 0.0, 20.05], [0.0, 0.3, 0.0, 34.0]], dtype=np.float32))
    for k, recording in enumerate((log, rows)):
        out = tmp_path / f"out{k}"
        assert main(["compare", str(two_runs[0]), str(recording), "--json", "-o", str(out)]) == 0
        data = json.loads(capsys.readouterr().out)
        matched = [m["range_m_error"] for m in data["detections"]["matched"] if m["object_id"] == 7]
        # the object's own detection lies within a range bin, 0.375 m, of its true range
        assert matched == pytest.approx([0.05], abs=0.375)
        assert [e["range_m"] > 30 for e in data["detections"]["extra"]] == [True]
        assert "recorded point cloud" in data["notes"][0]
    assert main(["compare", str(two_runs[0]), str(log), "--frame", "7"]) == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["{mesh}", "nowhere"], "no such run folder or recording"),
        (["{mesh}", "{empty}"], "not a run folder"),
        (["{mesh}", "{lidar}", "--radar", "rear"], "no radar 'rear' in this run; it has front"),
        (["{mesh}", "{lidar}", "--frame", "3"], "no frame 3; it has [0]"),
        (["{mesh}", "{lidar}", "--lidar-origin", "1,2"], "three numbers x,y,z"),
        (["{mesh}", "{lidar}", "--gate", "0"], "gate_cells and voxel_m must be positive"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    arguments: list[str], message: str, two_runs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    places = {"mesh": two_runs[0], "lidar": two_runs[1], "empty": tmp_path}
    assert main(["compare", *(a.format(**places) for a in arguments)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def test_a_processed_capture_is_compared_in_maps_and_detections(
    two_runs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    frame = hand_made_frame()
    full = write_run(tmp_path / "full", frame, {})
    del frame.scatterers
    frame.returns = None
    path = runs.frame_folder(full, "front", 0)
    for name in ("scatterers.npz", "returns.npz"):
        (path / name).rename(tmp_path / name)
    other = write_run(tmp_path / "other", hand_made_frame(), {})
    assert main(["compare", str(full), str(other), "--json", "-o", str(tmp_path / "out")]) == 0
    data = json.loads(capsys.readouterr().out)
    assert {o["cause"] for o in data["objects"]} == {"not_simulated"}
    assert data["maps"]["range_doppler"]["log_spectral_distance_db"] == 0
    assert data["scatterers"] is None
