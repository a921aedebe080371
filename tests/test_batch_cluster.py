"""Batches on a Dask cluster: the same bytes, also when a worker is killed; what is said where there is none."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from batch_tools import contents, write_plan

import shenron_rt as srt
from shenron_rt.batch import cluster as cluster_module
from shenron_rt.cli import main

pytestmark = [
    # Dask's own processes and loops outlive the test that made them by moments
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]


def test_a_cluster_that_loses_a_worker_gives_the_same_bytes_as_one_process(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="extra cluster")
    plan = write_plan(tmp_path, seeds=[1, 2], frames="0:8", block=1, options={"rays": 3000, "backend": "scalar"})
    out, calm = tmp_path / "out", tmp_path / "calm"
    found: list[srt.BatchResult] = []
    options: dict[str, Any] = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": ":0"}
    with distributed.LocalCluster(**options) as cluster:
        file = tmp_path / "scheduler.json"  # as dask scheduler --scheduler-file writes it
        file.write_text(json.dumps({"address": cluster.scheduler_address}))
        work = threading.Thread(target=lambda: found.append(srt.run_batch(plan, out, cluster=str(file))))
        work.start()
        end = time.monotonic() + 120
        while '"done"' not in (_text(out / "journal.jsonl")) and time.monotonic() < end:
            time.sleep(0.02)
        os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)
        work.join(timeout=120)
    (result,) = found
    assert result.complete
    assert result.rendered == 16
    srt.run_batch(plan, calm, workers=1)
    assert contents(out) == contents(calm)


def test_a_driver_and_a_worker_killed_on_a_cluster_leave_a_batch_that_ends_the_same(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="extra cluster")
    plan = write_plan(tmp_path, seeds=[1, 2], frames="0:8", block=1, options={"rays": 3000, "backend": "scalar"})
    out, calm, file = tmp_path / "out", tmp_path / "calm", tmp_path / "scheduler.json"
    options: dict[str, Any] = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": ":0"}
    with distributed.LocalCluster(**options) as cluster:
        file.write_text(json.dumps({"address": cluster.scheduler_address}))
        words = ["batch", str(plan), "-o", str(out), "--cluster", str(file)]
        path = os.pathsep.join([str(Path(srt.__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
        driver = subprocess.Popen(
            [sys.executable, "-m", "shenron_rt.cli", *words],
            env=os.environ | {"PYTHONPATH": path}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        end = time.monotonic() + 120
        while '"done"' not in _text(out / "journal.jsonl") and time.monotonic() < end:
            time.sleep(0.02)
        os.kill(next(iter(cluster.workers.values())).pid, signal.SIGKILL)
        driver.kill()
        assert driver.wait(60) == -signal.SIGKILL  # in the middle of it
        # what the dead driver has asked for may still be at work beside this
        result = srt.run_batch(plan, out, cluster=str(file), resume=True)
    assert result.complete
    assert 0 < result.rendered < 16  # what was done is kept
    srt.run_batch(plan, calm, workers=1)
    assert contents(out) == contents(calm)


def _text(file: Path) -> str:
    return file.read_text() if file.is_file() else ""


def test_without_dask_the_message_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    out = tmp_path / "out"
    assert main(["batch", str(write_plan(tmp_path)), "-o", str(out), "--cluster", "tcp://127.0.0.1:8786"]) == 2
    error = capsys.readouterr().err
    assert "pip install 'shenron-rt[cluster]'" in error
    assert error.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("nowhere.json", "neither an address like tcp://host:8786 nor a scheduler file"),
        ("tcp://127.0.0.1:9", "no scheduler answers"),
    ],
)
def test_a_cluster_that_is_not_there_is_one_line(
    address: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("distributed", reason="extra cluster")
    monkeypatch.setattr(cluster_module, "_TIMEOUT_S", 1)
    out = tmp_path / "out"
    assert main(["batch", str(write_plan(tmp_path)), "-o", str(out), "--cluster", address]) == 2
    error = [line for line in capsys.readouterr().err.splitlines() if line.startswith("shenron-rt:")]
    assert len(error) == 1
    assert message in error[0]
    assert not out.exists()


def test_a_cluster_has_its_own_workers(tmp_path: Path) -> None:
    with pytest.raises(srt.InputError, match="workers are processes of this machine"):
        srt.run_batch(write_plan(tmp_path), tmp_path / "out", cluster="tcp://127.0.0.1:9", workers=2)
