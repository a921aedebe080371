"""Three radars from one trace beside one radar alone: frames of ``braking``, 300 k rays, first surface, accuracy 1e-4.

    python benchmarks/bench_radars.py [--rays N]

The three are those of ``shenron-rt run braking --profile awrl1432 --profile radarbook --profile ti_cascade``, the one
is awrl1432, whose pattern is the widest. Frames follow each other at 10 Hz. Both take turns, after warm-up.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

from common import Row, main

import shenron_rt as srt
from shenron_rt import pipeline, rendering
from shenron_rt.run_setup import RunOptions, with_profiles

NAMES = ["awrl1432", "radarbook", "ti_cascade"]
BAR = 1.6
TIMES, WARM = 7, 2


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    parser.add_argument("--rays", type=int, default=300_000)
    parser.add_argument("--json", action="store_true")
    return parser.parse_args()


def _watched(spent: dict[str, float]) -> None:
    """Let the stages of the pipeline, and the shared trace, add up their CPU seconds by profile."""

    def watch(module: Any, name: str, label: Callable[..., str]) -> None:
        real = getattr(module, name)

        def timed(*args: Any, **kwargs: Any) -> Any:
            start = time.process_time()
            result = real(*args, **kwargs)
            key = f"{name} {label(*args)}"
            spent[key] = spent.get(key, 0.0) + time.process_time() - start
            return result

        setattr(module, name, timed)

    watch(rendering, "trace_shared", lambda *_: "all")
    watch(pipeline, "illuminate", lambda _, profile: profile.name)
    watch(pipeline, "synthesize", lambda _, profile: profile.name)
    watch(pipeline, "process", lambda adc: adc.profile.name)
    watch(pipeline, "detect", lambda cube: cube.profile.name)


def measure() -> list[Row]:
    """Time both in turn, and tell where the CPU time of the three goes."""
    options = RunOptions(rays=_arguments().rays, accuracy=1e-4)
    scenes = {n: with_profiles(srt.load_scene("braking"), NAMES[:n], {}) for n in (1, 3)}
    wall: dict[int, list[float]] = {1: [], 3: []}
    cpu: dict[int, list[float]] = {1: [], 3: []}
    spent: dict[str, float] = {}
    _watched(spent)
    for k in range(-WARM, TIMES):
        if k == 0:
            spent.clear()
        for n, scene in scenes.items():
            start = time.perf_counter(), time.process_time()
            for _ in rendering.rendered(scene, options, range(k + WARM, k + WARM + 1)):
                pass
            if k >= 0:
                wall[n].append(time.perf_counter() - start[0])
                cpu[n].append(time.process_time() - start[1])
            elif n == 1:
                spent.clear()
    ratio, load = min(wall[3]) / min(wall[1]), min(cpu[3]) / min(cpu[1])
    # the one radar's own stages are in both: take them out of the sums
    split = {k: 1e3 * v / TIMES for k, v in spent.items()}
    shared = {k: v / (2 if k.endswith("awrl1432") else 1) for k, v in split.items()}
    text = ", ".join(f"{k} {v:.0f}" for k, v in sorted(shared.items(), key=lambda kv: -kv[1]))
    return [
        Row(
            f"three radars from one trace / awrl1432 alone, `braking`, {options.rays // 1000} k rays",
            f"<= {BAR}",
            "",
            f"{ratio:.2f} (CPU {load:.2f})",
            ratio <= BAR,
        ),
        Row("- best of wall, one and three", "", "", f"{min(wall[1]):.3f} s, {min(wall[3]):.3f} s"),
        Row("- best of CPU, one and three", "", "", f"{min(cpu[1]):.3f} s, {min(cpu[3]):.3f} s"),
        Row("- CPU of the three, stage by stage [ms]", "", "", text),
    ]


if __name__ == "__main__":
    main(measure)
