"""The link budget through the whole chain: scene, rays, echoes, ADC samples, detections, against the radar equation."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dsp_tools import table_rows

import shenron_rt as srt
from shenron_rt.constants import BOLTZMANN, FOUR_PI_CUBED, SPEED_OF_LIGHT, T0
from shenron_rt.frames import direction
from shenron_rt.physics import rain_attenuation

#: Strong enough to be found at the end of every profile's span, with no noise added.
RCS_DBSM = 30.0
ADC_DB = 0.1
DETECTED_DB = 0.3


def db(ratio: Any) -> Any:
    return 10 * np.log10(ratio)


def pattern_db(profile: srt.RadarProfile, azimuth: float, elevation: float) -> float:
    """Return the one-way Gaussian pattern, -3.01 dB at half the full width: written out again, from the definition."""
    a = profile.antenna
    assert a.pattern == "gaussian"
    assert a.beamwidth_az_deg
    assert a.beamwidth_el_deg
    u, v = math.degrees(azimuth) / (a.beamwidth_az_deg / 2), math.degrees(elevation) / (a.beamwidth_el_deg / 2)
    return -10 * math.log10(2) * (u**2 + v**2)


def equation_dbw(profile: srt.RadarProfile, rcs_dbsm: float, range_m: float, az: float = 0.0, el: float = 0.0) -> float:
    """Return Pt Gt Gr lambda^2 sigma / ((4 pi)^3 R^4 L) in dBW."""
    a = profile.antenna
    level = profile.receiver.tx_power_dbm - 30 + a.gain_tx_dbi + a.gain_rx_dbi - a.radome_loss_db
    level += 2 * pattern_db(profile, az, el)
    return level + rcs_dbsm + float(db(profile.wavelength_m**2 / FOUR_PI_CUBED / range_m**4))


def render(profile: str, scene: dict[str, Any], **options: Any) -> srt.Frame:
    """Render a scene with one radar at the origin that looks along +x."""
    mount = {"name": "front", "profile": profile, "xyz_m": (0, 0, 0)}
    return srt.simulate(srt.Scene(radars=[mount], **scene), **{"rays": 100, "noise": None, **options})


def point(profile: str, range_m: float, az_deg: float = 0.0, el_deg: float = 0.0, **options: Any) -> srt.Frame:
    where = range_m * direction(np.radians(az_deg), np.radians(el_deg))
    target = {"id": 900, "xyz_m": tuple(where), "rcs_dbsm": options.pop("rcs_dbsm", RCS_DBSM)}
    scene = {"point_targets": [target], **options.pop("scene", {})}
    return render(profile, scene, **options)


def channel_power(frame: srt.Frame) -> np.ndarray:
    """Return the mean of abs(x)^2 of every channel [W]."""
    return np.mean(np.abs(frame.adc.data) ** 2, axis=(0, 2))


SPANS = {
    "awrl1432": (5.0, 10.0, 25.0, 50.0, 90.0),
    "awrl1432_137mhz": (5.0, 20.0, 80.0, 160.0),
    "awrl1432boost": (5.0, 30.0, 100.0),
    "radarbook": (5.0, 60.0, 140.0),
    "radarbook2": (6.0, 140.0),
    "radarbook_200mhz": (5.0, 60.0, 160.0, 185.0),
    "ti_cascade": (5.0, 40.0, 140.0),
    "mmwcas": (10.0, 120.0),
}


@pytest.mark.parametrize(("profile", "range_m"), [(p, r) for p, ranges in SPANS.items() for r in ranges])
def test_a_point_target_follows_the_radar_equation(profile: str, range_m: float) -> None:
    frame = point(profile, range_m)
    want = equation_dbw(frame.profile, RCS_DBSM, range_m)
    assert db(channel_power(frame)) == pytest.approx(want, abs=ADC_DB)
    strongest = frame.detections
    assert strongest.object_id[0] == 900
    assert db(strongest.power[0]) == pytest.approx(want, abs=ADC_DB)
    assert strongest.rcs_dbsm[0] == pytest.approx(RCS_DBSM, abs=DETECTED_DB)
    # a hundredth of a bin: what windows and fit leave of one noiseless target
    assert strongest.range[0] == pytest.approx(range_m, abs=0.01 * frame.profile.range_resolution_m)


@pytest.mark.parametrize("profile", SPANS)
def test_a_point_target_off_boresight_follows_both_patterns(profile: str) -> None:
    range_m, az, el = 30.0, np.radians(30.0), np.radians(5.0)
    frame = point(profile, range_m, 30.0, 5.0)
    want = equation_dbw(frame.profile, RCS_DBSM, range_m, az, el)
    assert db(channel_power(frame)) == pytest.approx(want, abs=ADC_DB)
    detected = frame.detections
    if detected.elevation_valid[0]:
        assert math.degrees(detected.elevation[0]) == pytest.approx(5.0, abs=0.1)
        assert detected.rcs_dbsm[0] == pytest.approx(RCS_DBSM, abs=DETECTED_DB)
    else:  # a line sees the cone sin(az) cos(el) and takes elevation 0: it is off by what the patterns differ
        cone = math.asin(math.sin(az) * math.cos(el))
        assert detected.azimuth[0] == pytest.approx(cone, abs=np.radians(0.1))
        off = 2 * (pattern_db(frame.profile, az, el) - pattern_db(frame.profile, cone, 0.0))
        assert off < 0
        assert detected.rcs_dbsm[0] == pytest.approx(RCS_DBSM + off, abs=DETECTED_DB)


@pytest.mark.parametrize("profile", ["awrl1432", "awrl1432boost", "radarbook"])
@pytest.mark.parametrize("az_deg", [-40.0, 25.0])
def test_the_detected_rcs_has_the_azimuth_pattern_removed(profile: str, az_deg: float) -> None:
    detected = point(profile, 30.0, az_deg).detections
    assert math.degrees(detected.azimuth[0]) == pytest.approx(az_deg, abs=0.05)
    assert detected.rcs_dbsm[0] == pytest.approx(RCS_DBSM, abs=DETECTED_DB)


# ---- a body with a closed form
SPHERE_M = 0.1


@pytest.mark.parametrize(
    ("profile", "range_m", "seed"),
    [
        *(("awrl1432", 10.0, seed) for seed in range(4)),
        ("awrl1432", 20.0, 1),
        ("awrl1432", 40.0, 2),
        ("awrl1432", 90.0, 3),
        ("awrl1432_137mhz", 150.0, 4),
    ],
)
def test_a_metal_sphere_follows_the_radar_equation_from_its_specular_point(
    profile: str, range_m: float, seed: int
) -> None:
    # Geometric optics of spherical waves: pi a^2 (R / (R + a))^2 with R to the specular point, -0.09 dB at 10 m.
    frame = _sphere(profile, range_m, seed)
    sigma = math.pi * SPHERE_M**2 * (range_m / (range_m + SPHERE_M)) ** 2
    want = equation_dbw(frame.profile, float(db(sigma)), range_m)
    assert db(frame.returns.power_by_object()[5]) == pytest.approx(want, abs=ADC_DB)
    assert db(channel_power(frame)) == pytest.approx(want, abs=ADC_DB)


def test_a_metal_sphere_is_detected_at_its_specular_point_with_its_rcs() -> None:
    frame = _sphere("awrl1432", 10.0, 3)
    found = frame.detections
    assert len(found) == 1
    assert found.object_id[0] == 5
    assert found.rcs_dbsm[0] == pytest.approx(float(db(math.pi * SPHERE_M**2)), abs=DETECTED_DB)
    assert found.range[0] == pytest.approx(10.0, abs=0.01 * frame.profile.range_resolution_m)


def _sphere(profile: str, range_m: float, seed: int) -> srt.Frame:
    ball = {"id": 5, "shape": f"sphere:r={SPHERE_M}", "material": "metal", "tag": "Other", "aim": 80_000}
    return render(profile, {"actors": [ball | {"xyz_m": (range_m + SPHERE_M, 0, 0)}]}, seed=seed)


# ---- noise
@pytest.mark.parametrize("profile", SPANS)
def test_noise_power_is_k_t0_f_fs(profile: str) -> None:
    frame = render(profile, {}, noise="thermal", seed=3)
    w = frame.profile.waveform
    power = BOLTZMANN * T0 * 10 ** (frame.profile.receiver.noise_figure_db / 10) * w.sample_rate_hz
    if w.adc == "real":
        power /= 2
        assert not np.any(frame.adc.data.imag)
    if frame.profile.array.multiplex == "bpm":  # decoding averages the chirps of a block
        power /= frame.profile.n_tx
    # 6.6e4 complex samples at least (ti_cascade): 5 sigma of their mean power is 5 / sqrt(6.6e4) = 1.9 %, 0.085 dB;
    # the smaller real cube has 9.8e4, 5 sqrt(2 / 9.8e4) = 2.3 %, 0.097 dB
    assert db(np.mean(np.abs(frame.adc.data) ** 2)) == pytest.approx(float(db(power)), abs=ADC_DB)
    assert frame.adc.noise_power_w == pytest.approx(power, rel=1e-9)


def test_noise_is_white_over_chirps_and_channels() -> None:
    x = render("awrl1432", {}, noise="thermal").adc.data
    n = x[0].size
    scale = np.mean(np.abs(x) ** 2)
    same = [np.vdot(x[i], x[j]) / (n * scale) for i, j in ((0, 1), (5, 40))]
    same += [np.vdot(x[:, i], x[:, j]) / (x[:, 0].size * scale) for i, j in ((0, 1), (2, 5))]
    assert max(np.abs(same)) < 5 / math.sqrt(n)  # 5 sigma of a correlation of n pairs


@pytest.mark.parametrize(
    ("sensor", "profile", "gain"),
    [
        ("awrl1432boost", "awrl1432", 1.0),
        # under BPM both transmitters send all the time: each of the 64 loops has two chirps in every channel
        ("awrl1432boost", "awrl1432boost", 2.0),
        ("mmwcas_awr2243x4", "mmwcas", 1.0),
        # the table counts 15 different positions, the board has 16 channels
        ("radarbook2_24ghz", "radarbook2", 16 / 15),
    ],
)
def test_the_link_budget_table_is_what_detections_read(
    shared_reference: Path, sensor: str, profile: str, gain: float
) -> None:
    """Rows of sensors without a profile (awr1843boost, two TI notes) are held by the closed form elsewhere."""
    table = [r for r in table_rows(shared_reference / "sensors/link_budget.csv") if r["sensor"] == sensor]
    assert len(table) == 2
    row = table[0]
    used = srt.load_profile(profile)
    # on a bin: the table has no straddling loss
    range_m = round(float(row["range_m"]) / used.range_resolution_m) * used.range_resolution_m
    farther = float(db((range_m / float(row["range_m"])) ** 4))
    rcs_dbsm = 50.0  # noise then moves the reading of the weakest by less than 0.02 dB; 40 dB are taken off again
    frame = point(profile, range_m, rcs_dbsm=rcs_dbsm, noise="thermal", seed=1)
    extra = rcs_dbsm - float(row["rcs_dbsm"]) - farther
    received = db(channel_power(frame).mean() - frame.adc.noise_power_w) + 30
    assert received == pytest.approx(float(row["pr_dbm"]) + extra, abs=0.1)
    cube = srt.process(frame.adc, range_window="rect", doppler_window="rect")
    found = srt.detect(cube)
    assert found.object_id[0] == 900
    want = float(row["snr_frame_all_channels_db"]) + extra + float(db(gain))
    assert found.snr_db[0] == pytest.approx(want, abs=0.1)


@pytest.mark.parametrize("profile", SPANS)
def test_snr_of_a_strong_target_is_the_closed_form_with_the_windows_loss(profile: str) -> None:
    """SNR = P T_chirp N_chirps N_channels / (k T0 F), less the noise bandwidths of the windows."""
    used = srt.load_profile(profile)
    range_m = round(30.0 / used.range_resolution_m) * used.range_resolution_m
    frame = point(profile, range_m, rcs_dbsm=50.0, noise="thermal", seed=2)
    w = used.waveform
    sent = w.chirps * (used.n_tx if used.array.multiplex == "bpm" else 1)
    factor = 10 ** (used.receiver.noise_figure_db / 10)
    gain = w.sampled_time_s * sent * used.n_virtual / (BOLTZMANN * T0 * factor)
    # a periodic Hann window of N > 2 samples: N sum w^2 / (sum w)^2 = 3/2 exactly
    widths = [1.5 if name == "hann" else 1.0 for name in (used.processing.range_window, used.processing.doppler_window)]
    want = equation_dbw(used, 50.0, range_m) + float(db(gain)) - float(db(np.prod(widths)))
    assert frame.detections.snr_db[0] == pytest.approx(want, abs=0.1)


# ---- weather
@pytest.mark.parametrize("rain_mm_h", [4.0, 25.0])
def test_rain_takes_what_its_attenuation_predicts(rain_mm_h: float) -> None:
    range_m = 80.0
    dry = point("awrl1432", range_m, scene={"weather": {}})
    wet = point("awrl1432", range_m, scene={"weather": {"rain_mm_h": rain_mm_h}})
    extra = 2 * range_m / 1e3 * float(rain_attenuation(dry.profile.center_hz, rain_mm_h, "V"))
    assert extra > 0.4
    # the synthesis is asked for 1e-5 of the cube's RMS
    assert db(channel_power(dry) / channel_power(wet)) == pytest.approx(extra, abs=1e-3)
    assert db(dry.detections.power[0] / wet.detections.power[0]) == pytest.approx(extra, abs=1e-3)
    for frame in (dry, wet):
        assert frame.detections.rcs_dbsm[0] == pytest.approx(RCS_DBSM, abs=DETECTED_DB)


def test_without_weather_nothing_attenuates_and_dry_air_does() -> None:
    range_m = 80.0
    none, dry = point("awrl1432", range_m), point("awrl1432", range_m, scene={"weather": {}})
    profile = none.profile
    assert db(channel_power(none)) == pytest.approx(equation_dbw(profile, RCS_DBSM, range_m), abs=1e-3)
    # ITU-R P.676 at 15 degC and 7.5 g/m^3: 0.348 dB/km at 77 GHz
    loss = db(channel_power(none) / channel_power(dry))
    assert loss == pytest.approx(2 * range_m / 1e3 * 0.348, rel=0.02)


def test_levels_use_the_wavelength_of_the_mid_frequency() -> None:
    profile = srt.load_profile("awrl1432")
    middle = 77.0e9 + 0.5 * 400e6
    assert profile.wavelength_m == pytest.approx(SPEED_OF_LIGHT / middle, rel=1e-12)
