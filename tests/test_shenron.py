"""The ``shenron`` echo model: the released preset against the public numbers, the corrections against closed forms."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.integrate import dblquad

import shenron_rt as srt
from shenron_rt import InputError, Returns, Scatterers, SemanticTag, illuminate, load_profile
from shenron_rt.cli import main
from shenron_rt.config.profile import RadarProfile
from shenron_rt.echo._shenron_lobe import lobe_solid_angle
from shenron_rt.echo._shenron_loss import reflectance
from shenron_rt.echo.shenron import ShenronModel
from shenron_rt.tags import tag_table

CORRECTED, RELEASED = ShenronModel.corrected(), ShenronModel.as_released()
#: Without beam patterns, for closed forms in RCS.
ISOTROPIC = replace(CORRECTED, azimuth_pattern=False, elevation_pattern=False)


@pytest.fixture(scope="module")
def profile() -> RadarProfile:
    return load_profile("ti_cascade")


def _plate(distance: float, half: float, n: int, tag: SemanticTag = SemanticTag.Car) -> Scatterers:
    """n x n points on a square plate facing the radar, each with its area and its normal."""
    line = (np.arange(n) + 0.5) / n * 2 * half - half
    y, z = (v.ravel() for v in np.meshgrid(line, line))
    position = np.column_stack([np.full(n * n, distance), y, z])
    cos = distance / np.linalg.norm(position, axis=1)
    return Scatterers(
        position=position,
        range_rate=np.zeros(n * n),
        cos_incidence=cos,
        object_id=np.ones(n * n, dtype=np.uint32),
        tag=np.full(n * n, tag, dtype=np.uint8),
        area=np.full(n * n, (2 * half / n) ** 2),
    )


def _point(distance: float = 20.0, **changes: object) -> Scatterers:
    one = Scatterers(
        position=np.array([[distance, 0.0, 0.0]]),
        range_rate=np.array([0.0]),
        cos_incidence=np.array([0.5]),
        object_id=np.array([1], dtype=np.uint32),
        tag=np.array([SemanticTag.Walls], dtype=np.uint8),
        area=np.array([0.02]),
    )
    return replace(one, **changes)  # type: ignore[arg-type]


def _power(returns: Returns) -> float:
    return float(np.sum(np.abs(returns.amplitude) ** 2))


def _rcs(returns: Returns, profile: RadarProfile, distance: float) -> float:
    """Invert the radar equation with the profile's levels."""
    a = profile.antenna
    gain = 10 ** ((a.gain_tx_dbi + a.gain_rx_dbi - a.radome_loss_db) / 10)
    link = profile.tx_power_w * gain * profile.wavelength_m**2 / (4 * np.pi) ** 3
    return _power(returns) * distance**4 / link


def test_as_released_has_the_amplitudes_of_the_public_code(shared_reference: Path, profile: RadarProfile) -> None:
    ref = np.load(shared_reference / "c_shenron_parity.npz")
    rows = ref["points"][ref["tic_v000_keep"]]
    scatterers = Scatterers(
        position=rows[:, :3] * [1, -1, 1],
        range_rate=np.ones(len(rows)),
        cos_incidence=rows[:, 3],
        object_id=rows[:, 4].astype(np.uint32),
        tag=tag_table("0.9.13").translate(rows[:, 5].astype(np.uint8)),
    )
    echoes = illuminate(scatterers, profile, model="shenron:as_released")
    scale = np.sqrt(10**10.5 / (4 * np.pi) ** 3) * 3e8 / 77e9  # 15.55
    expected = scale * np.sqrt(ref["tic_v000_loss"]) / ref["tic_v000_rho"]
    found = np.zeros(len(rows))
    found[echoes.scatterer] = np.abs(echoes.amplitude)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)  # the human body is 1e-13 of rounding
    assert echoes.coherent.all()
    assert not echoes.velocity.any()


