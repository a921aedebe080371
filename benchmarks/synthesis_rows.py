"""The synthesis rows of the speed table; ``bench_synthesis.py`` has the whole comparison."""

from __future__ import annotations

import numpy as np
from bench_synthesis import SUBSET, best, phases, road_scene
from common import Row, main, peak_mib

from shenron_rt.config.profile import load_profile
from shenron_rt.synthesis import synthesize

ECHOES = 100_000
#: (accuracy, bar [s], goal)
LEVELS = ((1e-6, 0.35, ""), (1e-4, 0.1, "0.05 s"))


def measure() -> list[Row]:
    """Time the fast sum, and the slow ones on a few echoes."""
    profile = load_profile("awrl1432")
    returns = road_scene(ECHOES, "ego")
    angle = phases(road_scene(1, "ego"), profile)
    exponential = best(lambda: np.exp(1j * angle).sum(axis=0), 3)[0] * ECHOES / SUBSET
    strength, basis = np.ones((1, SUBSET)), np.exp(1j * angle)
    product = best(lambda: strength @ basis, 5)[0] * ECHOES / SUBSET
    rows = []
    for accuracy, bar, goal in LEVELS:
        wall, _ = best(lambda a=accuracy: synthesize(returns, profile, noise=None, accuracy=a), 7)
        rows += [
            Row(
                f"ADC synthesis, {ECHOES:.0e} moving scatterers, awrl1432, accuracy {accuracy:g}",
                f"<= {bar} s",
                goal,
                f"{wall:.3f} s",
                wall <= bar,
            ),
            Row(
                "- against the element-wise exponential sum",
                ">= 1000 x",
                "",
                f"{exponential / wall:.0f} x",
                exponential / wall >= 1000,
            ),
            Row("- against a matrix product with ready exponentials", "", "", f"{product / wall:.0f} x"),
        ]
    peak = peak_mib()
    return [*rows, Row("- peak memory", "<= 2 GB", "", f"{peak:.0f} MiB", peak * 1024**2 <= 2e9)]


if __name__ == "__main__":
    main(measure)
