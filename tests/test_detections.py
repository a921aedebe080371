"""Detections: levels, grouping, folding, truth, files."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from dsp_tools import noise_adc, point_adc, point_returns, rcs_power

from shenron_rt.config.profile import load_profile
from shenron_rt.dsp import DETECTION_DTYPE, Detections, detect, noise_threshold, process
from shenron_rt.dsp.detect import local_maxima
from shenron_rt.errors import InputError, NotFoundError
from shenron_rt.returns import Returns
from shenron_rt.synthesis.adc import AdcCube
from shenron_rt.synthesis.synthesize import synthesize


def nearest(found: Detections, distance: float):
    """Return the row nearest to a range."""
    return found.table[np.argmin(np.abs(found.range - distance))]


def test_point_target_gives_its_range_velocity_azimuth_power_and_rcs():
    profile = load_profile("awrl1432")
    for distance, azimuth, velocity in ((5.0, 0.0, 0.0), (23.7, -0.6, 11.3), (60.2, 0.35, -19.0), (90.0, 0.1, 4.0)):
        power = rcs_power(profile, 10.0, distance, azimuth)
        found = detect(process(point_adc(profile, distance, azimuth, velocity, power)))
        top = found.table[0]
        assert top["range"] == pytest.approx(distance, abs=2e-3)
        assert top["azimuth"] == pytest.approx(azimuth, abs=1e-3)
        assert top["velocity"] == pytest.approx(velocity, abs=1e-2)
        assert top["rcs_dbsm"] == pytest.approx(10.0, abs=0.05)
        assert 10 * np.log10(top["power"] / power) == pytest.approx(0, abs=0.05)
        assert (top["x"], top["y"]) == pytest.approx((distance * np.cos(azimuth), distance * np.sin(azimuth)), abs=0.1)
        assert np.isnan(top["elevation"])
        assert top["z"] == 0
        assert not top["elevation_valid"]
        assert not top["ambiguous"]


def test_snr_is_that_of_the_beamformed_peak_cell():
    profile = load_profile("awrl1432")
    w = profile.waveform
    # on bin centres: no scalloping; what is left is the two windows' noise bandwidth
    distance, velocity = 80 * profile.range_resolution_m, 0.0
    power = 1e-13
    expected = 10 * np.log10(power / profile.noise_power_w * w.samples * w.chirps * 6) - 2 * 1.76091
    quiet = detect(process(point_adc(profile, distance, 0.2, velocity, power)))
    assert quiet.snr_db[0] == pytest.approx(expected, abs=0.02)
    noisy = detect(process(point_adc(profile, distance, 0.2, velocity, power, noise="thermal")))
    # noise itself moves the level by 4.3 dB / sqrt(SNR / 2) at one sigma: 0.02 dB
    assert noisy.snr_db[0] == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize("name", ["awrl1432boost", "radarbook2"])
def test_levels_hold_under_bpm_and_tdm(name):
    profile = load_profile(name)
    distance, azimuth, velocity = 40.3, -0.25, 0.4 * profile.max_velocity_mps
    power = rcs_power(profile, 10.0, distance, azimuth)
    top = detect(process(point_adc(profile, distance, azimuth, velocity, power))).table[0]
    assert top["rcs_dbsm"] == pytest.approx(10.0, abs=0.3)  # radarbook2: the target crosses 0.2 cells
    assert top["azimuth"] == pytest.approx(azimuth, abs=2e-3)


def test_elevation_comes_from_the_rows_of_the_board():
    profile = load_profile("awrl1432boost")
    found = detect(process(point_adc(profile, 30.0, 0.3, 2.0, 1e-10, elevation=0.12)))
    top = found.table[0]
    assert top["elevation_valid"]
    assert (top["azimuth"], top["elevation"]) == pytest.approx((0.3, 0.12), abs=2e-3)
    assert top["z"] == pytest.approx(30.0 * np.sin(0.12), abs=0.05)
    assert top["rcs_dbsm"] == pytest.approx(
        10 * np.log10(1e-10 / rcs_power(profile, 0.0, 30.0, 0.3, 0.12)), abs=0.1
    )  # fmt: skip


@pytest.mark.parametrize("azimuth_deg", [0.0, 10.0])
def test_static_wall_at_highway_speed_folds_and_says_so(azimuth_deg):
    profile = load_profile("awrl1432")
    azimuth = np.radians(azimuth_deg)
    ret = point_returns(profile, 80.0, azimuth, 0.0)
    ret = dataclasses.replace(ret, velocity=np.array([[-27.7, 0.0, 0.0]]))
    found = detect(process(synthesize(ret, profile, noise=None, method="direct")))
    true = -27.7 * np.cos(azimuth)
    assert found.velocity[0] == pytest.approx(true + 2 * profile.max_velocity_mps, abs=0.05)
    if azimuth_deg == 0:
        assert found.velocity[0] == pytest.approx(25.7, abs=0.2)
    assert found.ambiguous[0]
    # the range keeps the coupling of the folded velocity: 2 v_max f_c / k, half a bin
    off = 2 * profile.max_velocity_mps * profile.center_hz / profile.slope_hz_per_s
    assert found.range[0] == pytest.approx(80.0 - off, abs=0.02)


def test_two_targets_of_one_cell_are_told_apart_by_direction():
    profile = load_profile("awrl1432")
    found = detect(process(point_adc(profile, [25.0, 25.05], [0.5, -0.5], [-10, -10], [1e-10, 0.6e-10])))
    assert sorted(found.azimuth[:2]) == pytest.approx([-0.5, 0.5], abs=5e-3)
    # the two lie 0.13 bins apart and each is fitted as a point
    assert sorted(found.range[:2]) == pytest.approx([25.0, 25.05], abs=0.02)
    assert 10 * np.log10(found.power[:2] / [1e-10, 0.6e-10]) == pytest.approx([0, 0], abs=0.3)
    assert list(found.object_id[:2]) == [1, 2]


def test_a_target_wider_than_a_cell_but_not_a_beam_is_one_detection_a_cell(rng):
    # a car's rear: 40 points over 1.8 m at 25 m are 4 degrees of a 19 degree beam
    profile = load_profile("awrl1432")
    azimuth = rng.uniform(-0.9, 0.9, 40) / 25
    found = detect(process(point_adc(profile, np.full(40, 25.0), azimuth, 0.0, 1e-11)), blanking_m=2.0)
    near = np.abs(found.range - 25.0) < 0.5
    assert near.sum() == 1


def test_side_lobes_show_with_hann_and_not_with_blackman_harris():
    profile = load_profile("awrl1432")
    # 95 dB over the noise of a cell; Hann's lobes fall from -31 dB by 18 dB an octave, Blackman-Harris' stay below -92
    adc = point_adc(profile, 12.13, 0.3, 3.1, 6e-7, noise="thermal", seed=4)
    count, tail, hits = {}, {}, {}
    for window in ("hann", "blackmanharris"):
        cube = process(adc, range_window=window, doppler_window=window)
        beam = np.argmax(cube.range_azimuth.max(axis=0))
        far = np.abs(cube.range_m - 12.13) > 6 * cube.range_step_m
        tail[window] = cube.range_azimuth[far, beam].max() / (cube.noise_power_w / 6)
        # an ordered statistic is not masked by the target's own main lobe in the training ring
        found = detect(cube, cfar="os")
        assert found.range[0] == pytest.approx(12.13, abs=0.01)
        off = np.abs(found.range - 12.13) / profile.range_resolution_m
        off += np.abs(found.velocity - 3.1) / profile.velocity_resolution_mps
        ghosts = (found.snr_db > 15) & (off > 4)
        assert np.all(found.object_id[ghosts] == -1)
        count[window], hits[window] = int(ghosts.sum()), found.n_cfar_hits
        if window == "hann":  # along the target's own azimuth
            assert np.abs(found.azimuth[ghosts] - 0.3).max() < 0.1
    assert count["hann"] >= 1  # sampled at whole bins the lobes fall steadily: few are maxima of their own
    assert count["blackmanharris"] == 0
    assert hits["hann"] > hits["blackmanharris"] + 30
    # on the picture: lobes at 6 bins are 56 dB down, 40 dB above the noise; else the largest of 16 000 noise cells
    assert tail["hann"] > 1e4
    assert tail["blackmanharris"] < 20


def test_blanking_takes_the_near_cells_only():
    profile = load_profile("awrl1432")
    adc = point_adc(profile, [1.2, 20.0], 0.0, 0.0, [1e-8, 1e-10])
    assert detect(process(adc)).range[0] == pytest.approx(1.2, abs=0.05)
    blanked = detect(process(adc), blanking_m=2.0)
    assert blanked.range.min() > 1.9
    assert blanked.range[0] == pytest.approx(20.0, abs=0.01)


def test_clear_air_gives_the_design_number_of_false_alarms_and_no_truth(rng):
    profile = load_profile("awrl1432")
    hits = rows = 0
    for _ in range(20):
        adc = dataclasses.replace(noise_adc(profile, rng), returns=point_returns(profile, np.zeros(0)))
        found = detect(process(adc))
        hits, rows = hits + found.n_cfar_hits, rows + len(found)
        assert np.all(found.object_id == -1)
    # 20 x 16384 cells at 1e-3, variance 1.6 times binomial
    assert hits == pytest.approx(327.7, abs=3 * np.sqrt(1.6 * 327.7))
    assert rows < hits


@pytest.mark.parametrize("cfar", ["ca", "go", "so", "os"])
def test_every_detector_finds_the_target(cfar):
    profile = load_profile("awrl1432")
    found = detect(process(point_adc(profile, 33.0, -0.2, 5.0, 3e-15, noise="thermal")), cfar=cfar)
    assert found.object_id[0] == 1
    assert found.range[0] == pytest.approx(33.0, abs=0.1)


def test_power_shifts_levels_and_nothing_else():
    profile = load_profile("awrl1432")
    low, high = (
        detect(process(point_adc(profile, [30.0, 50.0], [0.2, -0.4], [3.0, -8.0], np.array([2e-12, 1e-12]) * gain)))
        for gain in (1.0, 100.0)
    )
    for name in ("range", "velocity", "azimuth"):
        assert high.table[name][:2] == pytest.approx(low.table[name][:2], abs=1e-9)
    for name in ("snr_db", "rcs_dbsm"):
        assert high.table[name][:2] - low.table[name][:2] == pytest.approx([20, 20], abs=1e-9)


def test_mirrored_scene_gives_mirrored_detections():
    profile = load_profile("awrl1432")
    left, right = (
        detect(process(point_adc(profile, [30.0, 50.0], side * np.array([0.2, -0.4]), [3.0, -8.0], [2e-12, 1e-12])))
        for side in (1, -1)
    )
    # the line of receivers grows to one side: the wave front's curvature differs by 1e-4 rad
    assert left.azimuth[:2] == pytest.approx(-right.azimuth[:2], abs=1e-4)
    assert left.power[:2] == pytest.approx(right.power[:2], rel=1e-3)


# ---- truth
def test_truth_is_the_object_with_the_most_power_in_the_cell():
    profile = load_profile("awrl1432")
    n = 50
    rng = np.random.default_rng(0)
    speckle = (rng.standard_normal(n) + 1j * rng.standard_normal(n)) / np.sqrt(2)
    # a rough object of 50 echoes, together 3 dB above a point in the same range-Doppler cell and beam
    power = np.r_[1e-11, np.full(n, 2e-11 / n)]
    base = point_returns(profile, np.full(n + 1, 40.0), np.r_[0.1, rng.uniform(0.09, 0.11, n)], 5.0, power)
    ret = dataclasses.replace(
        base,
        amplitude=base.amplitude * np.r_[1.0, speckle],
        object_id=np.r_[7, np.full(n, 9)].astype(np.uint32),
        tag=np.r_[1, np.full(n, 2)].astype(np.uint8),
        coherent=np.r_[True, np.zeros(n, dtype=bool)],
    )
    found = detect(process(synthesize(ret, profile, noise=None, method="direct")))
    assert (found.object_id[0], found.tag[0]) == (9, 2)


def test_coherent_echoes_that_cancel_do_not_count():
    profile = load_profile("awrl1432")
    quarter = profile.wavelength_m / 4
    base = point_returns(profile, [40.0, 40.0 + quarter, 40.1], 0.0, 0.0, [1e-10, 1e-10, 1e-12])
    ret = dataclasses.replace(base, object_id=np.array([5, 5, 6], dtype=np.uint32))
    found = detect(process(synthesize(ret, profile, noise=None, method="direct")))
    assert found.object_id[0] == 6


def test_truth_is_told_apart_by_direction():
    profile = load_profile("awrl1432")
    found = detect(process(point_adc(profile, [40.0, 40.0], [0.6, -0.6], 5.0, [1e-11, 0.9e-11])))
    by_side = {np.sign(a): i for a, i in zip(found.azimuth[:2], found.object_id[:2], strict=True)}
    assert by_side == {1.0: 1, -1.0: 2}


def test_truth_of_large_ids_survives():
    profile = load_profile("awrl1432")
    ids = np.array([4_000_000_000, 3], dtype=np.uint32)
    found = detect(process(point_adc(profile, [30.0, 60.0], 0.0, 0.0, [2e-10, 1e-10], object_id=ids)))
    assert list(found.object_id[:2]) == [4_000_000_000, 3]


def test_without_truth_ids_are_minus_one():
    profile = load_profile("awrl1432")
    adc = point_adc(profile, 30.0)
    found = detect(process(AdcCube(adc.data, profile)))
    assert found.object_id[0] == -1
    assert not found.ambiguous.any()


# ---- values, files, errors
def test_rows_come_strongest_first_and_names_are_attributes():
    profile = load_profile("awrl1432")
    found = detect(process(point_adc(profile, [70.0, 20.0, 45.0], 0.1, 0.0, [1e-12, 1e-10, 1e-11])))
    assert np.all(np.diff(found.power) <= 0)
    assert list(found.object_id[:3]) == [2, 3, 1]
    for name in DETECTION_DTYPE.names:
        assert np.array_equal(
            getattr(found, name), found.table[name], equal_nan=name not in ("ambiguous", "elevation_valid")
        )
    assert DETECTION_DTYPE["object_id"] == np.int64
    assert DETECTION_DTYPE["tag"] == np.uint8


def test_empty_map_gives_an_empty_table():
    profile = load_profile("awrl1432")
    zero = AdcCube(np.zeros((64, 6, 256), dtype=complex), profile)
    found = detect(process(zero))
    assert len(found) == 0
    assert found.n_cfar_hits == 0
    assert found.table.dtype == DETECTION_DTYPE


def test_csv_round_trip_is_exact(tmp_path):
    profile = load_profile("awrl1432boost")
    found = detect(process(point_adc(profile, [30.0, 60.0], 0.1, 3.0, 1e-12, noise="thermal")))
    path = found.save(tmp_path / "frame" / "detections.csv")
    header = path.read_text().splitlines()[0]
    assert header == (
        "x,y,z,velocity,snr_db,rcs_dbsm,range,azimuth,elevation,power,object_id,tag,ambiguous,elevation_valid"
    )
    back = Detections.from_csv(path)
    assert back.table.tobytes() == found.table.tobytes()
    assert [p.name for p in path.parent.iterdir()] == ["detections.csv"]


def test_bad_csv_says_where(tmp_path):
    with pytest.raises(NotFoundError, match="no such file"):
        Detections.from_csv(tmp_path / "none.csv")
    bad = tmp_path / "bad.csv"
    bad.write_text("x,y\n1,2\n")
    with pytest.raises(InputError, match=r"bad.csv:1: the header must be"):
        Detections.from_csv(bad)
    bad.write_text(",".join(DETECTION_DTYPE.names) + "\n1,2,three\n")
    with pytest.raises(InputError, match=r"bad.csv:2: 14 numbers"):
        Detections.from_csv(bad)


def test_wrong_arguments_say_what_is_allowed():
    cube = process(point_adc(load_profile("awrl1432"), 30.0))
    with pytest.raises(InputError, match="allowed: None"):
        detect(cube, ambiguity="crt")
    with pytest.raises(InputError, match="blanking_m"):
        detect(cube, blanking_m=-1.0)
    with pytest.raises(InputError, match="known: ca"):
        detect(cube, cfar="median")
    with pytest.raises(InputError, match="between 0 and 1"):
        detect(cube, pfa=2.0)


def test_threshold_of_a_noise_free_cube_stays_above_rounding():
    cube = process(point_adc(load_profile("awrl1432"), 30.0))
    assert not cube.noise_added
    assert 1e-4 < noise_threshold(cube).min() / cube.noise_power_w < 1e-2


def test_local_maxima_count_a_plateau_once_and_wrap_in_doppler():
    power = np.zeros((6, 8))
    power[2, 3:5] = 1.0
    power[4, 0], power[4, 7] = 2.0, 3.0
    assert list(zip(*np.nonzero(local_maxima(power) & (power > 0)), strict=True)) == [(2, 3), (4, 7)]


@pytest.mark.parametrize("chirps", [1, 2, 3, 8])
def test_few_chirps_still_give_range_and_azimuth(chirps):
    profile = load_profile("awrl1432", {"waveform.chirps": chirps})
    # a periodic Hann window of two samples is 0, 1: no Doppler at all
    found = detect(process(point_adc(profile, 30.1, 0.2, 0.0, 1e-9), doppler_window="rect"))
    assert found.range[0] == pytest.approx(30.1, abs=0.01)
    assert found.azimuth[0] == pytest.approx(0.2, abs=2e-3)
    assert found.velocity[0] == pytest.approx(0.0, abs=0.1)


def test_single_receiver_gives_range_and_velocity_at_boresight():
    profile = load_profile("awrl1432", {"array.line": 1})
    found = detect(process(point_adc(profile, 30.1, 0.0, 4.0, 1e-9)))
    assert (found.range[0], found.velocity[0], found.azimuth[0]) == pytest.approx((30.1, 4.0, 0.0), abs=0.01)


def test_returns_without_position_do_not_break_attribution():
    profile = load_profile("awrl1432")
    base = point_returns(profile, [30.0, 40.0])
    ret = dataclasses.replace(base, position=np.array([[30.0, 0, 0], [0.0, 0, 0]]), amplitude=np.array([1e-5, 0]))
    adc = synthesize(ret, profile, noise=None, method="direct")
    assert isinstance(adc.returns, Returns)
    assert detect(process(adc)).object_id[0] == 1
