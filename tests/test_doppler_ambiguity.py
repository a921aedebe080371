"""Unfolding of velocities: by bursts at unequal chirp intervals, and by the range change between two frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dsp_tools import point_adc, point_returns, table_rows
from synthesis_cases import make_profile, make_returns

from shenron_rt.config.profile import RadarProfile, load_profile
from shenron_rt.dsp import Detections, RadarCube, detect, process
from shenron_rt.dsp.ambiguity import least_interval_s
from shenron_rt.errors import InputError
from shenron_rt.synthesis.synthesize import synthesize

STAGGERED = load_profile("awrl1432_staggered")
PLAIN = load_profile("awrl1432")


def found(profile: RadarProfile, distance, velocity, azimuth=0.1, power=1e-10, **options) -> Detections:
    return detect(process(point_adc(profile, distance, azimuth, velocity, power)), **options)


def two_frames(distance, velocity, interval=0.1, azimuth=0.1, power=1e-10, **options) -> Detections:
    """Detect point targets in two frames, the second with them where they have gone."""
    distance, velocity = np.atleast_1d(distance), np.atleast_1d(velocity)
    before = found(PLAIN, distance, velocity, azimuth, power)
    cube = process(point_adc(PLAIN, distance + velocity * interval, azimuth, velocity, power))
    return detect(cube, ambiguity="two_frame", previous=before, interval_s=interval, **options)


# ---- bursts
def test_bursts_are_blocks_of_equal_interval_in_one_frame():
    p = STAGGERED
    steps = np.diff(p.raw_chirp_start_s[:, 0])
    assert steps == pytest.approx([36.4e-6] * 64 + [31.2e-6] * 63)
    assert p.chirp_start_s.shape == (128, 6)
    first, second = p.bursts
    assert (first.waveform.chirps, first.loop_period_s) == (64, 36.4e-6)
    assert (second.waveform.chirps, second.loop_period_s) == (64, 31.2e-6)
    assert first.max_velocity_mps == pytest.approx(p.wavelength_m / (4 * 36.4e-6))
    adc = point_adc(p, 30.0, 0.1, 5.0)
    assert adc.data.shape == (128, 6, 256)
    assert np.array_equal(np.concatenate([b.data for b in adc.bursts]), adc.data)
    # middle of a burst's chirps from the middle of all: -(64 * 31.2 - 0)/2 us and so on, sample time alike
    last = 64 * 36.4e-6 + 63 * 31.2e-6
    expected = [(63 * 36.4e-6 - last) / 2, (64 * 36.4e-6 + last - last) / 2]
    assert [b.mid_offset_s for b in adc.bursts] == pytest.approx(expected)


def test_a_frame_that_bursts_cannot_share_is_refused():
    with pytest.raises(ValueError, match="65 chirps cannot be shared equally by 2 bursts"):
        load_profile("awrl1432_staggered", {"waveform.chirps": 65})


@pytest.mark.parametrize("method", ["direct", "nufft"])
def test_unequal_bursts_are_synthesised_exactly(method):
    target = make_returns([[30.0, 5.0, 0.0]], [[-27.7, 3.0, 0.0]])
    profile = make_profile(chirps=8, chirp_period_s=(36.4e-6, 31.2e-6), stagger="burst")
    t = np.arange(256) / 12.5e6
    k = 400e6 / 20.48e-6
    data = synthesize(target, profile, noise=None, method=method, accuracy=1e-6).data
    for m, start in enumerate([0, 36.4e-6, 72.8e-6, 109.2e-6, 145.6e-6, 176.8e-6, 208.0e-6, 239.2e-6]):
        time = start + t - profile.frame_mid_s
        at = np.array([30.0, 5.0, 0.0]) + np.array([-27.7, 3.0, 0.0]) * time[:, None]
        tau = 2 * np.linalg.norm(at, axis=1) / 299_792_458.0
        tone = np.exp(2j * np.pi * (77e9 * tau + k * tau * t - k * tau**2 / 2))
        assert np.abs(data[m, 0] - tone).max() < 1e-5  # accuracy is relative to the RMS, here 1


def test_cube_of_bursts_survives_a_file(tmp_path: Path):
    cube = process(point_adc(STAGGERED, 30.0, 0.1, -27.7))
    cube.save(tmp_path / "cube.npz")
    again = RadarCube.load(tmp_path / "cube.npz")
    for a, b in zip((cube, *cube.bursts), (again, *again.bursts), strict=True):
        assert np.array_equal(a.data, b.data)
        assert (a.profile, a.n_fft, a.mid_offset_s) == (b.profile, b.n_fft, b.mid_offset_s)
    options = {"ambiguity": "staggered"}
    assert detect(again, **options).velocity[0] == detect(cube, **options).velocity[0]


def test_folded_velocity_of_each_interval_is_that_of_the_reference_table(shared_reference: Path):
    # the table's frequency is that of the middle of the window
    intervals = (30e-6, 33e-6, 37e-6)
    profile = make_profile(carrier_hz=77e9 - 200e6, chirps=192, chirp_period_s=intervals, stagger="burst")
    assert profile.center_hz == pytest.approx(77e9)
    rows = list(table_rows(shared_reference / "dsp" / "doppler_ambiguity.csv"))
    assert len(rows) == 9
    for row in rows:
        true = float(row["v_true_mps"])
        cube = process(point_adc(profile, 20.0, 0.0, true))
        for burst, key in zip(cube.bursts, ("v_T30us", "v_T33us", "v_T37us"), strict=True):
            span = 2 * burst.profile.max_velocity_mps
            off = detect(burst).velocity[0] - float(row[key])
            # fits are good to 0.01 m/s; spans at the target's delay are k tau / f_c = 3.4e-5 longer: 0.004 m/s
            assert abs(off - span * np.rint(off / span)) < 0.02
        assert detect(cube, ambiguity="staggered").velocity[0] == pytest.approx(true, abs=0.02)


@pytest.mark.parametrize("velocity", [-90.0, -61.5, -27.7, -26.6, 0.0, 13.3, 26.7, 53.4, 75.0, 95.0])
def test_bursts_unfold_a_velocity_and_put_its_range_right(velocity):
    top = found(STAGGERED, 40.0, velocity, ambiguity="staggered").table[0]
    assert top["velocity"] == pytest.approx(velocity, abs=0.02)
    # range holds at mid-frame, coupling of the true velocity taken out: as good as without folds
    assert top["range"] == pytest.approx(40.0, abs=5e-3)
    assert not top["ambiguous"]


def test_bursts_unfold_in_noise():
    # 18 dB over the noise of a beamformed cell: a burst's velocity is good to 0.1 bins, its spans differ by 10
    for seed in range(20):
        adc = point_adc(STAGGERED, 40.0, 0.1, -27.7, 2e-15, noise="thermal", seed=seed)
        table = detect(process(adc), ambiguity="staggered").table
        mine = table[table["object_id"] == 1][0]
        assert mine["velocity"] == pytest.approx(-27.7, abs=0.4)
        assert not mine["ambiguous"]


def test_false_alarms_of_a_burst_are_the_design():
    hits, cells = 0, 0
    for seed in range(20):
        cube = process(synthesize(point_returns(STAGGERED, np.zeros(0)), STAGGERED, seed=seed))
        hits += detect(cube).n_cfar_hits
        cells += cube.bursts[0].range_doppler.size
        for burst in cube.bursts:
            assert burst.range_doppler.mean() == pytest.approx(burst.noise_power_w, rel=0.02)
    # 20 x 16384 cells at 1e-3, variance 1.6 times binomial
    assert hits == pytest.approx(1e-3 * cells, abs=3 * np.sqrt(1.6e-3 * cells))


def test_without_a_method_the_first_burst_is_reported_folded():
    top = found(STAGGERED, 80.0, -27.7).table[0]
    assert top["velocity"] == pytest.approx(-27.7 + 2 * PLAIN.max_velocity_mps, abs=0.02)
    assert top["ambiguous"]


def test_two_targets_of_a_cell_that_stand_for_a_third_velocity_stay_folded():
    # A shows in burst 1 where +10 m/s would, B in burst 2: the pair (A, B) is as good as (A, A)
    spans = [2 * p.max_velocity_mps for p in STAGGERED.bursts]
    velocity = np.array([10 - spans[0], 10 - spans[1]])
    table = found(STAGGERED, [40.0, 40.0], velocity, ambiguity="staggered").table
    a = table[np.abs(table["velocity"] - 10) < 0.2]
    assert len(a) == 1
    assert a["ambiguous"][0]


def test_bursts_need_a_staggered_profile():
    cube = process(point_adc(PLAIN, 40.0))
    with pytest.raises(InputError, match="'awrl1432' has one burst a frame"):
        detect(cube, ambiguity="staggered")
    with pytest.raises(InputError, match="unknown ambiguity 'magic'"):
        detect(cube, ambiguity="magic")


def test_tdm_direction_is_right_again_when_the_velocity_is_unfolded():
    array = {"multiplex": "tdm", "tx": [[0, 0, 0], [0, -4, 0]], "rx": [[0, -c, 0] for c in range(4)]}
    profile = make_profile(array=array, chirps=128, chirp_period_s=(25e-6, 22e-6), stagger="burst")
    span = 2 * profile.bursts[0].max_velocity_mps
    velocity = 0.3 * span + span
    adc = point_adc(profile, 30.0, 0.3, velocity, 1e-10)
    raw, true = detect(process(adc)), detect(process(adc), ambiguity="staggered")
    # one fold turns the second transmitter by 2 pi / 2: the beam of the whole line of eight breaks in two
    turned = np.exp(1j * np.arange(8) * np.linspace(-np.pi, np.pi, 4001)[:, None]) @ np.repeat([1.0, -1.0], 4)
    lost = 20 * np.log10(np.abs(turned).max() / 8)
    assert abs(raw.azimuth[0] - 0.3) > 0.05
    assert true.velocity[0] == pytest.approx(velocity, abs=0.02)
    assert true.azimuth[0] == pytest.approx(0.3, abs=2e-3)
    assert raw.snr_db[0] - true.snr_db[0] == pytest.approx(lost, abs=0.25)  # the fit shares it among two targets


# ---- phases of transmitters in turn
BLOCKS = {"multiplex": "tdm", "tx": [[0, -4 * i, 0] for i in range(3)], "rx": [[0, -c, 0] for c in range(4)]}


@pytest.mark.parametrize("turns", [-1.4, -0.9, -0.3, 0.2, 0.7, 1.3])
def test_phases_of_transmitters_in_turn_unfold_up_to_the_chirp_rate(turns):
    profile = make_profile(array=BLOCKS, chirp_period_s=25e-6)
    velocity = turns * 2 * profile.max_velocity_mps  # three transmitters: +-1.5 of 2 v_max
    top = found(profile, 30.0, velocity, 0.3, ambiguity="tdm_phase").table[0]
    assert top["velocity"] == pytest.approx(velocity, abs=0.02)
    assert top["azimuth"] == pytest.approx(0.3, abs=2e-3)
    assert top["range"] == pytest.approx(30.0, abs=5e-3)
    assert not top["ambiguous"]


def test_beyond_the_chirp_rate_phases_fold_again():
    profile = make_profile(array=BLOCKS, chirp_period_s=25e-6)
    span = 2 * profile.max_velocity_mps
    top = found(profile, 30.0, 1.6 * span, 0.3, ambiguity="tdm_phase").table[0]
    # 3 spans are one chirp interval's: with the right direction, and unaware
    assert top["velocity"] == pytest.approx(1.6 * span - 3 * span, abs=0.02)
    assert top["azimuth"] == pytest.approx(0.3, abs=2e-3)


def test_transmitters_between_receivers_make_every_fold_a_direction():
    # tx lambda/2 apart, rx three: column 3 r + m turns by q m / 3 as by q (3 r + m) / 3, like sin(az) + 2 q / 3
    array = {"multiplex": "tdm", "tx": [[0, -i, 0] for i in range(3)], "rx": [[0, -3 * c, 0] for c in range(4)]}
    profile = make_profile(array=array, chirp_period_s=25e-6)
    velocity = 0.7 * 2 * profile.max_velocity_mps
    raw, tried = (found(profile, 30.0, velocity, 0.1, ambiguity=m).table[0] for m in (None, "tdm_phase"))
    assert np.sin(raw["azimuth"]) - np.sin(0.1) == pytest.approx(2 / 3, abs=0.01)
    assert tried["ambiguous"]


def test_phases_need_transmitters_in_turn():
    with pytest.raises(InputError, match="'awrl1432' has 1 and simultaneous"):
        found(PLAIN, 30.0, 1.0, ambiguity="tdm_phase")


def test_phases_in_noise_are_right_or_say_that_they_are_not():
    profile = make_profile(array=BLOCKS, chirp_period_s=25e-6)
    velocity = 0.9 * 2 * profile.max_velocity_mps
    right = unsure = 0
    for seed in range(20):
        # 22 dB in the beamformed cell, 158 times its noise; the wrong fold has 1.37 dB less: 43 times the noise
        cube = process(point_adc(profile, 40.0, 0.1, velocity, 3e-15, noise="thermal", seed=seed))
        table = detect(cube, ambiguity="tdm_phase").table
        mine = table[np.abs(table["range"] - 40.0) < 1.0][0]
        right += int(abs(mine["velocity"] - velocity) < 1.0)
        unsure += int(mine["ambiguous"])
    assert right + unsure == 20
    assert right >= 18


# ---- two frames
@pytest.mark.parametrize("velocity", [-95.0, -61.5, -27.7, 0.0, 13.3, 53.4, 75.0])
def test_range_change_between_frames_unfolds(velocity):
    top = two_frames(40.0 if velocity > 0 else 60.0, velocity).table[0]
    assert top["velocity"] == pytest.approx(velocity, abs=0.02)
    assert not top["ambiguous"]
    assert top["range"] == pytest.approx((40.0 if velocity > 0 else 60.0) + 0.1 * velocity, abs=5e-3)


def test_frames_too_close_in_time_are_refused():
    least = least_interval_s(PLAIN)
    # v_max t = range bin + a t^2 / 2
    assert PLAIN.max_velocity_mps * least == pytest.approx(PLAIN.range_resolution_m + 5 * least**2, rel=1e-9)
    assert least == pytest.approx(0.0141, abs=2e-4)
    with pytest.raises(InputError, match=r"need at least 0\.0141 s"):
        two_frames(40.0, -27.7, interval=0.99 * least)
    assert two_frames(40.0, -27.7, interval=1.01 * least).velocity[0] == pytest.approx(-27.7, abs=0.02)


def test_equal_targets_one_fold_of_range_apart_stay_folded():
    # of a row of posts, 2 v_max t apart, another may have come from where this one was: 5.33 m at 0.1 s
    step = 2 * PLAIN.max_velocity_mps * 0.1
    table = two_frames(40.0 + step * np.arange(3), np.full(3, -27.7)).table
    middle = table[np.argmin(np.abs(table["range"] - (40.0 + step - 2.77)))]
    assert middle["ambiguous"]
    apart = two_frames(40.0 + 0.6 * step * np.arange(3), np.full(3, -27.7)).table
    assert np.allclose(apart["velocity"][:3], -27.7, atol=0.05)
    assert not apart["ambiguous"][:3].any()


def test_a_target_that_passes_close_by_stays_folded():
    # across at 20 m/s and 8 m: the range rate changes by V^2/R t = 5 m/s between the frames, more than braking would
    speed, interval = 20.0, 0.1
    tables = []
    for time in (0.0, interval):
        ret = point_returns(PLAIN, 8.0, 0.0, 0.0, 1e-9)
        position = np.array([[8.0, -1.0 + speed * time, 0.0]])
        moving = type(ret)(**{**vars(ret), "position": position, "velocity": np.array([[0.0, speed, 0.0]])})
        cube = process(synthesize(moving, PLAIN, noise=None, method="direct"))
        before = tables[-1] if tables else None
        tables.append(detect(cube, ambiguity="two_frame", previous=before, interval_s=interval))
    assert tables[1].ambiguous[0]


def test_the_first_frame_has_nothing_to_compare_with():
    top = found(PLAIN, 40.0, -27.7, ambiguity="two_frame").table[0]
    assert top["ambiguous"]
    assert top["velocity"] == pytest.approx(-27.7 + 2 * PLAIN.max_velocity_mps, abs=0.02)
    with pytest.raises(InputError, match="interval_s > 0"):
        found(PLAIN, 40.0, 1.0, ambiguity="two_frame", previous=found(PLAIN, 40.0, 1.0))


def test_an_unfolded_frame_serves_as_previous_as_a_folded_one_does():
    before = [found(PLAIN, 42.77, -27.7)]
    before.append(two_frames(42.77 + 2.77, -27.7))
    assert before[1].velocity[0] < -27
    cube = process(point_adc(PLAIN, 40.0, 0.1, -27.7, 1e-10))
    rows = [detect(cube, ambiguity="two_frame", previous=b, interval_s=0.1).table[0] for b in before]
    assert rows[0]["velocity"] == rows[1]["velocity"] == pytest.approx(-27.7, abs=0.02)
