"""The radar cube: levels, axes, multiplexing, files."""

from __future__ import annotations

import numpy as np
import pytest
from dsp_tools import point_adc, point_returns, table_rows
from hypothesis import given, settings
from hypothesis import strategies as st

from shenron_rt.config.profile import RadarProfile, load_profile
from shenron_rt.constants import SPEED_OF_LIGHT
from shenron_rt.dsp import WINDOWS, RadarCube, process, steering
from shenron_rt.dsp.spectra import doppler_spectrum, range_spectrum
from shenron_rt.errors import InputError
from shenron_rt.resources import available
from shenron_rt.synthesis.adc import AdcCube
from shenron_rt.synthesis.synthesize import synthesize

PROFILES = sorted(available("profiles"))


def changed(name: str, **keys) -> RadarProfile:
    """Return a profile with dotted keys (written with __) changed."""
    return load_profile(name, {key.replace("__", "."): value for key, value in keys.items()})


def tone(profile: RadarProfile, range_bin: float, doppler_bin: float, power: float) -> AdcCube:
    """Return a tone of the same phase in all channels."""
    w = profile.waveform
    fast = np.exp(2j * np.pi * range_bin * np.arange(w.samples) / w.samples)
    slow = np.exp(2j * np.pi * doppler_bin * np.arange(w.chirps) / w.chirps)
    data = np.sqrt(power) * np.broadcast_to(slow[:, None, None] * fast, (w.chirps, profile.n_virtual, w.samples))
    if w.adc == "real":
        data = np.sqrt(2) * data.real
    return AdcCube(data.astype(complex), profile)


@pytest.mark.parametrize("name", WINDOWS)
def test_bin_centred_tone_of_power_p_reads_p(name):
    cube = process(tone(load_profile("awrl1432"), 40, -7, 3e-9), range_window=name, doppler_window=name)
    assert np.abs(cube.data[40, 32 - 7]) ** 2 == pytest.approx(3e-9, rel=1e-12)
    assert np.unravel_index(np.argmax(cube.range_doppler), (256, 64)) == (40, 25)


