"""Doppler division: transmitters that send at once, told apart by sub-bands of the Doppler spectrum."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dsp_tools import point_adc, point_returns, rcs_power
from synthesis_cases import draw_returns, make_profile, relative_error, tones

from shenron_rt.config.profile import RadarProfile, load_profile
from shenron_rt.dsp import detect, process
from shenron_rt.dsp.multiplex import strongest_alias
from shenron_rt.errors import InputError
from shenron_rt.io.captures import read_dca1000, write_dca1000
from shenron_rt.synthesis import synthesize

PROFILE = load_profile("ddm_4x4")
#: Channels that another transmitter fills, s sub-bands away: {0, 1, 2, 3} and {s, ... s + 3} modulo 6.
SHARED = [4, 3, 2, 2, 2, 3]


def alike(multiplex: str, **waveform) -> RadarProfile:
    """Return the same array with another multiplexing."""
    data = PROFILE.model_dump()
    return RadarProfile.model_validate(
        data
        | {
            "array": data["array"] | {"multiplex": multiplex, "empty_subbands": 2 if multiplex == "ddm" else None},
            "waveform": data["waveform"] | waveform,
        }
    )


def test_every_chirp_holds_all_transmitters_with_their_ramps(rng):
    array = {"multiplex": "ddm", "tx": [[0, 0, 0], [0, -3, 0]], "rx": [[0, -c, 0] for c in range(3)]}
    profile = make_profile(array=array, chirps=6, samples=64)
    returns = draw_returns(rng, 5, profile, near=False)
    starts = 36.4e-6 * np.arange(6)
    m = np.arange(6)[:, None, None]
    # sub-bands: two transmitters and an empty one
    raw = sum(np.exp(2j * np.pi * tx * m / 3) * tones(profile, returns, tx, starts) for tx in (0, 1))
    expected = np.concatenate([raw, np.exp(-2j * np.pi * m / 3) * raw], axis=1)
    for method, bound in (("direct", 1e-9), ("nufft", 1e-5)):
        found = synthesize(returns, profile, noise=None, method=method).data
        assert found.shape == (6, 6, 64)
        assert relative_error(found, expected) < bound


@pytest.mark.parametrize("velocity", [-40.0, -20.0, -6.0, 0.0, 3.1, 14.0, 25.0, 37.0])
def test_point_target_gives_range_velocity_azimuth_and_rcs_over_the_whole_doppler_axis(velocity):
    # sub-bands are 13.55 m/s wide: at 0, +-1, +-2 and 3 of them the channels change place without the empty ones
    power = rcs_power(PROFILE, 10.0, 40.3, 0.2)
    found = detect(process(point_adc(PROFILE, 40.3, 0.2, velocity, power)))
    assert len(found) == 1
    top = found.table[0]
    assert top["range"] == pytest.approx(40.3, abs=2e-3)
    assert top["velocity"] == pytest.approx(velocity, abs=0.01)
    assert top["azimuth"] == pytest.approx(0.2, abs=5e-4)
    # at 40 m/s the target crosses half a range bin in the frame, which takes 0.1 dB
    assert top["rcs_dbsm"] == pytest.approx(10.0, abs=0.15)
    assert not top["ambiguous"]


def test_channels_are_those_of_transmitters_that_do_not_disturb_each_other():
    target = point_returns(PROFILE, [40.3, 22.0], [0.2, -0.4], [3.1, -17.0], [1e-10, 4e-10])
    ddm, ideal = (process(synthesize(target, p, noise=None, method="direct")) for p in (PROFILE, alike("simultaneous")))
    for distance, velocity in ((40.3, 3.1), (22.0, -17.0)):
        row = np.argmin(np.abs(ddm.range_m - distance - velocity * PROFILE.center_hz / PROFILE.slope_hz_per_s))
        column = np.argmin(np.abs(ddm.velocity_mps - velocity))
        own, alone = ddm.data[row, column], ideal.data[row, column]
        # Hann's side lobes are down by 1/(pi d^3) = 1e-5 at the 32 bins of a sub-band
        assert np.abs(own - alone).max() < 5e-5 * np.abs(ideal.data).max()


def test_whole_sub_bands_away_a_target_shows_in_the_channels_that_others_fill():
    cube = process(point_adc(PROFILE, 40.3, 0.2, 3.1, 1e-10), doppler_window="blackmanharris")
    row, column = np.unravel_index(np.argmax(cube.range_doppler), cube.range_doppler.shape)
    there = cube.range_doppler[row, (column + 32 * np.arange(6)) % 192]
    # the last bits: the target's delay differs between transmitters by 3 lambda / 2
    assert there / there[0] == pytest.approx(np.array(SHARED) / 4, abs=2e-3)
    keep = strongest_alias(cube.range_doppler, 6)
    assert keep[row, column]
    assert keep.sum() == keep.size / 6


def test_the_range_azimuth_map_shows_one_target_once():
    cube = process(point_adc(PROFILE, 40.3, 0.2, 3.1, 1e-10))
    row, column = np.unravel_index(np.argmax(cube.range_azimuth), cube.range_azimuth.shape)
    assert np.sin(cube.azimuth_rad[column]) == pytest.approx(np.sin(0.2), abs=1 / 16)
    away = np.abs(cube.azimuth_sine - np.sin(0.2)) > 2 / 16
    # side lobes of sixteen equal elements: -13.3 dB; ghosts of two or three transmitters would reach -2.5 dB
    assert cube.range_azimuth[row, away].max() < 0.06 * cube.range_azimuth[row, column]


def test_all_chirps_count_for_every_transmitter():
    # the same 192 chirps shared in turn: 48 for each transmitter
    tdm = alike("tdm", chirps=48)
    snr = {}
    for name, p in (("ddm", PROFILE), ("tdm", tdm)):
        top = detect(process(point_adc(p, 40.3, 0.2, 0.0, 1e-12))).table[0]
        snr[name] = top["snr_db"]
    assert snr["ddm"] - snr["tdm"] == pytest.approx(10 * np.log10(4), abs=0.02)


def test_noise_of_a_cell_and_false_alarms_are_the_design(rng):
    hits, expected = 0, 0.0
    for seed in range(6):
        cube = process(synthesize(point_returns(PROFILE, np.zeros(0)), PROFILE, seed=seed))
        # 48 independent receivers' cells a channel set; 16 channels share 4 receivers' samples
        assert cube.range_doppler.mean() == pytest.approx(
            cube.noise_power_w, rel=3 / np.sqrt(4 * cube.data[..., 0].size / 2.25)
        )
        hits += detect(cube).n_cfar_hits
        expected += 1e-3 * cube.range_doppler.size
    # hits of neighbouring cells come together: variance 1.6 times binomial, as for one transmitter; a draw shows at six
    # places that are a fourth to a half the same
    assert hits == pytest.approx(expected, abs=3 * np.sqrt(2 * 1.6 * expected))


def test_a_weaker_target_whole_sub_bands_away_is_lost_and_beside_it_is_not():
    sub_band = 2 * PROFILE.max_velocity_mps / 6
    for apart, seen in ((1.0, 1), (2.0, 1), (0.5, 2), (1.5, 2)):
        velocity = [2.0, 2.0 + apart * sub_band]
        coupling = np.array(velocity) * PROFILE.center_hz / PROFILE.slope_hz_per_s
        adc = point_adc(PROFILE, 40.0 - coupling, 0.1, velocity, [1e-10, 2e-11], noise="thermal")
        found = detect(process(adc), pfa=1e-6)
        assert (found.snr_db > 30).sum() == seen, apart
        assert found.velocity[0] == pytest.approx(2.0, abs=0.05)


def test_beyond_v_max_a_velocity_folds_as_ever():
    top = detect(process(point_adc(PROFILE, 40.0, 0.1, 45.0, 1e-10))).table[0]
    assert top["velocity"] == pytest.approx(45.0 - 2 * PROFILE.max_velocity_mps, abs=0.02)
    assert top["azimuth"] == pytest.approx(0.1, abs=1e-3)
    assert top["ambiguous"]


def test_a_real_converter_divides_too():
    profile = alike("ddm", adc="real")
    power = rcs_power(profile, 10.0, 30.3, -0.3)
    top = detect(process(point_adc(profile, 30.3, -0.3, 20.0, power))).table[0]
    assert top["range"] == pytest.approx(30.3, abs=5e-3)
    assert top["velocity"] == pytest.approx(20.0, abs=0.02)
    assert top["azimuth"] == pytest.approx(-0.3, abs=1e-3)
    assert top["rcs_dbsm"] == pytest.approx(10.0, abs=0.15)


def test_bursts_and_sub_bands_go_together():
    profile = alike("ddm", chirps=384, chirp_period_s=(24e-6, 21e-6), stagger="burst")
    top = detect(process(point_adc(profile, 40.0, 0.1, 60.0, 1e-10)), ambiguity="staggered").table[0]
    assert top["velocity"] == pytest.approx(60.0, abs=0.02)
    assert top["azimuth"] == pytest.approx(0.1, abs=1e-3)


def test_captures_keep_what_the_receivers_saw(tmp_path: Path):
    profile = RadarProfile.model_validate(
        PROFILE.model_dump() | {"receiver": PROFILE.receiver.model_dump() | {"adc_bits": 16, "full_scale_dbm": -30}}
    )
    adc = point_adc(profile, 40.3, 0.2, 14.0, 1e-9)
    write_dca1000(tmp_path / "adc.bin", [adc], layout="four_lane")
    (again,) = read_dca1000(tmp_path / "adc.bin", profile, layout="four_lane")
    assert np.abs(again.data - adc.data).max() < 1e-12


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"waveform.chirps": 190}, "190 chirps do not fill 6 sub-bands"),
        ({"waveform.chirp_period_s": [24e-6, 25e-6]}, "one chirp_period_s is needed"),
        ({"array.empty_subbands": 0}, "greater than or equal to 1"),
        ({"array.multiplex": "tdm"}, "belongs to multiplex ddm, not to tdm"),
    ],
)
def test_frames_that_do_not_divide_are_refused(change, words):
    with pytest.raises(ValueError, match=words):
        load_profile("ddm_4x4", change)


def test_transforms_that_do_not_divide_are_refused():
    with pytest.raises(InputError, match="multiple of the 6 sub-bands"):
        process(point_adc(PROFILE, 40.0), n_fft=(256, 256))
    cube = process(point_adc(PROFILE, 40.0, 0.1, 14.0), n_fft=(512, 384))
    column = np.unravel_index(np.argmax(cube.range_doppler), cube.range_doppler.shape)[1]
    assert cube.velocity_mps[column] == pytest.approx(14.0, abs=0.51 * cube.velocity_step_mps)
