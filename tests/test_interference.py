"""FMCW interference: level, burst, ghost, direction, raised floor, and the scene that makes it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from dsp_tools import point_returns
from synthesis_cases import make_profile, make_returns

import shenron_rt as srt
from shenron_rt.cli import main
from shenron_rt.config.profile import RadarProfile
from shenron_rt.constants import BOLTZMANN, SPEED_OF_LIGHT
from shenron_rt.dsp import angle, detect, process
from shenron_rt.physics import one_way_power
from shenron_rt.synthesis import synthesize
from shenron_rt.synthesis.heard import heard_radars
from shenron_rt.synthesis.interference import HeardRadar

NOTHING = make_returns(np.zeros((0, 3)))
STILL = np.zeros(3)


def heard(profile: RadarProfile, position=(60.0, 0.0, 0.0), power=1e-9, start_s=0.0, velocity=STILL) -> HeardRadar:
    return HeardRadar(profile, np.asarray(position, float), np.asarray(velocity, float), power, start_s, 0.7)


def other(**waveform) -> RadarProfile:
    """Another radar: one long chirp that crosses this radar's band, by default at half its slope."""
    return make_profile(
        **{
            "bandwidth_hz": 400e6,
            "samples": 512,
            "sample_rate_hz": 12.5e6,
            "chirps": 1,
            "chirp_period_s": 50e-6,
            **waveform,
        }
    )


def chirp(victim: RadarProfile, *radars: HeardRadar) -> np.ndarray:
    """Return the first chirp of the first receiver, without noise."""
    return synthesize(NOTHING, victim, noise=None, interference=radars).data[0, 0]


# ---- the burst
@pytest.mark.parametrize("adc", ["complex", "real"])
@pytest.mark.parametrize("slope", [0.1, 0.5, 0.8])
def test_a_burst_lasts_if_band_over_slope_difference_and_stands_where_the_chirps_cross(adc, slope):
    victim = make_profile(adc=adc, chirps=1)
    k = victim.slope_hz_per_s
    radar = other(bandwidth_hz=slope * k * 512 / 12.5e6, carrier_hz=77e9 + 200e6 * (1 - slope))
    data = chirp(victim, heard(radar))
    # frequencies: 77 GHz + k t against f0 + s k (t - R/c): equal when (1 - s) k t = f0 - 77 GHz - s k R/c
    crossing = (200e6 * (1 - slope) - slope * k * 60.0 / SPEED_OF_LIGHT) / ((1 - slope) * k)
    lasts = 12.5e6 / ((1 - slope) * k)
    first, last = (crossing, crossing + lasts) if adc == "complex" else (crossing - lasts / 2, crossing + lasts / 2)
    on = np.flatnonzero(data)
    inside = np.arange(256)[(np.arange(256) / 12.5e6 >= first) & (np.arange(256) / 12.5e6 < last)]
    assert len(inside) > 5
    assert on[0] == pytest.approx(inside[0], abs=1)
    assert on[-1] == pytest.approx(min(inside[-1], 255), abs=1)
    if adc == "complex":
        assert np.abs(data[on]) == pytest.approx(np.sqrt(1e-9), rel=1e-12)


def test_inside_the_burst_the_beat_sweeps_at_the_slope_difference():
    victim = make_profile(chirps=1)
    k = victim.slope_hz_per_s
    data = chirp(victim, heard(other(bandwidth_hz=0.9 * k * 512 / 12.5e6, carrier_hz=77e9)))
    on = np.flatnonzero(data)
    beat = data[on] / np.abs(data[on])
    bend = np.angle(beat[2:] * beat[:-2] * beat[1:-1].conj() ** 2) * 12.5e6**2 / (2 * np.pi)
    # phases of 1e6 cycles are good to 1e-9 rad: 1e-7 of the rate
    assert bend == pytest.approx(0.1 * k, rel=1e-6)


def test_without_a_chirp_or_out_of_band_there_is_nothing():
    victim = make_profile(chirps=1)
    assert not chirp(victim, heard(other(carrier_hz=76e9))).any()
    assert not chirp(victim, heard(other(), start_s=30e-6)).any()
    assert not chirp(victim, heard(other(), start_s=-100e-6)).any()


def test_interference_adds_to_echoes_and_to_itself():
    victim = make_profile(chirps=4)
    target, radars = make_returns([30.0, 1, 0], amplitude=1e-5), (heard(other()), heard(other(), start_s=5e-6))
    parts = [synthesize(NOTHING, victim, noise=None, interference=(r,)).data for r in radars]
    alone = synthesize(target, victim, noise=None).data
    both = synthesize(target, victim, noise=None, interference=radars).data
    assert both == pytest.approx(alone + sum(parts), abs=1e-18)


