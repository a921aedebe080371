"""``batch`` and ``run_batch``: what a plan becomes, how failures are told, what a full disk leaves."""

from __future__ import annotations

import errno
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from batch_tools import SCENE, InlineWorkers, contents, write_plan

import shenron_rt as srt
from shenron_rt import runs
from shenron_rt.batch import BatchProgress, driver
from shenron_rt.batch.expansion import Unit, expand, units_of
from shenron_rt.batch.work import Outcome
from shenron_rt.cli import main
from shenron_rt.config.plan import load_plan

HALF = b"half a file"


@pytest.fixture
def inline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(driver, "LocalWorkers", InlineWorkers)


def test_a_run_for_each_combination_has_what_the_plan_says(tmp_path: Path) -> None:
    values = {"profile.receiver.noise_figure_db": [10, 14], "scene.weather.rain_mm_h": 25, "processing.pfa": [1e-3]}
    plan = load_plan(write_plan(tmp_path, profiles=["awrl1432", ["awrl1432", "radarbook"]], seeds=[1, 2], set=values))
    planned = expand(plan)
    assert len(planned) == 1 * 2 * 2 * 2
    assert len({r.name for r in planned}) == 8
    assert planned[0].name == "street-awrl1432-seed1-noise_figure_db=10"  # what does not vary is not in the name
    assert planned[-1].profiles == ("awrl1432", "radarbook")
    (tmp_path / "config.yaml").write_text(planned[-1].config)
    scene = srt.load_scene(tmp_path / "config.yaml")
    assert scene.seed == 2
    assert scene.weather is not None
    assert scene.weather.rain_mm_h == 25
    assert {scene.profile_of(r).receiver.noise_figure_db for r in scene.radars} == {14}
    assert scene.run["rays"] == 200


