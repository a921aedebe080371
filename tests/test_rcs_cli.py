"""``shenron-rt rcs``: the sweep of the Python call, files, refusals in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import yaml

import shenron_rt as srt
from shenron_rt import runs
from shenron_rt.cli import main
from shenron_rt.cli.rcs_options import load_target, read_axis, read_pair, read_permittivity
from shenron_rt.errors import InputError

PLATE = ("rcs", "plate:0.05x0.05", "--freq-ghz", "24")


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def _refused(capsys: pytest.CaptureFixture[str], *argv: str) -> str:
    """Run, expect exit 2, nothing on stdout, one line on stderr and no folder; return the line."""
    before = set(Path().iterdir())
    assert main(argv) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1, err
    assert set(Path().iterdir()) == before
    return err


# ---- what is read
@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("5", [5.0]), ("24,77", [24.0, 77.0]), ("-1:1:0.5", [-1.0, -0.5, 0.0, 0.5, 1.0]), ("1:-1:-1", [1.0, 0.0, -1.0]),
        ("0:0.3:0.1", [0.0, 0.1, 0.2, 0.3]), ("0:1:0.4", [0.0, 0.4, 0.8]), ("-3,0:1:1", [-3.0, 0.0, 1.0]),
        ("2:2:1", [2.0]),
    ],
)  # fmt: skip
def test_axes_include_their_end_and_take_negative_values(text: str, values: list[float]) -> None:
    assert read_axis("az", text) == values


@pytest.mark.parametrize("text", ["", "a", "1:2", "1:2:0", "1:2:-1", "1:2:3:4", "nan", "0:1e9:1e-3", "1,,2"])
def test_axes_that_say_nothing_are_refused(text: str) -> None:
    with pytest.raises(InputError, match="--az"):
        read_axis("az", text)


def test_pairs_and_permittivities_are_read_in_both_forms() -> None:
    assert read_pair("bistatic", "-30,2.5") == (-30.0, 2.5)
    assert read_permittivity("3.2-0.05j") == read_permittivity("3.2,0.05") == 3.2 - 0.05j
    for read in (lambda: read_pair("bistatic", "1"), lambda: read_permittivity("wet"), lambda: read_pair("b", "1,inf")):
        with pytest.raises(InputError, match="--"):
            read()


def test_a_mesh_file_is_brought_to_metres_and_its_parts_get_tags(tmp_path: Path) -> None:
    file = tmp_path / "sign.obj"
    file.write_text("o Wall_01\nv 0 -5 -5\nv 0 5 -5\nv 0 5 5\nv 0 -5 5\nf 1 2 3\nf 1 3 4\n")
    name, mesh = load_target(str(file), mesh_frame="ros_z_up", units="cm", parts=False)
    assert name == "sign.obj"
    assert mesh.face_area.sum() == pytest.approx(0.01)
    assert load_target(str(file), mesh_frame="ros_z_up", units="0.01", parts=False)[1].face_area.sum() == pytest.approx(
        0.01
    )
    tagged = load_target(str(file), mesh_frame="ros_z_up", units="cm", parts=True)[1]
    assert [p.tag.name for p in tagged.parts] == ["Walls"]


# ---- what is written
def test_a_sweep_is_that_of_the_python_call_and_its_folder_is_whole(capsys: pytest.CaptureFixture[str]) -> None:
    argv = (*PLATE, "--az", "-40:40:1", "--pol", "vv,HH", "--seed", "3", "--max-bounces", "1", "-o", "out")
    assert main(argv) == 0
    out = Path("out")
    names = {p.name for p in out.iterdir()}
    assert names == {
        "config.yaml", "manifest.json", "summary.json", "rcs.csv", "rcs.npz", "rcs_azimuth.png", "rcs_polar.png"
    }  # fmt: skip
    assert runs.verify_manifest(out) == []
    sweep = srt.RcsSweep.load(out / "rcs.npz")
    same = srt.sweep_rcs(
        "plate:0.05x0.05", frequency_hz=24e9, azimuth_deg=np.arange(-40, 41.0), polarization=("VV", "HH"), seed=3,
        max_bounces=1,
    )  # fmt: skip
    assert np.array_equal(sweep.amplitude, same.amplitude)
    assert np.array_equal(sweep.azimuth_deg, same.azimuth_deg)
    assert sweep.target == "plate:0.05x0.05"

    summary = json.loads((out / "summary.json").read_text())
    assert summary["peak"] == {
        "rcs_dbsm": pytest.approx(float(sweep.rcs_dbsm.max())), "frequency_hz": 24e9, "elevation_deg": 0.0,
        "azimuth_deg": 0.0, "polarization": "VV",
    }  # fmt: skip
    first = summary["statistics"][0]
    assert first["median_dbsm"] == pytest.approx(float(np.median(sweep.rcs_dbsm[..., 0])))
    assert first["mean_dbsm"] == pytest.approx(10 * np.log10(sweep.rcs_m2[..., 0].mean()))
    assert summary["reference"]["mean_abs_db"] < 0.1  # the solver's bar for cuts of plates
    assert summary["settings"]["az"] == "-40:40:1"
    assert {"version", "backend", "seed", "seconds", "plan", "convergence", "pictures", "notes"} <= set(summary)
    assert set(summary["pictures"]) <= names
    config = yaml.safe_load((out / "config.yaml").read_text())["rcs"]
    assert (config["target"], config["freq_ghz"], config["polarization"]) == ("plate:0.05x0.05", "24", ["VV", "HH"])

    said = capsys.readouterr().out
    for word in ("81 aspects x 1 frequency", "peak -2.", "closed form", "out: written"):
        assert word in said
    assert main(["validate", "out", "out/config.yaml"]) == 0
    assert "sweep of plate:0.05x0.05" in capsys.readouterr().out


def test_json_is_all_that_stands_on_stdout_and_folders_are_numbered(capsys: pytest.CaptureFixture[str]) -> None:
    for folder in ("plate-0.05x0.05-rcs-24ghz", "plate-0.05x0.05-rcs-24ghz-2"):
        assert main([*PLATE, "--az", "-40:40:4", "--json", "--no-pictures"]) == 0
        summary = json.loads(capsys.readouterr().out)
        assert summary == json.loads((Path("out") / folder / "summary.json").read_text())
    assert summary["pictures"] == []


def test_frequencies_and_angles_give_profiles_images_and_maps(capsys: pytest.CaptureFixture[str]) -> None:
    argv = ("rcs", "plate:0.06x0.05", "--freq-ghz", "20:28:1", "--az=-10:10:2", "--el", "-2:2:2", "-o", "out")
    assert main([*argv, "--max-bounces", "1", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["pictures"] == [
        "rcs_azimuth.png", "rcs_map.png", "range_profile.png", "range_azimuth.png", "isar.png"
    ]  # fmt: skip
    assert summary["notes"] == []  # 0.15 m are unambiguous, and 0.17 m across: the plate fits
    assert all((Path("out") / name).stat().st_size > 5000 for name in summary["pictures"])
    assert len((Path("out") / "rcs.csv").read_text().splitlines()) == 1 + 9 * 3 * 11


def test_notes_say_when_a_profile_folds_or_cannot_be_made(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rcs", "box:2x0.05x0.05", "--freq-ghz", "23:25:0.25", "--el", "5", "-o", "a", "--json"]) == 0
    assert "fold" in json.loads(capsys.readouterr().out)["notes"][0]  # c/(2 x 0.25 GHz) = 0.6 m
    assert main([*PLATE[:2], "--freq-ghz", "23,24,26", "-o", "b", "--json"]) == 0
    assert "equally spaced" in json.loads(capsys.readouterr().out)["notes"][0]


def test_bistatic_near_range_and_dielectric_sweeps_are_those_of_python(capsys: pytest.CaptureFixture[str]) -> None:
    cases: list[tuple[list[str], dict[str, Any]]] = [
        (["--bistatic", "-20,0"], {"bistatic": (-20.0, 0.0)}),
        (["--distance-m", "2"], {"distance_m": 2.0}),
        (["--permittivity", "3-0.1j"], {"permittivity": 3 - 0.1j}),
        (["--material", "parts", "--rays-per-wavelength", "2"], {"material": None, "rays_per_wavelength": 2.0}),
    ]
    for options, keywords in cases:
        assert main([*PLATE, "--az", "10:30:5", *options, "-o", "out", "--overwrite", "--no-pictures"]) == 0
        sweep = srt.RcsSweep.load("out/rcs.npz")
        same = srt.sweep_rcs("plate:0.05x0.05", frequency_hz=24e9, azimuth_deg=[10, 15, 20, 25, 30.0], **keywords)
        assert np.array_equal(sweep.amplitude, same.amplitude), options
        assert json.loads(Path("out/summary.json").read_text())["reference"] is None
    assert "closed form" not in capsys.readouterr().out


# ---- convergence
def test_convergence_is_reported_and_drawn_and_the_finer_sweep_is_kept(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*PLATE, "--az", "-40:40:2", "--converge", "-o", "out"]) == 0
    summary = json.loads(Path("out/summary.json").read_text())
    assert summary["rays_per_wavelength"] == srt.RcsSweep.load("out/rcs.npz").rays_per_wavelength == 2.0
    (step,) = summary["convergence"]["steps"]
    assert step["rays_per_wavelength"] == [1.0, 2.0]
    assert "convergence.png" in summary["pictures"]
    assert f"convergence: {summary['convergence']['says']}" in capsys.readouterr().out


def test_a_target_error_that_is_met_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*PLATE, "--az", "-40:40:4", "--target-error-db", "0.5", "--json", "--no-pictures"]) == 0
    found = json.loads(capsys.readouterr().out)["convergence"]
    assert found["reached"] is True
    assert found["says"].endswith("target 0.5 dB reached")


# ---- plan
def test_a_plan_is_printed_and_nothing_else_happens(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*PLATE, "--az", "-40:40:1", "--plan"]) == 0
    said = capsys.readouterr().out
    for word in ("81 aspects", "cells", "rays", "peak memory", " s,"):
        assert word in said
    assert main([*PLATE, "--az", "-40:40:1", "--plan", "--json"]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert plan["aspects"] == 81
    assert 0 < plan["seconds"] < 60
    assert list(Path().iterdir()) == []


def test_coarse_round_targets_can_be_rounded(tmp_path: Path) -> None:
    """A ball of 320 facets scatters like a ball, and the run says that it was rounded."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=0.1)
    ball.export(tmp_path / "ball.stl")
    at = (
        "rcs",
        str(tmp_path / "ball.stl"),
        "--freq-ghz",
        "24",
        "--az",
        "0:30:10",
        "--max-bounces",
        "1",
        "--no-pictures",
    )
    levels = {}
    for word, more in (("coarse", ()), ("round", ("--round-below-deg", "30"))):
        assert main([*at, *more, "-o", word]) == 0
        levels[word] = 10 ** (np.load(f"{word}/rcs.npz")["rcs_dbsm"].ravel() / 10) / (np.pi * 0.1**2)
    # facets of 30 mm within lambda / 256 of the ball, off by 0.05 rad at most: 0.2 dB; ka = 50 leaves 0.2 dB more
    assert np.abs(10 * np.log10(levels["round"])).max() < 0.4
    assert np.abs(10 * np.log10(levels["coarse"])).max() > 1.0
    recorded = yaml.safe_load(Path("round/config.yaml").read_text())
    assert recorded["rcs"]["round_below_deg"] == 30.0