# ---- a radar of the same make
@pytest.mark.parametrize("velocity", [0.0, 10.0, -16.0])
def test_an_equal_radar_in_step_is_a_ghost_at_half_its_distance_and_half_its_velocity(velocity):
    victim = make_profile()
    radar = heard(victim, (60.0, 0, 0), 1e-12, velocity=np.array([velocity, 0, 0]))
    top = detect(process(synthesize(NOTHING, victim, noise=None, interference=(radar,)))).table[0]
    # one way: delay R/c and Doppler v/lambda are those of a target at R/2 and v/2
    assert top["range"] == pytest.approx(30.0, abs=5e-3)
    assert top["velocity"] == pytest.approx(velocity / 2, abs=0.01)
    assert top["power"] == pytest.approx(1e-12, rel=0.02)


def test_a_late_start_moves_the_ghost_by_c_over_two():
    victim = make_profile()
    radar = heard(victim, (60.0, 0, 0), 1e-12, start_s=0.2e-6)
    top = detect(process(synthesize(NOTHING, victim, noise=None, interference=(radar,)))).table[0]
    assert top["range"] == pytest.approx(30.0 + 0.2e-6 * SPEED_OF_LIGHT / 2, abs=5e-3)


# ---- after processing
def test_direction_of_a_burst_is_that_of_the_radar():
    victim = make_profile(chirps=1)
    place = 60 * np.array([np.cos(0.4), np.sin(0.4), 0.0])
    data = synthesize(NOTHING, victim, noise=None, interference=(heard(other(), place),)).data[0]
    on = np.flatnonzero(data[0])[2:-2]
    sine = np.linspace(-1, 1, 2001)
    beams = angle.bartlett(data[:, on].T, angle.steering(victim.positions_m, victim.wavelength_m, sine)).mean(axis=0)
    # receivers half a wavelength apart: the wave front turns them as an echo's does
    assert sine[np.argmax(beams)] == pytest.approx(np.sin(0.4), abs=5e-3)


def test_raised_floor_is_the_share_of_samples_that_are_hit():
    victim = make_profile(chirps=64)
    k = victim.slope_hz_per_s
    crossing = make_profile(
        bandwidth_hz=0.4 * k * 256 / 12.5e6, carrier_hz=77.1e9, chirps=64, chirp_period_s=36.45e-6, samples=256
    )
    power = 1e-11
    adc = synthesize(NOTHING, victim, seed=2, interference=(heard(crossing, power=power),))
    hit = np.mean(np.abs(synthesize(NOTHING, victim, noise=None, interference=(heard(crossing),)).data) > 0)
    # the victim sweeps 0.6 k past the other one through 12.5 MHz in 1.07 us, 13.3 of its 256 samples
    assert hit == pytest.approx(12.5e6 / (0.6 * k) / 20.48e-6, rel=0.02)
    cube = process(adc, range_window="rect", doppler_window="rect")
    thermal = BOLTZMANN * 290 * 10**1.4 * 12.5e6
    expected = (thermal + power * hit) / (256 * 64)
    assert expected > 1.3 * cube.noise_power_w
    # Parseval: the mean over all cells is exact but for the noise, 1 of 98 304 powers
    assert cube.range_doppler.mean() == pytest.approx(expected, rel=5 / np.sqrt(98_304))
    # a chirp that sweeps the whole band is flat over it: most cells are near the mean
    assert np.median(cube.range_doppler) == pytest.approx(expected, rel=0.5)


def test_a_strong_interferer_hides_a_weak_target():
    victim = make_profile()
    crossing = make_profile(bandwidth_hz=160e6, carrier_hz=77.1e9, chirp_period_s=36.45e-6)
    target = point_returns(victim, 40.0, 0.1, 3.0, 3e-15)
    seen = []
    for radars in ((), (heard(crossing, power=1e-8),)):
        found = detect(process(synthesize(target, victim, seed=1, interference=radars)))
        seen.append(1 in found.object_id)
    assert seen == [True, False]


# ---- scenes
def scene(**more) -> srt.Scene:
    facing = {"name": "oncoming", "profile": "awrl1432", "xyz_m": (52.0, 0, 1.0), "ypr_deg": (180, 0, 0)} | more
    return srt.Scene(interferers=[facing], radars=[{"name": "front", "xyz_m": (2.0, 0, 1.0)}])


