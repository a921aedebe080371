"""Echoes over several surfaces: transmitters see one image of the last reflection, receivers another."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from synthesis_cases import LINE, C, draw_returns, make_profile, make_returns, relative_error

import shenron_rt as srt
from shenron_rt.config.profile import RadarProfile
from shenron_rt.config.scene import Scene
from shenron_rt.errors import InputError
from shenron_rt.paths import Paths
from shenron_rt.returns import Returns
from shenron_rt.synthesis import blocks, synthesize

# 3 x 6 elements, 0.11 m across, transmitters in azimuth and height
CASCADE = {
    "multiplex": "tdm",
    "tx_m": [[0, 0, 0], [0, -0.062, 0.002], [0, -0.11, 0.004]],
    "rx_m": [[0, -0.0195 * i, 0] for i in range(6)],
}
PROFILES = {
    "awrl1432boost": lambda: shortened("awrl1432boost", chirps=16, samples=64),
    "ti_cascade": lambda: shortened("ti_cascade", samples=64),
    "mmwcas": lambda: shortened("mmwcas", chirps=2, samples=32),
    "cascade_tdm": lambda: make_profile(
        array=CASCADE, chirps=6, samples=64, bandwidth_hz=256e6, sample_rate_hz=8e6, chirp_period_s=160e-6
    ),
    "tdm": lambda: make_profile(
        array={"multiplex": "tdm", "tx": [[0, 0, 0], [0, -3, 1]], "rx": LINE}, chirps=16, samples=64
    ),
}


def shortened(name: str, **waveform: Any) -> RadarProfile:
    """A bundled profile with fewer samples, so that the exact sum takes no minutes."""
    profile = srt.load_profile(name)
    window = profile.waveform.sampled_time_s
    if "samples" in waveform:
        waveform["sample_rate_hz"] = waveform["samples"] / window
    return profile.model_copy(update={"waveform": profile.waveform.model_copy(update=waveform)})


@pytest.fixture
def only_nufft(monkeypatch: pytest.MonkeyPatch) -> None:
    """Forbid the exact sum that few echoes would otherwise get, so that the NUFFT itself is measured."""
    monkeypatch.setattr(blocks, "COST_EXACT", np.inf)


def with_legs(returns: Returns, rng: np.random.Generator, every: int = 1) -> Returns:
    """Give some echoes a departure of their own: another direction, 0.3 to 1.7 of the range, another motion."""
    n = len(returns)
    u = rng.normal(size=(n, 3)) * [1, 1, 0.4]
    reach = rng.uniform(0.3, 1.7, n) * np.linalg.norm(returns.position, axis=1)
    u *= (reach / np.linalg.norm(u, axis=1))[:, None]
    own = (np.arange(n) % every == 0)[:, None]
    return replace(
        returns,
        departure=np.where(own, u, returns.position),
        departure_velocity=np.where(own, rng.normal(size=(n, 3)) * 15, returns.velocity),
    )


@pytest.mark.parametrize("accuracy", [1e-4, 1e-6])
@pytest.mark.parametrize("name", PROFILES)
def test_nufft_reaches_the_accuracy_for_legs_that_differ(name: str, accuracy: float, only_nufft: None) -> None:
    profile, rng = PROFILES[name](), np.random.default_rng(len(name))
    returns = with_legs(draw_returns(rng, 60, profile, near=False), rng, every=2)
    exact = synthesize(returns, profile, noise=None, method="direct").data
    found = synthesize(returns, profile, noise=None, accuracy=accuracy).data
    assert relative_error(found, exact) <= accuracy
    worst = max(relative_error(found[:, v], exact[:, v]) for v in range(profile.n_virtual))
    assert worst <= 2 * accuracy


@pytest.mark.parametrize("method", ["direct", "nufft"])
@pytest.mark.parametrize("name", ["awrl1432boost", "cascade_tdm"])
def test_a_departure_equal_to_the_arrival_changes_no_byte(name: str, method: str) -> None:
    profile = PROFILES[name]()
    plain = draw_returns(np.random.default_rng(4), 3000 if method == "nufft" else 20, profile, near=False)
    for columns in ({"departure": plain.position}, {"departure": plain.position, "departure_velocity": plain.velocity}):
        told = replace(plain, **columns)
        cubes = [synthesize(r, profile, noise=None, method=method).data.tobytes() for r in (plain, told)]
        assert cubes[0] == cubes[1]


def test_first_surfaces_are_summed_as_if_no_others_were_there() -> None:
    profile, rng = PROFILES["tdm"](), np.random.default_rng(8)
    plain = draw_returns(rng, 4000, profile, near=False)
    both = with_legs(plain, rng, every=4)
    silent = replace(both, amplitude=np.where(np.arange(len(both)) % 4 == 0, 0.0, both.amplitude))
    first = replace(silent, departure=None, departure_velocity=None)
    cubes = [synthesize(r, profile, noise=None).data.tobytes() for r in (first, silent)]
    assert cubes[0] == cubes[1]


def test_a_departure_without_velocity_moves_along_its_line_of_sight() -> None:
    profile = PROFILES["tdm"]()
    u, away = np.array([0.6, 0.8, 0.0]), np.array([0.8, -0.6, 0.0])
    echo = replace(make_returns(20 * u, 7.0 * u), departure=(20 * away)[None])
    told = replace(echo, departure_velocity=(7.0 * away)[None])
    cubes = [synthesize(r, profile, noise=None, method="direct").data for r in (echo, told)]
    # rounding of 1e4 cycles of carrier phase
    assert relative_error(cubes[0], cubes[1]) < 1e-10


def test_a_departure_longer_than_the_whole_way_is_refused() -> None:
    echo = replace(make_returns([10.0, 0, 0]), departure=np.array([[21.0, 0, 0]]))
    with pytest.raises(InputError, match="way there must be shorter"):
        synthesize(echo, make_profile(), noise=None)


# ---- images
def corner_of_the_street(profile: RadarProfile) -> srt.Scatterers:
    """A wall across the road, both seen by a radar that drives toward them, and a box that drives before it."""
    scene = Scene.model_validate(
        {
            "ego": {"velocity_mps": [9, 0.5, 0]},
            "static": [
                {"name": "road", "shape": "ground:60x30", "xyz_m": [20, 0, 0], "material": "asphalt"},
                {"name": "wall", "shape": "box:0.3x10x4", "xyz_m": [9, 1, 2], "ypr_deg": [8, 0, 0],
                 "tag": "Walls", "material": "metal", "id": 40},
            ],
            "actors": [
                {"id": 7, "name": "box", "shape": "box:0.4x0.5x0.4", "xyz_m": [6, -1.5, 0.8], "ypr_deg": [5, 0, 0],
                 "velocity_mps": [3, 1, 0], "tag": "Other", "aim": 2000, "material": "metal"}
            ],
            "radars": [{"name": "r", "profile": profile.model_dump(), "xyz_m": [0, 0, 1]}],
        }
    )  # fmt: skip
    return srt.trace(scene, profile, rays=1500, max_bounces=3)


def some_of_every_kind(returns: Returns, paths: Paths) -> np.ndarray:
    """Rows of the strongest ten echoes over the same objects in the same order, of either sense."""
    rows = np.flatnonzero(returns.scatterer < 0)
    rows = rows[np.argsort(-np.abs(returns.amplitude[rows]), kind="stable")]
    path = -1 - returns.scatterer[rows]
    reverse = rows - np.count_nonzero(returns.scatterer >= 0) >= len(paths)
    kind = np.column_stack([paths.object_id[path], paths.count[path], paths.radiates[path], reverse])
    number = np.unique(kind, axis=0, return_inverse=True)[1].ravel()
    assert number.max() >= 5  # road and wall, road and box, wall and box; there, back and both
    return np.concatenate([rows[number == n][:10] for n in range(number.max() + 1)])


def image(paths: Paths, row: int, columns: list[int], time: np.ndarray) -> np.ndarray:
    """(..., 3) where the source of a path is at some times, seen in the mirrors of some columns, the last one first."""
    at = paths.source[row] + paths.velocity[row, paths.radiates[row]] * time[..., None]
    for column in columns:
        n = paths.normal[row, column]
        plane = paths.point[row, column] + paths.velocity[row, column] * time[..., None]
        at = at - 2 * ((at - plane) @ n)[..., None] * n
    return at


def image_tones(profile: RadarProfile, returns: Returns, paths: Paths, tx: int, starts: np.ndarray) -> np.ndarray:
    """(n_starts, n_rx, n_samples): every echo over several surfaces, its delay from images in moving mirrors."""
    w = profile.waveform
    t = w.adc_start_s + np.arange(w.samples) / w.sample_rate_hz
    k = w.bandwidth_hz * w.sample_rate_hz / w.samples
    time = np.asarray(starts)[:, None] + t - profile.frame_mid_s
    total = np.zeros((len(starts), profile.n_rx, w.samples), dtype=complex)
    rows = np.flatnonzero(returns.scatterer < 0)
    for k_th, i in enumerate(rows):
        if not returns.amplitude[i]:
            continue
        row = -1 - int(returns.scatterer[i])
        radiates, count = int(paths.radiates[row]), int(paths.count[row])
        sides = [image(paths, row, list(c), time) for c in (reversed(range(radiates)), range(radiates + 1, count))]
        if k_th >= len(paths):  # the reverse path
            sides.reverse()
        there = np.linalg.norm(sides[0] - profile.tx_m[tx], axis=-1)
        for j, rx in enumerate(profile.rx_m):
            tau = (there + np.linalg.norm(sides[1] - rx, axis=-1)) / C
            cycles = w.carrier_hz * tau + k * tau * t - k * tau**2 / 2
            total[:, j] += returns.amplitude[i] * np.exp(2j * np.pi * cycles)
    return total


def image_cube(profile: RadarProfile, returns: Returns, paths: Paths) -> np.ndarray:
    """What the ADC cube holds of the echoes over several surfaces, every multiplexing by its definition."""
    starts = profile.raw_chirp_start_s
    if profile.array.multiplex != "bpm":
        columns = range(profile.n_tx) if profile.array.multiplex == "tdm" else [0] * profile.n_tx
        parts = [image_tones(profile, returns, paths, i, starts[:, c]) for i, c in enumerate(columns)]
        return np.concatenate(parts, axis=1)
    # each chirp of a pair carries both transmitters with the signs of (1, 1), (1, -1)
    shape = (*starts.shape, profile.n_rx, profile.waveform.samples)
    first, second = (image_tones(profile, returns, paths, i, starts.ravel()).reshape(shape) for i in range(2))
    plus, minus = (first + second)[:, 0], (first - second)[:, 1]
    if profile.waveform.adc == "real":
        plus, minus = np.sqrt(2) * plus.real, np.sqrt(2) * minus.real
    return np.concatenate([(plus + minus) / 2, (plus - minus) / 2], axis=1)


@pytest.mark.parametrize("name", PROFILES)
def test_two_plates_are_the_exact_sum_of_image_point_delays(name: str, only_nufft: None) -> None:
    profile = PROFILES[name]()
    hits = corner_of_the_street(profile)
    echoes = srt.illuminate(hits, profile)
    assert hits.paths is not None
    strong = some_of_every_kind(echoes, hits.paths)
    amplitude = np.zeros_like(echoes.amplitude)
    amplitude[strong] = echoes.amplitude[strong]
    kept = replace(echoes, amplitude=amplitude)
    assert echoes.departure is not None
    apart = np.linalg.norm(echoes.departure[strong] - echoes.position[strong], axis=1)
    assert np.max(apart) > 1.0
    exact = image_cube(profile, kept, hits.paths)
    direct = synthesize(kept, profile, noise=None, method="direct").data
    # rounding of 1e4 cycles of carrier phase
    assert relative_error(direct, exact) < 1e-9
    found = synthesize(kept, profile, noise=None, accuracy=1e-6).data
    assert relative_error(found, exact) < 1e-6
    # what both legs in the direction of arrival would give is another cube
    wrong = replace(kept, departure=None, departure_velocity=None)
    assert relative_error(synthesize(wrong, profile, noise=None, method="direct").data, exact) > 0.01
