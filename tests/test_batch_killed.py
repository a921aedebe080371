"""A batch whose driver or workers are killed goes on where it was: nothing lost, nothing twice, the same bytes."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from batch_tools import InlineWorkers, contents, write_plan

import shenron_rt as srt
from shenron_rt.batch import driver

HERE = Path(__file__).resolve().parent
#: Writes of the plan below when nothing disturbs it, counted by the test that kills before each of them.
WRITES = 33


def _environment() -> dict[str, str]:
    path = os.pathsep.join([str(HERE.parent), os.environ.get("PYTHONPATH", "")])
    return os.environ | {"PYTHONPATH": path}


def _killed_before(write: int, plan: Path, out: Path) -> int:
    command = [sys.executable, str(HERE / "batch_tools.py"), str(plan), str(out), str(write)]
    return subprocess.run(command, env=_environment(), capture_output=True, timeout=120, check=False).returncode


def _goes_on_after(writes: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    monkeypatch.setattr(driver, "LocalWorkers", InlineWorkers)
    plan = write_plan(tmp_path, frames="0:2", block=1)
    srt.run_batch(plan, tmp_path / "calm")
    codes = []
    for write in writes:
        out = tmp_path / f"killed{write}"
        codes.append(_killed_before(write, plan, out))
        assert (out / "manifest.json").exists() == (write > WRITES - 2)  # not before all is done
        assert srt.run_batch(plan, out, resume=True).complete
        assert contents(out) == contents(tmp_path / "calm"), f"killed before write {write}"
        assert [p.name for p in out.rglob(".*") if p.name != ".lock"] == []
    return codes


def test_a_driver_killed_before_a_write_leaves_a_batch_that_ends_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # the plan, a frame's file, a part of the run that is put together, the clearing up after it
    codes = _goes_on_after([1, 6, 22, 30], tmp_path, monkeypatch)
    assert set(codes) == {9}


@pytest.mark.slow
def test_so_it_is_before_every_write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    codes = _goes_on_after(list(range(WRITES + 1)), tmp_path, monkeypatch)
    assert codes == [9] * WRITES + [0]


def test_workers_and_driver_killed_in_their_work_leave_a_batch_that_ends_the_same(tmp_path: Path) -> None:
    plan = write_plan(tmp_path, seeds=[1, 2, 3], frames="0:16", block=1, options={"rays": 3000, "backend": "scalar"})
    out, calm = tmp_path / "out", tmp_path / "calm"
    command = [sys.executable, "-m", "shenron_rt.cli", "batch", str(plan), "-o", str(out), "--workers", "2"]
    process = subprocess.Popen(command, env=_environment(), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        _wait_for(lambda: _count(out, "done") >= 3)
        first = _workers_of(process.pid)[0]
        os.kill(first, signal.SIGKILL)
        done = _count(out, "done")
        _wait_for(lambda: _count(out, "failed") == 1 and _count(out, "done") > done + 2)  # the others go on
        workers = _workers_of(process.pid)
        assert first not in workers
    finally:
        process.kill()
        process.wait()
    assert 3 < _count(out, "done") < 48
    assert _count(out, "end") == 0
    _wait_for(lambda: not any(_lives(w) for w in workers))  # none goes on without a driver
    result = srt.run_batch(plan, out, workers=1, resume=True)
    assert result.complete
    assert 0 < result.rendered < 48
    srt.run_batch(plan, calm, workers=1)
    assert contents(out) == contents(calm)


def _count(out: Path, event: str) -> int:
    journal = out / "journal.jsonl"
    if not journal.is_file():
        return 0
    lines = journal.read_text().splitlines(keepends=True)
    return sum(json.loads(line)["event"] == event for line in lines if line.endswith("\n"))


def _workers_of(pid: int) -> list[int]:
    """Return the processes that a batch has spawned; the one that tracks resources is not one of its workers."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(c) for c in children if "spawn_main" in Path(f"/proc/{c}/cmdline").read_text()]


def _lives(pid: int) -> bool:
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


def _wait_for(happens: object, seconds: float = 90.0) -> None:
    assert callable(happens)
    end = time.monotonic() + seconds
    while not happens():
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.02)