def test_received_power_is_friis():
    profile = srt.load_profile("awrl1432")
    (radar,) = heard_radars(scene(), scene().radars[0], profile, time=0.0)
    # 10 dBm, 6 + 6 dBi, (lambda / 4 pi R)^2 at 50 m and 77.2 GHz: -104.2 dB
    spread = 20 * np.log10(profile.wavelength_m / (4 * np.pi * 50))
    assert spread == pytest.approx(-104.18, abs=0.01)
    assert 10 * np.log10(radar.power_w) + 30 == pytest.approx(10 + 12 + spread)
    assert radar.position == pytest.approx([50.0, 0, 0])
    # at half of the half-power width on both sides: 3 dB each
    at = 50 * np.array([np.cos(np.pi / 3), np.sin(np.pi / 3)])
    aside = scene(xyz_m=(2 + at[0], at[1], 1.0))
    (radar,) = heard_radars(aside, aside.radars[0], profile, time=0.0)
    assert 10 * np.log10(radar.power_w) + 30 == pytest.approx(22 + spread - 2 * 3.0103, abs=1e-3)
    louder = scene(tx_power_dbm=13.0)
    (radar,) = heard_radars(louder, louder.radars[0], profile, time=0.0)
    assert 10 * np.log10(radar.power_w) + 30 == pytest.approx(25 + spread)
    assert one_way_power(50.0, 4e-3, 1.0, 2.0, 3.0, 1.5) == pytest.approx(4 * (4e-3 / (200 * np.pi)) ** 2)


def test_radome_and_weather_count_one_way():
    profile = srt.load_profile("awrl1432", {"antenna.radome_loss_db": 2.0})
    clear = scene(profile=profile)
    (dry,) = heard_radars(scene(), clear.radars[0], srt.load_profile("awrl1432"), time=0.0)
    (radome,) = heard_radars(clear, clear.radars[0], profile, time=0.0)
    # half of 2 dB in each of the two
    assert 10 * np.log10(radome.power_w / dry.power_w) == pytest.approx(-2.0)
    rain = scene().model_copy(update={"weather": srt.Scene(weather={"rain_mm_h": 50}).weather})
    (wet,) = heard_radars(rain, rain.radars[0], srt.load_profile("awrl1432"), time=0.0)
    two_way = rain.weather.plain().two_way_loss(50.0, profile.center_hz, "VV")
    assert dry.power_w / wet.power_w == pytest.approx(np.sqrt(two_way))


def test_motion_of_both_and_frames_that_overlap():
    profile = srt.load_profile("awrl1432")
    moving = scene(velocity_mps=(-20.0, 0, 0), start_s=0.001)
    moving = moving.model_copy(update={"ego": moving.ego.model_copy(update={"velocity_mps": (10.0, 0, 0)})})
    (radar,) = heard_radars(moving, moving.radars[0], profile, time=0.2)
    mid = 0.2 + profile.frame_mid_s
    assert radar.velocity == pytest.approx([-30.0, 0, 0])
    assert radar.position == pytest.approx([50.0 - 30 * mid, 0, 0])
    assert radar.start_s == pytest.approx(0.001)  # its third frame begins 1 ms after this one's
    apart = scene(start_s=0.05)
    assert heard_radars(apart, apart.radars[0], profile, time=0.2) == ()
    dense = scene(frame_period_s=0.0024)
    starts = [r.start_s for r in heard_radars(dense, dense.radars[0], profile, time=0.2)]
    # 2.33 ms long frames every 2.4 ms: the one that runs already (from 0.1992 s) and the next
    assert starts == pytest.approx([0.0024 * 83 - 0.2, 0.0024 * 84 - 0.2])


def test_a_scene_file_with_an_interferer_runs_and_runs_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    Path("own.yaml").write_text(yaml.safe_dump(srt.load_profile("awrl1432").model_dump(mode="json") | {"name": "own"}))
    Path("street.yaml").write_text(
        "version: 1\npoint_targets: [{id: 9, xyz_m: [30, 0, 1], rcs_dbsm: 10}]\n"
        "interferers: [{name: oncoming, profile: own.yaml, xyz_m: [82, 0, 1], ypr_deg: [180, 0, 0]}]\n"
        "radars: [{name: front, profile: awrl1432}]\n"
    )
    fast = ["--rays", "1000", "--backend", "scalar", "--no-pictures"]
    assert main(["validate", "street.yaml"]) == 0
    assert main(["run", "street.yaml", *fast, "-o", "a"]) == 0
    assert main(["run", "a/config.yaml", *fast, "-o", "b"]) == 0
    first, again = (np.load(f"{k}/radars/front/frame_000000/adc.npz")["data"] for k in "ab")
    assert np.array_equal(first, again)
    # an equal radar in step: a ghost at half of 80 m, far stronger than the target at 28 m
    found = srt.Detections.from_csv("a/radars/front/frame_000000/detections.csv")
    assert found.range[0] == pytest.approx(40.0, abs=0.05)
    assert found.object_id[0] == -1
