"""A 20 dBsm corner reflector from 5 to 160 m at 24.1 GHz, scene to detections: range law, and lobes over a road."""

from __future__ import annotations

import numpy as np
import pytest
from corner_tools import LEG_M, corner_scene, four_path_corner

import shenron_rt as srt
from shenron_rt._typing import FloatArray
from shenron_rt.physics import near_range_trihedral_matrix, trihedral_scattering_matrix

RANGES = np.arange(5.0, 160.1, 2.5)


def dbsm(amplitude: FloatArray | complex) -> FloatArray:
    return np.asarray(20 * np.log10(np.abs(amplitude)))


def detected_dbsm(distance: float, *, road: bool, seed: int = 0) -> float:
    """Return the RCS of the corner's strongest detection, noise and all."""
    bounces = 5 if road else 3
    scene = corner_scene(distance, road=road, profile="radarbook_200mhz")
    found = srt.simulate(scene, max_bounces=bounces, rays=5000 if road else 1000, seed=seed).detections
    mine = found.table[found.object_id == 5]
    assert len(mine) == 1
    assert mine["range"][0] == pytest.approx(distance, abs=0.4)  # half a bin: the ways over the road are longer
    return float(mine["rcs_dbsm"][0])


def test_the_profile_reaches_beyond_160_m_and_sweeps_about_24_1_ghz() -> None:
    profile = srt.load_profile("radarbook_200mhz")
    assert profile.max_range_m > 160 + 10 * profile.range_resolution_m
    assert profile.center_hz == pytest.approx(24.1e9, abs=1e6)
    assert profile.waveform.carrier_hz >= 24.0e9
    assert profile.waveform.carrier_hz + profile.waveform.bandwidth_hz <= 24.25e9  # the ISM band


@pytest.mark.parametrize("ranges", [RANGES[::12], pytest.param(RANGES, marks=pytest.mark.slow)], ids=["coarse", "all"])
def test_a_corner_keeps_the_range_law_from_5_to_160_m(ranges: FloatArray) -> None:
    wavelength = srt.load_profile("radarbook_200mhz").wavelength_m
    far = float(dbsm(trihedral_scattering_matrix("triangular", LEG_M, wavelength, 0.0)[0, 0]))
    near = [dbsm(near_range_trihedral_matrix("triangular", LEG_M, wavelength, r)[0, 0]) for r in ranges]
    found = np.array([detected_dbsm(r, road=False) for r in ranges])
    # the bar; edges cut tubes that are taken whole or not at all, 0.1 to 0.2 dB at this aim, and at 160 m noise at
    # 42 dB SNR moves a level by 0.05 dB
    np.testing.assert_allclose(found, near, atol=0.3)
    beyond = ranges >= 10
    np.testing.assert_allclose(found[beyond], far, atol=0.3)


@pytest.mark.parametrize("ranges", [RANGES[::13], pytest.param(RANGES, marks=pytest.mark.slow)], ids=["coarse", "all"])
def test_a_corner_over_a_road_keeps_the_sum_of_four_paths(ranges: FloatArray) -> None:
    profile = srt.load_profile("radarbook_200mhz")
    wanted = dbsm(np.array([four_path_corner(profile, r) for r in ranges]))
    error = np.array([detected_dbsm(r, road=True) for r in ranges]) - wanted
    # the bar is 1 dB RMS; where the paths cancel to -10 dB, 0.1 dB of each is 0.5 dB of the sum
    assert np.sqrt(np.mean(error**2)) < 1.0
    # undisturbed where they add up
    strong = wanted > 20
    assert np.abs(error[strong & (ranges > 60)]).max() < 0.2
