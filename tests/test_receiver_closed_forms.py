"""Converter and TDM timing against closed forms: the 6 dB law, a clipped tone, a real converter's band, phases."""

from __future__ import annotations

import numpy as np
import pytest
from dsp_tools import point_adc, point_returns
from scipy.special import j0
from synthesis_cases import make_profile

from shenron_rt.constants import BOLTZMANN, SPEED_OF_LIGHT
from shenron_rt.dsp import process
from shenron_rt.synthesis import synthesize

LEVEL_DBM = -40.0


def tone(bits: int | None, adc: str, above_db: float, *, range_bin: float = 21.0, velocity: float = 0.0):
    """Return the cube of one target, its power ``above_db`` over full scale, and the same without a converter."""
    scale = {"adc_bits": bits, "full_scale_dbm": LEVEL_DBM}
    profile, ideal = (make_profile(adc=adc, receiver=r) for r in (scale, None))
    power = 10 ** ((LEVEL_DBM + above_db - 30) / 10)
    place = (range_bin * profile.range_resolution_m, 0.0, velocity, power)
    return point_adc(profile, *place), point_adc(ideal, *place), power


@pytest.mark.parametrize("adc", ["complex", "real"])
@pytest.mark.parametrize("bits", [6, 8, 10, 12, 14])
def test_quantisation_follows_6_02_n_plus_1_76_db(adc, bits):
    # half a decibel below full scale, whose top code is one step short; beat and Doppler meet no code twice alike
    adc_cube, ideal, power = tone(bits, adc, -0.5, range_bin=20.7182818, velocity=3.14159)
    error = np.mean(np.abs(adc_cube.data - ideal.data) ** 2)
    # the error of rounding has the Fourier series sum (-1)^n sin(2 pi n x / step) step / (pi n); over a sine each term
    # of its square averages to a Bessel function of the crest
    crest = 2 ** (bits - 1) * 10 ** (-0.5 / 20)
    n = np.arange(1, 2000)
    crests = 1 + 12 / np.pi**2 * np.sum((-1.0) ** n / n**2 * j0(2 * np.pi * n * crest))
    law = 6.0206 * bits + 1.7609 - 0.5
    # 16 384 different errors, their squares of relative variance 4/5: sigma is 0.03 dB
    assert 10 * np.log10(power / error) == pytest.approx(law - 10 * np.log10(crests), abs=0.1)
    assert abs(10 * np.log10(crests)) < (0.3 if bits == 6 else 0.15)


def fourier_of_clipped_sine(ratio: float, harmonic: int) -> float:
    """Return the amplitude of a harmonic, 1 or 3, of a sine of amplitude 1 clipped at ``ratio``."""
    a = np.arcsin(ratio)
    if harmonic == 1:
        return float(2 / np.pi * (a + ratio * np.cos(a)))
    return float(4 / np.pi * (np.sin(2 * a) / 4 - np.sin(4 * a) / 8 + ratio * np.cos(3 * a) / 3))


@pytest.mark.parametrize("above_db", [1.0, 3.0, 6.0, 12.0, 20.0])
@pytest.mark.parametrize("adc", ["complex", "real"])
def test_a_clipped_tone_keeps_its_fundamental_and_makes_a_third_harmonic(adc, above_db, caplog):
    clipped, _, power = tone(20, adc, above_db)
    assert "ADC saturation" in caplog.text
    cube = process(clipped, range_window="rect", doppler_window="rect")
    ratio = 10 ** (-above_db / 20)
    first, third = (power * fourier_of_clipped_sine(ratio, n) ** 2 for n in (1, 3))
    # harmonics fold back: on 256 samples and bin 21 the first to meet another one is the 253rd
    assert cube.range_doppler[21, 32] == pytest.approx(first, rel=2e-3)
    # of I and Q clipped alike, - b3 cos 3x + j b3 sin 3x turns the other way round: the ghost stands at the far end
    at = 63 if adc == "real" else 256 - 63
    assert cube.range_doppler[at, 32] == pytest.approx(third, rel=2e-2)


