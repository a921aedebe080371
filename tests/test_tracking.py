"""Tracks of simulated sequences: one identity through all frames, in the world, whatever the ego does."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import shenron_rt as srt
from shenron_rt.cli import main
from shenron_rt.dsp import DETECTION_DTYPE, Detections
from shenron_rt.objects import Observation, Tracking, observe_frame, observe_run, track
from shenron_rt.objects.observe import radar_state, truths_of
from shenron_rt.objects.track import TRACK_COLUMNS
from shenron_rt.runs import verify_manifest

PERIOD_S = 0.1


def _street(**options: object) -> srt.Scene:
    """Return the scene ``braking`` at constant velocities: the gap closes from 25 m to 7 m in 9 s between the walls."""
    wall = {"shape": "box:80x0.3x3", "tag": "Walls", "material": "concrete"}
    return srt.Scene(
        seed=7,
        ego={"velocity_mps": (15, 0, 0)},
        static=[
            {"name": "road", "shape": "ground:220x40", "xyz_m": (116, 0, 0), "tag": "Roads", "material": "asphalt"},
            wall | {"name": "left_wall", "xyz_m": (43, 4.15, 1.5), "id": 40},
            wall | {"name": "right_wall", "xyz_m": (43, -4.15, 1.5), "id": 41},
        ],
        actors=[
            {"id": 101, "name": "lead", "shape": "car", "xyz_m": (29.25, 0, 0), "velocity_mps": (13, 0, 0), "aim": 2000}
        ],
        radars=[{"name": "front", "profile": "awrl1432", "xyz_m": (2, 0, 1)}],
        **options,
    )


def _observed(scene: srt.Scene, frames: int, rays: int) -> list[Observation]:
    return [
        observe_frame(srt.simulate(scene, frame=k, time=PERIOD_S * k, rays=rays, accuracy=1e-3), scene)
        for k in range(frames)
    ]


def _check_lead(found: Tracking, seen: list[Observation]) -> None:
    """Check one identity from the fourth frame on, at the car's tail, with its velocity."""
    late = found.identity.truths - found.identity.matches
    assert late == 3  # confirmed with the fourth hit, and never lost
    assert (found.identity.switches, found.identity.fragmentations, found.identity.false_tracks) == (0, 0, 0)
    assert len(found.tracks_of[101]) == 1
    resolution = seen[0].profile.range_resolution_m
    (number,) = found.tracks_of[101]
    mine = {r.frame: r for r in found.rows if r.track == number}
    for o in seen[10:]:
        tail = 29.25 - 2.25 + 13 * o.time_s
        # the middle of the echoes lies on the tail, up to the bumper's curve: one cell; across, half a beam at most
        assert mine[o.frame].x_m == pytest.approx(tail, abs=resolution)
        assert abs(mine[o.frame].y_m) < 1.0
        assert mine[o.frame].vx_mps == pytest.approx(13, abs=0.5)
        assert not mine[o.frame].coasting
        assert mine[o.frame].object_id == 101
    # three frames without a track cost the cutoff, the others next to nothing
    assert found.mean_ospa_m < (3 * found.cutoff_m + len(seen) * 0.25) / len(seen)


def test_the_car_of_braking_is_one_track_from_its_fourth_frame_on() -> None:
    seen = _observed(_street(), 16, 3000)
    _check_lead(track(seen), seen)


@pytest.mark.slow
def test_the_car_of_braking_is_one_track_over_ninety_frames() -> None:
    seen = _observed(_street(), 90, 20_000)
    assert all(o.truths[101].snr_db > 16 for o in seen)  # the link budget allows every one of them
    found = track(seen)
    assert found.identity.truths == 90
    _check_lead(found, seen)


