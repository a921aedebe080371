"""Scenes ``highway`` and ``turning``: folded velocities, a car seen from all sides, posts that stay put."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from contract_tools import FAST, apparent_rcs_dbsm, perturbed, with_chrono
from real_input_tools import lock_on

import shenron_rt as srt

#: Of the turn: 0 to 180 degrees at 20 degrees a second.
TIMES = [0.0, 1.5, 3.0, 4.5, 6.0, 7.5, 9.0]
POSTS = {60: (17.0, 6.0), 61: (20.0, -7.0), 62: (42.0, 5.0)}


# ---- highway
@pytest.mark.parametrize("seed", range(4))
def test_building_at_the_end_of_the_road_folds_to_plus_25_7(seed: int) -> None:
    frame = srt.simulate(perturbed(srt.load_scene("highway"), seed), seed=seed, **FAST)
    table = frame.detections.table
    ahead = table[(table["object_id"] == 50) & (np.abs(table["azimuth"]) < np.radians(10))]
    assert len(ahead)
    # -27.7 m/s + 2 v_max = 25.69; the face spans 4.6 degrees: cos takes 0.09 m/s at most
    assert ahead["velocity"][0] == pytest.approx(25.7, abs=0.2)
    assert ahead["ambiguous"][0]
    # folded, the range is off by the coupling of 2 v_max, 2 * 0.29 bins
    assert ahead["range"][0] == pytest.approx(80.0, abs=frame.cube.range_step_m)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4, 20))
def test_building_folds_for_every_seed(seed: int) -> None:
    test_building_at_the_end_of_the_road_folds_to_plus_25_7(seed)


def _unfolded(seed: int, method: str) -> srt.Frame:
    """Return the last frame of the perturbed scene, velocities unfolded by one of the two methods."""
    scene = perturbed(srt.load_scene("highway"), seed)
    name = {"staggered": "awrl1432_staggered", "two_frame": "awrl1432"}[method]
    profile = srt.load_profile(name, {"processing.ambiguity": method})
    if method == "staggered":
        return srt.simulate(scene, profile, seed=seed, **FAST)
    first = srt.simulate(scene, profile, seed=seed, **FAST)
    return srt.simulate(scene, profile, seed=seed, time=0.1, frame=1, previous=first, **FAST)


@pytest.mark.parametrize("method", ["staggered", "two_frame"])
@pytest.mark.parametrize("seed", range(3))
def test_building_at_the_end_of_the_road_unfolds_to_minus_27_7(seed: int, method: str) -> None:
    frame = _unfolded(seed, method)
    table = frame.detections.table
    ahead = table[(table["object_id"] == 50) & (np.abs(table["azimuth"]) < np.radians(10))]
    # as raw: the face spans 4.6 degrees, cos takes 0.09 m/s at most
    assert ahead["velocity"][0] == pytest.approx(-27.7, abs=0.2)
    assert not ahead["ambiguous"][0]
    # the face stands 80 m away at time 0; its range holds at mid-frame without the half bin of the fold's coupling
    away = 80.0 - 27.7 * (frame.time + frame.profile.frame_mid_s)
    assert ahead["range"][0] == pytest.approx(away, abs=0.1)
    for key, speed in ((101, 22.0 - 27.7), (102, 33.0 - 27.7)):
        row = table[table["object_id"] == key][0]
        assert row["velocity"] == pytest.approx(speed, abs=frame.cube.velocity_step_mps)
        assert not row["ambiguous"]


@pytest.mark.slow
@pytest.mark.parametrize("method", ["staggered", "two_frame"])
@pytest.mark.parametrize("seed", range(3, 20))
def test_building_unfolds_for_every_seed(seed: int, method: str) -> None:
    test_building_at_the_end_of_the_road_unfolds_to_minus_27_7(seed, method)


def test_cars_on_the_highway_are_slow_enough_not_to_fold() -> None:
    frame = srt.simulate(srt.load_scene("highway"), seed=1, **FAST)
    for key, speed in ((101, 22.0 - 27.7), (102, 33.0 - 27.7)):
        row = frame.detections.table[frame.detections.object_id == key][0]
        assert row["velocity"] == pytest.approx(speed, abs=frame.cube.velocity_step_mps)
        assert not row["ambiguous"]


# ---- turning
@lru_cache(maxsize=64)
def turn(time: float, profile: str = "awrl1432", data: Path | None = None) -> srt.Frame:
    scene = srt.load_scene("turning")
    scene = scene if data is None else with_chrono(scene, data)
    return srt.simulate(scene, srt.load_profile(profile), time=time, seed=1, rays=40_000, accuracy=1e-3)


@pytest.mark.parametrize("profile", ["awrl1432", "radarbook"])
@pytest.mark.parametrize("time", TIMES)
def test_turning_car_is_detected_from_every_side(time: float, profile: str) -> None:
    lock = lock_on(turn(time, profile), 101)
    assert 101 in lock.found["object_id"], str(lock)


def test_rcs_of_the_turning_car_stays_inside_published_bands() -> None:
    level = np.array([apparent_rcs_dbsm(turn(t), 101) for t in TIMES])
    # 3GPP TR 38.901 vehicle: mean 11.25, spread 3.41 dB, side lobe 20.8 dBsm; recalled bands: rear 5 to 20, side 20 to
    # 35, oblique 0 to 10 dBsm. Single aspects fade by a few dB, so 0 and 20.8 + 2 * 3.41 bound them.
    assert np.all((level > 0.0) & (level < 27.6)), level
    assert 11.25 - 3.41 < np.median(level) < 11.25 + 3.41, level
    side = level[TIMES.index(4.5)]
    assert side == max(level)


def test_lambda_squared_is_most_of_what_24_ghz_has_over_77_ghz() -> None:
    high, low = (srt.load_profile(n) for n in ("awrl1432", "radarbook"))
    wave = 20 * np.log10(low.wavelength_m / high.wavelength_m)
    assert wave == pytest.approx(10.1, abs=0.1)
    rcs = {p.name: np.median([apparent_rcs_dbsm(turn(t, p.name), 101) for t in TIMES]) for p in (high, low)}
    # What is left when lambda^2 and both budgets are taken out: the car's RCS. Curved metal in the optical region has
    # the same at both bands; glass and paint differ by a few dB. So the car does not vanish at 77 GHz.
    assert abs(rcs["awrl1432"] - rcs["radarbook"]) < 5.0 < wave


def test_chrono_sedan_is_detected_from_most_sides(shared_data: Path) -> None:
    seen = []
    for time in TIMES:
        lock = lock_on(turn(time, "awrl1432", shared_data), 101)
        seen.append(101 in lock.found["object_id"])
        assert seen[-1] or lock.snr_db < 15.0, str(lock)
    assert sum(seen) >= 5, seen


@pytest.mark.parametrize("yaw_rate_deg_s", [0.0, 30.0])
def test_posts_stay_put_while_the_ego_turns(yaw_rate_deg_s: float) -> None:
    scene = srt.load_scene("turning")
    ego = scene.ego.model_copy(update={"yaw_rate_deg_s": yaw_rate_deg_s})
    scene = scene.model_copy(update={"ego": ego, "actors": ()})
    errors = {key: [] for key in POSTS}
    for k in range(-3, 4):
        frame = srt.simulate(scene, time=0.1 * k, frame=k + 3, seed=1, rays=20_000, accuracy=1e-3)
        psi = np.radians(yaw_rate_deg_s) * (0.1 * k + frame.profile.frame_mid_s)
        for key, (px, py) in POSTS.items():
            rows = frame.detections.table[frame.detections.object_id == key]
            assert len(rows), (key, k)
            # where the post really is, seen from the radar on its arm of 2 m
            x, y = px * np.cos(psi) + py * np.sin(psi) - 2.0, py * np.cos(psi) - px * np.sin(psi)
            distance, azimuth = np.hypot(x, y), np.arctan2(y, x)
            errors[key].append((rows["range"][0] - distance, np.sin(rows["azimuth"][0]) - np.sin(azimuth)))
            # the arm moves across: range rate = -(omega x arm) . u
            assert rows["velocity"][0] == pytest.approx(
                -np.radians(yaw_rate_deg_s) * 2.0 * np.sin(azimuth), abs=frame.cube.velocity_step_mps
            )
    for key, rows in errors.items():
        off = np.abs(np.array(rows))
        assert off[:, 0].max() < 0.375, key  # a range bin
        assert off[:, 1].max() < 1 / 6, key  # half a beam, 2/M
        # a lag of one frame would be 30 deg/s * 0.1 s = 0.052 in sine, with one sign
        assert abs(np.mean([r[1] for r in rows])) < 0.02, key
