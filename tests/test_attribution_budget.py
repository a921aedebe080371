"""Link budgets against the radar equation, and for every kind of array and converter."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from explain_reasons import FAST, made_scene
from explain_tools import two_points

import shenron_rt as srt
from shenron_rt.config.profile import load_profile


def test_the_waterfall_of_a_point_is_the_radar_equation_and_the_gains_of_the_transforms() -> None:
    p = load_profile("awrl1432")
    velocity = 10 * p.velocity_resolution_mps
    # on the centre of a Doppler bin and, with the coupling f_D T_sampled, of a range bin at mid-frame
    coupling = 10 / (64 * 36.4e-6) * p.waveform.sampled_time_s * p.range_resolution_m
    middle = 80 * p.range_resolution_m - coupling
    distance = middle - velocity * p.frame_mid_s
    points = [{"id": 1, "xyz_m": (2 + distance, 0, 1), "velocity_mps": (velocity, 0, 0), "rcs_dbsm": 10}]
    scene = srt.Scene(point_targets=points, radars=[{"xyz_m": (2, 0, 1)}])
    frame = srt.simulate(scene, noise=None, accuracy=1e-8)
    budget = srt.explain(frame, scene=scene).frames[0].of(1).waterfall
    assert budget is not None
    gains = {s.name: s.gain_db for s in budget.stages}
    # by hand: 10 dBm + 6 + 6 dBi, lambda 3.883 mm, (4 pi)^3, R^4, 10 dBsm
    received = 10 + 12 + 20 * math.log10(p.wavelength_m) - 30 * math.log10(4 * math.pi) - 40 * math.log10(middle) + 10
    assert budget.received_dbm == pytest.approx(received, abs=1e-3)
    assert gains["apparent cross section"] == pytest.approx(10, abs=1e-3)
    noise_dbm = 10 * math.log10(1.380649e-23 * 290 * 10**1.4 * 12.5e6) + 30
    assert budget.sample_snr_db == pytest.approx(received - noise_dbm, abs=1e-3)
    # a Hann window's noise bandwidth is 1.5 bins on either axis; 256 samples, 64 loops, 6 channels
    processing = 10 * math.log10(256 * 64 * 6 / 1.5**2)
    straddling = gains["range spread and straddling"] + gains["Doppler spread and straddling"]
    # the range drifts by +-0.026 bins over the frame: Hann loses 5.7 dB bin^-2 x 0.026^2 / 3 at most, 1.3e-3 dB
    assert -2e-3 < straddling <= 1e-6
    assert budget.object_snr_db == pytest.approx(received - noise_dbm + processing, abs=3e-3)
    assert budget.measured_snr_db == pytest.approx(budget.object_snr_db, abs=1e-3)


def test_a_budget_that_misses_an_echo_does_not_close() -> None:
    profile = load_profile("awrl1432")
    scene = two_points(profile, {"velocity_mps": (-5, 0, 0)}, {"velocity_mps": (-5.1, 0, 0), "rcs_dbsm": 10})
    frame = srt.simulate(scene)
    kept = frame.returns.object_id == 1
    columns = ("amplitude", "position", "velocity", "object_id", "tag", "coherent", "bounces", "scatterer")
    forgetful = replace(frame.returns, **{name: getattr(frame.returns, name)[kept] for name in columns})
    found = srt.explain(replace(frame, returns=forgetful)).frames[0].of(1)
    assert found.waterfall is not None
    assert not found.waterfall.closes


def test_released_counts_have_no_link_budget() -> None:
    frame = srt.simulate(made_scene(), model="shenron:as_released", **FAST)
    with pytest.raises(srt.InputError, match="not watts"):
        srt.explain(frame)


@pytest.mark.parametrize("name", ["awrl1432boost", "radarbook2", "ti_cascade"])
def test_budgets_close_for_every_kind_of_array_and_converter(name: str) -> None:
    """BPM and a real ADC, TDM with a folded target, 86 channels and three loops."""
    profile = load_profile(name, {} if name == "ti_cascade" else {"waveform.chirps": 32})
    fast = 2 * profile.max_velocity_mps - 1
    scene = two_points(
        profile,
        {"xyz_m": (32, 4, 2), "rcs_dbsm": 15, "velocity_mps": (-1, 0, 0)},
        {"xyz_m": (22, -3, 1.5), "rcs_dbsm": 5, "velocity_mps": (fast, 0, 0)},
    )
    frame = srt.simulate(scene)
    found = srt.explain(frame, scene=scene).frames[0]
    for number, rcs_dbsm in ((1, 15), (2, 5)):
        item = found.of(number)
        assert item.waterfall is not None
        assert item.waterfall.closes
        assert item.waterfall.measured_snr_db == pytest.approx(frame.detections.snr_db[item.detections[0]], abs=1e-2)
        gains = {s.name: s.gain_db for s in item.waterfall.stages}
        # the radar equation holds at mid-frame for the array's reference: 1e-2 dB for apertures of metres in 20
        assert gains["apparent cross section"] == pytest.approx(rcs_dbsm, abs=1e-2)
    assert found.of(2).labels[0] == "direct, folded"
