"""Phase noise after de-chirping: level, shape, range correlation, Doppler, several echoes and channels."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from dsp_tools import point_adc, point_returns
from synthesis_cases import make_profile, make_returns, relative_error

from shenron_rt.config.profile import RadarProfile
from shenron_rt.constants import SPEED_OF_LIGHT
from shenron_rt.dsp import process
from shenron_rt.physics import dechirped_phase_noise, single_sideband_level
from shenron_rt.synthesis import synthesize
from shenron_rt.synthesis.direct import direct_field
from shenron_rt.synthesis.phase_noise import PhaseNoise, add_phase_noise, margin_samples
from shenron_rt.synthesis.signal import Points, transmitted

#: A loop's plateau and the fall beyond it.
TABLE = ((1e4, -80.0), (1e5, -85.0), (1e6, -95.0), (1e7, -115.0))
#: So cold that thermal noise is 100 dB below where it would be.
COLD = {"temperature_k": 2.9e-8}


def shaky(table=TABLE, **options) -> RadarProfile:
    return make_profile(receiver={"phase_noise_dbc_hz": table, **COLD}, **{"array": {"line": 1}, **options})


def residual(profile: RadarProfile, distance: float, frames: int) -> np.ndarray:
    """Return phi(t) - phi(t - tau) of one still target, (frames * n_chirps, n_samples) [rad]."""
    target = make_returns([distance, 0, 0])
    clean = synthesize(target, profile, noise=None, accuracy=1e-9).data[:, 0]
    noisy = [synthesize(target, profile, frame=frame, accuracy=1e-9).data[:, 0] for frame in range(frames)]
    return np.concatenate([np.angle(data * clean.conj()) for data in noisy])


@cache
def density(distance: float, rate: float = 12.5e6) -> tuple[np.ndarray, np.ndarray]:
    """Return offsets [Hz] and single-sideband density [1/Hz] of a target by Welch's mean of 128 Hann periodograms."""
    phase = residual(shaky(), distance, 2)
    taper = np.hanning(phase.shape[1] + 2)[1:-1]
    power = np.abs(np.fft.rfft(phase * taper, axis=1)) ** 2 / (rate * np.sum(taper**2))
    return np.arange(power.shape[1]) * rate / phase.shape[1], power.mean(axis=0)


def test_levels_between_the_points_of_a_table_lie_on_straight_lines():
    level = 10 * np.log10(single_sideband_level([1e3, 1e4, 10**4.5, 1e6, 10**6.5, 1e8], TABLE))
    assert level == pytest.approx([-80, -80, -82.5, -95, -105, -115])


@pytest.mark.parametrize("distance", [0.5, 3.0, 20.0, 75.0])
def test_density_is_l_of_f_times_four_sine_squared(distance):
    offset, found = density(distance)
    # S_phi(f) = 2 L(f), and so is what a density over positive and negative f shows of it: L(f) on either side
    expected = dechirped_phase_noise(np.maximum(offset, 1.0), 2 * distance / SPEED_OF_LIGHT, TABLE)
    # from three bins on (the window's width), and where f tau is no whole number: sin^2 has nulls there
    used = slice(3, -3)
    clear = expected[used] > 0.05 * single_sideband_level(offset[used], TABLE) if distance > 50 else slice(None)
    off = 10 * np.log10(found[used] / expected[used])[clear]
    # 128 periodograms: 4.34 / sqrt(128) = 0.38 dB a bin, 4 sigma at most; of steep slopes the window takes 0.1 dB
    assert np.abs(off).max() < 1.65
    # Hann's neighbours are alike, so 123 bins are worth 82: 3.5 sigma
    assert abs(off.mean()) < 3.5 * 0.38 / np.sqrt(82)


def test_near_echoes_cancel_it():
    offset, near = density(0.5)
    _, far = density(20.0)
    band = (offset > 0.3e6) & (offset < 1.0e6)
    # sin^2 of small arguments: (0.5 / 20)^2, -32 dB
    ratio = 10 * np.log10(near[band].sum() / far[band].sum())
    assert ratio == pytest.approx(20 * np.log10(0.5 / 20), abs=0.6)