def test_runs_are_those_of_the_run_verb_and_can_be_compared(
    tmp_path: Path, inline: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = write_plan(tmp_path, set={"profile.receiver.noise_figure_db": [10, 14]})
    assert main(["batch", str(plan), "-o", str(tmp_path / "out")]) == 0
    low, high = (tmp_path / "out" / "runs" / f"street-awrl1432-seed5-noise_figure_db={n}" for n in (10, 14))
    monkeypatch.chdir(tmp_path)
    given = ["--rays", "200", "--backend", "scalar", "--no-pictures", "--frames", "0:4"]
    assert main(["run", "street.yaml", *given, "--set", "profile.receiver.noise_figure_db=10", "-o", "alone"]) == 0
    # file by file: frames, summary, and a configuration that makes both again
    assert _tree(tmp_path / "alone") == _tree(low)
    assert main(["compare", str(low), str(high), "-o", "compared", "--json"]) == 0
    told = json.loads(Path("compared/compare.json").read_text())
    assert [(s["key"], s["a"], s["b"]) for s in told["settings"]] == [("profile.receiver.noise_figure_db", 10, 14)]
    # 4 dB of noise figure are 4 dB of noise
    noise = [told["results"][side]["noise_dbw"] for side in "ab"]
    assert noise[1] - noise[0] == pytest.approx(4.0, abs=1e-9)


def _tree(root: Path) -> dict[str, bytes]:
    return {p.relative_to(root).as_posix(): p.read_bytes() for p in root.rglob("*") if p.is_file()}


def test_results_depend_neither_on_workers_nor_on_blocks(tmp_path: Path) -> None:
    found = []
    for workers, block in ((1, 4), (2, 1)):
        out = tmp_path / f"out{workers}"
        result = srt.run_batch(write_plan(tmp_path, block=block), out, workers=workers)
        assert result.complete
        assert (result.frames, result.rendered) == (4, 4)
        found.append({k: v for k, v in contents(out).items() if k != "batch.json"})  # which says the block
        assert runs.verify_manifest(next(iter(result.runs.values()))) == []
        assert not (out / ".work").exists()
    assert found[0] == found[1]
    assert len(found[0]) == 4 * 5 + 3 + 1  # frames, the run's three files, the manifest


def test_frames_that_build_on_each_other_are_one_piece_of_work(tmp_path: Path) -> None:
    plan = load_plan(write_plan(tmp_path, block=1))
    assert len(units_of(expand(plan)[0], tmp_path, plan)) == 4
    plan = load_plan(write_plan(tmp_path, block=1, set={"processing.ambiguity": "two_frame"}))
    (unit,) = units_of(expand(plan)[0], tmp_path, plan)
    assert (unit.first, unit.stop) == (0, 4)


def test_a_plan_says_what_is_kept_of_a_frame(tmp_path: Path, inline: None) -> None:
    result = srt.run_batch(write_plan(tmp_path, write="detections,maps"), tmp_path / "out")
    (run,) = result.runs.values()
    assert {p.name for p in (run / "radars/front/frame_000003").iterdir()} == {"detections.csv", "maps.npz"}
    with pytest.raises(srt.InputError, match="began with write detections,maps, now None"):
        srt.run_batch(write_plan(tmp_path), tmp_path / "out", resume=True)
    with pytest.raises(srt.InputError, match="'map' is not a part of a frame"):
        srt.run_batch(write_plan(tmp_path, write="map"), tmp_path / "other")
    assert not (tmp_path / "other").exists()


def test_progress_counts_every_frame_once_and_tells_when_it_ends(tmp_path: Path, inline: None) -> None:
    told: list[BatchProgress] = []
    srt.run_batch(write_plan(tmp_path, seeds=[1, 2]), tmp_path / "out", progress=told.append)
    assert [p.done for p in told] == [0, 2, 4, 6, 8]
    assert {p.total for p in told} == {8}
    assert told[0].eta_s is None
    assert told[2].eta_s == pytest.approx(told[2].seconds)  # half is done
    assert told[-1].eta_s == 0


def test_finished_work_is_kept_and_damaged_work_is_done_again(tmp_path: Path, inline: None) -> None:
    plan, out = write_plan(tmp_path, seeds=[1, 2]), tmp_path / "out"
    srt.run_batch(plan, out)
    before = contents(out)
    assert srt.run_batch(plan, out, resume=True).rendered == 0
    cube = out / "runs/street-awrl1432-seed2/radars/front/frame_000001/adc.npz"
    data = bytearray(cube.read_bytes())
    data[len(data) // 2] ^= 1
    cube.write_bytes(data)
    assert srt.run_batch(plan, out, resume=True).rendered == 4
    assert contents(out) == before
    assert '"damaged"' in (out / "journal.jsonl").read_text()


class Failing(InlineWorkers):
    """Units of seed 2 fail as often as it is told, then go well."""

    times: int
    outcome_of_failure = Outcome("other", "the machine was hit by lightning")

    def outcome(self, unit: Unit) -> Outcome:
        if "seed2" in unit.run and unit.first == 2 and type(self).times > 0:
            type(self).times -= 1
            return self.outcome_of_failure
        return super().outcome(unit)


@pytest.mark.parametrize(("times", "lost"), [(2, False), (3, True)])
def test_failures_are_tried_again_and_then_listed(
    times: int, lost: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(driver, "LocalWorkers", Failing)
    monkeypatch.setattr(Failing, "times", times, raising=False)
    plan, out = write_plan(tmp_path, seeds=[1, 2, 3], retries=2), tmp_path / "out"
    assert main(["batch", str(plan), "-o", str(out), "--json"]) == (2 if lost else 0)
    told = json.loads(capsys.readouterr().out)
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["complete"] is told["complete"] is not lost
    assert [r["status"] for r in manifest["runs"]] == ["done", "missing" if lost else "done", "done"]
    if lost:
        assert told["failures"] == manifest["failures"]
        assert manifest["failures"] == [
            {
                "run": "street-awrl1432-seed2",
                "frames": "2:4",
                "error": "the machine was hit by lightning",
                "attempts": 3,
            }
        ]
        assert not (out / "runs/street-awrl1432-seed2").exists()
        assert srt.run_batch(plan, out, resume=True).rendered == 2  # the other block is kept
    srt.run_batch(plan, tmp_path / "calm")
    assert contents(out) == contents(tmp_path / "calm")


def test_a_scene_that_cannot_be_traced_is_a_listed_failure_beside_those_that_can(
    tmp_path: Path, inline: None, capsys: pytest.CaptureFixture[str]
) -> None:
    plan = write_plan(tmp_path, scenes=["street.yaml", "broken.yaml"])
    (tmp_path / "broken.yaml").write_text(SCENE + "static:\n  - {mesh: wall.obj, tag: Walls}\n")
    (tmp_path / "wall.obj").write_text("v 0 0\nf 1 2 9\n")
    assert main(["batch", str(plan), "-o", str(tmp_path / "out")]) == 2
    manifest = json.loads((tmp_path / "out/manifest.json").read_text())
    assert [r["status"] for r in manifest["runs"]] == ["done", "missing"]
    assert all("wall.obj" in f["error"] and f["attempts"] == 1 for f in manifest["failures"])
    error = capsys.readouterr().err
    assert "2 pieces of work failed" in error
    assert "Traceback" not in error


@pytest.mark.parametrize("at", [0, 3, 7])
def test_a_full_disk_stops_the_batch_and_leaves_nothing_half_written(
    at: int, tmp_path: Path, inline: None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plan, out = write_plan(tmp_path), tmp_path / "out"
    real, count = np.savez, 0

    def savez(file: Any, **arrays: Any) -> None:
        nonlocal count
        count += 1
        if count > at:
            file.write(HALF)
            raise OSError(errno.ENOSPC, "No space left on device")
        real(file, **arrays)

    monkeypatch.setattr(np, "savez", savez)
    assert main(["batch", str(plan), "-o", str(out)]) == 2
    error = [line for line in capsys.readouterr().err.splitlines() if line.startswith("shenron-rt:")]
    assert len(error) == 1
    assert "no space left on the disk" in error[0]
    assert "--resume" in error[0]
    left = [p for p in out.rglob("*") if "partial" in p.name or (p.is_file() and HALF in p.read_bytes())]
    assert left == []
    monkeypatch.setattr(np, "savez", real)
    assert srt.run_batch(plan, out, resume=True).complete
    srt.run_batch(plan, tmp_path / "calm")
    assert contents(out) == contents(tmp_path / "calm")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("scenes: [braking]\nframes: 1:10\n", "plan.yaml:2: frames: a text in quotes"),
        ("scenes: [braking]\nprofile: awrl1432\n", "plan.yaml:2: profile: "),
        ("scenes: []\n", "plan.yaml:1: scenes: "),
        ("scenes: [braking]\nseeds: [-1]\n", "plan.yaml:2: seeds.0: "),
        ("scenes: [braking]\nset: {receiver.noise_figure_db: 3}\n", "a key starts with one of profile."),
        ("scenes: [braking]\nset: {profile.receiver.noise_figure_db: []}\n", "has no values"),
        ("scenes: [braking]\nset: {profile.receiver.noise: 3}\n", "receiver.noise"),
        ("scenes: [brake]\n", "unknown scene 'brake'; did you mean 'braking'?"),
        ("scenes: [braking]\nprofiles: [nothing]\n", "unknown profile 'nothing'"),
        ("scenes: [braking]\nseeds: [1, 1]\n", "2 runs are the same"),
        ("scenes: [broken.yaml]\n", "broken.yaml:1: "),
        ("scenes: [braking\n", "not valid YAML"),
    ],
)
def test_a_plan_that_cannot_be_run_is_one_line_and_writes_nothing(
    text: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "plan.yaml").write_text(text)
    (tmp_path / "broken.yaml").write_text("radar: 3\n")
    assert main(["batch", str(tmp_path / "plan.yaml"), "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_resume_holds_to_the_batch_that_was_begun(tmp_path: Path, inline: None) -> None:
    plan, out = write_plan(tmp_path), tmp_path / "out"
    srt.run_batch(plan, out)
    with pytest.raises(srt.InputError, match="holds a batch; --resume"):
        srt.run_batch(plan, out)
    with pytest.raises(srt.InputError, match="run street-awrl1432-seed9 is new"):
        srt.run_batch(write_plan(tmp_path, seeds=[9]), out, resume=True)
    with pytest.raises(srt.InputError, match="began with block 2, now 3"):
        srt.run_batch(write_plan(tmp_path, block=3), out, resume=True)
    write_plan(tmp_path)
    (tmp_path / "street.yaml").write_text(SCENE.replace("rcs_dbsm: 20", "rcs_dbsm: 10"))
    with pytest.raises(srt.InputError, match="run street-awrl1432-seed5 changed"):
        srt.run_batch(plan, out, resume=True)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.tex").write_text("years of work")
    with pytest.raises(srt.InputError, match="holds no batch"):
        srt.run_batch(plan, tmp_path / "other", resume=True)
    with pytest.raises(srt.InputError, match="say with -o"):
        srt.run_batch(plan, resume=True)


def test_validate_counts_what_a_plan_will_render(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["validate", str(write_plan(tmp_path, seeds=[1, 2, 3]))]) == 0
    assert "batch plan, 3 runs, 12 frames" in capsys.readouterr().out
    assert main(["validate", str(write_plan(tmp_path, seeds=[1, 1]))]) == 2


def test_warnings_of_workers_are_told_once_by_the_driver(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    plan = write_plan(
        tmp_path, seeds=[1, 2], options={"rays": 200, "backend": "scalar", "model": "shenron:as_released"}
    )
    assert main(["batch", str(plan), "-o", str(tmp_path / "out"), "--workers", "2"]) == 0
    error = capfd.readouterr().err
    assert error.count("not watts") == 1
    assert sum('"warning"' in line for line in (tmp_path / "out/journal.jsonl").read_text().splitlines()) == 1


def test_two_batches_do_not_work_in_one_folder(tmp_path: Path, inline: None) -> None:
    from shenron_rt.batch.folder import BatchFolder

    with BatchFolder(tmp_path / "out").locked(), pytest.raises(srt.InputError, match="another batch is at work"):
        srt.run_batch(write_plan(tmp_path), tmp_path / "out")
