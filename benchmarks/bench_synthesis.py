"""ADC synthesis: time of the fast sum beside the element-wise exponential sum and a matrix product, in one run.

    python benchmarks/bench_synthesis.py [--echoes 100000] [--profile awrl1432] [--repeat 5]

The slow sums are timed on a subset of the echoes and scaled to all of them; the table says so. CPU seconds are printed
beside wall seconds, since a busy machine stretches the latter.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable

import numpy as np

from shenron_rt.config.profile import RadarProfile, load_profile
from shenron_rt.returns import Returns
from shenron_rt.synthesis import synthesize
from shenron_rt.synthesis.nufft import worker_count

SUBSET = 4


def road_scene(n: int, motion: str, seed: int = 0) -> Returns:
    """Echoes on a road seen from its middle: 2 to 90 m ahead, 40 m to both sides, power falling as R^-4.

    Motion "ego": a static world seen at 20 m/s, a third of it moving along the road at up to 15 m/s beside that;
    "radial": range rates up to 60 m/s; "any": up to 60 m/s in random directions.
    """
    rng = np.random.default_rng(seed)
    p = np.stack([rng.uniform(2, 90, n), rng.uniform(-40, 40, n), rng.uniform(-1, 4, n)], axis=1)
    r = np.linalg.norm(p, axis=1, keepdims=True)
    if motion == "ego":
        v = np.tile([-20.0, 0.0, 0.0], (n, 1))
        v[:, 0] += np.where(rng.random(n) < 0.3, rng.uniform(-15, 15, n), 0.0)
    elif motion == "radial":
        v = p / r * rng.uniform(-60, 60, (n, 1))
    else:
        v = rng.normal(size=(n, 3))
        v *= rng.uniform(0, 60, (n, 1)) / np.linalg.norm(v, axis=1, keepdims=True)
    amplitude = 1e-4 * (rng.normal(size=n) + 1j * rng.normal(size=n)) / r[:, 0] ** 2
    zero = np.zeros(n, dtype=np.int64)
    ids, small = zero.astype(np.uint32), zero.astype(np.uint8)
    return Returns(amplitude, p, v, ids, small, zero == 0, small, zero, 77e9)


def best(work: Callable[[], object], repeat: int) -> tuple[float, float]:
    """Shortest wall and CPU seconds of some runs."""
    wall, cpu = [], []
    for _ in range(repeat):
        a, b = time.perf_counter(), time.process_time()
        work()
        wall.append(time.perf_counter() - a)
        cpu.append(time.process_time() - b)
    return min(wall), min(cpu)


def phases(returns: Returns, profile: RadarProfile) -> np.ndarray:
    """(n, cube size) phases of a few echoes in linear-phase approximation, enough to time what follows [rad]."""
    rng = np.random.default_rng(1)
    size = profile.waveform.chirps * profile.n_virtual * profile.waveform.samples
    return rng.uniform(-1e3, 1e3, (SUBSET, 1)) * np.linspace(-1, 1, size)


def bare_type1(n: int, profile: RadarProfile) -> Callable[[], object]:
    """One uncorrected linear-phase transform onto the cube, the least a NUFFT can do."""
    import finufft

    rng = np.random.default_rng(2)
    points = rng.uniform(-np.pi, np.pi, (3, n))
    strength = rng.normal(size=n) + 1j * rng.normal(size=n)
    shape = (profile.waveform.samples, profile.waveform.chirps, profile.n_virtual)
    return lambda: finufft.nufft3d1(*points, strength, shape, eps=1e-6, nthreads=worker_count())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--echoes", type=int, default=100_000)
    parser.add_argument("--profile", default="awrl1432")
    parser.add_argument("--repeat", type=int, default=5)
    args = parser.parse_args()
    profile, n = load_profile(args.profile), args.echoes
    print(f"{profile}\n{n} echoes, {worker_count()} threads\n")

    angle = phases(road_scene(1, "ego"), profile)
    scaled = n / SUBSET
    exponential = best(lambda: np.exp(1j * angle).sum(axis=0), 2)[0] * scaled
    strength, basis = np.ones((1, SUBSET)), np.exp(1j * angle)
    product = best(lambda: strength @ basis, args.repeat)[0] * scaled
    print(f"{'what':<44}{'wall s':>10}{'CPU s':>10}{'vs exp':>10}{'vs GEMM':>10}")
    print(f"{f'element-wise exp, {SUBSET} echoes scaled':<44}{exponential:>10.1f}{'':>10}{1:>10}")
    label = f"GEMM of ready exponentials, {SUBSET} scaled"
    print(f"{label:<44}{product:>10.2f}{'':>10}{exponential / product:>10.0f}{1:>10}")
    wall, cpu = best(bare_type1(n, profile), args.repeat)
    print(f"{'bare 3-D type 1, 1e-6, no corrections':<44}{wall:>10.3f}{cpu:>10.3f}{exponential / wall:>10.0f}")
    for motion in ("ego", "radial", "any"):
        returns = road_scene(n, motion)
        for accuracy in (1e-4, 1e-5, 1e-6):
            wall, cpu = best(lambda r=returns, a=accuracy: synthesize(r, profile, noise=None, accuracy=a), args.repeat)
            label = f"synthesize, {motion} motion, {accuracy:g}"
            print(f"{label:<44}{wall:>10.3f}{cpu:>10.3f}{exponential / wall:>10.0f}{product / wall:>10.1f}")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"\npeak memory {peak:.0f} MiB")


if __name__ == "__main__":
    main()