@pytest.mark.parametrize("distance", [5.0, 20.0, 80.0])
def test_a_metal_plate_wider_than_the_mask_reads_pi_r_squared(profile: RadarProfile, distance: float) -> None:
    half = distance * np.tan(np.radians(3.0))
    rcs = _rcs(illuminate(_plate(distance, half, 201), profile, model=ISOTROPIC), profile, distance)
    # permittivity 1e5 reflects 0.987, and roughness of 50 um takes exp(-(4 pi s/lambda)^2) of that; what it scatters
    # adds 0.002 dB over 3 degrees, the rim of the mask is cut into cells of 1/67 of its radius: 0.02 dB
    expected = ((np.sqrt(1e5) - 1) / (np.sqrt(1e5) + 1)) ** 2 * np.exp(-((4 * np.pi * 50e-6 * 77e9 / 3e8) ** 2))
    assert 10 * np.log10(rcs / (np.pi * distance**2 * expected)) == pytest.approx(0.0, abs=0.03)


@pytest.mark.parametrize("switch", [True, False])
def test_density_alone_decides_whether_more_points_are_more_power(profile: RadarProfile, switch: bool) -> None:
    model = replace(CORRECTED, density=switch)
    wall = [_plate(20.0, 1.0, n, SemanticTag.Walls) for n in (20, 40)]
    few, many = (_power(illuminate(s, profile, model=model)) for s in wall)
    # the centres of twice as fine cells see a lobe that differs by a thousandth
    assert many / few == pytest.approx(1.0 if switch else 4.0, rel=2e-3)


def test_power_falls_with_r4_and_without_it_as_released(profile: RadarProfile) -> None:
    for model, exponent in ((CORRECTED, 4), (replace(CORRECTED, r4=False), 2), (RELEASED, 2)):
        near, far = (_power(illuminate(_point(r), profile, model=model)) for r in (20.0, 40.0))
        assert near / far == pytest.approx(2.0**exponent, rel=1e-12)


@pytest.mark.parametrize("reference", [7.0, 20.0])
def test_the_reference_range_cancels_where_neither_or_both_switches_are_on(
    profile: RadarProfile, reference: float
) -> None:
    for preset in (CORRECTED, RELEASED):
        changed = _power(illuminate(_point(), profile, model=replace(preset, reference_range_m=reference)))
        assert changed == pytest.approx(_power(illuminate(_point(), profile, model=preset)), rel=1e-12)


@pytest.mark.parametrize(("switch", "axis"), [("azimuth_pattern", 1), ("elevation_pattern", 2)])
def test_a_beam_loses_three_db_each_way_at_half_its_width(profile: RadarProfile, switch: str, axis: int) -> None:
    width = (profile.antenna.beamwidth_az_deg, profile.antenna.beamwidth_el_deg)[axis - 1]
    assert width is not None
    position = np.zeros((1, 3))
    position[0, [0, axis]] = 20 * np.cos(np.radians(width / 2)), 20 * np.sin(np.radians(width / 2))
    point = _point(position=position)
    ratio = _power(illuminate(point, profile, model=CORRECTED)) / _power(
        illuminate(point, profile, model=replace(CORRECTED, **{switch: False}))
    )
    assert ratio == pytest.approx(0.25, rel=1e-9)


def test_the_cosine_taken_for_an_angle_inverts_incidence(profile: RadarProfile) -> None:
    facing, grazing = _point(cos_incidence=np.array([1.0])), _point(cos_incidence=np.array([0.02]))
    for true_angle in (True, False):
        model = replace(RELEASED, true_angle=true_angle)
        ratio = _power(illuminate(facing, profile, model=model)) / _power(illuminate(grazing, profile, model=model))
        assert (ratio > 1) == true_angle
    assert 10 * np.log10(ratio) == pytest.approx(-15.9, abs=0.2)  # concrete, as published of the released code


def test_a_normal_replaces_the_cosine_recorded_at_the_lidar(profile: RadarProfile) -> None:
    seen = _point(normal=np.array([[-1.0, 0.0, 0.0]]))
    assert _power(illuminate(seen, profile, model=CORRECTED)) == _power(
        illuminate(_point(cos_incidence=np.array([1.0])), profile, model=CORRECTED)
    )


