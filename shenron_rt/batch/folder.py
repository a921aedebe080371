"""The folder of a batch: what it was asked for, what is done, runs put together from their pieces.

::

    plan.yaml         the plan
    batch.json        every run with checksums of its configuration and of the files it names: what --resume holds to
    journal.jsonl     what happened when, line by line
    manifest.json     every run with the checksum of its own manifest, and what failed
    runs/<name>/      run folders, each complete
    .work/<name>/     configuration and finished blocks of runs that are not
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import yaml

from .. import runs
from ..config.plan import BatchPlan
from ..errors import InputError
from ..io.npz import atomic_write
from ..run_setup import merge_options, package_version, summary_of
from .expansion import PlannedRun, Unit
from .work import WORK, work_folder

__all__ = ["BatchFolder"]


class BatchFolder:
    """A batch on disk.

    Parameters
    ----------
    root : Path
        Absolute.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self.runs = root / "runs"

    def run_folder(self, run: PlannedRun) -> Path:
        """Return where a run stands once it is complete."""
        return self.runs / run.name

    # ---- beginning
    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other batches out; a process that dies lets go.

        Raises
        ------
        InputError
            Another process is at work in the folder.
        """
        import fcntl

        self.root.mkdir(parents=True, exist_ok=True)
        with (self.root / ".lock").open("w") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise InputError(f"{self.root}: another batch is at work in this folder") from None
            yield

    def begin(self, plan: BatchPlan, planned: Sequence[PlannedRun], resume: bool) -> None:
        """Write down what is asked for; with ``resume``, hold to what was asked for before.

        Raises
        ------
        InputError
            The folder holds something; with ``resume``, something else than this plan's batch.
        """
        asked = _asked(plan, planned)
        file = self.root / "batch.json"
        if file.is_file():
            if not resume:
                raise InputError(f"{self.root}: holds a batch; --resume goes on with it, or give another -o")
            self._hold_to(json.loads(file.read_text(encoding="utf-8")), asked)
        elif any(not p.name.startswith(".") for p in self.root.iterdir()):  # hidden: the lock, files half written
            raise InputError(f"-o {self.root}: the folder is not empty and holds no batch; give another one")
        self._sweep()
        _write_json(file, asked)
        text = yaml.safe_dump(plan.model_dump(mode="json", exclude_none=True), sort_keys=False, allow_unicode=True)
        _write_text(self.root / "plan.yaml", text)
        self.runs.mkdir(exist_ok=True)

    def _hold_to(self, before: Mapping[str, Any], asked: Mapping[str, Any]) -> None:
        for key, what in (("version", "version of shenron_rt"), ("block", "block"), ("write", "write")):
            if before.get(key) != asked[key]:
                raise InputError(f"{self.root}: began with {what} {before.get(key)}, now {asked[key]}; give another -o")
        for kind, what in (("runs", "run"), ("files", "file")):
            old, new = before.get(kind, {}), asked[kind]
            changed = [k for k in [*new, *(k for k in old if k not in new)] if old.get(k) != new.get(k)]
            if changed:
                state = "is new" if changed[0] not in old else "is gone" if changed[0] not in new else "changed"
                raise InputError(
                    f"{self.root}: {what} {changed[0]} {state} since the batch began, so its frames would not fit "
                    "together; give another -o"
                )

    def _sweep(self) -> None:
        """Remove what a process that died had not finished."""
        for partial in [*self.root.glob("runs/.*.partial-*"), *self.root.glob(f"{WORK}/*/.*.partial-*")]:
            shutil.rmtree(partial, ignore_errors=True)
        for name in ("batch.json", "plan.yaml", "manifest.json"):
            for half in self.root.glob(f".{name}.*"):
                half.unlink()

    # ---- what is there
    def is_complete(self, run: PlannedRun) -> bool:
        """Tell whether a run stands whole; one that does not, or not any more, is removed."""
        return self._whole(self.run_folder(run), ())

    def is_done(self, unit: Unit) -> bool:
        """Tell whether a block of frames stands whole; one that does not is removed."""
        return self._whole(work_folder(self.root, unit.run) / unit.block, ("records.json",))

    def _whole(self, folder: Path, needs: Sequence[str]) -> bool:
        if not folder.is_dir():
            return False
        try:
            problems = runs.verify_manifest(folder) + [n for n in needs if not (folder / n).is_file()]
        except ValueError as error:  # a manifest that a power cut has left empty
            problems = [str(error)]
        except FileNotFoundError as error:
            problems = [str(error)]
        if problems:
            self.note("damaged", folder=str(folder.relative_to(self.root)), error=problems[0])
            shutil.rmtree(folder)
        return not problems

    # ---- on the way
    def prepare(self, run: PlannedRun) -> None:
        """Lay out what a run's blocks are made from."""
        _write_text(work_folder(self.root, run.name) / "config.yaml", run.config)

    def note(self, event: str, **facts: Any) -> None:
        """Add a line to the journal; it is on the disk when this returns."""
        line = json.dumps(runs.plain({"time": round(time.time(), 3), "event": event, **facts}), ensure_ascii=False)
        with (self.root / "journal.jsonl").open("ab") as file:
            if file.tell() and not self._ends_with_a_line():
                line = "\n" + line  # after a line that was cut off
            file.write(line.encode() + b"\n")
            file.flush()
            os.fsync(file.fileno())

    def _ends_with_a_line(self) -> bool:
        with (self.root / "journal.jsonl").open("rb") as file:
            file.seek(-1, os.SEEK_END)
            return file.read() == b"\n"

    def assemble(self, run: PlannedRun, units: Sequence[Unit]) -> None:
        """Put a run together from its blocks. Killed at any point, it can be done again."""
        home = work_folder(self.root, run.name)
        pieces = [home / u.block for u in units]
        told = [json.loads((p / "records.json").read_text(encoding="utf-8")) for p in pieces]
        radars = [
            radar | {"frames": [f for t in told for f in t["radars"][k]["frames"]]}
            for k, radar in enumerate(told[0]["radars"])
        ]
        with runs.write_run(self.run_folder(run)) as place:
            for piece in pieces:
                listed = json.loads((piece / "manifest.json").read_text(encoding="utf-8"))["files"]
                for name in (n for n in listed if n != "records.json"):
                    _link(piece / name, place.partial / name)
                    place.known[name] = listed[name]
            config = yaml.safe_load(run.config)
            options = merge_options(config["run"], {})
            head = summary_of(run.scene, run.seed, options, told[0]["backend"], radars)
            runs.write_json(place.partial / "summary.json", head)
            _write_text(place.partial / "config.yaml", run.config)
        self.clear(run)

    def clear(self, run: PlannedRun) -> None:
        """Remove the blocks of a run that is complete."""
        shutil.rmtree(work_folder(self.root, run.name), ignore_errors=True)

    # ---- the end
    def write_manifest(self, planned: Sequence[PlannedRun], failures: Sequence[Mapping[str, Any]]) -> bool:
        """Write ``manifest.json``; return whether every run is complete."""
        records = [self._record(run) for run in planned]
        complete = all(r["status"] == "done" for r in records)
        manifest = {"version": 1, "complete": complete, "runs": records, "failures": list(failures)}
        _write_json(self.root / "manifest.json", manifest)
        if complete:
            shutil.rmtree(self.root / WORK, ignore_errors=True)
        return complete

    def _record(self, run: PlannedRun) -> dict[str, Any]:
        folder = self.run_folder(run)
        record = {
            "name": run.name,
            "folder": f"runs/{run.name}",
            "scene": run.scene,
            "profiles": run.profiles,
            "seed": run.seed,
            "frames": f"{run.frames.start}:{run.frames.stop}",
            "set": run.values,
        }
        if not folder.is_dir():
            return record | {"status": "missing"}
        text = (folder / "manifest.json").read_bytes()
        files = json.loads(text)["files"].values()
        sizes = {"files": len(files), "bytes": sum(f["size"] for f in files)}
        return record | {"status": "done", **sizes, "manifest_sha256": hashlib.sha256(text).hexdigest()}


def _asked(plan: BatchPlan, planned: Sequence[PlannedRun]) -> dict[str, Any]:
    files = sorted({f for run in planned for f in run.files})
    return {
        "version": package_version(),
        "block": plan.block,
        "write": plan.write,
        "runs": {run.name: hashlib.sha256(run.config.encode()).hexdigest() for run in planned},
        "files": {str(f): hashlib.sha256(f.read_bytes()).hexdigest() for f in files},
    }


def _link(source: Path, target: Path) -> None:
    """Give a file a second place without copying it, where the file system can."""
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)


def _write_text(file: Path, text: str) -> None:
    def write(out: IO[bytes]) -> None:
        out.write(text.encode())

    atomic_write(file, write)


def _write_json(file: Path, value: Any) -> None:
    _write_text(file, json.dumps(runs.plain(value), indent=2, allow_nan=False) + "\n")