@pytest.mark.parametrize("padding", [(256, 64), (512, 256), (300, 65)])
def test_real_adc_reads_the_same_power_in_half_the_bins(padding):
    profile = changed("awrl1432", waveform__adc="real")
    cube = process(tone(profile, 40, 5, 3e-9), range_window="blackmanharris", n_fft=padding)
    assert cube.data.shape == (padding[0] // 2, padding[1], 6)
    at = round(40 * padding[0] / 256), padding[1] // 2 + round(5 * padding[1] / 64)
    if padding != (300, 65):  # on a bin: the mirrored tone is 92 dB down
        assert cube.range_doppler[at] == pytest.approx(3e-9, rel=1e-4)
    assert cube.range_m[at[0]] == pytest.approx(40 * profile.range_resolution_m, abs=cube.range_step_m / 2)
    assert cube.velocity_mps[at[1]] == pytest.approx(
        5 * profile.velocity_resolution_mps, abs=cube.velocity_step_mps / 2
    )


@pytest.mark.parametrize("name", PROFILES)
def test_axes_follow_the_profile_of_the_data(name):
    profile = load_profile(name)
    distance, velocity = 0.4 * profile.max_range_m, 0.3 * profile.max_velocity_mps
    cube = process(point_adc(profile, distance, 0.2, velocity))
    w = profile.waveform
    assert cube.profile is profile
    assert cube.data.shape == (profile.n_range, w.chirps, profile.n_virtual)
    assert cube.range_m[1] == pytest.approx(SPEED_OF_LIGHT / (2 * w.bandwidth_hz))
    assert cube.range_m[-1] == pytest.approx(profile.max_range_m - profile.range_resolution_m)
    assert cube.velocity_mps[0] == pytest.approx(-(w.chirps // 2) * profile.velocity_resolution_mps)
    assert np.diff(cube.velocity_mps) == pytest.approx(profile.velocity_resolution_mps)
    assert cube.velocity_mps[w.chirps // 2] == 0
    assert np.ptp(np.diff(np.sin(cube.azimuth_rad))) < 1e-12
    assert np.all(np.diff(cube.azimuth_rad) > 0)
    row, column = np.unravel_index(np.argmax(cube.range_doppler), cube.range_doppler.shape)
    coupling = velocity * profile.center_hz / profile.slope_hz_per_s
    assert cube.range_m[row] == pytest.approx(distance + coupling, abs=0.6 * cube.range_step_m)
    assert cube.velocity_mps[column] == pytest.approx(velocity, abs=0.6 * cube.velocity_step_mps)
    beam = np.unravel_index(np.argmax(cube.range_azimuth), cube.range_azimuth.shape)[1]
    # the far-field beams of an array of 0.2 m still point right at this range
    assert np.sin(cube.azimuth_rad[beam]) == pytest.approx(np.sin(0.2), abs=2 / len(cube.azimuth_rad) + 0.005)


def test_exact_beat_doppler_and_array_steps_of_the_reference_table(shared_reference):
    for row in table_rows(shared_reference / "dsp" / "fmcw_point_targets.csv"):
        value = {k: float(v) for k, v in row.items() if k != "profile"}
        bin_hz = 1e3 * value["beat_khz"] / value["range_bin"]
        n = {"awrl1432_bsd_like": 256, "cascade_like": 256, "wide_4ghz": 512, "ism_24ghz": 1024}[row["profile"]]
        bounds = next(
            r for r in table_rows(shared_reference / "dsp" / "crlb.csv") if r["profile"] == row["profile"]
        )  # fmt: skip
        slope = SPEED_OF_LIGHT * bin_hz / (2 * float(bounds["range_res_m"]))
        moving = value["v_mps"] != 0
        centre = value["doppler_hz"] * SPEED_OF_LIGHT / (2 * value["v_mps"]) if moving else 77e9
        t = np.arange(n) / (n * bin_hz)
        mid = t[-1] / 2 + (t[1] - t[0]) / 2
        loop = SPEED_OF_LIGHT / centre / (4 * float(bounds["vmax_mps"]))
        chirps = round(2 * float(bounds["vmax_mps"]) / float(bounds["vel_res_mps"]))
        tau = lambda at, r=value: 2 * (r["range_m"] + r["v_mps"] * at) / SPEED_OF_LIGHT  # noqa: E731
        f0 = centre - slope * mid

        def phase(fast, slow, tau=tau, f0=f0, slope=slope):
            delay = tau(slow + fast)
            return 2 * np.pi * (f0 * delay + slope * delay * fast - slope * delay**2 / 2)

        padded = 64 * n
        fast = range_spectrum(np.exp(1j * phase(t, 0.0)), name="rect", n_fft=padded, real=False)
        assert _peak(fast) / 64 == pytest.approx(value["range_bin"] % n, abs=1e-3 + 0.005 * moving), row
        slow = np.arange(chirps) * loop
        pulses = np.exp(1j * phase(mid, slow))[:, None, None]
        doppler = doppler_spectrum(
            pulses, name="rect", n_fft=64 * chirps, chirp_start_s=slow[:, None], loop_period_s=loop
        ).ravel()
        folded = (_peak(doppler) - 32 * chirps) / 64
        # the table leaves out the residual video phase: Doppler is (2 v / c)(f_c - k tau), 1e-3 of it at most
        tolerance = 1e-3 + abs(value["doppler_hz"] * loop * chirps * slope * tau(0.0) / centre)
        gap = (folded - value["doppler_bin"] + chirps / 2) % chirps - chirps / 2
        assert abs(gap) < tolerance, row
        column = np.angle(
            steering(
                [[0, -SPEED_OF_LIGHT / centre / 2, 0]], SPEED_OF_LIGHT / centre, np.sin(np.radians(value["az_deg"]))
            )
        )
        assert np.degrees(column) == pytest.approx(value["array_step_deg"], abs=1e-3)


def _peak(spectrum) -> float:
    """Return the position of the maximum [bins], by a parabola through a densely padded main lobe."""
    level = np.abs(spectrum)
    i = int(np.argmax(level))
    a, b, c = level[i - 1], level[i], level[(i + 1) % len(level)]
    return i + 0.5 * (a - c) / (a - 2 * b + c)


def test_velocities_fold_as_in_the_ambiguity_table(shared_reference):
    for row in table_rows(shared_reference / "dsp" / "doppler_ambiguity.csv"):
        for key, expected in row.items():
            if key == "v_true_mps":
                continue
            period = float(key.removeprefix("v_T").removesuffix("us")) * 1e-6
            profile = changed(
                "awrl1432", waveform__chirp_period_s=period, waveform__carrier_hz=77e9 - 200e6, array__line=1
            )  # f_c = 77 GHz as in the table
            cube = process(point_adc(profile, 30.0, 0.0, float(row["v_true_mps"])), n_fft=(256, 1024))
            column = np.unravel_index(np.argmax(cube.range_doppler), cube.range_doppler.shape)[1]
            gap = (cube.velocity_mps[column] - float(expected)) / (2 * profile.max_velocity_mps)
            # half a padded bin, and 2e-5 of 70 m/s that k tau takes from the carrier
            assert abs(gap - round(gap)) * 2 * profile.max_velocity_mps < 0.6 * cube.velocity_step_mps


@pytest.mark.parametrize("name", ["awrl1432", "awrl1432boost", "radarbook2"])
@pytest.mark.parametrize("window", ["rect", "hann"])
def test_noise_in_a_cell_is_what_the_cube_says(name, window):
    # complex, real under BPM, real under TDM
    profile = load_profile(name)
    empty = point_returns(profile, np.zeros(0))
    cube = process(synthesize(empty, profile, seed=3), range_window=window, doppler_window=window)
    # Hann cells: about a third of them independent; three sigma of the mean
    independent = cube.range_doppler.size * profile.n_virtual / 3
    assert cube.range_doppler.mean() / cube.noise_power_w == pytest.approx(1, abs=3 / np.sqrt(independent))
    assert cube.noise_added


def test_range_azimuth_reads_the_power_of_the_strongest_target():
    profile = load_profile("awrl1432")
    w = profile.waveform
    sine = np.array([0.25, -0.5])  # on the 64-point grid
    data = np.zeros((w.chirps, 6, w.samples), dtype=complex)
    for s, power, r, v in zip(sine, (4e-9, 1e-9), (60, 100), (3, -9), strict=True):
        one = tone(profile, r, v, power).data
        data += one * steering(profile.positions_m, profile.wavelength_m, s)[None, :, None]
    cube = process(AdcCube(data, profile))
    assert cube.range_azimuth.shape == (256, len(cube.azimuth_rad))
    assert np.unravel_index(np.argmax(cube.range_azimuth), cube.range_azimuth.shape) == (60, 40)
    assert cube.range_azimuth[60, 40] == pytest.approx(4e-9, rel=1e-9)
    assert cube.range_azimuth[100, 16] == pytest.approx(1e-9, rel=1e-9)


@pytest.mark.parametrize("name", ["awrl1432boost", "radarbook2", "mmwcas"])
def test_channels_of_a_moving_target_line_up_after_compensation(name):
    profile = load_profile(name)
    # a whole number of Doppler bins: nothing is left over but the direction
    velocity = 0.25 * profile.waveform.chirps * profile.velocity_resolution_mps
    azimuth, distance = 0.3, 60.0
    cube = process(point_adc(profile, distance, azimuth, velocity))
    row, column = np.unravel_index(np.argmax(cube.range_doppler), cube.range_doppler.shape)
    target = distance * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    legs = [np.linalg.norm(target - element, axis=1) - distance for element in (profile.tx_m, profile.rx_m)]
    expected = np.exp(2j * np.pi / profile.wavelength_m * (legs[0][:, None] + legs[1]).ravel())
    seen = cube.data[row, column]
    likeness = abs(np.vdot(expected, seen)) / np.linalg.norm(expected) / np.linalg.norm(seen)
    # Doppler is k tau / f_c = 1e-4 off its bin, samples half a bin off theirs: 0.02 rad at most
    assert likeness > 1 - 0.02**2


def test_staggered_loops_keep_level_and_velocity():
    profile = changed("awrl1432", waveform__chirp_period_s=[36.4e-6, 41.1e-6, 38.0e-6])
    velocity = 9.0 * profile.velocity_resolution_mps
    cube = process(point_adc(profile, 107 * profile.range_resolution_m, 0.0, velocity, 1e-9), doppler_window="rect")
    row, column = np.unravel_index(np.argmax(cube.range_doppler), cube.range_doppler.shape)
    assert column == 32 + 9
    # range migrates and lies 0.1 bin off by Doppler coupling: Hann loses 0.06 dB there
    assert 10 * np.log10(cube.range_doppler[row, column] / 1e-9) == pytest.approx(0, abs=0.1)


@settings(max_examples=25, deadline=None)
@given(
    range_bin=st.floats(3, 250),
    doppler_bin=st.floats(-31, 31),
    window=st.sampled_from(WINDOWS),
    gain=st.floats(1e-3, 1e3),
)
def test_no_tone_reads_more_than_its_power(range_bin, doppler_bin, window, gain):
    profile = changed("awrl1432", array__line=1)
    adc = tone(profile, range_bin, doppler_bin, gain)
    cube = process(adc, range_window=window, doppler_window=window)
    assert cube.range_doppler.max() <= gain * (1 + 1e-9)
    # what scalloping takes at most in both dimensions: 2 x 3.92 dB of the rectangular window
    assert cube.range_doppler.max() >= gain * 10 ** (-0.79)


def test_cube_survives_the_disk(tmp_path):
    profile = load_profile("awrl1432boost")
    cube = process(point_adc(profile, 30.0, noise="thermal"), range_window="taylor", n_fft=(512, 128))
    cube.save(tmp_path / "cube.npz")
    back = RadarCube.load(tmp_path / "cube.npz")
    assert np.array_equal(back.data, cube.data)
    assert (back.profile, back.range_window, back.doppler_window, back.n_fft) == (
        profile, "taylor", "hann", (512, 128),
    )  # fmt: skip
    assert back.noise_added
    with np.load(tmp_path / "cube.npz") as file:
        for name in ("range_m", "velocity_mps", "azimuth_rad", "range_doppler", "range_azimuth"):
            assert np.array_equal(file[name], getattr(cube, name)), name


def test_wrong_arguments_say_what_is_allowed():
    profile = load_profile("awrl1432")
    adc = tone(profile, 10, 0, 1.0)
    with pytest.raises(InputError, match="at least \\(256, 64\\)"):
        process(adc, n_fft=(128, 64))
    with pytest.raises(InputError, match="did you mean 'taylor'"):
        process(adc, range_window="tailor")
    with pytest.raises(InputError, match="needs shape"):
        RadarCube(np.zeros((3, 3, 2), dtype=complex), profile)
