"""What the benchmarks share: rows of the table, repeated timing, memory, the machine in words."""

from __future__ import annotations

import json
import os
import platform
import resource
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path


@dataclass(frozen=True)
class Row:
    """One line of the table: what, the bar and the goal in words, the measured value in words, whether the bar is met.

    ``met`` is None where there is no bar.
    """

    what: str
    bar: str
    goal: str
    measured: str
    met: bool | None = None


@dataclass(frozen=True)
class Times:
    """Seconds of repeated runs."""

    seconds: tuple[float, ...]

    @property
    def median(self) -> float:
        return statistics.median(self.seconds)

    @property
    def best(self) -> float:
        return min(self.seconds)


def repeat(work: Callable[[int], object], times: int = 9, warm: int = 2) -> Times:
    """Time ``work(k)`` after some runs that do not count."""
    seconds = []
    for k in range(-warm, times):
        start = time.perf_counter()
        work(k + warm)
        if k >= 0:
            seconds.append(time.perf_counter() - start)
    return Times(tuple(seconds))


def side_by_side(works: dict[str, Callable[[], object]], times: int = 9, warm: int = 2) -> dict[str, Times]:
    """Time several pieces of work in turn, so that what else the machine does hits all of them alike."""
    seconds: dict[str, list[float]] = {name: [] for name in works}
    for k in range(-warm, times):
        for name, work in works.items():
            start = time.perf_counter()
            work()
            if k >= 0:
                seconds[name].append(time.perf_counter() - start)
    return {name: Times(tuple(s)) for name, s in seconds.items()}


def peak_mib() -> float:
    """Return the peak resident memory of this process [MiB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def machine() -> str:
    """Say what ran: processor, cores this process may use, load, versions."""
    from importlib.metadata import version

    names = [line.split(":")[1].strip() for line in _cpuinfo() if line.startswith("model name")]
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    load = os.getloadavg()[0]
    libraries = ", ".join(f"{n} {version(n)}" for n in ("numpy", "mitsuba", "drjit", "finufft"))
    return (
        f"{names[0] if names else platform.processor() or platform.machine()}, {cores} cores, load {load:.1f}; "
        f"Python {platform.python_version()}, {libraries}"
    )


def _cpuinfo() -> list[str]:
    file = Path("/proc/cpuinfo")
    return file.read_text().splitlines() if file.is_file() else []


def main(measure: Callable[[], list[Row]]) -> None:
    """Print the rows of a benchmark: as JSON lines with ``--json``, else as a table."""
    rows = measure()
    if "--json" in sys.argv:
        for row in rows:
            print(json.dumps(asdict(row)))
    else:
        print(machine())
        print(markdown(rows))


def markdown(rows: list[Row]) -> str:
    """Return the rows as a Markdown table."""
    lines = ["| what | bar | goal | measured | bar met |", "|---|---|---|---|---|"]
    mark = {None: "", True: "yes", False: "**no**"}
    lines += [f"| {r.what} | {r.bar} | {r.goal} | {r.measured} | {mark[r.met]} |" for r in rows]
    return "\n".join(lines)
