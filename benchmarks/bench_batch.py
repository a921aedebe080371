"""Two Dask workers beside one: the same batch of ``braking`` on clusters of one and of two workers of one thread each.

    python benchmarks/bench_batch.py [--rays N] [--frames N]

Warm-up is left out: every worker has rendered frames of the same scene before the clock starts, so that imports,
kernels and the scene are there. All else counts: handing out, files, checksums, putting runs together. The two
clusters take turns, so that what else the machine does hits both alike; needs the extra ``cluster`` and two idle cores.
"""

from __future__ import annotations

import argparse
import logging
import sys
import tempfile
from pathlib import Path

from common import Row, main, peak_mib

import shenron_rt as srt

BAR, GOAL = 1.7, 1.9
TIMES = 3


def _plan(seeds: list[int], arguments: argparse.Namespace) -> srt.BatchPlan:
    return srt.BatchPlan(
        scenes=("braking",),
        profiles=("awrl1432",),
        seeds=tuple(seeds),
        frames=f"0:{arguments.frames}",
        block=1,  # an uneven end, one worker at a last block alone, costs least
        options={"rays": arguments.rays, "accuracy": 1e-4},
    )


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    parser.add_argument("--rays", type=int, default=300_000)
    parser.add_argument("--frames", type=int, default=48)
    parser.add_argument("--json", action="store_true")
    return parser.parse_args()


def measure() -> list[Row]:
    """Time the batch on both clusters in turn."""
    from distributed import LocalCluster

    arguments = _arguments()
    best = {1: float("inf"), 2: float("inf")}
    clusters = {
        n: LocalCluster(n_workers=n, threads_per_worker=1, dashboard_address=":0", silence_logs=logging.ERROR)
        for n in best
    }
    try:
        for k in range(-1, TIMES):  # the first is the warm-up
            for n, cluster in clusters.items():
                with tempfile.TemporaryDirectory() as folder:
                    plan = _plan([k + 1], arguments)
                    result = srt.run_batch(plan, Path(folder) / "batch", cluster=cluster.scheduler_address)
                if not result.complete:
                    sys.exit(f"a batch failed: {result.failures[0].error}")
                if k >= 0:
                    best[n] = min(best[n], result.seconds)
    finally:
        for cluster in clusters.values():
            cluster.close()
    ratio = best[1] / best[2]
    frames = arguments.frames
    what = f"two Dask workers / one, {frames} frames of `braking`, {arguments.rays // 1000} k rays, warm"
    return [
        Row(what, f">= {BAR}", f"{GOAL}", f"{ratio:.2f}", ratio >= BAR),
        Row("- frames a second, one and two workers", "", "", f"{frames / best[1]:.2f}, {frames / best[2]:.2f}"),
        Row("- peak memory of the driver", "", "", f"{peak_mib():.0f} MiB"),
    ]


if __name__ == "__main__":
    main(measure)