def test_hard_clipping_leaves_four_over_pi_of_full_scale():
    # a square wave of height c has a fundamental of 4 c / pi
    assert fourier_of_clipped_sine(1e-4, 1) == pytest.approx(4 / np.pi * 1e-4, rel=1e-6)
    assert fourier_of_clipped_sine(1e-4, 3) == pytest.approx(4 / np.pi * 1e-4 / 3, rel=1e-6)
    assert fourier_of_clipped_sine(1.0, 1) == pytest.approx(1.0)
    assert fourier_of_clipped_sine(1.0, 3) == pytest.approx(0.0, abs=1e-12)


def test_a_real_converter_has_half_the_noise_and_the_same_floor():
    profiles = [make_profile(adc=adc) for adc in ("complex", "real")]
    nothing = [point_returns(p, np.zeros(0)) for p in profiles]
    cubes = [synthesize(r, p) for r, p in zip(nothing, profiles, strict=True)]
    kt = BOLTZMANN * 290 * 10**1.4
    for cube, expected in zip(cubes, (kt * 12.5e6, kt * 12.5e6 / 2), strict=True):
        # means of N powers, each of relative variance 1 (complex) or 2 (real)
        assert np.mean(np.abs(cube.data) ** 2) == pytest.approx(expected, rel=3 * np.sqrt(2 / cube.data.size))
    floors = []
    for cube in cubes:
        spectrum = process(cube, range_window="rect", doppler_window="rect")
        # every cell of every channel: k T F f_s / (samples x chirps); bin 0 of a real transform is real
        cells = np.abs(spectrum.data[1:]) ** 2
        floors.append(cells.mean())
        assert spectrum.noise_power_w == pytest.approx(kt * 12.5e6 / (256 * 64))
        assert floors[-1] == pytest.approx(spectrum.noise_power_w, rel=3 / np.sqrt(cells.size))


# ---- TDM
#: Two transmitters three columns apart and four receivers: channels 3 and 4 are the same place.
OVERLAP = {"multiplex": "tdm", "tx": [[0, 0, 0], [0, -3, 0]], "rx": [[0, -c, 0] for c in range(4)]}


def turned(profile, velocity, bins) -> tuple[float, float]:
    """Return the phase of the later transmitter against the earlier one at one place: raw, and in the cube [rad]."""
    adc = point_adc(profile, 30.0, 0.2, velocity)
    raw = np.angle(np.vdot(adc.data[32, 3], adc.data[32, 4]))
    cube = process(adc)
    row = np.argmax(cube.range_doppler.max(axis=1))
    return float(raw), float(np.angle(np.vdot(cube.data[row, 32 + bins, 3], cube.data[row, 32 + bins, 4])))


@pytest.mark.parametrize("bins", [-20, -7, 0, 9, 31])
def test_tdm_phase_is_4_pi_v_t_over_lambda_and_is_taken_out(bins):
    profile = make_profile(array=OVERLAP, chirp_period_s=30e-6)
    seen = profile.center_hz - profile.slope_hz_per_s * 2 * 30.0 / SPEED_OF_LIGHT
    velocity = bins * SPEED_OF_LIGHT / (2 * seen) / (64 * 60e-6)
    raw, left = turned(profile, velocity, bins)
    expected = 4 * np.pi * velocity * 30e-6 / profile.wavelength_m
    # the target moves k tau / f_c in frequency (1e-4) and its near field differs by (1.5 lambda)^2 / R: 1e-3 rad
    assert np.angle(np.exp(1j * (raw - expected))) == pytest.approx(0.0, abs=5e-3)
    assert left == pytest.approx(0.0, abs=5e-3)


@pytest.mark.parametrize("fold", [-1, 1, 2])
def test_a_fold_leaves_two_pi_q_over_n_tx(fold):
    profile = make_profile(array=OVERLAP, chirp_period_s=30e-6)
    seen = profile.center_hz - profile.slope_hz_per_s * 2 * 30.0 / SPEED_OF_LIGHT
    velocity = (9 + 64 * fold) * SPEED_OF_LIGHT / (2 * seen) / (64 * 60e-6)
    _, left = turned(profile, velocity, 9)
    assert np.angle(np.exp(1j * (left - np.pi * fold))) == pytest.approx(0.0, abs=5e-3)
