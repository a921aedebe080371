"""Ways over several surfaces: corners, the road below them, what moves, and that first surfaces stay as they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from corner_tools import corner_scene, four_path_corner, turntable_corner

import shenron_rt as srt
from shenron_rt.config.scene import Scene
from shenron_rt.echo.bounced import tube_phase_integral
from shenron_rt.paths import Paths


def amplitude_of_the_corner(scene: Scene, distance: float, max_bounces: int, seed: int = 0) -> complex:
    """Return its scattering amplitude by the radar equation [m]."""
    profile = srt.load_profile("radarbook")
    hits = srt.trace(scene, profile, max_bounces=max_bounces, rays=5000, seed=seed)
    echoes = srt.illuminate(hits, profile, materials=scene.materials)
    mine = (echoes.object_id == 5) & echoes.coherent
    phasor = echoes.amplitude * np.exp(2j * np.pi * echoes.center_hz * echoes.delay_s)
    antenna = profile.antenna
    gain = 10 ** ((antenna.gain_tx_dbi + antenna.gain_rx_dbi - antenna.radome_loss_db) / 10)
    unit = profile.tx_power_w * gain * profile.wavelength_m**2 / (4 * np.pi) ** 3
    return complex(phasor[mine].sum() / np.sqrt(unit) * distance**2)


@pytest.mark.parametrize("distance", [10.0, 40.0])
def test_a_corner_in_a_scene_has_the_level_of_the_turntable(distance: float) -> None:
    # tubes that an edge cuts are taken whole or not at all: 0.1 dB at this density, mean of four lattices
    levels = [abs(amplitude_of_the_corner(corner_scene(distance), distance, 3, seed)) ** 2 for seed in range(4)]
    expected = abs(turntable_corner(srt.load_profile("radarbook"), distance, 0.0)) ** 2
    assert 10 * np.log10(np.mean(levels) / expected) == pytest.approx(0.0, abs=0.2)


@pytest.mark.parametrize("distance", [25.0, 65.0, 100.0, 145.0])
def test_a_corner_over_a_road_is_the_sum_of_four_paths(distance: float) -> None:
    wanted = four_path_corner(srt.load_profile("radarbook"), distance)
    found = amplitude_of_the_corner(corner_scene(distance, road=True), distance, 5)
    # at one of these the paths cancel to -10 dB, where 0.1 dB of each is 0.5 dB of the sum
    assert 20 * np.log10(abs(found) / abs(wanted)) == pytest.approx(0.0, abs=0.6)


def test_the_doppler_of_a_corner_is_that_of_its_motion() -> None:
    hits = srt.trace(corner_scene(20.0, velocity=(7.0, 0.0, 0.0)), max_bounces=3, rays=2000)
    assert hits.paths is not None
    inner = hits.paths.count == 3
    assert inner.sum() > 1000
    # over three mirrors at right angles the way grows by twice the range of the apex, up to its parallax
    np.testing.assert_allclose(hits.paths.range_rate[inner], 7.0, rtol=2e-4)


def test_first_surfaces_do_not_depend_on_what_is_followed_further() -> None:
    scene = corner_scene(20.0, road=True)
    one, three = (srt.trace(scene, max_bounces=n, rays=3000) for n in (1, 3))
    assert one.paths is None
    assert three.paths is not None
    assert len(three.paths) > 0
    np.testing.assert_array_equal(one.table(), three.table())


def test_paths_are_saved_and_loaded_with_the_scatterers(tmp_path: Path) -> None:
    hits = srt.trace(corner_scene(20.0, road=True), max_bounces=3, rays=2000)
    hits.save(tmp_path / "hits.npz")
    again = srt.Scatterers.load(tmp_path / "hits.npz")
    assert hits.paths is not None
    assert again.paths is not None
    np.testing.assert_array_equal(again.paths.point, hits.paths.point)
    np.testing.assert_array_equal(again.paths.two_way, hits.paths.two_way)
    assert len(Paths.none()) == 0


def test_the_integral_over_a_tube_is_that_of_its_quadratic_phase() -> None:
    rng = np.random.default_rng(3)
    slope, curvature = rng.uniform(-8, 8, (40, 2)), rng.uniform(-6, 6, (40, 3))
    x = (np.arange(2000) + 0.5) / 1000 - 1
    u, v = np.meshgrid(x, x, indexing="ij")
    for a, h in zip(slope[:8], curvature[:8], strict=True):
        phase = a[0] * u + a[1] * v + 0.5 * (h[0] * u * u + h[1] * v * v) + h[2] * u * v
        expected = np.exp(-1j * phase).mean() * 4
        # midpoint rule: (phase step)^2 / 24 of the modulus of the integrand
        assert abs(tube_phase_integral(a[None], h[None], 1.0)[0] - expected) < 1e-4
    # far beyond: the stationary point alone, to the order of what the edges add, 1/phase
    wide = tube_phase_integral(np.zeros((1, 2)), np.array([[900.0, 700.0, 0.0]]), 1.0)[0]
    assert abs(wide) == pytest.approx(2 * np.pi / np.sqrt(900.0 * 700.0), rel=1e-12)


@pytest.mark.parametrize("bounces", [0, 6])
def test_a_number_of_bounces_out_of_bounds_is_refused(bounces: int) -> None:
    with pytest.raises(srt.InputError, match=r"1 .*to 5"):
        srt.trace(corner_scene(20.0), max_bounces=bounces, rays=1000)
