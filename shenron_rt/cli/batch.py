"""``shenron-rt batch``: scenes x profiles x seeds x parameters into run folders."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from .common import Json, print_json, say, show_table

if TYPE_CHECKING:
    from ..batch import BatchProgress, BatchResult

__all__ = ["batch"]

#: Seconds between lines of progress where stderr is no terminal.
_EVERY_S = 10.0


def batch(
    plan: Path,
    /,
    *,
    output: Annotated[
        Path | None, Parameter(name=["-o", "--output"], help="Folder. Default: out/batch-<plan>, numbered.")
    ] = None,
    cluster: str | None = None,
    workers: int | None = None,
    resume: Annotated[bool, Parameter(negative=())] = False,
    json_: Json = False,
) -> int:
    """Render every combination of a plan's scenes, profiles, seeds and parameters, each into a run folder.

    Parameters
    ----------
    plan
        YAML file; docs/batch.md has its keys.
    cluster
        Dask scheduler, tcp://HOST:PORT, or a scheduler file. Default: processes of this machine.
    workers
        Processes of this machine. Default: one a core.
    resume
        Go on with the batch in the -o folder, after whatever stopped it.
    """
    from ..batch import run_batch

    with _shown() as show:
        result = run_batch(plan, output, cluster=cluster, workers=workers, resume=resume, progress=show)
    if json_:
        print_json(_record(result))
    else:
        _show(result)
    if result.complete:
        return 0
    lost = len(result.failures)
    sys.stderr.write(
        f"shenron-rt: {lost} piece{'s' if lost > 1 else ''} of work failed, see {result.folder / 'manifest.json'}; "
        "--resume tries again\n"
    )
    return 2


def _record(result: BatchResult) -> dict[str, Any]:
    return {
        "folder": result.folder,
        "complete": result.complete,
        "runs": result.runs,
        "failures": [asdict(f) for f in result.failures],
        "frames": result.frames,
        "rendered": result.rendered,
        "seconds": round(result.seconds, 3),
    }


def _show(result: BatchResult) -> None:
    show_table("Runs", ("run",), [(name,) for name in result.runs])
    if result.failures:
        rows = [(f.run, f.frames, f.attempts, f.error.splitlines()[0]) for f in result.failures]
        show_table("Failed", ("run", "frames", "attempts", "error"), rows)
    say(
        f"{result.folder}: {len(result.runs)} runs, {result.frames} frames, "
        f"{result.rendered} of them rendered now in {result.seconds:.1f} s"
    )


@contextmanager
def _shown() -> Iterator[Callable[[BatchProgress], None]]:
    """Show progress on stderr: a bar on a terminal, else a line now and then."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    console = Console(stderr=True, highlight=False)
    if not console.is_terminal:
        yield _lines()
        return
    columns = (
        TextColumn("frames"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("")

        def show(now: BatchProgress) -> None:
            bar.update(task, total=now.total, completed=now.done + now.failed, description=_tail(now))

        yield show


def _lines() -> Callable[[BatchProgress], None]:
    said = -_EVERY_S

    def show(now: BatchProgress) -> None:
        nonlocal said
        if now.seconds - said >= _EVERY_S or " failed" in now.what:
            said = now.seconds
            sys.stderr.write(f"batch: {now.done} of {now.total} frames, {_tail(now)}\n")

    return show


def _tail(now: BatchProgress) -> str:
    eta = "-" if now.eta_s is None else f"{now.eta_s:.0f} s"
    lost = f"{now.failed} failed, " if now.failed else ""
    return f"{lost}ETA {eta}, {now.what.splitlines()[0] if now.what else 'begins'}"