def test_the_mean_of_te_and_tm_is_what_a_lossless_half_space_gives() -> None:
    te, tm = reflectance(5.24, np.radians([0.0, np.degrees(np.arctan(np.sqrt(5.24)))]))
    assert te[0] == pytest.approx(tm[0], rel=1e-12)
    assert tm[1] == pytest.approx(0.0, abs=1e-28)  # Brewster


def test_scattered_and_specular_power_never_exceed_what_falls_in(profile: RadarProfile) -> None:
    for angle in np.radians([0.0, 30.0, 75.0]):
        for power in (1, 2):
            expected = dblquad(lambda t, u, a=angle, p=power: _lobe(a, u, t) ** p, 0, 1, 0, 2 * np.pi)[0]
            assert lobe_solid_angle(np.array([angle]), power)[0] == pytest.approx(expected, rel=1e-4)


def _lobe(angle: float, up: float, turn: float) -> float:
    """(0.9 ((1 + cos s)/2)^4 + 0.1 ((1 + cos i)/2)^4) / 1.09 of the directive model, from its definition."""
    out = np.array([np.sqrt(1 - up**2) * np.cos(turn), np.sqrt(1 - up**2) * np.sin(turn), up])
    mirror, back = (np.array([s * np.sin(angle), 0.0, np.cos(angle)]) for s in (1, -1))
    return float((0.9 * ((1 + out @ mirror) / 2) ** 4 + 0.1 * ((1 + out @ back) / 2) ** 4) / 1.09)


def test_pedestrians_reflect_only_where_corrected(profile: RadarProfile) -> None:
    walker = _point(tag=np.array([SemanticTag.Pedestrians], dtype=np.uint8))
    assert _power(illuminate(walker, profile, model=replace(CORRECTED, pedestrians=False))) < 1e-30
    # body over wall: reflectance of 15 against 5.24 at 60 degrees, and both wholly rough
    te, tm = reflectance(np.array([15.0, 5.24]), np.radians(60.0))
    ratio = _power(illuminate(walker, profile, model=CORRECTED)) / _power(
        illuminate(_point(), profile, model=CORRECTED)
    )
    assert ratio == pytest.approx((te + tm)[0] / (te + tm)[1], rel=1e-3)


def test_the_released_table_swaps_buildings_and_fences(profile: RadarProfile) -> None:
    building, fence = (_point(tag=np.array([t], dtype=np.uint8)) for t in (SemanticTag.Buildings, SemanticTag.Fences))
    for fixed in (True, False):
        model = replace(CORRECTED, tag_table_fixed=fixed)
        as_concrete = _power(illuminate(_point(), profile, model=model))  # a wall, concrete in both
        assert (_power(illuminate(building, profile, model=model)) == as_concrete) == fixed
        assert (_power(illuminate(fence, profile, model=model)) == as_concrete) == (not fixed)


def test_echoes_move_with_their_scatterers_only_where_corrected(profile: RadarProfile) -> None:
    moving = _point(range_rate=np.array([-7.0]))
    np.testing.assert_allclose(illuminate(moving, profile, model=CORRECTED).velocity, [[-7.0, 0.0, 0.0]])
    assert not illuminate(moving, profile, model=replace(CORRECTED, velocity=False)).velocity.any()


def test_a_point_target_keeps_its_rcs(profile: RadarProfile) -> None:
    target = _point(rcs=np.array([10.0]))
    assert _rcs(illuminate(target, profile, model=ISOTROPIC), profile, 20.0) == pytest.approx(10.0, rel=1e-9)


