"""Run every benchmark of the speed table, each in a process of its own, and print one Markdown table.

    python benchmarks/run_all.py

On a machine that does nothing else: the load is printed with the table.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from common import Row, machine, markdown

HERE = Path(__file__).resolve().parent
PARTS = ("bench_rays.py", "synthesis_rows.py", "bench_frame.py", "bench_import.py")


def rows_of(script: str) -> list[Row]:
    """Return the rows that a benchmark prints; one that fails is a row that says so."""
    done = subprocess.run([sys.executable, str(HERE / script), "--json"], capture_output=True, text=True, check=False)
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return [Row(script, "", "", f"failed: {last}", False)]
    return [Row(**json.loads(line)) for line in done.stdout.splitlines() if line.startswith("{")]


def main() -> int:
    """Print the table; 1 where a bar is missed."""
    print(machine() + "\n")
    rows = [row for script in PARTS for row in rows_of(script)]
    print(markdown(rows))
    return int(any(row.met is False for row in rows))


if __name__ == "__main__":
    sys.exit(main())
