"""Time process and detect on a street of 300 000 echoes: two rough walls, a road, a car; awrl1432, one thread.

python benchmarks/bench_dsp.py [profile]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np

from shenron_rt.config.profile import RadarProfile, load_profile
from shenron_rt.dsp import detect, process
from shenron_rt.returns import Returns
from shenron_rt.synthesis.synthesize import synthesize

ROWS = 300_000
EGO_MPS = 15.0


def street(profile: RadarProfile, rows: int, seed: int = 0) -> Returns:
    """Return speckle of two walls and a road that pass by at the ego's speed, and a car 25 m ahead."""
    rng = np.random.default_rng(seed)
    part = rng.choice(3, size=rows, p=[0.4, 0.4, 0.2])
    x = rng.uniform(2, 70, rows)
    y = np.choose(part, [np.full(rows, 4.0), np.full(rows, -4.0), rng.uniform(-4, 4, rows)])
    z = np.where(part == 2, -1.0, rng.uniform(-1, 2, rows))
    car = rng.random(rows) < 0.05
    x[car], y[car], z[car] = 25.0, rng.uniform(-0.9, 0.9, car.sum()), rng.uniform(-0.7, 0.5, car.sum())
    position = np.stack([x, y, z], axis=1)
    distance = np.linalg.norm(position, axis=1)
    velocity = np.zeros_like(position)
    velocity[:, 0] = np.where(car, -5.0, -EGO_MPS)
    level = np.sqrt(np.where(car, 1e-3, 1e-4) * np.where(part == 2, 0.01, 1.0)) / distance**2 * 1e-4
    speckle = (rng.standard_normal(rows) + 1j * rng.standard_normal(rows)) / np.sqrt(2)
    return Returns(
        amplitude=level * speckle,
        position=position,
        velocity=velocity,
        object_id=np.where(car, 101, 40 + part).astype(np.uint32),
        tag=np.where(car, 14, 11).astype(np.uint8),
        coherent=np.zeros(rows, dtype=bool),
        bounces=np.ones(rows, dtype=np.uint8),
        scatterer=np.arange(rows),
        center_hz=profile.center_hz,
    )


def best(call: Callable[[], object], repeats: int = 7) -> float:
    """Return the shortest of a few runs [ms]."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return 1e3 * min(times)


def main(name: str = "awrl1432") -> None:
    profile = load_profile(name)
    adc = synthesize(street(profile, ROWS), profile, accuracy=1e-4)
    start = time.perf_counter()
    cube = process(adc)
    found = detect(cube)
    print(f"{name}: first frame {1e3 * (time.perf_counter() - start):.0f} ms (windows, CFAR multipliers), {found}")
    print(f"process        {best(lambda: process(adc)):7.1f} ms")
    print(
        f"detect         {best(lambda: detect(process(adc))) - best(lambda: process(adc)):7.1f} ms, {len(found)} rows"
    )
    bare = process(type(adc)(adc.data, profile, adc.noise_power_w))
    print(f"  without truth {best(lambda: detect(bare)):6.1f} ms")
    print(f"range_azimuth  {best(lambda: process(adc).range_azimuth) - best(lambda: process(adc)):7.1f} ms")
    for kind in ("go", "so", "os"):
        detect(cube, cfar=kind)
        print(f"detect, {kind}     {best(lambda kind=kind: detect(cube, cfar=kind), 3):7.1f} ms")


if __name__ == "__main__":
    main(*sys.argv[1:])
