"""Start-up: importing the package, the first run of the demo scene, and the run without LLVM.

    python benchmarks/bench_import.py

Every number is of a fresh process. The cold run has an empty home folder: no compiled kernels, no font cache.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from common import Row, main

IMPORT = "import time; t = time.perf_counter(); import shenron_rt; print(time.perf_counter() - t)"
FIRST_USE = (
    "import time; t = time.perf_counter(); import shenron_rt; shenron_rt.simulate; print(time.perf_counter() - t)"
)
RUN = [sys.executable, "-m", "shenron_rt.cli", "run", "braking"]


def fresh(code: str, times: int = 5) -> float:
    """Return the median of what fresh interpreters print [s]."""
    command = [sys.executable, "-c", code]
    return statistics.median(
        float(subprocess.run(command, capture_output=True, text=True, check=True).stdout) for _ in range(times)
    )


def run(folder: Path, home: Path | None, *options: str) -> tuple[float, float]:
    """Run the demo scene; return wall seconds and the peak memory of the process [MiB]."""
    home = home or Path.home()
    environment = os.environ | {"HOME": str(home), "XDG_CACHE_HOME": str(home / ".cache")}
    environment.pop("MPLCONFIGDIR", None)
    start = time.perf_counter()
    with (folder / "log").open("wb") as log:
        child = subprocess.Popen([*RUN, "-o", str(folder / "out"), *options], env=environment, stdout=log, stderr=log)
        _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    wall = time.perf_counter() - start
    if child.returncode:
        raise RuntimeError(f"{' '.join(RUN)} failed:\n{(folder / 'log').read_text()}")
    return wall, usage.ru_maxrss / 1024


def measure() -> list[Row]:
    """Time the starts and return the table's rows."""
    bare = fresh(IMPORT)
    rows = [
        Row("`import shenron_rt`", "<= 0.3 s", "", f"{bare:.3f} s", bare <= 0.3),
        Row("- `shenron_rt.simulate` imported too", "", "", f"{fresh(FIRST_USE):.2f} s"),
    ]
    with tempfile.TemporaryDirectory() as name:
        cold, again, scalar = (Path(name) / k for k in ("cold", "again", "scalar"))
        for folder in (cold, again, scalar):
            folder.mkdir()
        home = Path(name) / "home"
        home.mkdir()
        for label, folder, bar, options in (
            ("cold `shenron-rt run braking`, with compilation and pictures", cold, 15.0, ()),
            ("- once more, kernels kept", again, None, ()),
            ("`shenron-rt run braking --backend scalar`", scalar, 60.0, ("--backend", "scalar")),
        ):
            wall, peak = run(folder, home, *options)
            limit = "" if bar is None else f"<= {bar:g} s, <= 2 GB"
            met = None if bar is None else wall <= bar and peak * 1024**2 <= 2e9
            rows.append(Row(label, limit, "", f"{wall:.1f} s, {peak:.0f} MiB", met))
    return rows


if __name__ == "__main__":
    main(measure)
