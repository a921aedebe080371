"""Verdicts on objects that a radar does and does not see: folded, masked, blanked, hidden, ghosts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from explain_reasons import FAST, GANTRY, WALKER, made_scene
from explain_tools import two_points

import shenron_rt as srt
from shenron_rt.chains import Chains
from shenron_rt.config.profile import load_profile


def test_a_folded_velocity_that_shares_anothers_cell_is_ambiguous_in_doppler() -> None:
    slow = load_profile("awrl1432", {"waveform.samples": 128})  # half the ramp leaves room for faster chirps
    folds = 2 * slow.max_velocity_mps
    scene = two_points(
        slow, {"velocity_mps": (-5 - folds, 0, 0), "rcs_dbsm": 5}, {"velocity_mps": (-5, 0, 0), "rcs_dbsm": 35}
    )
    found = srt.explain(srt.simulate(scene), scene=scene).frames[0].of(1).verdict
    assert found.name == "ambiguous in Doppler"
    assert found.by == "two"
    assert found.numbers["true_velocity_mps"] == pytest.approx(-5 - folds, abs=0.01)
    assert "tried, it is detected" in found.change


def test_two_objects_in_one_cell_mask_each_other_without_any_folding() -> None:
    profile = load_profile("awrl1432")
    scene = two_points(profile, {"velocity_mps": (-5, 0, 0)}, {"velocity_mps": (-5.3, 0, 0), "rcs_dbsm": 30})
    found = srt.explain(srt.simulate(scene), scene=scene).frames[0].of(1).verdict
    assert found.name == "masked"
    assert "shares its cell" in found.text


def test_an_object_nearer_than_the_processing_looks_is_blanked() -> None:
    profile = load_profile("awrl1432", {"processing.blanking_m": 10.0})
    scene = two_points(profile, {"xyz_m": (8, 0, 1)}, {})
    frame = srt.explain(srt.simulate(scene), scene=scene).frames[0]
    assert frame.of(1).verdict.name == "blanked"
    assert frame.of(2).verdict.name == "detected"


def test_an_object_behind_the_radar_that_no_ray_meets_is_outside_the_beam() -> None:
    actors = [
        {"id": 1, "name": "follower", "shape": "box:4x2x2", "xyz_m": (-8, 0, 1), "material": "metal", "tag": "Car"}
    ]
    scene = srt.Scene(actors=actors, radars=[{"xyz_m": (2, 0, 1)}])
    frame = srt.explain(srt.simulate(scene, **FAST), scene=scene).frames[0]
    assert frame.of(1).rows == 0
    assert frame.of(1).verdict.name == "outside the beam"
    assert "turn the radar 180 deg" in frame.of(1).verdict.change


def test_without_a_scene_what_no_ray_met_is_absent() -> None:
    scene = made_scene()
    frame = srt.simulate(scene, **FAST)
    found = srt.explain(frame).frames[0]
    assert WALKER not in {o.object_id for o in found.objects}  # nothing in the frame's own data tells of it
    assert found.of(GANTRY).verdict.name == "below noise"  # and what the pattern takes cannot be told from range


def _with_a_ghost(*, all_of_it: bool = False) -> srt.Frame:
    """Return a frame of two points of one id, of which the farther, or both, came by way of object 40."""
    scene = two_points(load_profile("awrl1432"), {}, {"xyz_m": (45, 0, 1), "rcs_dbsm": 15})
    frame = srt.simulate(scene)
    ghost = (frame.returns.object_id == 2) | all_of_it
    returns = replace(
        frame.returns,
        object_id=np.full(2, 7, dtype=np.uint32),
        bounces=np.where(ghost, 2, 1).astype(np.uint8),
        chains=Chains(np.array([[7, -1], [40, 7]]), ghost.astype(np.int32), ghost),
    )
    cube = replace(frame.cube, returns=returns)
    return replace(frame, returns=returns, cube=cube, detections=srt.detect(cube))


def test_a_ghost_is_labelled_with_its_chain_and_is_a_part_of_its_own() -> None:
    found = srt.explain(_with_a_ghost()).frames[0].of(7)
    assert sorted(found.labels) == ["direct", "ghost 40>7"]
    assert found.verdict.name == "detected"
    assert found.cell is not None
    assert found.cell.range_m == pytest.approx(28, abs=0.4)  # the card shows the object, not its stronger ghost
    assert "ghost of object 7" in {s.name for s in found.shares}
    # and its power is its own: 0 dBsm at 28 m
    assert found.waterfall is not None
    assert {s.name: s.gain_db for s in found.waterfall.stages}["apparent cross section"] == pytest.approx(0, abs=0.01)


def test_an_object_seen_only_as_its_ghost_is_not_detected() -> None:
    found = srt.explain(_with_a_ghost(all_of_it=True)).frames[0].of(7)
    assert found.verdict.name != "detected"
    assert "seen only elsewhere, as ghost 40>7" in found.verdict.text


def test_a_folded_detection_is_labelled_with_its_verdict() -> None:
    profile = load_profile("awrl1432")
    scene = two_points(
        profile, {"velocity_mps": (-profile.max_velocity_mps - 1, 0, 0)}, {"xyz_m": (45, 0, 1), "rcs_dbsm": 15}
    )
    found = srt.explain(srt.simulate(scene), scene=scene).frames[0].of(1)
    assert found.verdict.text == "detected (direct, folded)"
    assert found.cell is not None
    assert found.cell.velocity_mps > 0 > found.velocity_mps


def test_what_is_wholly_hidden_is_occluded_even_where_it_would_be_too_weak_alone() -> None:
    wall = {"name": "wall", "shape": "wall:8x3", "xyz_m": (15, 0, 0), "ypr_deg": (90, 0, 0), "tag": "Walls"}
    person = {"id": 3, "name": "person", "shape": "pedestrian", "xyz_m": (45, 0, 0), "aim": 1000}
    scene = srt.Scene(static=[wall | {"material": "concrete"}], actors=[person], radars=[{"xyz_m": (2, 0, 1)}])
    found = srt.explain(srt.simulate(scene, **FAST), scene=scene).frames[0].of(3).verdict
    assert (found.name, found.by) == ("occluded", "wall")
    assert found.numbers["margin_alone_db"] < 0
    assert "take wall away, and find" in found.change


@pytest.mark.parametrize(
    ("shape", "xyz_m", "yaw_deg", "verdict"),
    [
        # 0.36 m^2 turned by 35 deg at 38 m: 5 dB short as an isotropic surface, and by far enough facing
        ("plate:0.6x0.6", (40, 0, 1), 215, "specular away"),
        # a ball mirrors from wherever it is seen: nothing to turn
        ("sphere:r=0.05", (80, 0, 1), 0, "below noise"),
        # two centimetres square at 80 m face the radar, and are too small
        ("plate:0.02x0.02", (80, 0, 1), 180, "below noise"),
    ],
)
def test_turning_away_is_told_from_being_small(
    shape: str, xyz_m: tuple[float, float, float], yaw_deg: float, verdict: str
) -> None:
    thing = {"id": 3, "name": "thing", "shape": shape, "xyz_m": xyz_m, "ypr_deg": (yaw_deg, 0, 0)}
    scene = srt.Scene(
        actors=[thing | {"material": "metal", "tag": "Other", "aim": 2000}], radars=[{"xyz_m": (2, 0, 1)}]
    )
    assert srt.explain(srt.simulate(scene, **FAST), scene=scene).frames[0].of(3).verdict.name == verdict
