"""Noise, real ADC, quantisation."""

from __future__ import annotations

import logging

import numpy as np
import pytest
from synthesis_cases import LINE, make_profile, make_returns

from shenron_rt.synthesis import synthesize

NOTHING = make_returns(np.zeros((0, 3)))
TWO_BY_THREE = {"tx": [[0, 0, 0], [0, -3, 0]], "rx": LINE}


def test_noise_power_is_k_T0_F_fs():
    profile = make_profile()
    data = synthesize(NOTHING, profile).data
    expected = 1.380649e-23 * 290 * 10**1.4 * 12.5e6
    # |n|^2 of circular noise is exponential: its mean over N samples has a relative sigma of 1 / sqrt(N)
    assert np.mean(np.abs(data) ** 2) == pytest.approx(expected, rel=3 / np.sqrt(data.size))
    assert np.mean(data.real**2) == pytest.approx(expected / 2, rel=3 * np.sqrt(2 / data.size))
    assert abs(np.mean(data**2)) < 3 * expected * np.sqrt(2 / data.size)
    assert synthesize(NOTHING, profile).noise_power_w == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_noise_is_independent_along_every_axis(axis):
    data = synthesize(NOTHING, make_profile()).data
    other = np.roll(data, 1, axis=axis)
    correlation = abs(np.mean(data * other.conj())) / np.mean(np.abs(data) ** 2)
    # |mean of N unit products|^2 is exponential with mean 1 / N: exceeding 4 / sqrt(N) has probability e^-16
    assert correlation < 4 / np.sqrt(data.size)


def test_noise_differs_between_frames_radars_and_seeds_and_repeats():
    profile = make_profile(chirps=2)
    first = synthesize(NOTHING, profile, seed=1, frame=2, radar="front").data
    assert np.array_equal(first, synthesize(NOTHING, profile, seed=1, frame=2, radar="front").data)
    for change in ({"seed": 2}, {"frame": 3}, {"radar": "left"}):
        other = synthesize(NOTHING, profile, **({"seed": 1, "frame": 2, "radar": "front"} | change)).data
        assert not np.any(first == other)
    assert np.array_equal(synthesize(NOTHING, profile).data, synthesize(NOTHING, profile, seed=0).data)


def test_bpm_decoding_lowers_the_noise_by_the_number_of_transmitters():
    tdm, bpm = (
        synthesize(NOTHING, make_profile(array=TWO_BY_THREE | {"multiplex": m}, chirp_period_s=40e-6))
        for m in ("tdm", "bpm")
    )
    measured = np.mean(np.abs(bpm.data) ** 2) / np.mean(np.abs(tdm.data) ** 2)
    assert measured == pytest.approx(0.5, rel=3 * np.sqrt(2 / bpm.data.size))
    assert bpm.noise_power_w == pytest.approx(tdm.noise_power_w / 2)
    # decoded channels of one receiver share raw chirps, yet an orthogonal code leaves their noise independent
    a, b = bpm.data[:, 0], bpm.data[:, 3]
    assert abs(np.mean(a * b.conj())) / np.mean(np.abs(a) ** 2) < 4 / np.sqrt(a.size)


def test_real_adc_keeps_tone_power_and_halves_the_noise():
    target = make_returns([20.0, 0, 0], amplitude=2e-6)
    complex_, real = (make_profile(adc=kind) for kind in ("complex", "real"))
    x, y = (synthesize(target, p, noise=None, method="direct").data for p in (complex_, real))
    assert np.array_equal(y.imag, np.zeros_like(y.imag))
    assert y.real == pytest.approx(np.sqrt(2) * x.real, rel=1e-12)
    # cos^2 averaged over 53 beat cycles a chirp
    assert np.mean(y.real**2) == pytest.approx(4e-12, rel=0.02)
    noise = synthesize(NOTHING, real)
    assert not noise.data.imag.any()
    assert np.mean(noise.data.real**2) == pytest.approx(real.noise_power_w / 2, rel=3 * np.sqrt(2 / noise.data.size))
    assert noise.noise_power_w == pytest.approx(real.noise_power_w / 2)


@pytest.mark.parametrize("adc", ["complex", "real"])
def test_quantisation_error_is_a_twelfth_of_the_step_squared(adc, caplog):
    bits, level = 10, -60.0
    receiver = {"adc_bits": bits, "full_scale_dbm": level}
    # 3 dB below full scale
    target = make_returns([[20.3, 1.0, 0.0]], [[3.1, 0, 0]], amplitude=np.sqrt(10 ** ((level - 33) / 10)))
    ideal = synthesize(target, make_profile(adc=adc), noise=None).data
    with caplog.at_level(logging.WARNING):
        found = synthesize(target, make_profile(adc=adc, receiver=receiver), noise=None).data
    assert not caplog.records
    step = np.sqrt(10 ** ((level - 30) / 10) * (2 if adc == "real" else 1)) / 2 ** (bits - 1)
    assert np.abs(np.rint(found.real / step) * step - found.real).max() < 1e-9 * step
    error = (found - ideal).real
    assert np.abs(error).max() <= step / 2 * (1 + 1e-9)
    # errors of 1e5 samples of an incommensurate tone
    assert np.mean(error**2) == pytest.approx(step**2 / 12, rel=0.05)


def test_saturation_is_clipped_and_counted(caplog):
    level = -60.0
    peak = np.sqrt(10 ** ((level - 30) / 10))
    profile = make_profile(receiver={"adc_bits": 8, "full_scale_dbm": level}, chirps=4)
    target = make_returns([20.3, 1.0, 0.0], amplitude=2 * peak)
    ideal = synthesize(target, profile.model_copy(update={"receiver": make_profile().receiver}), noise=None).data
    with caplog.at_level(logging.WARNING, logger="shenron_rt"):
        data = synthesize(target, profile, noise=None).data
    assert data.real.max() == pytest.approx(peak * 127 / 128)
    assert data.real.min() == pytest.approx(-peak)
    codes = np.rint(np.stack([ideal.real, ideal.imag]) / (peak / 128))
    beyond = int(((codes > 127) | (codes < -128)).any(axis=0).sum())
    assert beyond > data.size // 2
    assert f"{beyond} of {data.size}" in caplog.text