def exact_and_found(position, velocity, amplitude) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return chirps without noise, with every echo's own difference of phases, and as synthesised."""
    profile = shaky(chirps=2)
    points, margin = Points.from_returns(make_returns(position, velocity, amplitude)), margin_samples(profile)
    raw = transmitted(profile, points, direct_field, margin)
    found = add_phase_noise(profile, points, raw, margin, np.random.default_rng(4))
    clean = transmitted(profile, points, direct_field)
    delays = 2 * np.linalg.norm(points.position, axis=1) / SPEED_OF_LIGHT
    noise, exact = _same_draw(profile, points, margin), np.zeros_like(clean)
    for i, delay in enumerate(delays):
        alone = transmitted(profile, points[np.array([i])], direct_field)
        for m in range(2):
            exact[m] += alone[m] * np.exp(1j * noise.difference(m, np.array([delay]))[0])
    return clean, exact, found


def error_of_the_noise(clean, exact, found) -> float:
    return float(np.sqrt(np.mean(np.abs(found - exact) ** 2) / np.mean(np.abs(exact - clean) ** 2)))


def test_every_echo_of_a_chirp_gets_the_correlation_of_its_own_delay():
    position = [[0.4, 0, 0], [7.0, 1, 0], [33.3, -4, 1], [90.0, 5, 0]]
    found = exact_and_found(position, [0.0, 0.0, 0.0], [1.0, 0.5j, -0.3, 0.2])
    # echoes fill 94 % of the unambiguous range: what the tapers leave across the gap and at the ends of the window
    assert error_of_the_noise(*found) < 2e-3


@pytest.mark.parametrize(("distance", "velocity"), [(0.4, 20.0), (7.0, 20.0), (20.0, -30.0)])
def test_the_delay_of_a_moving_echo_is_off_by_its_range_doppler_coupling(distance, velocity):
    profile = shaky()
    coupling = abs(velocity) * profile.center_hz / profile.slope_hz_per_s
    # of noise that is 2 pi f tau while that is small, tau is off by the coupling
    error = error_of_the_noise(*exact_and_found([[distance, 0, 0]], [velocity, 0, 0], [1.0]))
    assert error == pytest.approx(coupling / distance, rel=0.1 if distance < 10 else 0.5)