def test_adding_background_leaves_a_target_as_it_was(profile: RadarProfile) -> None:
    car, wall = _plate(20.0, 1.0, 20), _plate(60.0, 20.0, 40, SemanticTag.Walls)
    both = Scatterers(
        **{
            f: np.concatenate([getattr(car, f), getattr(wall, f)])
            for f in ("position", "range_rate", "cos_incidence", "object_id", "tag", "area")
        }
    )
    alone, among = illuminate(car, profile, model="shenron"), illuminate(both, profile, model="shenron")
    np.testing.assert_array_equal(among.amplitude[: len(alone)], alone.amplitude)


def test_random_phases_add_powers_and_come_from_the_seed(profile: RadarProfile) -> None:
    plate = _plate(20.0, 1.0, 20)
    one, same = (illuminate(plate, profile, model="shenron") for _ in range(2))
    other = illuminate(replace(plate, seed=1), profile, model="shenron")
    np.testing.assert_array_equal(one.amplitude, same.amplitude)
    assert not np.allclose(np.angle(one.amplitude), np.angle(other.amplitude))
    assert one.power_by_object()[1] == pytest.approx(_power(one), rel=1e-12)


@pytest.mark.parametrize("switch", ShenronModel.switches())
def test_every_switch_has_a_name_that_reads_back(switch: str) -> None:
    one, all_but_one = replace(RELEASED, **{switch: True}), replace(CORRECTED, **{switch: False})
    assert ShenronModel.parse(one.name) == one == ShenronModel.parse(f"shenron:as_released+{switch}")
    assert ShenronModel.parse(all_but_one.name) == all_but_one


#: Switches that concern where the radar stands and its noise, not the echo.
ELSEWHERE = {"noise_per_chirp", "mount"}


@pytest.mark.parametrize("switch", sorted(set(ShenronModel.switches()) - ELSEWHERE))
def test_every_switch_changes_an_echo(switch: str, profile: RadarProfile) -> None:
    n = 6
    cos = np.array([1.0, 0.7, 0.5, 0.3, 0.9, 0.01])  # the last is inside the mask where the cosine is the angle
    tags = [SemanticTag[t] for t in ("Car", "Buildings", "Pedestrians", "Vegetation", "Poles", "Car")]
    position = np.column_stack([np.linspace(10, 30, n), np.linspace(-6, 7, n), np.linspace(-1, 2, n)])
    scatterers = Scatterers(
        position=position,
        range_rate=np.full(n, 3.0),
        cos_incidence=cos,
        object_id=np.arange(n, dtype=np.uint32),
        tag=np.array(tags, dtype=np.uint8),
        area=np.full(n, 0.02),
    )
    for preset in (CORRECTED, RELEASED):
        before, after = (
            illuminate(scatterers, profile, model=m)
            for m in (preset, replace(preset, **{switch: not getattr(preset, switch)}))
        )
        same = len(before) == len(after) and all(
            np.array_equal(getattr(before, f), getattr(after, f)) for f in ("amplitude", "velocity", "coherent")
        )
        assert not same


def test_what_cannot_be_done_is_refused(profile: RadarProfile) -> None:
    with pytest.raises(InputError, match="area"):
        illuminate(_point(area=None), profile, model="shenron")
    with pytest.raises(InputError, match="preset"):
        illuminate(_point(), profile, model="shenron:released")
    with pytest.raises(InputError, match="unknown switch 'true_angel'; did you mean 'true_angle'"):
        illuminate(_point(), profile, model="shenron:as_released+true_angel")
    with pytest.raises(InputError, match="reference_range_m"):
        ShenronModel(reference_range_m=0.0)


def test_a_run_takes_the_model_and_keeps_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    common = ["--no-pictures", "--model", "shenron:as_released"]
    assert main(["run", "braking", *common, "--rays", "2000", "--backend", "scalar", "-o", "run"]) == 0
    assert yaml.safe_load(Path("run/config.yaml").read_text())["run"]["model"] == "shenron:as_released"
    returns = srt.Returns.load("run/radars/front/frame_000000/returns.npz")
    assert returns.model == "shenron:as_released"
    assert returns.coherent.all()
    assert main(["run", "braking", "--model", "shenron:released", "-o", "other"]) == 2
