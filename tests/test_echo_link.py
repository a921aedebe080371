"""Radar equation, antenna patterns, radome and weather, by point targets and plates."""

from __future__ import annotations

import math

import numpy as np
import pytest
from echo_tools import FOUR_PI_CUBED, ISO, db, isotropic_profile, scene_of, unit_power

import shenron_rt as srt
from shenron_rt.errors import InputError
from shenron_rt.frames import direction
from shenron_rt.physics.attenuation import two_way_loss


def power(profile, xyz, rcs_dbsm=10.0, **more):
    scene = scene_of(profile=profile, point_targets=[{"id": 3, "xyz_m": tuple(xyz), "rcs_dbsm": rcs_dbsm}], **more)
    return srt.illuminate(srt.trace(scene, rays=100), profile).power_by_object()[3]


@pytest.mark.parametrize("range_m", [2.0, 5.0, 90.0, 160.0])
def test_point_target_follows_the_radar_equation(range_m):
    assert power(ISO, (range_m, 0, 0)) == pytest.approx(10 * unit_power(range_m), rel=1e-12)


def test_gains_radome_and_power_enter_once_each():
    profile = srt.load_profile("awrl1432")
    plain = power(profile, (20, 0, 0))
    lam = profile.wavelength_m
    expected = 10 ** ((10 - 30) / 10) * 10**0.6 * 10**0.6 * lam**2 * 10 / (FOUR_PI_CUBED * 20.0**4)
    assert plain == pytest.approx(expected, rel=1e-12)
    behind_radome = profile.model_copy(
        update={"antenna": profile.antenna.model_copy(update={"radome_loss_db": 3.0, "gain_tx_dbi": 7.0})}
    )
    assert db(power(behind_radome, (20, 0, 0)) / plain) == pytest.approx(-2.0, abs=1e-9)


@pytest.mark.parametrize("pattern", ["gaussian", "cosn"])
def test_half_width_costs_six_db_two_way(pattern):
    profile = isotropic_profile(pattern=pattern, beamwidth_az_deg=80.0, beamwidth_el_deg=30.0)
    ahead = power(profile, (25, 0, 0))
    for az, el in ((40, 0), (-40, 0), (0, 15), (0, -15)):
        aside = power(profile, 25 * direction(math.radians(az), math.radians(el)))
        # half of the one-way power twice: 6.0206 dB
        assert db(aside / ahead) == pytest.approx(20 * math.log10(0.5), abs=1e-9)
    corner = power(profile, 25 * direction(math.radians(40), math.radians(15)))
    assert db(corner / ahead) == pytest.approx(40 * math.log10(0.5), abs=1e-9)


def test_table_pattern_counts_in_both_cuts():
    profile = isotropic_profile(
        pattern="table",
        table_az=((-60, -12), (0, 0), (60, -9)),
        table_el=((-30, -8), (0, 0), (30, -10)),
    )
    ahead = power(profile, (25, 0, 0))
    aside = power(profile, 25 * direction(math.radians(60), math.radians(-15)))
    assert db(aside / ahead) == pytest.approx(2 * (-9 - 4), abs=1e-9)


def test_no_hard_edge_of_the_field_of_view():
    """At 80 and 90 deg the gaussian of 120 deg is 10.7 and 13.5 dB down two-way, not gone."""
    profile = isotropic_profile(pattern="gaussian", beamwidth_az_deg=120.0, beamwidth_el_deg=40.0)
    ahead = power(profile, (25, 0, 0))
    for az in (80.0, 90.0, 110.0):
        loss = db(power(profile, 25 * direction(math.radians(az), 0.0)) / ahead)
        assert loss == pytest.approx(20 * math.log10(0.5) * (az / 60.0) ** 2, abs=1e-6)


@pytest.mark.parametrize("rain", [0.0, 25.0])
@pytest.mark.parametrize("fog", [None, 60.0])
def test_weather_costs_what_the_recommendations_say(rain, fog):
    dry = power(ISO, (80, 0, 0))
    weather = {"rain_mm_h": rain, "fog_visibility_m": fog, "temperature_c": 15.0}
    wet = power(ISO, (80, 0, 0), weather=weather)
    loss = two_way_loss(
        np.array([80.0]), ISO.center_hz, rain_mm_h=rain, fog_visibility_m=fog, temperature_c=15.0, polarization="V"
    )[0]
    assert dry / wet == pytest.approx(loss, rel=1e-12)
    assert loss > 1.0
    if rain:
        # P.838-3 at 77 GHz and 25 mm/h: about 11 dB/km, over 160 m
        assert 1.2 < db(loss) < 3.5


def test_scene_without_weather_has_no_attenuation():
    assert power(ISO, (150, 0, 0)) == pytest.approx(10 * unit_power(150.0), rel=1e-12)


def test_pattern_weighs_a_surface_as_it_weighs_a_point():
    """A small plate at 40 deg of an 80 deg beam loses 6.02 dB against the isotropic radar; it spans 0.2 deg."""
    beam = isotropic_profile(pattern="gaussian", beamwidth_az_deg=80.0, beamwidth_el_deg=30.0)
    where = tuple(25 * direction(math.radians(40), 0.0))
    target = {"id": 5, "shape": "plate:0.1x0.1", "xyz_m": where, "ypr_deg": (40, 0, 0), "aim": 400}
    levels = [
        srt.illuminate(srt.trace(scene_of(target, profile=p), rays=100), p).power_by_object()[5] for p in (beam, ISO)
    ]
    assert db(levels[0] / levels[1]) == pytest.approx(-6.0206, abs=0.03)


def test_unknown_echo_model_is_refused():
    scat = srt.trace(scene_of(point_targets=[{"id": 3, "xyz_m": (9, 0, 0), "rcs_dbsm": 0}]), rays=100)
    with pytest.raises(InputError, match="unknown echo model 'phsical'"):
        srt.illuminate(scat, ISO, model="phsical")


def test_scatterers_without_area_are_refused():
    scat = srt.Scatterers.from_table([[10.0, 0, 0, 0, 1, 0, 1]])
    with pytest.raises(InputError, match=r"area"):
        srt.illuminate(scat, ISO)
