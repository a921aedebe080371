"""Runs a plan: hands out work, tries again what failed, puts runs together, and can be stopped at any point."""

from __future__ import annotations

import contextlib
import logging
import os
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Protocol

from ..config.plan import BatchPlan, load_plan
from ..errors import InputError
from ..run_frames import parts_of
from .cluster import DaskWorkers
from .expansion import PlannedRun, Unit, expand, units_of
from .folder import BatchFolder
from .local import LocalWorkers, cores
from .work import Outcome

__all__ = ["BatchProgress", "BatchResult", "Failure", "run_batch"]

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Failure:
    """A piece of work that was given up: its run, its frames ``A:B``, the last error, how often it was tried."""

    run: str
    frames: str
    error: str
    attempts: int


@dataclass(frozen=True)
class BatchProgress:
    """How far a batch is.

    Parameters
    ----------
    total, done, failed, before : int
        Frames in all, written, given up, and those of ``done`` that an earlier call had written.
    seconds : float
        Since this call began [s].
    what : str
        What happened last.
    """

    total: int
    done: int
    failed: int
    before: int
    seconds: float
    what: str = ""

    @property
    def eta_s(self) -> float | None:
        """Seconds until the end, by the pace so far; None before the first frame [s]."""
        new = self.done + self.failed - self.before
        return None if new <= 0 else self.seconds / new * (self.total - self.done - self.failed)


@dataclass(frozen=True)
class BatchResult:
    """What a batch came to.

    Parameters
    ----------
    folder : Path
    runs : dict of str to Path
        Complete run folders by name.
    failures : tuple of Failure
    frames, rendered : int
        Frames in complete runs, and frames rendered by this call.
    seconds : float
    """

    folder: Path
    runs: dict[str, Path]
    failures: tuple[Failure, ...]
    frames: int
    rendered: int
    seconds: float

    @property
    def complete(self) -> bool:
        """Whether every run is there."""
        return not self.failures


class _Workers(Protocol):
    @property
    def room(self) -> int: ...
    def submit(self, unit: Unit) -> None: ...
    def finished(self) -> list[tuple[Unit, Outcome]]: ...
    def close(self) -> None: ...


def run_batch(
    plan: BatchPlan | str | os.PathLike[str],
    output: str | os.PathLike[str] | None = None,
    *,
    cluster: str | None = None,
    workers: int | None = None,
    resume: bool = False,
    progress: Callable[[BatchProgress], None] | None = None,
) -> BatchResult:
    """Render every run of a plan into a folder.

    Parameters
    ----------
    plan : BatchPlan or path
    output : path, optional
        Folder of the batch; default ``out/batch-<name>``, numbered.
    cluster : str, optional
        A Dask cluster: address of its scheduler or path of a scheduler file. Default: processes of this machine.
    workers : int, optional
        Processes of this machine; default one a core.
    resume : bool
        Go on with the batch that ``output`` holds; a new one where it holds none.
    progress : callable
        Told after each piece of work.

    Returns
    -------
    BatchResult

    Raises
    ------
    ConfigError, InputError, NotFoundError
        A plan that cannot be run, before anything is written; a folder that holds something else; a cluster that does
        not answer; a full disk, which leaves everything that is finished for ``resume``.

    Notes
    -----
    Processes start anew from the main module: a script calls this under ``if __name__ == "__main__":``.
    """
    used = plan if isinstance(plan, BatchPlan) else load_plan(plan)
    if cluster is not None and workers is not None:
        raise InputError("run_batch: workers are processes of this machine; a cluster has its own. Give one of the two")
    if workers is not None and workers < 1:
        raise InputError(f"workers: {workers}; at least 1 is needed")
    parts_of(used.write)
    planned = expand(used)
    folder = BatchFolder(_root(used, output, resume))
    with contextlib.ExitStack() as stack:
        team: _Workers = DaskWorkers(cluster) if cluster is not None else LocalWorkers(workers or cores())
        stack.callback(team.close)
        stack.enter_context(folder.locked())
        folder.begin(used, planned, resume)
        folder.note("begin", runs=len(planned), cluster=cluster, process=os.getpid())
        return _Driver(folder, used, planned, team, progress).run()


