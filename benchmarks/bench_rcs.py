"""Turntable sweeps: a sedan at 77 GHz, and large shapes at 3 GHz whose times an open GPU code publishes.

    python benchmarks/bench_rcs.py [--circle]

The sedan is that of docs/rcs-validation.md and needs its meshes beside the checkout, or where SHENRON_RT_SHARED says;
``--circle`` sweeps 361 aspects of it, about five minutes. The bars of plate, dihedral and trihedral are the times that
PO-SBR-Python's authors give for an RTX 4070 Super.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from pathlib import Path

import numpy as np
from common import Row, main, peak_mib, repeat

import shenron_rt as srt

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))

from rcs_bars.tables import shared_folder
from rcs_bars.vehicles import vehicle

SHAPES = {"plate:1.5x1.5": (1, 4.1), "dihedral:a=1.5,b=1.5,h=1.5": (2, 7.9), "trihedral:triangular,a=1.5": (3, 8.6)}
SEDAN_S, CIRCLE_S, MEMORY_MIB = 1.0, 300.0, 2000.0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    parser.add_argument("--circle", action="store_true")
    parser.add_argument("--json", action="store_true")
    return parser.parse_args()


def measure() -> list[Row]:
    """Time all of it; a mesh that is new each time has its search tree built anew."""
    sedan = vehicle("sedan", shared_folder())
    side = repeat(
        lambda _: srt.sweep_rcs(dataclasses.replace(sedan), frequency_hz=77e9, azimuth_deg=90.0), times=16, warm=1
    )
    rows = [
        Row(
            f"sedan, {sedan.n_faces} triangles, 77 GHz, one side aspect, 3 bounces", f"<= {SEDAN_S:g} s", "",
            f"{side.median:.2f} s (best {side.best:.2f})", side.median <= SEDAN_S,
        )
    ]  # fmt: skip
    if _arguments().circle:
        begun = time.perf_counter()
        srt.sweep_rcs(sedan, frequency_hz=77e9, azimuth_deg=np.linspace(-180.0, 180.0, 361))
        took = time.perf_counter() - begun
        rows.append(Row("- 361 aspects around it", f"<= {CIRCLE_S:g} s", "", f"{took:.0f} s", took <= CIRCLE_S))
    azimuth = np.linspace(-45.0, 45.0, 901)
    for shape, (bounces, bar) in SHAPES.items():
        begun = time.perf_counter()
        srt.sweep_rcs(shape, frequency_hz=3e9, azimuth_deg=azimuth, max_bounces=bounces)
        took = time.perf_counter() - begun
        rows.append(Row(f"{shape}, 3 GHz, 901 aspects", f"< {bar:g} s", "", f"{took:.1f} s", took < bar))
    peak = peak_mib()
    return [*rows, Row("- peak memory", "<= 2 GB", "", f"{peak:.0f} MiB", peak <= MEMORY_MIB)]


if __name__ == "__main__":
    main(measure)