def _same_draw(profile: RadarProfile, points: Points, margin: int) -> PhaseNoise:
    """Return the realisation that ``add_phase_noise`` draws from a generator of seed 4."""
    seen = []

    class Spy(PhaseNoise):
        pass

    original = PhaseNoise.draw.__func__

    def draw(cls, *args):
        seen.append(original(cls, *args))
        return seen[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(PhaseNoise, "draw", classmethod(draw))
        raw = transmitted(profile, points, direct_field, margin)
        add_phase_noise(profile, points, raw, margin, np.random.default_rng(4))
    return seen[0]


def test_without_a_level_the_chirps_are_untouched():
    profile = shaky(((1e6, -400.0),), chirps=8)
    returns = make_returns([[0.4, 0, 0], [33.3, -4, 1], [90.0, 5, 0]], [[0, 0, 0], [30, 2, 0], [5, 0, 0]])
    found = synthesize(returns, profile, accuracy=1e-9).data
    clean = synthesize(returns, profile, noise=None, method="direct").data
    # taper, bins and back are exact; thermal noise of the cold receiver is 1e-10
    assert relative_error(found, clean) < 2e-8


def test_pedestal_of_a_strong_target_in_the_cube():
    profile = shaky(chirps=64)
    distance, cells, frames = 110 * profile.range_resolution_m, 20, 2
    total = np.zeros(2)
    for frame in range(frames):
        adc = synthesize(point_returns(profile, distance, 0.0, 0.0, 1.0), profile, frame=frame)
        cube = process(adc)
        total += cube.range_doppler[[110 - cells, 110 + cells]].mean(axis=1) / frames
    tau, bin_hz = 2 * distance / SPEED_OF_LIGHT, 12.5e6 / 256
    level = dechirped_phase_noise(cells * bin_hz, tau, TABLE)
    # noise of one bin, wider by the window's 1.5 (256/255 of it: periodic), shared by the Doppler bins of 64 chirps
    expected = level * bin_hz * 1.5 * 1.5 / 64
    # 20 bins off in range, noise is each chirp's own: 2 frames x 64 bins of Hann, 2/3 of them independent, 85 powers
    assert 10 * np.log10(total / expected) == pytest.approx([0.0, 0.0], abs=3 * 4.34 / np.sqrt(85))


def test_channels_share_the_oscillator():
    profile = shaky(chirps=4, array={"line": 6})
    cube = point_adc(profile, 40.0, 0.3, noise="thermal")
    clean = point_adc(profile, 40.0, 0.3)
    phase = np.angle(cube.data * clean.data.conj())
    # elements differ by 5 lambda / 4 of path, that is nothing
    assert np.abs(phase - phase[:, :1]).max() < 1e-3 * np.abs(phase).max()


def test_close_in_noise_goes_on_from_chirp_to_chirp_and_far_noise_does_not():
    near, far = (((1e3, -60.0), (1e4, -60.0), (2e4, -300.0)), ((3e4, -300.0), (1e5, -80.0), (1e6, -80.0)))
    correlation = []
    for table in (near, far):
        # a quarter of the chirp: the same slope, and only its mean is looked at
        profile = shaky(table, samples=64, bandwidth_hz=100e6)
        mean = residual(profile, 70.0, 4).mean(axis=1).reshape(4, 64)
        correlation.append(float(np.mean(mean[:, 1:] * mean[:, :-1]) / np.mean(mean**2)))
    # differences of noise up to 10 kHz, 36.4 us apart: int f^2 cos(2 pi f T) df / int f^2 df
    f = np.linspace(0, 1e4, 1001)
    assert correlation[0] == pytest.approx(np.mean(f**2 * np.cos(2 * np.pi * f * 36.4e-6)) / np.mean(f**2), abs=0.17)
    # 252 products of independent numbers: 4 sigma
    assert abs(correlation[1]) < 4 / np.sqrt(252)


@pytest.mark.parametrize("multiplex", ["tdm", "bpm", "ddm"])
def test_every_multiplexing_and_a_real_converter_take_it(multiplex):
    array = {"multiplex": multiplex, "tx": [[0, 0, 0], [0, -2, 0]], "rx": [[0, 0, 0], [0, -1, 0]]}
    for adc in ("complex", "real"):
        profile = shaky(array=array, chirps=6, adc=adc)
        returns = make_returns([20.0, 1.0, 0.0])
        found, clean = (synthesize(returns, profile, noise=n).data for n in ("thermal", None))
        tau = 2 * 20.0 / SPEED_OF_LIGHT
        f = np.linspace(1e3, 6.25e6, 100_000)
        # two sides; of BPM each channel has half of the noise of both transmitters
        expected = 2 * np.trapezoid(dechirped_phase_noise(f, tau, TABLE), f)
        assert np.mean(np.abs(found - clean) ** 2) / np.mean(np.abs(clean) ** 2) == pytest.approx(expected, rel=0.35)


def test_it_repeats_with_its_seed_and_leaves_thermal_noise_as_it_was():
    profile = make_profile(receiver={"phase_noise_dbc_hz": TABLE}, chirps=4)
    nothing = make_returns(np.zeros((0, 3)))
    plain = synthesize(nothing, make_profile(chirps=4), seed=3).data
    assert np.array_equal(synthesize(nothing, profile, seed=3).data, plain)
    target = make_returns([20.0, 1.0, 0.0])
    assert np.array_equal(synthesize(target, profile, seed=3).data, synthesize(target, profile, seed=3).data)
    assert not np.array_equal(synthesize(target, profile, seed=3).data, synthesize(target, profile, seed=4).data)


def test_offsets_must_ascend():
    with pytest.raises(ValueError, match="ascending offsets"):
        shaky(((1e6, -90.0), (1e5, -80.0)))
    with pytest.raises(ValueError, match="ascending offsets"):
        shaky(())
