"""The command line: exit codes, one-line errors, JSON, and that help stays cheap."""

from __future__ import annotations

import errno
import json
import logging
import math
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from shenron_rt.cli import main
from shenron_rt.cli.common import Overrides, complain, frame_range, log_to_stderr, override_profile
from shenron_rt.config.profile import load_profile
from shenron_rt.errors import InputError

VERBS = ("run", "rcs", "cast-lidar", "process", "report", "resolve", "validate", "profiles", "materials", "doctor")


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.chdir(tmp_path)
    yield
    logger = logging.getLogger("shenron_rt")
    logger.handlers = [h for h in logger.handlers if h.name != "cli"]


def _refused(capsys: pytest.CaptureFixture[str], *argv: str) -> str:
    """Run, expect exit 2, nothing on stdout and one line on stderr; return the line."""
    assert main(argv) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1, err
    assert err.startswith("shenron-rt: ")
    return err


# ---- help
def test_help_is_cheap_and_names_every_verb() -> None:
    code = (
        "import sys\nfrom shenron_rt.cli import main\nassert main(['--help']) == 0\n"
        "heavy = {'mitsuba', 'drjit', 'scipy', 'matplotlib', 'trimesh', 'finufft', 'numpy'} & set(sys.modules)\n"
        "sys.exit(f'loaded {heavy}' if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for verb in VERBS:
        assert f" {verb} " in done.stdout


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_help(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([verb, "--help"]) == 0
    assert f"Usage: shenron-rt {verb}" in capsys.readouterr().out


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip()[0].isdigit()


# ---- bad usage
@pytest.mark.parametrize(
    ("argv", "words"),
    [
        (["frob"], "frob"),
        (["run", "--rays", "many"], "--rays"),
        (["run", "--rays", "0"], "at least 1"),
        (["run", "--backend", "gpu"], "llvm"),
        (["run", "--frames", "3:3"], "B is not included"),
        (["run", "--frames", "x"], "B is not included"),
        (["run", "--seed", "-1"], "--seed -1"),
        (["run", "nope"], "braking"),
        (["run", "nope.yaml"], "does not exist"),
        (["run", "--profile", "awrl143"], "did you mean 'awrl1432'"),
        (["run", "--profile", "awrl1432", "--profile", "awrl1432"], "given twice"),
        (["run", "--set", "rain=3"], "scene.weather.rain_mm_h=25"),
        (["run", "--set", "profile.waveform.chirps"], "KEY=VALUE"),
        (["run", "--set", "profile.waveform.chrps=3"], "did you mean 'chirps'"),
        (["run", "--set", "scene.weather.rain_mm_h=-3"], "weather.rain_mm_h"),
        (["run", "--set", "processing.pfa=2"], "processing.pfa"),
        (["process", "adc.npz"], "adc.npz: no such file"),
        (["profiles", "nope"], "known: awrl1432"),
        (["profiles", "awrl1432", "--set", "scene.seed=3"], "has no scene"),
        (["materials", "asfalt"], "did you mean 'asphalt'"),
        (["materials", "--table", "nope"], "automotive"),
        (["resolve", "nope.obj"], "nope.obj"),
        (["validate"], "--all"),
        (["validate", "nope.yaml"], "nope.yaml: no such file"),
    ],
)
def test_bad_input_is_exit_2_and_one_line(argv: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert words in _refused(capsys, *argv)
    assert list(Path().iterdir()) == [], "nothing was written"


def test_a_file_with_several_problems_is_one_line_that_counts_them(capsys: pytest.CaptureFixture[str]) -> None:
    Path("bad.yaml").write_text("version: 1\nactors:\n  - {id: 1, shape: car, velocity: 3}\nweather: {rain_mm_h: -1}\n")
    line = _refused(capsys, "run", "bad.yaml")
    assert "bad.yaml:" in line
    assert "(and 1 more; shenron-rt validate lists all)" in line
    assert main(["validate", "bad.yaml"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2
    assert any("bad.yaml:3: actors.0.velocity" in item for item in lines)
    assert any("bad.yaml:4: weather.rain_mm_h" in item for item in lines)


def test_an_internal_error_is_exit_1(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: Any, **__: Any) -> None:
        raise ZeroDivisionError("planted")

    monkeypatch.setattr("shenron_rt.config.profile.load_profile", broken)
    assert main(["profiles", "awrl1432"]) == 1
    assert "internal error: ZeroDivisionError: planted" in capsys.readouterr().err
    monkeypatch.setenv("SHENRON_RT_DEBUG", "1")
    with pytest.raises(ZeroDivisionError):
        main(["profiles", "awrl1432"])


@pytest.mark.parametrize(
    ("code", "said"),
    [
        (errno.ENOSPC, "a.npz: no space left on the disk; what was being written has been removed"),
        (errno.EROFS, "a.npz: Read-only file system"),
        (errno.ENAMETOOLONG, "a.npz: File name too long"),
        (errno.EFBIG, "a.npz: File too large; what was being written has been removed"),
    ],
)
def test_what_the_system_refuses_is_exit_2(
    code: int, said: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: Any, **__: Any) -> None:
        raise OSError(code, os.strerror(code), "a.npz")

    monkeypatch.setattr("shenron_rt.config.profile.load_profile", refused)
    assert _refused(capsys, "profiles", "awrl1432") == f"shenron-rt: {said}\n"


def test_complain_prints_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert complain("a\n\n  b\n c", hint="h", code=5) == 5
    assert capsys.readouterr().err == "shenron-rt: a (and 2 more; shenron-rt validate lists all) (h)\n"


def test_warnings_go_to_stderr_once(capsys: pytest.CaptureFixture[str]) -> None:
    log_to_stderr()
    for _ in range(3):
        logging.getLogger("shenron_rt.somewhere").warning("falling back to %s", "scalar")
    out, err = capsys.readouterr()
    assert out == ""
    assert err == "warning: falling back to scalar\n"


# ---- options
def test_set_options_are_sorted_by_what_they_change() -> None:
    given = Overrides(["profile.receiver.noise_figure_db=12", "scene.weather.rain_mm_h=25", "processing.pfa=1e-4"])
    assert given.profile == {"receiver.noise_figure_db": "12", "processing.pfa": "1e-4"}
    assert given.scene == {"weather.rain_mm_h": "25"}
    profile = override_profile(load_profile("awrl1432"), given.profile)
    assert profile.receiver.noise_figure_db == 12.0
    assert profile.processing.pfa == 1e-4


def test_frame_ranges_are_half_open() -> None:
    assert list(frame_range("2:5")) == [2, 3, 4]
    assert list(frame_range(":2")) == [0, 1]
    assert list(frame_range("7")) == [7]
    for bad in ("5:2", "a:b", "-1:3", "3:", ""):
        if bad:
            with pytest.raises(InputError, match="--frames"):
                frame_range(bad)


# ---- profiles, materials, doctor
def test_profiles_lists_all_and_shows_one_with_sources(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["profiles"]) == 0
    out = capsys.readouterr().out
    for name in (
        "awrl1432", "awrl1432_137mhz", "awrl1432_staggered", "awrl1432boost", "ddm_4x4", "radarbook", "radarbook2",
        "radarbook_200mhz", "ti_cascade", "mmwcas",
    ):  # fmt: skip
        assert f" {name} " in out
    assert "R max [m]" in out
    assert main(["profiles", "awrl1432boost"]) == 0
    out = capsys.readouterr().out
    assert "waveform.chirp_period_s" in out
    assert "TI TIDUF76" in out
    assert "unconfirmed: recalled" in out
    assert "range_resolution_m" in out
    assert "Unconfirmed or assumed: waveform.carrier_hz" in out


def test_profiles_json_holds_given_derived_and_sources(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["profiles", "awrl1432", "--set", "profile.waveform.chirps=32", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    profile = load_profile("awrl1432", {"waveform.chirps": 32})
    assert shown["given"]["waveform"]["chirps"] == 32
    assert shown["derived"]["velocity_resolution_mps"] == pytest.approx(profile.velocity_resolution_mps)
    assert shown["derived"]["loss_azimuth_60_deg_db"] == pytest.approx(3.0103, abs=1e-4)
    assert shown["sources"]["waveform.carrier_hz"].startswith("C-Shenron")
    assert main(["profiles", "--json"]) == 0
    assert {"awrl1432", "mmwcas"} <= {p["name"] for p in json.loads(capsys.readouterr().out)}


def test_a_profile_file_of_ones_own_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    data = load_profile("awrl1432").model_dump(mode="json", exclude_none=True) | {"name": "mine", "sources": {}}
    Path("mine.yaml").write_text(yaml.safe_dump(data))
    assert main(["profiles", "mine.yaml"]) == 0
    assert capsys.readouterr().out.startswith("mine: ")


def test_materials_lists_and_shows_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["materials"]) == 0
    assert "asphalt" in capsys.readouterr().out
    assert main(["materials", "concrete"]) == 0
    assert "P.2040" in capsys.readouterr().out
    assert main(["materials", "concrete", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    assert shown["given"]["permittivity"]["model"] == "p2040"
    # ITU-R P.2040-3 concrete at 77 GHz: 5.24 - j 0.323, a normal reflection of ((sqrt(eps) - 1) / (sqrt(eps) + 1))^2,
    # less exp(-(4 pi s / lambda)^2) of its roughness
    index = complex(5.24, -0.323) ** 0.5
    smooth = abs((index - 1) / (index + 1)) ** 2
    rough = math.exp(-((4 * math.pi * shown["given"]["roughness_rms_m"] * 77e9 / 299_792_458) ** 2))
    first = shown["surface"][0]
    assert first["mirror_te_db"] == pytest.approx(10 * math.log10(smooth * rough), abs=0.02)
    assert first["mirror_tm_db"] == pytest.approx(first["mirror_te_db"], abs=1e-6)


def test_doctor_says_what_can_trace_rays(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    by_name = {b["backend"]: b for b in facts["backends"]}
    assert set(by_name) == {"cuda", "llvm", "scalar"}
    assert by_name["scalar"]["usable"]
    assert by_name[facts["chosen"]]["usable"]
    assert facts["packages"]["numpy"]
    assert main(["doctor"]) == 0
    assert f"backend auto is {facts['chosen']}" in capsys.readouterr().out


# ---- resolve
def test_resolve_shows_the_evidence_of_every_part(capsys: pytest.CaptureFixture[str]) -> None:
    Path("street.obj").write_text(
        "v 0 0 0\nv 4 0 0\nv 0 3 0\nv 0 0 2\no SM_Road_01\nf 1 2 3\no Wall_brick\nf 1 3 4\n", encoding="utf-8"
    )
    assert main(["resolve", "street.obj", "--json"]) == 0
    shown = json.loads(capsys.readouterr().out)
    parts = {p["part"]: p for p in shown["parts"]}
    assert len(parts) == 2
    road = next(p for name, p in parts.items() if "Road" in name)
    assert road["tag"] == "Roads"
    assert road["triangles"] == 1
    assert road["area_m2"] == pytest.approx(6.0)
    assert road["rule"]
    assert main(["resolve", "street.obj"]) == 0
    assert "2 parts, 2 triangles" in capsys.readouterr().out


# ---- validate
def test_everything_that_ships_is_valid(capsys: pytest.CaptureFixture[str]) -> None:
    code = main(["validate", "--all", "--json"])
    verdicts = json.loads(capsys.readouterr().out)
    assert [v for v in verdicts if v["problems"]] == []
    assert code == 0
    assert {"profile", "material table", "scene"} <= {v["kind"] for v in verdicts}


def test_validate_tells_files_apart_and_places_their_problems(capsys: pytest.CaptureFixture[str]) -> None:
    files = {
        "scene.yaml": "version: 1\npoint_targets: [{id: 3, xyz_m: [20, 0, 0], rcs_dbsm: 10}]\n",
        "profile.yaml": "name: profile\nwaveform: {carrier_hz: 77e9}\n",
        "twice.yaml": "seed: 1\nseed: 2\n",
        "other.yaml": "colour: red\n",
        "list.yaml": "- 1\n",
        "mesh.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
        "notes.txt": "hello\n",
    }
    for name, text in files.items():
        Path(name).write_text(text)
    assert main(["validate", *files, "--json"]) == 2
    verdicts = {v["path"]: v for v in json.loads(capsys.readouterr().out)}
    assert verdicts["scene.yaml"]["kind"] == "scene"
    assert verdicts["scene.yaml"]["problems"] == []
    assert "1 point targets" in verdicts["scene.yaml"]["what"]
    assert verdicts["profile.yaml"]["kind"] == "profile"
    assert any(p.startswith("profile.yaml:2: waveform.samples: ") for p in verdicts["profile.yaml"]["problems"])
    assert verdicts["twice.yaml"]["problems"][0].startswith("twice.yaml:2: ")
    assert "'seed' is given twice" in verdicts["twice.yaml"]["problems"][0]
    assert "neither a profile" in verdicts["other.yaml"]["problems"][0]
    assert "a mapping of keys is needed" in verdicts["list.yaml"]["problems"][0]
    assert verdicts["mesh.obj"]["kind"] == "mesh"
    assert verdicts["mesh.obj"]["problems"]
    assert "not a kind of file" in verdicts["notes.txt"]["problems"][0]
    assert all(p.startswith(path) for path, v in verdicts.items() for p in v["problems"])
