"""Small plans, workers inside the test's process, and a driver that dies at a chosen write.

``python tests/batch_tools.py PLAN OUT N`` ends the process before its N-th write, as ``kill -9`` would.
"""

from __future__ import annotations

import hashlib
import os
import sys
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml

from shenron_rt.batch import driver
from shenron_rt.batch.expansion import Unit
from shenron_rt.batch.folder import BatchFolder
from shenron_rt.batch.work import Outcome, render_unit
from shenron_rt.cli import main

SCENE = """\
version: 1
seed: 5
ego: {velocity_mps: [2, 0, 0]}
point_targets:
  - {id: 900, name: drone, xyz_m: [27, 5, 1], velocity_mps: [-1, 0, 0], rcs_dbsm: 20, tag: Other}
radars:
  - {name: front, profile: awrl1432, xyz_m: [2.0, 0, 1.0]}
"""
#: One radar, few samples: a frame is done in milliseconds.
PLAN: dict[str, Any] = {
    "scenes": ["street.yaml"],
    "profiles": ["awrl1432"],
    "frames": "0:4",
    "block": 2,
    "set": {"profile.waveform.chirps": 8, "profile.waveform.samples": 32},
    "options": {"rays": 200, "backend": "scalar"},
}


def write_plan(folder: Path, **changes: Any) -> Path:
    """Write a scene and a plan, and return the plan's file."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "street.yaml").write_text(SCENE)
    file = folder / "study.yaml"
    file.write_text(yaml.safe_dump(PLAN | changes, sort_keys=False))
    return file


def contents(root: Path) -> dict[str, str]:
    """Return the checksum of every file that a batch promises to make again; its journal has the time of day."""
    files = [root / "manifest.json", root / "batch.json", *(p for p in (root / "runs").rglob("*") if p.is_file())]
    return {p.relative_to(root).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


class InlineWorkers:
    """Work done where it is asked for, one piece at a time."""

    def __init__(self, count: int = 1) -> None:
        self.queue: deque[Unit] = deque()

    @property
    def room(self) -> int:
        return 1 - len(self.queue)

    def submit(self, unit: Unit) -> None:
        self.queue.append(unit)

    def finished(self) -> list[tuple[Unit, Outcome]]:
        unit = self.queue.popleft()
        return [(unit, self.outcome(unit))]

    def outcome(self, unit: Unit) -> Outcome:
        return render_unit(unit)

    def close(self) -> None:
        self.queue.clear()


def _die_at(number: int) -> None:
    """Let this process end without a word before the ``number``-th file, link or line of the journal is written."""
    left = number

    def dying(real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **kwargs: Any) -> Any:
            nonlocal left
            left -= 1
            if left < 0:
                os._exit(9)
            return real(*args, **kwargs)

        return call

    Path.replace = dying(Path.replace)  # type: ignore[method-assign]
    os.link = dying(os.link)
    BatchFolder.note = dying(BatchFolder.note)  # type: ignore[method-assign]


if __name__ == "__main__":
    driver.LocalWorkers = InlineWorkers  # type: ignore[assignment, misc]
    _die_at(int(sys.argv[3]))
    sys.exit(main(["batch", sys.argv[1], "-o", sys.argv[2]]))
