"""Scenes ``tree_wall`` and ``clear_road``, side lobes as ghosts, blanking: what stands beside the car on the map."""

from __future__ import annotations

import numpy as np
import pytest
from contract_tools import FAST, db, is_the_car, perturbed, strongest_cell, twin

import shenron_rt as srt
from shenron_rt.dsp import noise_threshold

TREES = range(70, 79)


# ---- tree wall
def tree_frame(seed: int, profile: srt.RadarProfile | None = None) -> srt.Frame:
    return srt.simulate(perturbed(srt.load_scene("tree_wall"), seed), profile, seed=seed, **FAST)


@pytest.mark.parametrize("seed", range(4))
def test_tree_wall_does_not_mask_the_car(seed: int) -> None:
    frame = tree_frame(seed)
    car = frame.detections.table[frame.detections.object_id == 101]
    assert len(car)
    assert is_the_car(strongest_cell(frame, far_deg=15.0), frame)
    found = frame.detections.table
    trees = found[np.isin(found["object_id"], TREES)]
    # no cell of a crown comes within 3 dB of the car's
    assert car["power"].max() > 2 * trees["power"].max(initial=0.0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4, 20))
def test_tree_wall_does_not_mask_the_car_for_any_seed(seed: int) -> None:
    test_tree_wall_does_not_mask_the_car(seed)


def test_elevation_pattern_puts_the_trees_below_the_car() -> None:
    scene = srt.load_scene("tree_wall")
    ratio = {}
    for name, profile in (("pattern", twin()), ("none", twin(beamwidth_el_deg=360))):
        power = srt.illuminate(srt.trace(scene, profile, seed=1, rays=60_000), profile).power_by_object()
        ratio[name] = float(db(sum(power.get(k, 0.0) for k in TREES) / power[101]))
    assert ratio["pattern"] < 0.0
    assert ratio["none"] > 3.0  # all trees together would be louder than the car
    assert ratio["none"] > ratio["pattern"] + 5.0


# ---- clear road
def quiet_cells(frame: srt.Frame) -> np.ndarray:
    """Mask range-Doppler cells that the road, with its side lobes, fills to less than a hundredth of the noise."""
    clean = srt.process(srt.synthesize(frame.returns, frame.profile, noise=None, accuracy=1e-4))
    return clean.range_doppler < 0.01 * frame.cube.noise_power_w


def false_alarms(frames: range) -> tuple[int, int]:
    """Return cells above the threshold and cells looked at, away from the road's echo."""
    scene, hits, cells = srt.load_scene("clear_road"), 0, 0
    for k in frames:
        frame = srt.simulate(scene, frame=k, rays=30_000, accuracy=1e-3)
        quiet = quiet_cells(frame)
        above = frame.cube.range_doppler > noise_threshold(frame.cube, pfa=frame.profile.processing.pfa)
        hits, cells = hits + int((above & quiet).sum()), cells + int(quiet.sum())
    return hits, cells


@pytest.mark.parametrize("frames", [pytest.param(range(8)), pytest.param(range(8, 68), marks=pytest.mark.slow)])
def test_false_alarms_on_the_clear_road_are_those_designed(frames: range) -> None:
    hits, cells = false_alarms(frames)
    assert cells > 0.9 * 256 * 64 * len(frames)
    expected = 1e-3 * cells
    # windows correlate cells: the number of hits varies 1.6 times as much as binomial; road in the training ring of
    # cells at the rim of the quiet part can only raise the threshold
    assert hits == pytest.approx(expected, abs=3 * np.sqrt(1.6 * expected))


def test_road_stays_on_its_own_doppler_ridge() -> None:
    frame = srt.simulate(srt.load_scene("clear_road"), seed=3, **FAST)
    road = frame.detections.table[frame.detections.object_id == 0]
    assert len(road) >= 3
    expected = -15.0 * np.cos(road["azimuth"]) * np.cos(np.arcsin(np.minimum(1.0 / road["range"], 1.0)))
    # extended in azimuth, so the fitted angle and Doppler need not be one patch's: two beams of six channels
    slack = 15.0 * np.abs(np.sin(road["azimuth"])) * 0.33 + 15.0 * 0.33**2 / 2 + frame.cube.velocity_step_mps
    assert np.all(np.abs(road["velocity"] - expected) < slack)


# ---- side lobes and blanking
def broadside(**processing: object) -> srt.Frame:
    """Return a car seen flat from the side at 8 m in open space: an echo 60 dB over the noise of a cell."""
    keys = {f"processing.{k}": v for k, v in processing.items()}
    profile = srt.load_profile("awrl1432", keys)
    wall = {"id": 7, "name": "trailer", "shape": "box:6x2.5x3", "xyz_m": (9.25, 0, 1.5), "ypr_deg": (90, 0, 0)}
    wall |= {"tag": "Truck", "material": "metal", "velocity_mps": (3, 0, 0), "aim": 5000}
    scene = srt.Scene(actors=[wall], radars=[{"name": "front", "xyz_m": (0, 0, 1.0)}])
    return srt.simulate(scene, profile, seed=2, rays=5_000)


def test_side_lobes_of_a_trailer_reach_along_its_azimuth_with_hann_alone() -> None:
    tail, ghosts = {}, {}
    for window in ("hann", "blackmanharris"):
        frame = broadside(range_window=window, doppler_window=window)
        cube = frame.cube
        row, column = np.unravel_index(cube.range_azimuth.argmax(), cube.range_azimuth.shape)
        # the flat side returns from one point at 8 m; the main lobe of Blackman-Harris ends 4 bins off, and what lies
        # 4 to 30 bins behind is lobes and noise
        far = slice(row + 4, row + 30)
        noise = cube.noise_power_w / cube.profile.n_virtual
        tail[window] = float(db(cube.range_azimuth[far, column].max() / noise))
        above = srt.detect(cube, cfar="os").table
        behind = (above["range"] > cube.range_m[row + 4]) & (above["snr_db"] > 15)
        ghosts[window] = int(behind.sum())
    # Hann's second lobe is 41 dB down: 61 dB leave 20, less what straddling takes
    assert tail["hann"] > 16.0, tail
    assert tail["blackmanharris"] < 14.0, tail  # the largest of 26 x 64 noise cells is 10 log10 ln 1664 = 8.7 dB
    assert ghosts["blackmanharris"] == 0


def test_blanking_takes_what_is_nearer_than_two_metres() -> None:
    near = {"id": 5, "xyz_m": (3.2, 0, 1.0), "rcs_dbsm": -10.0}
    car = {"id": 6, "xyz_m": (27.0, 0, 1.0), "rcs_dbsm": 10.0}
    scene = srt.Scene(point_targets=[near, car])
    seen = srt.simulate(scene, seed=1).detections
    assert seen.object_id[0] == 5
    assert seen.range[0] == pytest.approx(1.2, abs=0.1)
    blanked = srt.simulate(scene, srt.load_profile("awrl1432", {"processing.blanking_m": 2.0}), seed=1).detections
    assert blanked.range.min() > 1.8
    assert blanked.object_id[0] == 6
