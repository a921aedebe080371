"""Attribution: parts add up to the cube, budgets to the measured ratio, and each verdict to what a change proves."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from explain_reasons import BIKE, FAST, GANTRY, PLATE, SPECK, TRUCK, VAN, WALKER, made_scene
from explain_tools import two_points

import shenron_rt as srt
from shenron_rt.attribution import Contributions, Explanation
from shenron_rt.attribution.cells import strongest_beam
from shenron_rt.attribution.contributions import GHOST
from shenron_rt.chains import Chains
from shenron_rt.config.profile import load_profile


@pytest.fixture(scope="module")
def made() -> tuple[srt.Scene, srt.Frame, Explanation]:
    scene = made_scene()
    frame = srt.simulate(scene, **FAST)
    return scene, frame, srt.explain(frame, scene=scene)


def _seen(scene: srt.Scene, object_id: int) -> bool:
    return bool(np.any(srt.simulate(scene, **FAST).detections.object_id == object_id))


# ---- linearity
def test_per_object_contributions_add_up_to_the_noise_free_cube(
    made: tuple[srt.Scene, srt.Frame, Explanation],
) -> None:
    _, frame, _ = made
    whole = srt.synthesize(frame.returns, frame.profile, noise=None, accuracy=1e-8)
    parts = Contributions(frame.returns, frame.cube, accuracy=1e-8)
    total = sum(parts.samples(i).data for i in parts.ids)
    rms = np.sqrt(np.mean(np.abs(whole.data) ** 2))
    assert np.sqrt(np.mean(np.abs(total - whole.data) ** 2)) < 1e-6 * rms
    # and so do the cubes, after both transforms
    cube = parts.processed(whole)
    spectra = sum(parts.of(i).data for i in parts.ids)
    assert np.abs(spectra - cube.data).max() < 1e-6 * np.abs(cube.data).max()


def test_taking_every_object_out_of_the_cube_leaves_the_thermal_noise(
    made: tuple[srt.Scene, srt.Frame, Explanation],
) -> None:
    _, frame, _ = made
    parts = Contributions(frame.returns, frame.cube)
    rest = parts.without(parts.ids)
    # 256 x 64 cells of 6 channels, Hann in Doppler: some 5e4 independent looks, 0.5 % each way at 1 sigma
    assert rest.range_doppler.mean() == pytest.approx(frame.cube.noise_power_w, rel=0.02)


# ---- the five reasons
@pytest.mark.parametrize(
    ("object_id", "verdict", "by"),
    [
        (SPECK, "below noise", ""),
        (BIKE, "masked", "truck"),
        (GANTRY, "outside the beam", ""),
        (WALKER, "occluded", "van"),
        (PLATE, "specular away", ""),
        (TRUCK, "detected", ""),
        (VAN, "detected", ""),
    ],
)
def test_each_invisible_object_gets_its_own_reason(
    made: tuple[srt.Scene, srt.Frame, Explanation], object_id: int, verdict: str, by: str
) -> None:
    found = made[2].frames[0].of(object_id).verdict
    assert (found.name, found.by) == (verdict, by)
    assert (found.change != "") == (verdict != "detected")


def test_the_side_lobe_is_named_as_such(made: tuple[srt.Scene, srt.Frame, Explanation]) -> None:
    bike = made[2].frames[0].of(BIKE)
    assert "truck's side lobe" in bike.verdict.text
    # the rectangular window's lobes, 46 dB stronger at the peak, lie within 1/(pi d) of it, d = 16.5 bins: -34 dB;
    # 3 dB for the lobe's phase
    levels = {s.name: s.cell_dbm for s in bike.shares}
    assert levels["truck"] - levels["bike"] == pytest.approx(46 + 40 * math.log10(26.7 / 20.5) - 34.3, abs=3)


def test_the_pattern_loss_of_the_gantry_is_that_of_the_gaussian(made: tuple[srt.Scene, srt.Frame, Explanation]) -> None:
    gantry = made[2].frames[0].of(GANTRY)
    numbers = gantry.verdict.numbers
    assert gantry.elevation_deg == pytest.approx(45, abs=0.1)
    # at 45 deg of a 40 deg half-power width: 2 x 10 log10(2) (45/20)^2 both ways
    assert numbers["pattern_db"] == pytest.approx(-20 * math.log10(2) * (gantry.elevation_deg / 20) ** 2, abs=1e-6)
    assert numbers["margin_on_axis_db"] - numbers["margin_alone_db"] == pytest.approx(-numbers["pattern_db"], abs=0.01)


def test_the_hidden_share_of_the_walker_is_all_of_it(made: tuple[srt.Scene, srt.Frame, Explanation]) -> None:
    walker = made[2].frames[0].of(WALKER)
    assert walker.rows == 0
    assert walker.waterfall is None
    assert walker.verdict.numbers["hidden_by"] == {"van": pytest.approx(1.0)}


def test_the_plate_echoes_far_less_than_an_isotropic_surface(made: tuple[srt.Scene, srt.Frame, Explanation]) -> None:
    plate = made[2].frames[0].of(PLATE)
    # 1 m^2 whose normal is 35 deg and 25 deg off: cos 35 cos 25, the radar being 1.6 deg beside its axis
    assert plate.visible_area_m2 == pytest.approx(1.0, rel=0.02)
    assert plate.projected_area_m2 == pytest.approx(math.cos(math.radians(35)) * math.cos(math.radians(25)), rel=0.05)
    assert plate.verdict.numbers["apparent_rcs_dbsm"] < 10 * math.log10(plate.projected_area_m2) - 10


@pytest.mark.parametrize(
    ("object_id", "scene"),
    [
        (SPECK, made_scene(speck_x=2 + 0.8 * 9.2)),  # "the same aspect within 9.2 m"
        (BIKE, made_scene(range_window="blackmanharris")),
        (GANTRY, made_scene(radar_ypr=(0, 45, 0))),
        (WALKER, made_scene(without=(VAN,))),
        (PLATE, made_scene(plate_ypr=(178.4, 0, 0))),
    ],
)
def test_the_change_that_is_named_makes_it_visible(
    made: tuple[srt.Scene, srt.Frame, Explanation], object_id: int, scene: srt.Scene
) -> None:
    said = made[2].frames[0].of(object_id).verdict.change
    words = {
        SPECK: "within 9.2 m",
        BIKE: "blackmanharris",
        GANTRY: "45 deg up",
        WALKER: "van away",
        PLATE: "turn it by",
    }
    assert words[object_id] in said
    assert _seen(scene, object_id)


# ---- other verdicts
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


# ---- the waterfall
def test_the_waterfall_of_a_point_is_the_radar_equation_and_the_gains_of_the_transforms() -> None:
    p = load_profile("awrl1432")
    velocity = 10 * p.velocity_resolution_mps
    # on the centre of a Doppler bin and, with the coupling f_D T_sampled, of a range bin at mid-frame
    coupling = 10 / (64 * 36.4e-6) * p.waveform.sampled_time_s * p.range_resolution_m
    middle = 80 * p.range_resolution_m - coupling
    distance = middle - velocity * p.frame_mid_s
    points = [{"id": 1, "xyz_m": (2 + distance, 0, 1), "velocity_mps": (velocity, 0, 0), "rcs_dbsm": 10}]
    scene = srt.Scene(point_targets=points, radars=[{"xyz_m": (2, 0, 1)}])
    frame = srt.simulate(scene, noise=None, accuracy=1e-8)
    budget = srt.explain(frame, scene=scene).frames[0].of(1).waterfall
    assert budget is not None
    gains = {s.name: s.gain_db for s in budget.stages}
    # by hand: 10 dBm + 6 + 6 dBi, lambda 3.883 mm, (4 pi)^3, R^4, 10 dBsm
    received = 10 + 12 + 20 * math.log10(p.wavelength_m) - 30 * math.log10(4 * math.pi) - 40 * math.log10(middle) + 10
    assert budget.received_dbm == pytest.approx(received, abs=1e-3)
    assert gains["apparent cross section"] == pytest.approx(10, abs=1e-3)
    noise_dbm = 10 * math.log10(1.380649e-23 * 290 * 10**1.4 * 12.5e6) + 30
    assert budget.sample_snr_db == pytest.approx(received - noise_dbm, abs=1e-3)
    # a Hann window's noise bandwidth is 1.5 bins on either axis; 256 samples, 64 loops, 6 channels
    processing = 10 * math.log10(256 * 64 * 6 / 1.5**2)
    straddling = gains["range spread and straddling"] + gains["Doppler spread and straddling"]
    # the range drifts by +-0.026 bins over the frame: Hann loses 5.7 dB bin^-2 x 0.026^2 / 3 at most, 1.3e-3 dB
    assert -2e-3 < straddling <= 1e-6
    assert budget.object_snr_db == pytest.approx(received - noise_dbm + processing, abs=3e-3)
    assert budget.measured_snr_db == pytest.approx(budget.object_snr_db, abs=1e-3)


def test_gains_add_up_to_the_levels_and_to_the_measured_ratio(made: tuple[srt.Scene, srt.Frame, Explanation]) -> None:
    _, frame, found = made
    noise_dbm = 10 * math.log10(frame.profile.noise_power_w) + 30
    for item in found.frames[0].objects:
        if item.waterfall is None:
            continue
        level = 0.0
        for stage in item.waterfall.stages:
            level += stage.gain_db
            assert stage.level == pytest.approx(level, abs=1e-9)
        assert level == pytest.approx(item.waterfall.measured_snr_db, abs=1e-6)  # rounding of twenty sums in dB
        assert item.waterfall.sample_snr_db == pytest.approx(item.waterfall.received_dbm - noise_dbm, abs=1e-9)
        assert item.waterfall.closes


def test_the_measured_ratio_of_a_detected_object_is_that_of_its_detection(
    made: tuple[srt.Scene, srt.Frame, Explanation],
) -> None:
    _, frame, found = made
    for number in (TRUCK, VAN):
        item = found.frames[0].of(number)
        assert item.waterfall is not None
        strongest = frame.detections.snr_db[item.detections[0]]
        # the beam's curvature is taken at the detected range, the detection's at its cell: metres apart in 20, 1e-3 dB
        assert item.waterfall.measured_snr_db == pytest.approx(strongest, abs=1e-2)


def test_a_budget_that_misses_an_echo_does_not_close() -> None:
    profile = load_profile("awrl1432")
    scene = two_points(profile, {"velocity_mps": (-5, 0, 0)}, {"velocity_mps": (-5.1, 0, 0), "rcs_dbsm": 10})
    frame = srt.simulate(scene)
    kept = frame.returns.object_id == 1
    columns = ("amplitude", "position", "velocity", "object_id", "tag", "coherent", "bounces", "scatterer")
    forgetful = replace(frame.returns, **{name: getattr(frame.returns, name)[kept] for name in columns})
    found = srt.explain(replace(frame, returns=forgetful)).frames[0].of(1)
    assert found.waterfall is not None
    assert not found.waterfall.closes


# ---- labels, peaks
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


def test_parts_of_a_frame_with_bounces_add_up_to_its_cube() -> None:
    scene = srt.load_scene("braking")
    rail = {
        "name": "mirror",
        "shape": "box:60x0.1x2",
        "xyz_m": (30, 3, 1),
        "material": "metal",
        "tag": "Walls",
        "id": 50,
    }
    scene = srt.Scene.model_validate(scene.model_dump() | {"static": [*scene.model_dump()["static"], rail]})
    frame = srt.simulate(scene, rays=5000, accuracy=1e-3, max_bounces=3)
    parts = Contributions(frame.returns, frame.cube, accuracy=1e-8)
    assert max(parts.ids) > GHOST  # the car is seen in the metal, too
    whole = srt.synthesize(frame.returns, frame.profile, noise=None, accuracy=1e-8)
    total = sum(parts.samples(i).data for i in parts.ids)
    assert np.sqrt(np.mean(np.abs(total - whole.data) ** 2)) < 1e-6 * np.sqrt(np.mean(np.abs(whole.data) ** 2))


def test_a_folded_detection_is_labelled_with_its_verdict() -> None:
    profile = load_profile("awrl1432")
    scene = two_points(
        profile, {"velocity_mps": (-profile.max_velocity_mps - 1, 0, 0)}, {"xyz_m": (45, 0, 1), "rcs_dbsm": 15}
    )
    found = srt.explain(srt.simulate(scene), scene=scene).frames[0].of(1)
    assert found.verdict.text == "detected (direct, folded)"
    assert found.cell is not None
    assert found.cell.velocity_mps > 0 > found.velocity_mps


def test_the_strongest_peak_is_that_of_the_map_and_its_owner(made: tuple[srt.Scene, srt.Frame, Explanation]) -> None:
    _, frame, found = made
    (row,) = found.evidence()
    assert row["name"] == "truck"
    assert row["level_dbm"] == pytest.approx(10 * np.log10(frame.cube.range_azimuth.max()) + 30)
    assert row["range_m"] == pytest.approx(20.5, abs=frame.profile.range_resolution_m)


def test_an_unknown_object_is_refused_with_those_there_are() -> None:
    scene = two_points(load_profile("awrl1432"), {}, {"xyz_m": (45, 0, 1)})
    with pytest.raises(srt.InputError, match=r"no object 7 in frame 0; there are 1 \(one\), 2 \(two\)"):
        srt.explain(srt.simulate(scene), scene=scene, object_id=7)


def test_released_counts_have_no_link_budget() -> None:
    frame = srt.simulate(made_scene(), model="shenron:as_released", **FAST)
    with pytest.raises(srt.InputError, match="not watts"):
        srt.explain(frame)


# ---- every radar
@pytest.mark.parametrize("name", ["awrl1432boost", "radarbook2", "ti_cascade"])
def test_budgets_close_for_every_kind_of_array_and_converter(name: str) -> None:
    """BPM and a real ADC, TDM with a folded target, 86 channels and three loops."""
    profile = load_profile(name, {} if name == "ti_cascade" else {"waveform.chirps": 32})
    fast = 2 * profile.max_velocity_mps - 1
    scene = two_points(
        profile,
        {"xyz_m": (32, 4, 2), "rcs_dbsm": 15, "velocity_mps": (-1, 0, 0)},
        {"xyz_m": (22, -3, 1.5), "rcs_dbsm": 5, "velocity_mps": (fast, 0, 0)},
    )
    frame = srt.simulate(scene)
    found = srt.explain(frame, scene=scene).frames[0]
    for number, rcs_dbsm in ((1, 15), (2, 5)):
        item = found.of(number)
        assert item.waterfall is not None
        assert item.waterfall.closes
        assert item.waterfall.measured_snr_db == pytest.approx(frame.detections.snr_db[item.detections[0]], abs=1e-2)
        gains = {s.name: s.gain_db for s in item.waterfall.stages}
        # the radar equation holds at mid-frame for the array's reference: 1e-2 dB for apertures of metres in 20
        assert gains["apparent cross section"] == pytest.approx(rcs_dbsm, abs=1e-2)
    assert found.of(2).labels[0] == "direct, folded"


def test_a_scene_without_objects_explains_nothing_and_has_no_peak_of_anyone() -> None:
    scene = srt.Scene()
    (frame,) = srt.explain(srt.simulate(scene), scene=scene)
    assert frame.objects == ()
    assert set(frame.detection_labels) <= {"noise"}
    assert frame.strongest is not None
    assert frame.strongest.name == "noise"


def test_the_search_for_the_strongest_beam_finds_the_maximum_of_the_map() -> None:
    cube = srt.process(srt.synthesize(srt.simulate(srt.Scene()).returns, load_profile("awrl1432"), seed=9))
    for first_row in (0, 200):
        found = strongest_beam(cube, first_row)  # of noise alone nearly every cell must be tried
        assert found is not None
        look, azimuth_deg, power = found
        part = cube.range_azimuth[first_row:]
        row, beam = np.unravel_index(int(part.argmax()), part.shape)
        assert power == pytest.approx(part.max(), rel=1e-12)
        assert look.row == row + first_row
        assert azimuth_deg == pytest.approx(np.degrees(cube.azimuth_rad[beam]))


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