def test_a_run_that_would_take_too_long_is_refused_unless_it_is_meant(capsys: pytest.CaptureFixture[str]) -> None:
    long = (*PLATE, "--az", "-40:40:1", "--max-seconds", "1e-6", "--no-pictures")
    assert "coarser step" in _refused(capsys, *long)
    assert main([*long, "--yes"]) == 0


def test_a_run_beyond_the_memory_of_the_machine_is_refused_even_then(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shenron_rt.turntable.plan.machine_memory", lambda: 1 << 20)
    assert "this machine has" in _refused(capsys, *PLATE, "--yes")


# ---- refusals
@pytest.mark.parametrize(
    ("argv", "word"),
    [
        (("rcs", "plate:0.05x0.05"), "freq-ghz"),
        (("rcs", "plat:0.05x0.05", "--freq-ghz", "24"), "did you mean 'plate'"),
        (("rcs", "none.obj", "--freq-ghz", "24"), "none.obj"),
        ((*PLATE, "--pol", "VX"), "VX"),
        ((*PLATE, "--az", "1:2"), "--az 1:2"),
        ((*PLATE, "--material", "stell"), "unknown material"),
        ((*PLATE, "--az", "90", "--distance-m", "0.01"), "distance_m"),
        ((*PLATE, "--max-bounces", "0"), "max_bounces"),
        ((*PLATE, "--rays-per-wavelength", "-1"), "rays"),
        ((*PLATE, "--target-error-db", "-1"), "--target-error-db"),
        ((*PLATE, "--window-deg", "-1"), "--window-deg"),
        ((*PLATE, "--seed", "-1"), "--seed"),
        ((*PLATE, "--freq-ghz", "-24"), "freq"),
    ],
)
def test_bad_input_is_one_line_and_leaves_nothing(
    capsys: pytest.CaptureFixture[str], argv: tuple[str, ...], word: str
) -> None:
    assert word in _refused(capsys, *argv)


def test_a_folder_that_holds_something_is_refused_before_any_work(capsys: pytest.CaptureFixture[str]) -> None:
    Path("full").mkdir()
    Path("full/notes.txt").write_text("mine")
    assert "not empty" in _refused(capsys, *PLATE, "-o", "full")
    assert "manifest.json" in _refused(capsys, *PLATE, "-o", "full", "--overwrite")
    assert Path("full/notes.txt").read_text() == "mine"
