"""Comparisons of frames that differ in one known thing: the cause must be that thing, with its size."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from compare_tools import ROWS, frame_of, patch, scatterers_of, small_profile

import shenron_rt as srt
from shenron_rt.comparison.budget import draw_probability
from shenron_rt.comparison.points import Gate, match_detections
from shenron_rt.comparison.verdict import CAUSES
from shenron_rt.io.recorded import PointCloud
from shenron_rt.returns import illuminate
from shenron_rt.scatterers import Weather
from shenron_rt.tags import SemanticTag

# Speckle of 900 equal rows moves a level by 4.34/sqrt(900) = 0.15 dB, the difference of two by 0.2; +-5 sigma:
SPECKLE_DB = 1.0
AT = (20.0, 0.0, 0.0)


def only_object(a: Any, b: Any, **options: Any) -> Any:
    (record,) = srt.compare(a, b, **options).objects
    return record


def causes(record: Any) -> list[str]:
    return [record.cause, *record.also]


@pytest.fixture(scope="module")
def plain() -> Any:
    return frame_of(scatterers_of(patch(7, AT)))


# ---- what makes levels differ
def test_a_frame_agrees_with_itself_in_everything(plain: Any) -> None:
    result = srt.compare(plain, plain)
    assert [o.cause for o in result.objects] == ["agrees"]
    assert result.objects[0].delta_db == 0
    for record in result.maps.values():
        assert record.correlation == pytest.approx(1, abs=1e-12)
        assert record.log_spectral_distance_db == 0
    assert len(result.detections.matched) == len(plain.detections) > 0
    assert result.detections.missed == result.detections.extra == []
    assert result.scatterers.occupancy.share_both == 1


def test_the_terms_of_a_difference_add_up_whatever_differs() -> None:
    second = patch(7, (31.0, 9.0, 1.0), area=5.0, cosine=0.5, material="asphalt")
    a = frame_of(scatterers_of(patch(7, AT, material="concrete"), patch(7, AT, cosine=0.2, material="glass")))
    b = frame_of(
        scatterers_of(
            second, patch(7, AT, cosine=0.9, material="glass"),
            seed=8, weather=Weather(rain_mm_h=40.0),
        ),
        small_profile(**{"receiver.tx_power_dbm": 3.0}),
    )  # fmt: skip
    record = only_object(a, b)
    power = [10 * np.log10(f.returns.power_by_object()[7]) for f in (a, b)]
    assert record.delta_db == pytest.approx(power[1] - power[0], abs=1e-9)
    assert sum(record.terms_db.values()) == pytest.approx(record.delta_db, abs=1e-9)
    assert min(abs(record.terms_db[k]) for k in ("coverage", "incidence", "material", "range", "weather")) > 0.1


@pytest.mark.parametrize(("tag", "polarization"), [(SemanticTag.Roads, "VV"), (SemanticTag.Walls, "HH")])
def test_another_angle_of_incidence_is_named_with_what_sigma0_predicts(tag: SemanticTag, polarization: str) -> None:
    # V lies in the plane of incidence of level ground and across that of an upright wall
    a, b = (frame_of(scatterers_of(patch(7, AT, cosine=c, tag=tag, material="concrete"))) for c in (0.95, 0.1))
    record = only_object(a, b)
    sigma0 = srt.load_materials()["concrete"].sigma0(a.profile.center_hz, np.array([0.95, 0.1]), polarization)
    predicted = np.diff(10 * np.log10(sigma0))[0]
    assert record.cause == "incidence"
    # both sides interpolate sigma0 over 1025 cosines
    assert record.terms_db["incidence"] == pytest.approx(predicted, abs=0.05)
    assert record.delta_db == pytest.approx(predicted, abs=SPECKLE_DB)
    assert (record.mean_cosine_a, record.mean_cosine_b) == pytest.approx((0.95, 0.1))


def test_another_material_is_named_and_where_the_tags_differ_the_tag() -> None:
    a, b = (frame_of(scatterers_of(patch(7, AT, material=m))) for m in ("concrete", "vegetation"))
    record = only_object(a, b)
    assert record.cause == "material"
    assert (list(record.materials_a), list(record.materials_b)) == (["concrete"], ["vegetation"])
    assert record.terms_db["material"] == pytest.approx(record.delta_db, abs=SPECKLE_DB)
    tagged = [frame_of(scatterers_of(patch(7, AT, tag=t))) for t in (SemanticTag.Walls, SemanticTag.Vegetation)]
    record = only_object(*tagged)
    assert record.cause == "tag"
    assert (record.tag_a, record.tag_b) == ("Walls", "Vegetation")


def test_the_beam_is_named_with_the_loss_of_the_pattern() -> None:
    turn = np.radians(55.0)
    a, b = (frame_of(scatterers_of(patch(7, at, size=0.2))) for at in (AT, (20 * np.cos(turn), 20 * np.sin(turn), 0.0)))
    record = only_object(a, b)
    # gaussian, 120 deg between the half-power points of one way: 3.01 (55/60)^2 dB a way, twice
    assert record.cause == "beam"
    assert record.terms_db["beam"] == pytest.approx(-2 * 3.01 * (55 / 60) ** 2, abs=0.1)


def test_another_range_is_named_with_its_fourth_power() -> None:
    a, b = (frame_of(scatterers_of(patch(7, (r, 0.0, 0.0), size=0.1))) for r in (20.0, 40.0))
    record = only_object(a, b)
    assert record.cause == "range"
    assert record.terms_db["range"] == pytest.approx(-40 * np.log10(2), abs=0.01)
    assert record.mean_range_m_b == pytest.approx(40, abs=0.01)


def test_more_transmit_power_is_the_profile_and_leaves_the_maps_comparable() -> None:
    near = scatterers_of(patch(7, (8.0, 0.0, 0.0), area=100.0))
    quiet, loud = (frame_of(near, small_profile(**{"receiver.tx_power_dbm": p})) for p in (10.0, 17.0))
    result = srt.compare(quiet, loud)
    (record,) = result.objects
    assert record.cause == "profile"
    assert record.delta_db == pytest.approx(7, abs=1e-9)  # the same draw of the speckle
    assert set(result.maps) == {"range_doppler", "range_azimuth"}
    assert result.maps["range_doppler"].mean_difference_signal_db == pytest.approx(7, abs=1)


def test_rain_is_weather() -> None:
    far = patch(7, (45.0, 0.0, 0.0), material="vegetation")
    a, b = (frame_of(scatterers_of(far, weather=w)) for w in (None, Weather(rain_mm_h=150.0)))
    record = only_object(a, b)
    rain = Weather(rain_mm_h=150.0).two_way_loss(45.0, a.profile.center_hz, "VV")
    assert "weather" in causes(record)
    assert record.terms_db["weather"] == pytest.approx(-10 * np.log10(float(rain)), abs=0.05)


def test_an_echo_model_that_differs_is_named() -> None:
    a = frame_of(scatterers_of(patch(7, AT)))
    other = dataclasses.replace(a.returns, amplitude=a.returns.amplitude * 10, model="shenron")
    record = only_object(a, frame_of(a.scatterers, returns=other))
    assert record.cause == "model"
    assert record.terms_db["model"] == pytest.approx(20, abs=1e-9)


def test_under_another_model_on_both_sides_what_its_formula_adds_is_not_explained(plain: Any) -> None:
    quiet = dataclasses.replace(plain.returns, model="shenron")
    loud = dataclasses.replace(quiet, amplitude=quiet.amplitude * 10)
    record = only_object(*(frame_of(plain.scatterers, returns=r) for r in (quiet, loud)))
    assert record.cause == "unexplained"
    assert record.terms_db["rest"] == pytest.approx(20, abs=1e-9)
    # what every model shares still is: the same surface twice as far away
    far = dataclasses.replace(illuminate(scatterers_of(patch(7, (40.0, 0.0, 0.0))), plain.profile), model="shenron")
    record = only_object(
        frame_of(plain.scatterers, returns=quiet), frame_of(scatterers_of(patch(7, (40.0, 0.0, 0.0))), returns=far)
    )
    assert record.cause == "range"


def test_the_odds_of_a_draw_are_those_of_the_gamma_distribution() -> None:
    rng = np.random.default_rng(2)
    n, looks = 20_000, np.full(20_000, 3.0)
    draws = rng.exponential(size=(n, 3)).mean(axis=1)
    one = SimpleNamespace(expected=np.ones(n), mirror=np.zeros(n), looks=looks)
    odds = draw_probability(one, draws)  # type: ignore[arg-type]
    # uniform on (0, 1): of 20,000 draws the share below p errs by sqrt(p / 20000), 5 sigma
    for p in (0.003, 0.05, 0.5):
        assert np.mean(odds < p) == pytest.approx(p, abs=5 * np.sqrt(p / n))


def test_a_coherent_echo_on_one_side_only_is_the_mirror_part(plain: Any) -> None:
    strong = np.sqrt(100 * np.sum(np.abs(plain.returns.amplitude) ** 2))
    echo = {f.name: getattr(plain.returns, f.name) for f in dataclasses.fields(plain.returns)}
    first = {k: v[:1] for k, v in echo.items() if isinstance(v, np.ndarray)}
    first |= {"amplitude": np.array([strong + 0j]), "coherent": np.array([True])}
    joined = dataclasses.replace(plain.returns, **{k: np.concatenate([echo[k], v]) for k, v in first.items()})
    record = only_object(frame_of(plain.scatterers, returns=joined), plain)
    assert record.cause == "mirror_part"
    assert record.coherent_share_a == pytest.approx(100 / 101, abs=1e-6)
    assert record.delta_db == pytest.approx(-10 * np.log10(101), abs=1e-6)
    # what lies under a mirror 20 dB above it explains nothing
    assert abs(record.terms_db["mirror"]) == pytest.approx(abs(record.delta_db), abs=SPECKLE_DB)


def test_power_that_nothing_accounts_for_stays_unexplained(plain: Any) -> None:
    wrong = dataclasses.replace(plain.returns, amplitude=plain.returns.amplitude * 10)
    record = only_object(plain, frame_of(plain.scatterers, returns=wrong))
    assert record.cause == "unexplained"
    assert record.unexplained_db == pytest.approx(20, abs=SPECKLE_DB)


def test_a_single_speckled_row_does_not_pass_for_a_difference() -> None:
    frames = [frame_of(scatterers_of(patch(7, AT, rows=1), seed=s)) for s in range(8)]
    records = [only_object(frames[0], f) for f in frames[1:]]
    # 5.6 dB a side: two standard deviations of the difference are 15.8 dB
    assert all(r.tolerance_db == pytest.approx(2 * np.sqrt(2) * 5.57, rel=0.02) for r in records)
    assert {r.cause for r in records} <= {"agrees", "speckle"}
    assert sum(r.cause == "agrees" for r in records) >= 6


# ---- what a side cannot see
def roof_view(*patches: dict[str, Any], origin: tuple[float, float, float] = (-2.0, 0.0, 1.5)) -> Any:
    return frame_of(scatterers_of(*patches, door="lidar", origin=origin, seed=4))


def wall_before(x: float) -> dict[str, Any]:
    return patch(40, (x, 0.0, 0.5), size=8.0, rows=4000, area=64.0)


def test_an_object_behind_the_lidars_own_points_is_hidden_from_the_lidar() -> None:
    mesh = frame_of(scatterers_of(wall_before(30.0), patch(7, AT, tag=SemanticTag.Car)))
    lidar = roof_view(wall_before(10.0))
    result = srt.compare(mesh, lidar)
    car = next(o for o in result.objects if o.id == 7)
    assert (car.seen_by, car.cause, car.delta_db) == ("a", "hidden_from_lidar", None)
    assert car.sight.behind_other > 0.95
    assert list(car.sight.occluders) == ["object 40"]


def test_an_object_behind_the_radars_own_rays_is_hidden_from_the_radar() -> None:
    mesh = frame_of(scatterers_of(wall_before(10.0)))
    lidar = roof_view(patch(7, AT, tag=SemanticTag.Car))
    car = next(o for o in srt.compare(mesh, lidar).objects if o.id == 7)
    assert (car.seen_by, car.cause) == ("b", "hidden_from_radar")


def test_the_ways_of_not_seeing_are_told_apart() -> None:
    mesh = frame_of(scatterers_of(patch(7, AT)))
    sides = {
        "outside_lidar_view": roof_view(patch(40, (20.0, 15.0, 0.0), rows=2000)),
        "not_there": roof_view(wall_before(30.0)),
        "other_label": roof_view(wall_before(20.0)),
    }
    for cause, lidar in sides.items():
        assert next(o for o in srt.compare(mesh, lidar).objects if o.id == 7).cause == cause


def test_half_hidden_and_half_out_of_view_takes_both_causes() -> None:
    left, right = (patch(7, (20.0, y, 0.0), seed=s) for y, s in ((0.0, 0), (15.0, 1)))
    mesh = frame_of(scatterers_of(left, right))
    record = next(o for o in srt.compare(mesh, roof_view(patch(40, (10.0, 0.0, 0.5), size=3.0))).objects if o.id == 7)
    # each share is near 0.5, so either alone may fall short of a half
    assert set(causes(record)) <= {"hidden_from_lidar", "outside_lidar_view"}
    assert record.sight.behind_other + record.sight.no_ray > 0.95


def test_metal_without_a_mirror_point_is_seen_and_gives_nothing() -> None:
    mesh = frame_of(scatterers_of(patch(7, AT, material="concrete")))
    lidar = roof_view(patch(7, AT, material="metal"))
    record = only_object(mesh, lidar)
    assert (record.seen_by, record.cause, record.rows_b) == ("a", "mirror_part", ROWS)


def test_tags_carry_causes_too() -> None:
    mesh = frame_of(scatterers_of(wall_before(30.0), patch(7, AT, tag=SemanticTag.Car)))
    by_tag = {t.tag: t for t in srt.compare(mesh, roof_view(wall_before(10.0))).tags}
    assert (by_tag["Car"].seen_by, by_tag["Car"].cause) == ("a", "hidden_from_lidar")
    assert list(by_tag["Car"].sight.occluders) == ["Walls"]
    assert by_tag["Walls"].delta_db == pytest.approx(sum(by_tag["Walls"].terms_db.values()), abs=1e-9)


def test_rows_that_neither_pattern_lights_are_no_area() -> None:
    behind = patch(0, (-20.0, 0.0, 0.0), area=500.0)
    a, b = frame_of(scatterers_of(patch(0, AT))), roof_view(patch(0, AT), behind)
    record = only_object(a, b)
    assert record.area_m2_b == pytest.approx(record.area_m2_a)
    assert record.cause == "agrees"


def test_without_the_lidars_place_nothing_is_said_to_be_hidden_from_it() -> None:
    mesh = frame_of(scatterers_of(patch(7, AT)))
    lidar = frame_of(scatterers_of(wall_before(10.0), door="lidar"))
    result = srt.compare(mesh, lidar)
    assert next(o for o in result.objects if o.id == 7).cause == "unexplained"
    assert any("lidar_origin" in note for note in result.notes)
    told = srt.compare(mesh, lidar, lidar_origin=(-2.0, 0.0, 1.5))
    assert next(o for o in told.objects if o.id == 7).cause == "hidden_from_lidar"


def test_an_object_mostly_behind_another_lacks_area_because_it_is_hidden() -> None:
    low = patch(7, (20.0, 0.0, -0.4), size=0.2, rows=100, area=0.2)
    mesh = frame_of(scatterers_of(patch(7, AT), patch(40, (40.0, 0.0, 0.0))))
    cover = patch(40, (12.0, 0.0, 0.6), size=1.1, rows=4000)
    record = next(o for o in srt.compare(mesh, roof_view(low, cover)).objects if o.id == 7)
    assert record.cause == "hidden_from_lidar"
    assert record.terms_db["coverage"] == pytest.approx(-10, abs=1e-6)  # 0.2 of 2 m^2


@pytest.mark.parametrize(("rows", "cause"), [(8, "too_few_points"), (ROWS, "different_surfaces")])
def test_a_tenth_of_the_area_is_told_by_how_many_points_stand_for_it(rows: int, cause: str) -> None:
    mesh = frame_of(scatterers_of(patch(7, AT)))
    record = only_object(mesh, roof_view(patch(7, AT, rows=rows, area=0.02)))
    assert record.cause == cause
    assert record.rows_b == rows
    assert record.terms_db["coverage"] == pytest.approx(-20, abs=1e-9)


# ---- detections
def cloud(ranges: Any, azimuth_deg: Any = 0.0, velocity: Any = 0.0) -> PointCloud:
    r, az, v = np.broadcast_arrays(*(np.asarray(x, dtype=np.float64) for x in (ranges, azimuth_deg, velocity)))
    return PointCloud.from_spherical(r, np.radians(az), np.zeros(len(r)), v)


def test_detections_match_one_to_one_at_the_least_total_distance() -> None:
    gate = Gate(range_m=1.0, velocity_mps=1.0, sine=0.1)
    found = match_detections(cloud([10.0, 10.6]), cloud([9.5, 10.1, 30.0]), gate)
    # the greedy pair (10.0, 10.1) would leave 10.6 without a partner
    assert [(m.a, m.b) for m in found.matched] == [(0, 0), (1, 1)]
    assert [m.range_m_error for m in found.matched] == pytest.approx([-0.5, -0.5])
    assert found.missed == []
    assert [e.range_m for e in found.extra] == [30.0]
    assert found.errors.range_m.mean == pytest.approx(-0.5)
    assert found.errors.snr_db.count == 0  # neither cloud has levels


@pytest.mark.parametrize("change", [{"ranges": [11.1]}, {"azimuth_deg": 6.5}, {"velocity": 1.1}])
def test_a_detection_outside_one_gate_is_not_the_same(change: dict[str, Any]) -> None:
    gate = Gate(range_m=1.0, velocity_mps=1.0, sine=0.1)
    found = match_detections(cloud([10.0]), cloud(**{"ranges": [10.0], **change}), gate)
    assert (len(found.matched), len(found.missed), len(found.extra)) == (0, 1, 1)


def test_velocities_are_compared_modulo_the_unambiguous_span() -> None:
    gate = Gate(range_m=1.0, velocity_mps=1.0, sine=0.1, velocity_span_mps=50.0)
    found = match_detections(cloud([10.0], velocity=24.8), cloud([10.0], velocity=-24.9), gate)
    assert found.errors.velocity_mps.mean == pytest.approx(0.3)


def test_nothing_found_on_a_side_is_all_missed() -> None:
    gate = Gate(range_m=1.0, velocity_mps=1.0, sine=0.1)
    found = match_detections(cloud([10.0, 20.0]), cloud([]), gate)
    assert (len(found.matched), len(found.missed), len(found.extra)) == (0, 2, 0)
    assert found.errors.range_m.mean is None


# ---- sides that cannot be compared in everything
def test_another_waveform_skips_the_maps_and_says_so(plain: Any) -> None:
    other = frame_of(plain.scatterers, small_profile(**{"waveform.bandwidth_hz": 200e6}))
    result = srt.compare(plain, other)
    assert result.maps == {}
    assert any("maps skipped" in note for note in result.notes)
    assert len(result.objects) == 1


def test_a_recorded_cloud_is_compared_in_its_detections(plain: Any) -> None:
    found = plain.detections
    recorded = PointCloud.from_spherical(found.range + 0.1, found.azimuth, np.zeros(len(found)), found.velocity)
    result = srt.compare(plain, recorded)
    assert len(result.detections.matched) == len(found)
    assert result.detections.errors.range_m.mean == pytest.approx(0.1, abs=1e-9)
    assert result.maps == {}
    assert result.scatterers is None
    assert any("recorded point cloud" in note for note in result.notes)
    with pytest.raises(srt.InputError, match="two recorded clouds"):
        srt.compare(recorded, recorded)
    with pytest.raises(srt.InputError, match="must be a Frame"):
        srt.compare(plain, 3)


def test_a_comparison_saves_json_and_a_page_of_maps(plain: Any, tmp_path: Path) -> None:
    import matplotlib.image

    b = frame_of(scatterers_of(patch(7, AT, cosine=0.3), patch(9, (12.0, 3.0, 0.0))))
    result = srt.compare(plain, b)
    result.save(tmp_path / "out")
    data = json.loads((tmp_path / "out" / "compare.json").read_text())
    assert {o["id"] for o in data["objects"]} == {7, 9}
    assert {o["cause"] for o in data["objects"]} <= set(CAUSES)
    assert data["maps"]["range_doppler"]["correlation"] == pytest.approx(result.maps["range_doppler"].correlation)
    page = matplotlib.image.imread(tmp_path / "out" / "compare.png")
    assert min(page.shape[:2]) > 1000
    assert len(np.unique(page.reshape(-1, page.shape[2]), axis=0)) > 500  # maps, not an empty page
