"""Attribution of a made street: parts add up to the cube, and each verdict to what a change proves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from explain_reasons import BIKE, FAST, GANTRY, PLATE, SPECK, TRUCK, VAN, WALKER, made_scene
from explain_tools import two_points

import shenron_rt as srt
from shenron_rt.attribution import Contributions, Explanation
from shenron_rt.attribution.cells import strongest_beam
from shenron_rt.attribution.contributions import GHOST
from shenron_rt.config.profile import load_profile


@pytest.fixture(scope="module")
def made() -> tuple[srt.Scene, srt.Frame, Explanation]:
    scene = made_scene()
    frame = srt.simulate(scene, **FAST)
    return scene, frame, srt.explain(frame, scene=scene)


def _seen(scene: srt.Scene, object_id: int) -> bool:
    return bool(np.any(srt.simulate(scene, **FAST).detections.object_id == object_id))


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
