"""The chain in one call: which radar and profile are used, what time and seed mean, that truth comes out at the end."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import shenron_rt as srt

AHEAD: dict[str, Any] = {"id": 900, "xyz_m": (30.0, 0.0, 1.0), "rcs_dbsm": 20.0}
WALL: dict[str, Any] = {"shape": "box:1x40x6", "xyz_m": (40.5, 0, 2), "tag": "Walls", "material": "concrete"}


def scene_of(**fields: Any) -> srt.Scene:
    """Return a scene of one point target unless told otherwise."""
    return srt.Scene(**{"point_targets": [AHEAD], **fields})


def simulate(scene: srt.Scene, *args: Any, **options: Any) -> srt.Frame:
    return srt.simulate(scene, *args, **{"rays": 500, **options})


def moving(velocity: tuple[float, float, float], xyz: tuple[float, float, float], **more: Any) -> srt.Scene:
    target = {"id": 900, "xyz_m": xyz, "velocity_mps": velocity, "rcs_dbsm": 30.0}
    mount = {"name": "front", "profile": more.pop("profile", "awrl1432"), "xyz_m": (0, 0, 0)}
    return srt.Scene(point_targets=[target], radars=[mount], **more)


# ---- which radar
TWO = [{"name": "front", "xyz_m": (2.0, 0, 1.0)}, {"name": "rear", "xyz_m": (-2.0, 0, 1.0), "ypr_deg": (180, 0, 0)}]


def test_the_only_radar_is_used_with_its_profile_and_mount() -> None:
    frame = simulate(scene_of(radars=[{"name": "bumper", "profile": "radarbook", "xyz_m": (3.0, 0, 1.0)}]), noise=None)
    assert frame.radar == "bumper"
    assert frame.profile == frame.adc.profile == frame.cube.profile == srt.load_profile("radarbook")
    assert frame.detections.range[0] == pytest.approx(27.0, abs=0.01)


def test_several_radars_and_none_named_is_refused_with_their_names() -> None:
    with pytest.raises(ValueError, match=r"front.*rear"):
        simulate(scene_of(radars=TWO))
    with pytest.raises(srt.InputError, match="side"):
        simulate(scene_of(radars=TWO), radar="side")


def test_simulate_all_renders_every_radar_as_simulate_does() -> None:
    scene = scene_of(radars=TWO)
    frames = srt.simulate_all(scene, rays=500)
    assert list(frames) == ["front", "rear"]
    assert frames["front"].scatterers.position[0] == pytest.approx([28, 0, 0])
    assert frames["rear"].scatterers.position[0] == pytest.approx([-32, 0, 0])
    alone = simulate(scene, radar="rear")
    assert np.array_equal(alone.adc.data, frames["rear"].adc.data)
    # the noise of two radars is independent
    front, rear = (frames[k].adc.data - simulate(scene, radar=k, noise=None).adc.data for k in frames)
    share = abs(np.vdot(front, rear)) / (np.linalg.norm(front) * np.linalg.norm(rear))
    assert share < 5 / math.sqrt(front.size)  # 5 sigma of a correlation


def test_a_given_profile_replaces_the_radars_and_keeps_the_mount() -> None:
    scene = scene_of(radars=[{"name": "bumper", "profile": "radarbook", "xyz_m": (3.0, 0, 1.0)}])
    profile = srt.load_profile("awrl1432_137mhz")
    frame = simulate(scene, profile, noise=None)
    assert frame.profile == frame.adc.profile == frame.cube.profile == profile
    assert frame.adc.data.shape == (128, 6, 256)
    assert frame.scatterers.position[0] == pytest.approx([27, 0, 0])


def test_a_given_mount_replaces_the_pose_alone() -> None:
    scene = scene_of(radars=TWO)
    frame = simulate(scene, radar="rear", mount=srt.Pose(xyz=(10.0, 0, 1.0), ypr_deg=(10.0, 0, 0)), noise=None)
    assert frame.radar == "rear"
    # yaw + left: what stands ahead appears to the right
    assert frame.scatterers.position[0] == pytest.approx(
        20 * np.array([math.cos(math.radians(10)), -math.sin(math.radians(10)), 0])
    )
    assert scene.radar("rear").xyz_m == (-2.0, 0, 1.0)


def test_the_profiles_processing_is_used() -> None:
    profile = srt.load_profile("awrl1432")
    changed = {"range_window": "blackmanharris", "doppler_window": "rect", "blanking_m": 29.0}
    other = profile.model_copy(update={"processing": profile.processing.model_copy(update=changed)})
    frame = simulate(scene_of(), other)
    assert (frame.cube.range_window, frame.cube.doppler_window) == ("blackmanharris", "rect")
    assert 900 not in frame.detections.object_id  # at 28 m, blanked


def test_something_that_is_no_scene_is_refused_by_name() -> None:
    with pytest.raises(srt.InputError, match="a Scene is needed, got str"):
        simulate("braking")  # type: ignore[arg-type]


# ---- time, motion, truth
@pytest.mark.parametrize("profile", ["awrl1432", "awrl1432_137mhz", "awrl1432boost", "radarbook2"])
@pytest.mark.parametrize("share", [-0.7, 0.4])
def test_a_moving_target_is_found_at_its_range_velocity_and_azimuth(profile: str, share: float) -> None:
    radar = srt.load_profile(profile)
    speed, azimuth = share * radar.max_velocity_mps, np.radians(-20.0)
    u = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    middle = 40.0 * u - speed * u * radar.frame_mid_s  # at mid-frame it is 40 m away
    frame = simulate(moving(tuple(speed * u), tuple(middle), profile=profile), noise=None)
    assert frame.scatterers.range_rate[0] == pytest.approx(speed, rel=1e-12)
    found = frame.detections
    assert found.object_id[0] == 900
    assert not found.ambiguous[0]
    # the estimates of a noiseless target: hundredths of a bin
    assert found.range[0] == pytest.approx(40.0, abs=0.02 * radar.range_resolution_m)
    assert found.velocity[0] == pytest.approx(speed, abs=0.02 * radar.velocity_resolution_mps)
    assert math.degrees(found.azimuth[0]) == pytest.approx(-20.0, abs=0.1)


def test_a_velocity_beyond_the_unambiguous_one_is_folded_and_flagged() -> None:
    # a building passed at 100 km/h: -27.78 folds by 2 v_max = 53.35 m/s to +25.6
    radar = srt.load_profile("awrl1432")
    frame = simulate(moving((0, 0, 0), (50.0, 0, 0), ego={"velocity_mps": (100 / 3.6, 0, 0)}), noise=None)
    assert frame.scatterers.range_rate[0] == pytest.approx(-100 / 3.6)
    found = frame.detections
    assert found.object_id[0] == 900
    assert found.velocity[0] == pytest.approx(2 * radar.max_velocity_mps - 100 / 3.6, abs=0.2)
    assert found.ambiguous[0]
    # its range is corrected with the folded velocity: off by the coupling c 2 v_max / (2 k) x 2 f_c / c
    slip = 2 * radar.max_velocity_mps * radar.center_hz / radar.slope_hz_per_s
    at_mid = 50.0 - 100 / 3.6 * radar.frame_mid_s
    assert found.range[0] == pytest.approx(at_mid - slip, abs=0.02)


def test_time_is_that_of_the_first_chirp_and_positions_those_of_mid_frame() -> None:
    scene = moving((10.0, 0, 0), (30.0, 0, 0), ego={"velocity_mps": (4.0, 0, 0)})
    for time in (0.0, 2.5):
        frame = simulate(scene, time=time, noise=None)
        assert frame.time == time
        want = 30.0 + 6.0 * (time + frame.profile.frame_mid_s)
        assert frame.scatterers.position[0, 0] == pytest.approx(want, rel=1e-12)
        assert frame.detections.range[0] == pytest.approx(want, abs=0.01)


def test_actors_and_ego_stand_where_they_are_at_the_frames_own_time() -> None:
    # a post stays put while the ego turns at 30 deg/s: its bearing turns the other way
    post = {"shape": "box:0.4x0.4x2", "xyz_m": (20.0, 0, 1.0), "tag": "Poles", "material": "metal", "id": 7}
    scene = srt.Scene(
        static=[post], ego={"yaw_rate_deg_s": 30.0}, radars=[{"name": "r", "xyz_m": (0, 0, 1.0)}], point_targets=[]
    )
    for time in (0.0, 0.5):
        frame = simulate(scene, time=time, rays=20_000)
        bearing = np.degrees(np.arctan2(frame.scatterers.position[:, 1], frame.scatterers.position[:, 0]))
        want = -30.0 * (time + frame.profile.frame_mid_s)
        assert bearing.mean() == pytest.approx(want, abs=0.6)  # half the post's width, 0.2 m at 20 m
        assert np.abs(frame.scatterers.range_rate).max() < 1e-9


# ---- weather, nothing, one thing
def test_a_scene_without_weather_has_no_attenuation() -> None:
    frame = simulate(scene_of(), noise=None)
    assert frame.scatterers.weather is None
    dry = simulate(scene_of(weather={}), noise=None)
    assert abs(dry.returns.amplitude[0]) < abs(frame.returns.amplitude[0])


def test_an_empty_scene_is_noise_alone() -> None:
    frame = simulate(srt.Scene(), seed=5)
    assert len(frame.scatterers) == len(frame.returns) == 0
    x = frame.adc.data
    # 98304 complex samples: 5 sigma of their mean power is 1.6 %
    assert np.mean(np.abs(x) ** 2) == pytest.approx(frame.profile.noise_power_w, rel=0.016)
    assert np.all(frame.detections.object_id == -1)
    silent = simulate(srt.Scene(), noise=None)
    assert not np.any(silent.adc.data)
    assert len(silent.detections) == 0


@pytest.mark.parametrize("profile", ["awrl1432boost", "radarbook2", "ti_cascade"])
def test_an_empty_scene_passes_through_every_kind_of_multiplexing(profile: str) -> None:
    silent = simulate(srt.Scene(radars=[{"name": "r", "profile": profile}]), noise=None)
    assert len(silent.detections) == 0
    assert not np.any(silent.cube.range_doppler)


def test_a_point_target_needs_no_mesh() -> None:
    frame = simulate(scene_of())
    assert len(frame.scatterers) == 1
    assert frame.scatterers.rcs is not None
    assert frame.scatterers.rcs[0] == pytest.approx(100.0)
    assert frame.detections.object_id[0] == 900
    assert frame.detections.tag[0] == int(srt.SemanticTag.Other)


def test_a_point_target_behind_a_wall_is_hidden_and_one_before_it_is_not() -> None:
    behind = {**AHEAD, "id": 901, "xyz_m": (60.0, 0.0, 1.0)}
    frame = simulate(scene_of(point_targets=[AHEAD, behind], static=[WALL]), rays=2000)
    assert 900 in frame.scatterers.object_id
    assert 901 not in frame.scatterers.object_id


def test_a_target_behind_the_radar_sends_next_to_nothing() -> None:
    ahead, behind = (
        simulate(scene_of(point_targets=[{**AHEAD, "xyz_m": (x, 0.0, 1.0)}]), noise=None) for x in (32.0, -28.0)
    )
    ratio = np.sum(np.abs(behind.returns.amplitude) ** 2) / np.sum(np.abs(ahead.returns.amplitude) ** 2)
    assert ratio < 1e-4  # the pattern is below -40 dB two-way there


# ---- seeds and frames
def test_the_seed_is_the_scenes_unless_given_and_zero_is_its_default() -> None:
    assert simulate(scene_of()).seed == 0
    own = simulate(scene_of(seed=11))
    assert own.seed == own.adc.seed == own.scatterers.seed == 11
    given = simulate(scene_of(), seed=11)
    assert given.seed == 11
    assert np.array_equal(own.adc.data, given.adc.data)
    assert not np.array_equal(own.adc.data, simulate(scene_of(), seed=12).adc.data)


def test_frames_differ_and_each_is_reproducible() -> None:
    scene = scene_of(static=[WALL])
    first, second, again = (simulate(scene, frame=k, rays=2000) for k in (0, 1, 0))
    assert (first.frame, second.frame) == (0, 1)
    assert np.array_equal(first.adc.data, again.adc.data)
    assert first.detections.table.tobytes() == again.detections.table.tobytes()  # elevation is NaN
    assert not np.array_equal(first.adc.data, second.adc.data)
    assert not np.array_equal(first.scatterers.speckle[:50], second.scatterers.speckle[:50])
    assert not np.array_equal(first.scatterers.position[:50], second.scatterers.position[:50])


def test_the_stages_one_by_one_are_the_whole() -> None:
    scene, profile = scene_of(static=[WALL], seed=4), srt.load_profile("awrl1432")
    whole = simulate(scene, frame=2, rays=2000)
    scatterers = srt.trace(scene, profile, frame=2, rays=2000)
    echoes = srt.illuminate(scatterers, profile)
    adc = srt.synthesize(echoes, profile, seed=4, frame=2, radar="radar")
    found = srt.detect(srt.process(adc))
    assert np.array_equal(adc.data, whole.adc.data)
    assert found.table.tobytes() == whole.detections.table.tobytes()


def test_background_leaves_a_target_as_it_was() -> None:
    # one bounce and no occlusion: neither the rays of an aimed target nor its seeds know of anything else
    ball = {"id": 5, "shape": "sphere:r=0.2,edge=0.01", "material": "metal", "tag": "Other", "aim": 2000}
    ball["xyz_m"] = (20, 0, 1)
    alone, crowded = (
        simulate(srt.Scene(actors=[ball], static=static), rays=2000, noise=None) for static in ([], [WALL])
    )
    p, q = (f.returns.power_by_object()[5] for f in (alone, crowded))
    assert q == pytest.approx(p, rel=1e-9)
    own = crowded.scatterers.object_id == 5
    assert np.array_equal(alone.scatterers.position, crowded.scatterers.position[own])
    assert not own.all()
