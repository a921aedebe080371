"""A warm frame of ``braking``, stage by stage: 300 k rays, first surface, accuracy 1e-4, to detections.

    python benchmarks/bench_frame.py

Twice: frames of one instant (the placed scene is kept), and frames that follow each other at 10 Hz (actors move and the
scene is placed for every one; the search trees are kept).
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "2")

import statistics
import time
from collections.abc import Callable
from typing import Any, TypeAlias

from common import Row, main, peak_mib

import shenron_rt as srt

RAYS, ACCURACY = 300_000, 1e-4
STAGES = ("trace", "illuminate", "synthesize", "process", "detect")
TIMES, WARM = 9, 3
Seconds: TypeAlias = dict[str, float]
BAR_S, GOAL_S = 0.25, 0.10


def stages(scene: srt.Scene, profile: srt.RadarProfile, frame: int, at: float) -> tuple[Seconds, Seconds]:
    """Run one frame and return wall and CPU seconds of each stage; a busy machine stretches the former."""
    seconds: Seconds = {}
    cpu: Seconds = {}

    def timed(name: str, work: Callable[[], Any]) -> Any:
        start = time.perf_counter(), time.process_time()
        result = work()
        seconds[name], cpu[name] = time.perf_counter() - start[0], time.process_time() - start[1]
        return result

    hits = timed("trace", lambda: srt.trace(scene, profile, frame=frame, time=at, rays=RAYS))
    echoes = timed("illuminate", lambda: srt.illuminate(hits, profile, materials=scene.materials))
    adc = timed("synthesize", lambda: srt.synthesize(echoes, profile, frame=frame, accuracy=ACCURACY, radar="front"))
    cube = timed("process", lambda: srt.process(adc))
    timed("detect", lambda: srt.detect(cube))
    return seconds, cpu


def measure() -> list[Row]:
    """Time the frames and return the table's rows."""
    scene = srt.load_scene("braking")
    profile = srt.load_profile("awrl1432")
    rows = []
    for label, period, bar in (("", 0.0, True), (", 10 frames/s one after the other", 0.1, False)):
        runs = [stages(scene, profile, k, k * period) for k in range(WARM + TIMES)][WARM:]
        totals = [sum(wall.values()) for wall, _ in runs]
        total = statistics.median(totals)
        rows.append(
            Row(
                f"warm frame `braking`, {RAYS // 1000} k rays, depth 1, accuracy {ACCURACY:g}{label}",
                f"<= {BAR_S} s" if bar else "",
                f"{GOAL_S:.2f} s" if bar else "",
                f"{total:.3f} s (best {min(totals):.3f})",
                total <= BAR_S if bar else None,
            )
        )
        for column, name in enumerate(("wall", "CPU of all cores")):
            parts = {s: 1e3 * statistics.median(run[column][s] for run in runs) for s in STAGES}
            text = ", ".join(f"{s} {ms:.0f}" for s, ms in parts.items())
            rows.append(Row(f"- stages, {name} [ms]", "", "", f"{text}; sum {sum(parts.values()):.0f}"))
    whole = peak_mib()
    rows.append(Row("- peak memory of these frames", "<= 2 GB", "", f"{whole:.0f} MiB", whole * 1024**2 <= 2e9))
    return rows


if __name__ == "__main__":
    main(measure)
