"""``shenron-rt export``: places, refusals, options, and what stands beside our radars."""

from __future__ import annotations

import importlib.util
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from export_tools import export_mcap_and_read, files_up_to, read_mcap, unpack

import shenron_rt as srt
from shenron_rt.cli import main

#: format -> (module of its optional library or None, extra, default name of the export of a run "run")
FORMATS = {
    "mcap": ("foxglove", "mcap", "run.mcap"),
    "ros2": ("rosbags", "ros", "run-ros2"),
    "zarr": ("zarr", "data", "run.zarr"),
    "pcd": (None, "", "run-pcd"),
    "ply": (None, "", "run-ply"),
    "csv": (None, "", "run-csv"),
}


@pytest.fixture
def run(street_run: Path, tmp_path: Path) -> Path:
    """The run under the name ``run`` in a folder of its own."""
    link = tmp_path / "place" / "run"
    link.parent.mkdir()
    link.symlink_to(street_run)
    return link


def _needs(form: str) -> None:
    library, extra, _ = FORMATS[form]
    if library is not None:
        pytest.importorskip(library, reason=f"{library} is not installed (extra {extra})")


def _contents(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize("form", FORMATS)
def test_a_full_disk_is_one_line_and_leaves_nothing_new_and_the_old_as_it_was(
    form: str, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _needs(form)
    words = ["export", str(run), "--to", form, "-o", str(tmp_path / "out" / "export")]
    with files_up_to(1_000):
        assert main(words) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "export could not be written (File too large); nothing was left there" in said
    assert list((tmp_path / "out").iterdir()) == []
    assert main([*words, "--frames", "0:1"]) == 0
    before = _contents(tmp_path / "out")
    with files_up_to(1_000):
        assert main([*words, "--overwrite"]) == 2
    assert _contents(tmp_path / "out") == before


@pytest.mark.parametrize("form", FORMATS)
def test_an_export_that_is_there_is_kept_unless_overwritten(
    form: str, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _needs(form)
    words = ["export", str(run), "--to", form, "--frames", "0:1"]
    assert main(words) == 0
    place = run.parent / FORMATS[form][2]
    assert place.exists()
    here = place.parent if place.is_file() else place
    before = _contents(place) if place.is_dir() else {place.name: place.read_bytes()}
    capsys.readouterr()
    assert main(words) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert {name: (here / name).read_bytes() for name in before} == before
    assert main([*words[:-1], "1:2", "--overwrite"]) == 0
    assert {name: (here / name).read_bytes() for name in before if (here / name).is_file()} != before
    assert [p for p in place.parent.iterdir() if ".partial-" in p.name] == []


@pytest.mark.parametrize("form", [f for f in FORMATS if f != "mcap"])
def test_overwrite_replaces_no_folder_that_is_no_export(
    form: str, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _needs(form)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/thesis.txt").write_text("years of work")
    assert main(["export", str(run), "--to", form, "-o", str(tmp_path / "mine"), "--overwrite"]) == 2
    assert "replaces exports of this kind only" in capsys.readouterr().err
    assert _contents(tmp_path / "mine") == {"thesis.txt": b"years of work"}


@pytest.mark.parametrize("form", [f for f, (library, _, _) in FORMATS.items() if library])
def test_a_missing_library_is_named_with_the_command_that_installs_it(
    form: str, run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    library, extra, _ = FORMATS[form]
    real = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *a: None if name == library else real(name, *a))
    assert main(["export", str(run), "--to", form, "-o", str(tmp_path / "export")]) == 2
    assert f"pip install 'shenron-rt[{extra}]'" in capsys.readouterr().err
    assert not (tmp_path / "export").exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--to", "csv", "--radar", "rear"], "no radar 'rear' in this run; it has front"),
        (["--to", "csv", "--frames", "7:9"], "no frames of 7:9; it has 0:3"),
        (["--to", "csv", "--lidar"], "--lidar: --to csv has no such option; it is for mcap and ros2"),
        (["--to", "zarr", "--text"], "--text: --to zarr has no such option; it is for pcd and ply"),
        (["--to", "ply", "--no-pictures"], "--no-pictures: --to ply has no such option; it is for mcap"),
        (["--to", "mcap", "--recorded", "nothing.dat"], "nothing.dat: no such file"),
        (["--to", "mcap", "--recorded-mount", "1,0,1"], "--recorded-mount: give the recording too"),
        (["--to", "usd"], "usd"),
    ],
)
def test_refusals_are_one_line_with_what_is_allowed(
    words: list[str], says: str, run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _needs("mcap")
    assert main(["export", str(run), *words]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert says in said


def test_a_folder_that_is_no_run_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(tmp_path), "--to", "csv"]) == 2
    assert "not a run folder" in capsys.readouterr().err


def test_json_says_what_was_written_and_nothing_else(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["export", str(run), "--to", "csv", "-o", str(run.parent / "x"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "to": "csv", "path": str(run.parent / "x"), "frames": 3, "radars": ["front"],
    }  # fmt: skip


def test_more_triangles_than_a_viewer_takes_leave_the_largest_body_out(
    run: Path, caplog: pytest.LogCaptureFixture
) -> None:
    from shenron_rt.export.poses import ScenePoses
    from shenron_rt.export.scene_bodies import drawable

    poses = ScenePoses(srt.load_scene(run / "config.yaml"))
    bodies = poses.bodies(0.0, moving=False) + poses.bodies(0.0, moving=True)
    assert [b.label for b in drawable(bodies)] == ["road", "left_wall", "right_wall", "lead"]
    assert [b.label for b in drawable(bodies, limit=30)] == ["road", "left_wall", "right_wall"]
    assert "the viewer gets no mesh of lead" in caplog.text


def test_a_body_that_bends_is_refused() -> None:
    from shenron_rt.errors import InputError
    from shenron_rt.export.poses import rigid_fit

    rng = np.random.default_rng(1)
    own = rng.normal(size=(40, 3))
    seen = own.copy()
    seen[7] += 1e-3
    with pytest.raises(InputError, match="body/walker: its vertices are up to"):
        rigid_fit(own, seen, child="body/walker")


@pytest.mark.parametrize("form", FORMATS)
def test_frames_without_a_detection_are_exported_too(form: str, street_run: Path, tmp_path: Path) -> None:
    _needs(form)
    empty = tmp_path / "run"
    shutil.copytree(street_run, empty)
    for file in empty.rglob("detections.csv"):
        file.write_text(file.read_text().splitlines()[0] + "\n")
    summary = json.loads((empty / "summary.json").read_text())
    for record in summary["radars"][0]["frames"]:
        record |= {"detections": 0, "strongest": None}
    (empty / "summary.json").write_text(json.dumps(summary))
    words = ["export", str(empty), "--to", form, "--frames", "0:2"]
    assert main([*words, *(["--no-pictures"] if form == "mcap" else [])]) == 0
    place = tmp_path / FORMATS[form][2]
    if form == "mcap":
        found = read_mcap(place)
        assert [len(unpack(m.message)["x"]) for m in found["/radar/front/points"]] == [0, 0]
        assert not {"/radar/front/strongest", "/radar/front/range_doppler"} & set(found)
        assert "0 detections" in found["/link_budget"][0].message.message
    elif form == "zarr":
        from shenron_rt.export import open_dataset

        with open_dataset(place) as data:
            assert data.sizes["detection"] == 0
            assert data["n_detections"].values.tolist() == [0, 0]
    elif form == "ros2":
        from rosbags.highlevel import AnyReader

        with AnyReader([place]) as reader:
            clouds = [
                reader.deserialize(raw, c.msgtype) for c, _, raw in reader.messages() if c.topic.endswith("points")
            ]
        assert [cloud.width for cloud in clouds] == [0, 0]
    else:
        assert [f["points"] for f in json.loads((place / "export.json").read_text())["frames"]] == [0, 0]


def test_ghosts_are_marked_in_clouds_and_stores(street_run: Path, tmp_path: Path) -> None:
    for form in ("mcap", "zarr"):
        _needs(form)
    from shenron_rt.export import open_dataset

    run = tmp_path / "run"
    shutil.copytree(street_run, run)
    folder = run / "radars/front/frame_000000"
    rows = len(srt.Detections.from_csv(folder / "detections.csv"))
    chains = ["chain,ghost", "40>101,1", *["101,0"] * (rows - 1)]
    (folder / "detections.chains.csv").write_text("\n".join(chains) + "\n")
    summary = json.loads((run / "summary.json").read_text())
    summary["radars"][0]["frames"][0]["strongest"] |= {"chain": "40>101", "ghost": True}
    (run / "summary.json").write_text(json.dumps(summary))
    wanted = [1] + [0] * (rows - 1)
    found = export_mcap_and_read(run, tmp_path / "a.mcap", "--frames", "0:1", "--no-pictures")
    assert unpack(found["/radar/front/points"][0].message)["ghost"].tolist() == wanted
    assert found["/radar/front/strongest"][0].message["chain"] == "40>101"
    assert "a ghost by way of 40>101" in found["/link_budget"][0].message.message
    assert main(["export", str(run), "--to", "zarr"]) == 0
    with open_dataset(tmp_path / "run.zarr") as data:
        assert data["detection_ghost"].sel(frame=0).values.astype(int).tolist()[:rows] == wanted
    assert main(["export", str(run), "--to", "csv"]) == 0
    assert srt.Detections.from_csv(tmp_path / "run-csv/front/frame_000000.csv").ghost.tolist() == wanted


def test_a_run_that_kept_maps_and_detections_only_gives_the_same_pictures_and_maps(
    street_run: Path, tmp_path: Path
) -> None:
    _needs("mcap")
    _needs("zarr")
    from shenron_rt.export import open_dataset

    source, lean = street_run / "radars/front/frame_000000", tmp_path / "lean/radars/front/frame_000000"
    lean.mkdir(parents=True)
    with np.load(source / "cube.npz") as cube:
        np.savez(lean / "maps.npz", **{name: cube[name] for name in ("range_doppler", "range_azimuth")})
    (lean / "detections.csv").write_bytes((source / "detections.csv").read_bytes())
    # the truth that pictures are labelled with
    (lean / "returns.npz").write_bytes((source / "returns.npz").read_bytes())
    summary = json.loads((street_run / "summary.json").read_text())
    summary["radars"][0]["frames"] = summary["radars"][0]["frames"][:1]
    (tmp_path / "lean/summary.json").write_text(json.dumps(summary))
    (tmp_path / "lean/config.yaml").write_bytes((street_run / "config.yaml").read_bytes())
    full, less = (
        export_mcap_and_read(folder, tmp_path / f"{folder.name}.mcap", "--frames", "0:1")
        for folder in (street_run, tmp_path / "lean")
    )
    for name in ("range_doppler", "range_azimuth"):
        topic = f"/radar/front/{name}"
        assert less[topic][0].message.data == full[topic][0].message.data
    assert main(["export", str(tmp_path / "lean"), "--to", "zarr"]) == 0
    with open_dataset(tmp_path / "lean.zarr") as data, np.load(source / "cube.npz") as cube:
        assert "adc" not in data
        np.testing.assert_array_equal(data["range_azimuth"][0], cube["range_azimuth"].astype(np.float32))
        np.testing.assert_array_equal(data["velocity"], cube["velocity_mps"])