@pytest.mark.slow
def test_the_car_of_the_bundled_scene_is_one_track_as_long_as_it_moves(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--frames", "0:90", "--rays", "30000", "--accuracy", "1e-3", "--no-pictures", "--json"]
    run = ["run", "braking", *words, "--write", "detections,returns,maps", "-o", str(tmp_path / "run")]
    assert main(run) == 0
    capsys.readouterr()
    assert main(["track", str(tmp_path / "run"), "-o", str(tmp_path / "tracks"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    # it brakes with 1.25 m/s^2 from 10 m/s at 1 s on, and is slower than 1 m/s from 8.2 s on: frames 0 to 81
    assert told["truths"] == 82
    assert told["misses"] == 3  # confirmed with the fourth hit
    assert (told["switches"], told["fragmentations"], told["false_tracks"]) == (0, 0, 0)
    assert told["tracks_of"] == {"101": [1]}
    # three frames without a track cost the cutoff; the others less than two thirds of a range cell
    assert told["ospa_m"] < (3 * told["ospa_cutoff_m"] + 82 * 0.25) / 90


def test_truth_has_the_velocity_over_ground_whatever_the_ego_does() -> None:
    scene = srt.Scene(
        ego={"velocity_mps": (8, 0, 0), "yaw_rate_deg_s": 30},
        point_targets=[{"id": 5, "xyz_m": (40, 6, 1), "velocity_mps": (-3, 2, 0), "rcs_dbsm": 10}],
    )
    frame = srt.simulate(scene, time=0.7)
    middle = 0.7 + frame.profile.frame_mid_s
    truth = truths_of(frame.returns, frame.cube, radar_state(scene, "radar", middle), [5])[5]
    assert truth.position == pytest.approx(np.array([40, 6, 1]) + middle * np.array([-3, 2, 0]), abs=1e-9)
    assert truth.velocity == pytest.approx([-3, 2, 0], abs=1e-9)


def _posts(yaw_rate: float, frames: int) -> list[Observation]:
    """Return what an ego in a steady turn detects of two posts, without noise or error."""
    scene = srt.Scene(ego={"velocity_mps": (8, 0, 0), "yaw_rate_deg_s": yaw_rate})
    profile = srt.load_profile("awrl1432")
    observations = []
    for k in range(frames):
        eye = radar_state(scene, "radar", PERIOD_S * k)
        local = (np.array([[30.0, 3.0, 1.0], [34.0, 12.0, 1.0]]) - eye.origin) @ eye.rotation
        distance = np.linalg.norm(local, axis=1)
        table = np.zeros(2, dtype=DETECTION_DTYPE)
        table["x"], table["y"], table["z"] = local.T
        table["range"], table["azimuth"] = distance, np.arctan2(local[:, 1], local[:, 0])
        table["velocity"] = -(local / distance[:, None]) @ (eye.rotation.T @ eye.velocity)
        table["power"], table["object_id"] = 1.0, [1, 2]
        observations.append(Observation(k, PERIOD_S * k, Detections(table), eye, profile))
    return observations


@pytest.mark.parametrize("yaw_rate", [0.0, 30.0])
def test_standing_posts_stand_still_while_the_ego_turns(yaw_rate: float) -> None:
    found = track(_posts(yaw_rate, 12), min_speed_mps=0.0)
    for r in (r for r in found.rows if r.frame >= 6):
        post = np.array([[30.0, 3.0], [34.0, 12.0]])[r.object_id - 1]
        # exact measurements: what is left is rounding
        assert (r.x_m, r.y_m) == pytest.approx(tuple(post), abs=1e-6)
        assert (r.vx_mps, r.vy_mps) == pytest.approx((0, 0), abs=1e-6)
    assert {r.object_id for r in found.rows} == {1, 2}


def test_what_stands_is_left_out_unless_it_is_asked_for() -> None:
    assert track(_posts(30.0, 12)).rows == ()


# ---- command line
SCENE = """\
version: 1
seed: 3
frame_period_s: 0.1
ego: {velocity_mps: [10, 0, 0]}
point_targets:
  - {id: 7, name: drone, xyz_m: [40, 3, 1], velocity_mps: [4, 0, 0], rcs_dbsm: 20}
radars:
  - {name: front, profile: awrl1432}
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("track")
    (folder / "street.yaml").write_text(SCENE)
    options = ["--rays", "100", "--no-pictures", "--frames", "0:8", "-o", str(folder / "run")]
    assert main(["run", str(folder / "street.yaml"), *options]) == 0
    return folder / "run"


def test_track_writes_tracks_and_metrics(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    out = tmp_path / "tracks"
    assert main(["track", str(run), "-o", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == json.loads((out / "tracks.json").read_text())
    assert (told["truths"], told["switches"], told["tracks_of"]) == (8, 0, {"7": [1]})
    rows = list(csv.DictReader((out / "tracks.csv").read_text().splitlines()))
    assert tuple(rows[0]) == TRACK_COLUMNS
    assert [int(r["frame"]) for r in rows if r["track"] == "1"] == [3, 4, 5, 6, 7]
    last = rows[-1]
    # mid-frame of the last frame; 4 m/s along x
    assert float(last["x_m"]) == pytest.approx(40 + 4 * float(last["time_s"]), abs=0.2)
    assert float(last["vx_mps"]) == pytest.approx(4, abs=0.3)
    assert (out / "tracks.png").read_bytes().startswith(b"\x89PNG")
    assert verify_manifest(out) == []


def test_track_prints_what_each_track_follows(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert main(["track", str(run), "-o", str(tmp_path / "tracks")]) == 0
    out = capsys.readouterr().out
    assert "drone" in out
    assert "ospa_m" in out
    assert main(["track", str(run), "-o", str(tmp_path / "tracks")]) == 2  # not empty


def test_a_lean_run_is_tracked_as_the_whole_one_and_a_leaner_says_what_it_needs(run: Path, tmp_path: Path) -> None:
    again = ["run", str(run / "config.yaml"), "--no-pictures", "-o"]
    assert main([*again, str(tmp_path / "lean"), "--write", "detections,returns,maps"]) == 0
    assert main(["track", str(tmp_path / "lean"), "-o", str(tmp_path / "a")]) == 0
    assert main(["track", str(run), "-o", str(tmp_path / "b")]) == 0
    for name in ("tracks.csv", "tracks.json"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    assert main([*again, str(tmp_path / "leaner"), "--write", "detections,maps"]) == 0
    with pytest.raises(srt.InputError, match=r"kept no returns\.npz, .* --write detections,returns,maps"):
        list(observe_run(tmp_path / "leaner"))


def test_a_run_without_a_scene_is_refused(run: Path, tmp_path: Path) -> None:
    adc = run / "radars" / "front" / "frame_000000" / "adc.npz"
    assert main(["process", str(adc), "-o", str(tmp_path / "again"), "--no-pictures"]) == 0
    with pytest.raises(srt.InputError, match="not rendered from a scene"):
        list(observe_run(tmp_path / "again"))
    with pytest.raises(srt.InputError, match="no radar 'rear' in this run; it has front"):
        list(observe_run(run, radar="rear"))
