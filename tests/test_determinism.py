"""Same seed, same bytes: twice in a process, in processes with one or two threads; same hits on any backend."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shenron_rt as srt
from shenron_rt.tracing.backend import backend_status

RAYS = 35_000  # three blocks of 2^14 rows: work is shared among threads

needs_llvm = pytest.mark.skipif(not backend_status("llvm").usable, reason="no usable LLVM")


def scene() -> srt.Scene:
    """Return a street with every kind of echo: rough and smooth, moving and turning, aimed, points."""
    return srt.Scene(
        seed=3,
        ego={"velocity_mps": (12.0, 0, 0), "yaw_rate_deg_s": 5.0},
        static=[
            {"shape": "ground:120x30", "xyz_m": (62, 0, 0), "tag": "Roads", "material": "asphalt"},
            {"shape": "box:60x0.3x3", "xyz_m": (33, 5.15, 1.5), "tag": "Walls", "material": "concrete", "id": 40},
        ],
        actors=[
            {"id": 101, "shape": "car", "xyz_m": (25, 0, 0), "velocity_mps": (9, 1, 0), "yaw_rate_deg_s": 20},
            {"id": 102, "shape": "sphere:r=0.2,edge=0.01", "xyz_m": (12, -3, 1), "tag": "Other", "aim": 500},
        ],
        point_targets=[{"id": 900, "xyz_m": (40, -2, 1), "rcs_dbsm": 10}],
    )


def digests(frame: srt.Frame) -> dict[str, str]:
    """Return the hash of every array of every stage."""
    arrays: dict[str, Any] = {"adc.data": frame.adc.data, "cube.data": frame.cube.data}
    arrays |= {"cube.range_doppler": frame.cube.range_doppler, "cube.range_azimuth": frame.cube.range_azimuth}
    arrays["detections.table"] = frame.detections.table
    for name in ("scatterers", "returns"):
        stage = getattr(frame, name)
        for field in dataclasses.fields(stage):
            value = getattr(stage, field.name)
            if isinstance(value, np.ndarray):
                arrays[f"{name}.{field.name}"] = value
    return {k: hashlib.sha256(np.ascontiguousarray(v).tobytes()).hexdigest() for k, v in arrays.items()}


def test_the_same_seed_twice_gives_the_same_bytes_of_every_stage() -> None:
    first, again = (digests(srt.simulate(scene(), rays=RAYS)) for _ in range(2))
    assert len(first) > 20
    assert first == again
    other = digests(srt.simulate(scene(), rays=RAYS, seed=4))
    same = {k for k in first if first[k] == other[k]}
    assert "adc.data" not in same
    assert "scatterers.position" not in same


def test_a_frame_does_not_depend_on_those_before_it() -> None:
    alone = digests(srt.simulate(scene(), rays=RAYS, frame=3, time=0.3))
    srt.simulate(scene(), rays=RAYS, frame=2, time=0.2)
    srt.simulate(srt.load_scene("clear_road"), rays=1000)
    assert digests(srt.simulate(scene(), rays=RAYS, frame=3, time=0.3)) == alone


CHILD = """
import json, os, sys
threads = int(sys.argv[1])
os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:threads])
import drjit as dr
dr.set_thread_count(threads)
sys.path.insert(0, sys.argv[2])
import shenron_rt as srt
from test_determinism import RAYS, digests, scene
from shenron_rt._parallel import pool
out = [digests(srt.simulate(scene(), srt.load_profile(p), rays=RAYS)) for p in ("awrl1432", "awrl1432boost")]
print(json.dumps({"workers": pool()._max_workers, "digests": out}))
"""


def run_child(threads: int) -> dict[str, Any]:
    libraries = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    done = subprocess.run(
        [sys.executable, "-c", CHILD, str(threads), str(Path(__file__).parent)],
        env=os.environ | dict.fromkeys(libraries, str(threads)),
        capture_output=True,
        text=True,
        check=True,
        timeout=250,
    )
    result: dict[str, Any] = json.loads(done.stdout)
    return result


@needs_llvm
@pytest.mark.skipif(
    not hasattr(os, "sched_setaffinity") or len(os.sched_getaffinity(0)) < 2, reason="one core, or no affinity"
)
def test_one_and_two_threads_give_the_same_bytes() -> None:
    one, two = run_child(1), run_child(2)
    assert (one["workers"], two["workers"]) == (1, 2)
    for a, b in zip(one["digests"], two["digests"], strict=True):
        assert [k for k in a if a[k] != b[k]] == []


@needs_llvm
def test_scalar_and_llvm_give_the_same_hits() -> None:
    few = {"rays": 6000, "seed": 1}
    fast, slow = (srt.trace(scene(), backend=b, **few) for b in ("llvm", "scalar"))  # type: ignore[arg-type]
    assert (fast.backend, slow.backend) == ("llvm", "scalar")
    # the bar: the same triangle for 99.99 % of rays, positions to 1e-4 m. Both walk the same float32 triangles with
    # the same code, so that of these few thousand rays none may differ.
    assert len(fast) == len(slow)
    for name in ("object_id", "tag", "material", "bounces"):
        assert np.array_equal(getattr(fast, name), getattr(slow, name)), name
    assert np.abs(fast.position - slow.position).max() < 1e-4
    assert np.array_equal(fast.cos_incidence, slow.cos_incidence)
    assert fast.speckle is not None
    assert slow.speckle is not None
    assert np.array_equal(fast.speckle, slow.speckle)
