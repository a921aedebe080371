"""Directions: steering, beamforming, Capon, MUSIC."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shenron_rt.config.profile import load_profile
from shenron_rt.dsp import bartlett, bartlett_2d, capon, covariance, music, steering
from shenron_rt.dsp.angle import azimuth_channels, has_elevation, refine_peak, sine_grid
from shenron_rt.errors import InputError

LAMBDA = 3.9e-3
LINE = np.stack([np.zeros(8), -np.arange(8) * LAMBDA / 2, np.zeros(8)], axis=1)
GRID = np.linspace(-1, 1, 801)


def snapshots(sines, powers, rng, count=200, noise=1e-3):
    """Return snapshots of independent sources in white noise."""
    a = steering(LINE, LAMBDA, np.asarray(sines))
    wave = rng.standard_normal((count, len(powers), 2)).view(complex)[..., 0] * np.sqrt(np.asarray(powers) / 2)
    white = rng.standard_normal((count, 8, 2)).view(complex)[..., 0] * np.sqrt(noise / 2)
    return wave @ a + white


def test_phase_steps_by_pi_sine_per_column_to_the_left():
    step = np.angle(steering(LINE, LAMBDA, 0.3)[1:] / steering(LINE, LAMBDA, 0.3)[:-1])
    assert step == pytest.approx(np.pi * 0.3)


@settings(max_examples=30, deadline=None)
@given(sine=st.floats(-0.95, 0.95), power=st.floats(1e-20, 1e3))
def test_beam_on_a_target_reads_its_power_and_no_other_reads_more(sine, power):
    x = np.sqrt(power) * steering(LINE, LAMBDA, sine)
    assert bartlett(x, steering(LINE, LAMBDA, [sine]))[0] == pytest.approx(power)
    assert bartlett(x, steering(LINE, LAMBDA, GRID)).max() <= power * (1 + 1e-12)


def test_bartlett_of_a_uniform_line_is_its_fourier_transform(rng):
    x = rng.standard_normal((5, 8)) + 1j * rng.standard_normal((5, 8))
    spectrum = np.abs(np.fft.fftshift(np.fft.fft(x, 64, axis=1), axes=1) / 8) ** 2
    vectors = steering(LINE, LAMBDA, (np.arange(64) - 32) / 32)
    assert bartlett(x, vectors) == pytest.approx(spectrum, rel=1e-9, abs=1e-12)


def test_capon_and_music_tell_what_a_beam_cannot(rng):
    true = np.array([0.0, 0.15])  # 2/M is 0.25
    cov = covariance(snapshots(true, (1.0, 1.0), rng))
    vectors = steering(LINE, LAMBDA, GRID)
    window = (GRID > -0.2) & (GRID < 0.35)
    for spectrum, expected in (
        (bartlett(snapshots(true, (1, 1), rng), vectors).mean(axis=0), 1),
        (capon(cov, vectors), 2),
        (music(cov, vectors, 2), 2),
    ):
        inner = spectrum[window]
        peaks = np.flatnonzero((inner[1:-1] > inner[:-2]) & (inner[1:-1] > inner[2:]))
        assert len(peaks) == expected
        if expected == 2:  # noise 30 dB down, 200 snapshots: within a twentieth of a beam
            assert GRID[window][1:-1][peaks] == pytest.approx(true, abs=0.0125)


def test_capon_reads_the_power_of_a_single_source(rng):
    cov = covariance(snapshots([0.2], [2.0], rng, count=4000))
    # 4000 snapshots of an exponential power: 1.6 %; loading adds 1e-3 of the power over 8 channels
    assert capon(cov, steering(LINE, LAMBDA, [0.2]))[0] == pytest.approx(2.0, rel=0.05)


def test_capon_and_music_take_stacks_and_empty_cells(rng):
    stack = np.stack([covariance(snapshots([0.1], [1.0], rng)), np.zeros((8, 8))])
    vectors = steering(LINE, LAMBDA, GRID)
    assert capon(stack, vectors).shape == (2, 801)
    assert capon(stack, vectors)[1].max() < 1e-100
    assert np.argmax(music(stack[:1], vectors, 1)) == np.argmin(np.abs(GRID - 0.1))
    with pytest.raises(InputError, match="1 to 7"):
        music(stack, vectors, 8)


def test_music_takes_columns_that_coincide_and_gaps(rng):
    # columns 0 1 1 3 6: one doubled, two missing
    positions = np.stack([np.zeros(5), -np.array([0, 1, 1, 3, 6]) * LAMBDA / 2, np.zeros(5)], axis=1)
    a = steering(positions, LAMBDA, [-0.4])
    x = rng.standard_normal((50, 1)) * a + 1e-3 * (rng.standard_normal((50, 5)) + 1j * rng.standard_normal((50, 5)))
    spectrum = music(covariance(x), steering(positions, LAMBDA, GRID), 1)
    assert GRID[np.argmax(spectrum)] == pytest.approx(-0.4, abs=0.003)


def test_two_dimensional_beam_finds_azimuth_and_elevation_of_the_board():
    profile = load_profile("awrl1432boost")
    assert has_elevation(profile.positions_m, profile.wavelength_m)
    sines, rises = np.linspace(-1, 1, 81), np.linspace(-1, 1, 81)
    x = steering(profile.positions_m, profile.wavelength_m, sines[50], rises[45])
    power = bartlett_2d(x, profile.positions_m, profile.wavelength_m, sines, rises)
    assert np.unravel_index(np.argmax(power), power.shape) == (50, 45)
    assert power.max() == pytest.approx(1.0)
    assert power[0, 0] == 0  # behind the horizon


def test_azimuth_aperture_is_the_widest_row():
    board = load_profile("awrl1432boost")
    rows = board.positions_m[:, 2]
    channels = azimuth_channels(board.positions_m, board.wavelength_m)
    assert np.ptp(rows[channels]) == 0
    assert len(np.unique(board.positions_m[channels, 1].round(9))) == 4
    line = load_profile("awrl1432")
    assert not has_elevation(line.positions_m, line.wavelength_m)
    assert list(azimuth_channels(line.positions_m, line.wavelength_m)) == list(range(6))


def test_grid_is_uniform_holds_boresight_and_grows_with_the_aperture():
    assert list(sine_grid(LINE[:1], LAMBDA)) == [0.0]
    small, large = sine_grid(LINE, LAMBDA), sine_grid(np.tile(LINE, (12, 1)) * np.arange(1, 97)[:, None], LAMBDA)
    assert len(small) == 64
    assert len(large) > 4 * 2 * np.ptp(np.tile(LINE, (12, 1)) * np.arange(1, 97)[:, None], axis=0)[1] / LAMBDA
    assert small[0] == -1
    assert 0 in small


def test_parabola_through_the_logarithm_is_exact_for_a_gaussian():
    x = np.arange(9.0)
    spectrum = np.exp(-((x - 4.3) ** 2))
    assert refine_peak(spectrum, np.array(4)) == pytest.approx(0.3)
    assert refine_peak(spectrum[4:], np.array(0)) == 0  # no neighbour on the left
