"""What must not matter to ``sweep_rcs``: direction of travel, triangulation, spacing, pose, size, backend, threads."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from rcs_bars import invariants
from rcs_tools import Bar, gated, hold

import shenron_rt as srt
from shenron_rt.constants import SPEED_OF_LIGHT
from shenron_rt.frames import Pose
from shenron_rt.scene.shapes import make_shape
from shenron_rt.tracing.backend import backend_status


@pytest.mark.parametrize("bar", gated(invariants, slow=False))
def test_what_must_not_matter_does_not(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=True)


@pytest.mark.slow
@pytest.mark.parametrize("bar", gated(invariants, slow=True))
def test_what_must_not_matter_does_not_at_every_sample(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=False)


def matrix(target: object, ghz: float = 24.0, **options: object) -> np.ndarray:
    """Return (n_el, n_az, 4) amplitudes VV, HH, HV, VH at one frequency."""
    found = srt.sweep_rcs(target, frequency_hz=ghz * 1e9, polarization=("VV", "HH", "HV", "VH"), **options)
    return found.amplitude[0]


def worst(got: np.ndarray, want: np.ndarray) -> float:
    """Return the largest difference over the largest amplitude."""
    return float(np.abs(got - want).max() / np.abs(want).max())


CORNER = make_shape("trihedral:square,a=0.1")
AZIMUTH, ELEVATION = np.array([-20.0, 0.0, 11.0]), np.array([-9.0, 14.0])


def test_turning_target_and_radar_together_changes_nothing() -> None:
    want = matrix(CORNER, azimuth_deg=AZIMUTH, elevation_deg=ELEVATION)
    turned = CORNER.transformed(Pose(ypr_deg=(73.0, 0.0, 0.0)))
    got = matrix(turned, azimuth_deg=AZIMUTH + 73.0, elevation_deg=ELEVATION)
    # the same rays on the same corner; the caster rounds the turned vertices to float32, 6e-8 of 0.1 m, which moves a
    # cut by no more than one halving, 1/256 of a cell's side: some 100 cuts of 1e-4 of the aperture, at random
    assert worst(got, want) < 1e-3


def test_size_and_wavelength_times_ten_make_a_hundred_times_the_rcs() -> None:
    want = matrix(CORNER, azimuth_deg=AZIMUTH, elevation_deg=ELEVATION)
    large = CORNER.transformed(np.diag([10.0, 10.0, 10.0]))
    got = matrix(large, 2.4, azimuth_deg=AZIMUTH, elevation_deg=ELEVATION)
    assert worst(got, 10.0 * want) < 1e-3  # as above
    # by a power of two nothing is rounded differently
    large = CORNER.transformed(np.diag([8.0, 8.0, 8.0]))
    got = matrix(large, 3.0, azimuth_deg=AZIMUTH, elevation_deg=ELEVATION)
    assert worst(got, 8.0 * want) < 1e-12


def test_shifting_the_target_turns_its_phase_by_the_way_saved() -> None:
    shift = np.array([0.31, -0.12, 0.07])
    want = matrix(CORNER, azimuth_deg=AZIMUTH, elevation_deg=ELEVATION)
    moved = CORNER.transformed(Pose(tuple(shift)))
    got = matrix(moved, azimuth_deg=AZIMUTH, elevation_deg=ELEVATION)
    az, el = np.meshgrid(np.radians(AZIMUTH), np.radians(ELEVATION))
    toward = np.stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)], axis=-1)
    phase = np.exp(2j * 2.0 * np.pi * 24e9 / SPEED_OF_LIGHT * (toward @ shift))
    # rays are cast about the middle of the target, which the shift leaves as it was but for rounding
    assert worst(got, want * phase[:, :, None]) < 1e-3
    assert worst(got, want) > 1.0


def test_the_seed_moves_the_lattice_and_not_the_result() -> None:
    one, other = (matrix(CORNER, azimuth_deg=AZIMUTH, elevation_deg=ELEVATION, seed=s) for s in (1, 2))
    again = matrix(CORNER, azimuth_deg=AZIMUTH, elevation_deg=ELEVATION, seed=1)
    assert np.array_equal(one, again)
    assert 0.0 < worst(other, one) < 10 ** (0.05 / 20.0) - 1.0  # 0.05 dB, the bar at boresight


def test_a_sweep_is_its_parts() -> None:
    # frequencies share one lattice, cut for the highest: compare at the same spacing
    both = srt.sweep_rcs(CORNER, frequency_hz=[23e9, 24e9], azimuth_deg=AZIMUTH, elevation_deg=ELEVATION)
    assert both.amplitude.shape == (2, 2, 3, 1)
    alone = srt.sweep_rcs(CORNER, frequency_hz=24e9, azimuth_deg=AZIMUTH, elevation_deg=ELEVATION)
    assert worst(both.amplitude[1], alone.amplitude[0]) < 1e-12
    other = srt.sweep_rcs(
        CORNER, frequency_hz=23e9, azimuth_deg=AZIMUTH, elevation_deg=ELEVATION, rays_per_wavelength=24.0 / 23.0
    )
    assert worst(both.amplitude[0], other.amplitude[0]) < 1e-2


@pytest.mark.skipif(not backend_status("llvm").usable, reason="no usable LLVM")
def test_scalar_and_llvm_agree_on_a_small_plate() -> None:
    options = {"azimuth_deg": [0.0, 3.0], "max_bounces": 1}
    fast, slow = (matrix("plate:0.03x0.03", 77.0, backend=b, **options) for b in ("llvm", "scalar"))
    assert worst(fast, slow) < 1e-6  # the same float32 triangles, walked by the same code


CHILD = """
import hashlib, os, sys
threads = int(sys.argv[1])
os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:threads])
import drjit as dr
dr.set_thread_count(threads)
import shenron_rt as srt
from shenron_rt._parallel import pool
for shape, ghz, bounces in (("trihedral:square,a=0.15", 77e9, 3), ("sphere:r=0.08,edge=0.002", 77e9, 1)):
    s = srt.sweep_rcs(shape, frequency_hz=ghz, azimuth_deg=[0.0, 9.0, 20.0], max_bounces=bounces,
                      polarization=("VV", "HH", "HV"))
    print(hashlib.sha256(s.amplitude.tobytes()).hexdigest())
print(pool()._max_workers)
"""


@pytest.mark.skipif(
    not backend_status("llvm").usable or not hasattr(os, "sched_setaffinity") or len(os.sched_getaffinity(0)) < 2,
    reason="one core, no affinity, or no usable LLVM",
)
def test_one_and_two_threads_give_the_same_bytes() -> None:
    libraries = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    said = [
        subprocess.run(
            [sys.executable, "-c", CHILD, str(threads)],
            env=os.environ | dict.fromkeys(libraries, str(threads)),
            capture_output=True,
            text=True,
            check=True,
            timeout=250,
        ).stdout.split()
        for threads in (1, 2)
    ]
    assert (said[0].pop(), said[1].pop()) == ("1", "2")
    assert len(said[0]) == 2
    assert said[0] == said[1]