def _root(plan: BatchPlan, output: str | os.PathLike[str] | None, resume: bool) -> Path:
    from ..runs import default_folder

    if output is not None:
        return Path(output).absolute()
    if resume:
        raise InputError("--resume: say with -o which folder to go on with")
    return default_folder("batch", plan.name).absolute()


@dataclass
class _Driver:
    """The state of a batch in progress."""

    folder: BatchFolder
    plan: BatchPlan
    planned: list[PlannedRun]
    workers: _Workers
    progress: Callable[[BatchProgress], None] | None
    began: float = field(default_factory=time.monotonic)
    waiting: deque[Unit] = field(default_factory=deque)
    open: dict[str, int] = field(default_factory=dict)  # blocks of each run that are not done
    attempts: Counter[Unit] = field(default_factory=Counter)
    failures: list[Failure] = field(default_factory=list)
    said: set[str] = field(default_factory=set)  # warnings, each told once
    done: int = 0
    failed: int = 0
    before: int = 0
    rendered: int = 0

    def run(self) -> BatchResult:
        self._look()
        try:
            self._work()
        finally:
            complete = self.folder.write_manifest(self.planned, [asdict(f) for f in self.failures])
            self.folder.note("end", complete=complete, frames=self.done, failures=len(self.failures))
        there = {r.name: r for r in self.planned if self.folder.run_folder(r).is_dir()}
        return BatchResult(
            folder=self.folder.root,
            runs={name: self.folder.run_folder(run) for name, run in there.items()},
            failures=tuple(self.failures),
            frames=sum(len(run.frames) for run in there.values()),
            rendered=self.rendered,
            seconds=time.monotonic() - self.began,
        )

    def _look(self) -> None:
        """Find what is done, and queue the rest."""
        for run in self.planned:
            if self.folder.is_complete(run):
                self.folder.clear(run)
                self.done += len(run.frames)
                continue
            self.folder.prepare(run)
            units = self._units(run)
            missing = [u for u in units if not self.folder.is_done(u)]
            self.open[run.name] = len(missing)
            self.waiting.extend(missing)
            self.done += len(run.frames) - sum(u.stop - u.first for u in missing)
            if not missing:
                self._assemble(run)
        self.before = self.done
        self._tell("")

    def _units(self, run: PlannedRun) -> list[Unit]:
        return units_of(run, self.folder.root, self.plan)

    def _work(self) -> None:
        busy = 0
        while self.waiting or busy:
            for _ in range(min(self.workers.room, len(self.waiting))):
                self.workers.submit(self.waiting.popleft())
                busy += 1
            for unit, outcome in self.workers.finished():
                busy -= 1
                self._settle(unit, outcome)

    def _settle(self, unit: Unit, outcome: Outcome) -> None:
        self.attempts[unit] += 1
        frames = unit.stop - unit.first
        told: dict[str, Any] = {"run": unit.run, "frames": f"{unit.first}:{unit.stop}", "attempt": self.attempts[unit]}
        for text in outcome.warnings:
            if text not in self.said:
                self.said.add(text)
                self.folder.note("warning", run=unit.run, text=text)
                _log.warning("%s", text)
        if outcome.kind == "done":
            self.folder.note("done", **told)
            self.done += frames
            self.rendered += frames
            self.open[unit.run] -= 1
            if self.open[unit.run] == 0:
                self._assemble(next(r for r in self.planned if r.name == unit.run))
            self._tell(unit.label)
            return
        self.folder.note("failed", **told, error=outcome.error, detail=outcome.detail)
        if outcome.kind == "disk":
            raise InputError(
                f"{self.folder.root}: {outcome.error}; nothing half-written was left. Make room, then --resume goes on"
            )
        if outcome.kind == "other" and self.attempts[unit] <= self.plan.retries:
            self.waiting.append(unit)
            self._tell(f"{unit.label} failed and is tried again: {outcome.error}")
            return
        self.failed += frames
        self.failures.append(Failure(unit.run, told["frames"], outcome.error, self.attempts[unit]))
        self._tell(f"{unit.label} failed: {outcome.error}")

    def _assemble(self, run: PlannedRun) -> None:
        self.folder.assemble(run, self._units(run))
        self.folder.note("run", run=run.name)

    def _tell(self, what: str) -> None:
        if self.progress is not None:
            total = sum(len(run.frames) for run in self.planned)
            seconds = time.monotonic() - self.began
            self.progress(BatchProgress(total, self.done, self.failed, self.before, seconds, what))
