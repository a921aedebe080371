"""C-Shenron's synthesis: time of the fast sum beside the element-wise evaluation of the same formula, in one run.

    python benchmarks/bench_shenron.py [--points 100000] [--fraction 0.0005] [--repeat 3]

The element-wise sum is NumPy in double precision, one exponential for every point, chirp, antenna and sample. It is
timed on the first points of the list, the stated fraction, and scaled to all; the fast sum does all of them, and its
difference to the element-wise one on that fraction is printed beside the speed. CPU seconds are printed beside wall
seconds, since a busy machine stretches the latter.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

from shenron_rt.config.profile import load_profile
from shenron_rt.cshenron.radar import ReleasedRadar
from shenron_rt.cshenron.synthesis import direct_sum, synthesize_released

#: What the public code took for 1e5 points on two cores, blocks of 1000 points; radarbook extrapolated [s].
PUBLIC_S = {"ti_cascade": 308.0, "radarbook": 1580.0}
#: Chirps of which the element-wise sum is timed where there are more; they cost the same.
CHIRPS = 4


def street(n: int, moving: bool, seed: int = 0) -> tuple[np.ndarray, ...]:
    """rho, theta, loss and speed of points 1 to 120 m away, within 80 degrees, up to 30 m/s where they move."""
    rng = np.random.default_rng(seed)
    speed = rng.uniform(-30, 30, n) if moving else np.zeros(n)
    return rng.uniform(1, 120, n), np.pi / 2 - np.radians(rng.uniform(-80, 80, n)), rng.uniform(0.1, 12, n), speed


def timed(work: Callable[[], np.ndarray], repeat: int) -> tuple[np.ndarray, float, float]:
    """Return the result and the shortest wall and CPU seconds of some runs."""
    wall, cpu = [], []
    for _ in range(repeat):
        a, b = time.perf_counter(), time.process_time()
        result = work()
        wall.append(time.perf_counter() - a)
        cpu.append(time.process_time() - b)
    return result, min(wall), min(cpu)


def main() -> None:
    """Print a line for each profile and motion."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--fraction", type=float, default=5e-4, help="of the points summed element by element")
    parser.add_argument("--repeat", type=int, default=3)
    options = parser.parse_args()
    n, few = options.points, max(1, round(options.points * options.fraction))
    print(f"{n} points; element-wise: the first {few} ({few / n:.3%}), scaled; double precision on both sides")
    for name in PUBLIC_S:
        radar = ReleasedRadar.of(load_profile(name))
        for moving in (False, True):
            points = street(n, moving)
            part = [p[:few] for p in points]
            chirps = slice(min(radar.chirps, CHIRPS))
            share = few / n * len(range(radar.chirps)[chirps]) / radar.chirps
            synthesize_released(radar, *part)  # imports and plans, once
            _, fast_wall, fast_cpu = timed(lambda: synthesize_released(radar, *points), options.repeat)  # noqa: B023
            exact, wall, cpu = timed(lambda: direct_sum(radar, *part, chirps=chirps), 1)  # noqa: B023
            error = np.abs(synthesize_released(radar, *part)[chirps] - exact)
            relative = np.sqrt(np.mean(error**2) / np.mean(np.abs(exact) ** 2))
            print(
                f"{name:10} {'moving' if moving else 'static':6} {'x'.join(map(str, radar.shape)):11} "
                f"fast {fast_wall:6.3f} s wall {fast_cpu:6.3f} s CPU   "
                f"element-wise {wall / share:7.0f} s wall {cpu / share:7.0f} s CPU   "
                f"ratio {wall / share / fast_wall:6.0f} wall {cpu / share / fast_cpu:6.0f} CPU   "
                f"difference {relative:.1e} RMS   public code {PUBLIC_S[name]:g} s (single precision, static)"
            )


if __name__ == "__main__":
    main()
