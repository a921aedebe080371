"""Three radars from one trace beside each alone: frames of ``braking``, 300 k rays, first surface, accuracy 1e-4.

    python benchmarks/bench_radars.py [--rays N]

The three are those of ``shenron-rt run braking --profile awrl1432 --profile radarbook --profile ti_cascade``. Frames
follow each other at 10 Hz. All take turns, after warm-up.
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
THREE = " ".join(NAMES)
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
    """Time all in turn, and tell where the CPU time of the three goes."""
    options = RunOptions(rays=_arguments().rays, accuracy=1e-4)
    scenes = {n: with_profiles(srt.load_scene("braking"), n.split(), {}) for n in (*NAMES, THREE)}
    wall: dict[str, list[float]] = {n: [] for n in scenes}
    cpu: dict[str, list[float]] = {n: [] for n in scenes}
    spent: dict[str, float] = {}
    _watched(spent)
    for k in range(WARM + TIMES):
        for n, scene in scenes.items():
            before = dict(spent)
            start = time.perf_counter(), time.process_time()
            for _ in rendering.rendered(scene, options, range(k, k + 1)):
                pass
            if k >= WARM:
                wall[n].append(time.perf_counter() - start[0])
                cpu[n].append(time.process_time() - start[1])
            if k < WARM or n != THREE:
                spent.clear()
                spent.update(before)
    best = {n: min(seconds) for n, seconds in wall.items()}
    alone = {n: best[THREE] / best[n] for n in NAMES}
    slowest = min(alone.values())
    split = sorted(((v / TIMES, name) for name, v in spent.items()), reverse=True)
    what = f"three radars from one trace / the slowest of them alone, `braking`, {options.rays // 1000} k rays"
    return [
        Row(what, f"<= {BAR}", "", f"{slowest:.2f}", slowest <= BAR),
        Row("- / each alone", "", "", ", ".join(f"{n} {ratio:.2f}" for n, ratio in alone.items())),
        Row("- / the sum of the three alone", "", "", f"{best[THREE] / sum(best[n] for n in NAMES):.2f}"),
        Row("- best of wall", "", "", ", ".join(f"{n.replace(' ', ' + ')} {t:.3f} s" for n, t in best.items())),
        Row("- best of CPU", "", "", ", ".join(f"{n.replace(' ', ' + ')} {min(t):.3f} s" for n, t in cpu.items())),
        Row("- CPU of the three, stage by stage [ms]", "", "", ", ".join(f"{name} {1e3 * v:.0f}" for v, name in split)),
    ]


if __name__ == "__main__":
    main(measure)
