"""Nine seconds at 10 Hz with one awrl1432, as a user waits for them: the whole command, detections and maps written.

    python benchmarks/bench_drive.py [--json]

300 k rays, first surface, accuracy 1e-4; a fresh process each time, kernels kept from the first, which does not count.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from bench_import import run
from common import Row, main

BAR_S, DRIVE_S = 25.0, 9.0
TIMES = 3
OPTIONS = ("--frames", "0:90", "--accuracy", "1e-4", "--no-pictures", "--write", "detections,maps")


def measure() -> list[Row]:
    """Time the command and return the table's row."""
    with tempfile.TemporaryDirectory() as name:
        folders = [Path(name) / str(k) for k in range(TIMES + 1)]
        for folder in folders:
            folder.mkdir()
        found = [run(folder, None, *OPTIONS) for folder in folders][1:]
    wall, peak = sorted(w for w, _ in found), max(p for _, p in found)
    middle = wall[TIMES // 2]
    measured = f"{middle:.1f} s (best {wall[0]:.1f}), {peak:.0f} MiB"
    what = "`shenron-rt run braking --frames 0:90`, 300 k rays, accuracy 1e-4, to detections and maps"
    return [
        Row(what, f"<= {BAR_S:g} s, <= 2 GB", f"{DRIVE_S:g} s", measured, middle <= BAR_S and peak <= 2e9 / 1024**2)
    ]


if __name__ == "__main__":
    main(measure)
