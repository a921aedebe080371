"""Fresnel, slab, layers, facet backscatter and permittivity against tables and conservation laws."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shenron_rt.errors import InputError
from shenron_rt.physics import (
    backscatter_reflection,
    coherent_factor,
    conductor_permittivity,
    fresnel,
    fresnel_cos,
    layered,
    p2040_permittivity,
    rayleigh_height,
    slab,
    water_permittivity,
)
from shenron_rt.physics.permittivity import P2040, cole_cole_permittivity

ASPHALT = 5.2 - 0.21j
# Bar of the acceptance table, absolute. The tables print six digits: 1e-5 in a complex value of modulus 1.
BAR = 1e-4

passive = st.builds(complex, st.floats(1.0, 80.0), st.floats(-80.0, 0.0))
angles = st.floats(0.0, math.pi / 2)


def rows(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a reference table, numeric where they can be."""
    with path.open() as file:
        table = list(csv.DictReader(line for line in file if not line.startswith("#")))
    columns = {}
    for key in table[0]:
        values = [row[key] for row in table]
        try:
            columns[key] = np.array(values, dtype=np.float64)
        except ValueError:
            columns[key] = np.array(values)
    return columns


def test_half_space_matches_the_table_in_amplitude_and_phase(shared_reference: Path) -> None:
    t = rows(shared_reference / "materials/fresnel_halfspace.csv")
    te, tm = fresnel(t["epsr"] - 1j * t["epsi"], np.radians(t["theta_deg"]))
    assert np.max(np.abs(te - t["absTE"] * np.exp(1j * np.radians(t["argTE_deg"])))) < BAR
    assert np.max(np.abs(tm - t["absTM"] * np.exp(1j * np.radians(t["argTM_deg"])))) < BAR


def test_slab_matches_the_table(shared_reference: Path) -> None:
    t = rows(shared_reference / "materials/slab.csv")
    bumper = 2.25 - 0.0034j
    eps = np.array(
        [
            bumper if name.startswith("polypropylene") else p2040_permittivity(name, f * 1e9)[0]
            for name, f in zip(t["material"], t["freq_ghz"], strict=True)
        ]
    )
    result = slab(eps, t["thickness_m"], np.radians(t["theta_deg"]), t["freq_ghz"] * 1e9)
    for value, column in zip(result, ("R_TE_db", "R_TM_db", "T_TE_db", "T_TM_db"), strict=True):
        assert np.max(np.abs(np.abs(value) - 10 ** (t[column] / 20))) < BAR


def test_layers_match_the_table_in_amplitude_and_phase(shared_reference: Path) -> None:
    t = rows(shared_reference / "materials/layered.csv")
    assert set(t["stack"]) == {"water_0.2mm_on_asphalt", "water_1mm_on_asphalt", "plastic3mm_on_metal"}
    for stack in set(t["stack"]):
        for frequency in (24.125e9, 77e9):
            here = (t["stack"] == stack) & (t["freq_ghz"] == frequency / 1e9)
            if stack.startswith("water"):
                layer, base = (water_permittivity(frequency, 20.0), float(stack.split("_")[1][:-2]) * 1e-3), ASPHALT
            else:  # the plastic of that stack is 2.6 - j0.02, found by fitting the table's complex rows (residual 1e-5)
                layer, base = (2.6 - 0.02j, 3e-3), complex(p2040_permittivity("metal", frequency)[0])
            te, tm = layered([layer], base, np.radians(t["theta_deg"][here]), frequency)
            for value, p in ((te, "TE"), (tm, "TM")):
                want = 10 ** (t[f"R_{p}_db"][here] / 20) * np.exp(1j * np.radians(t[f"arg{p}_deg"][here]))
                assert np.max(np.abs(value - want)) < BAR, (stack, frequency, p)


def test_p2040_matches_the_table_and_flags_extrapolation(shared_reference: Path) -> None:
    t = rows(shared_reference / "materials/materials_p2040_3.csv")
    assert set(t["material"]) == set(P2040)
    for i, name in enumerate(t["material"]):
        for f in ("24", "24.125", "76.5", "77", "79"):
            eps, outside = p2040_permittivity(name, float(f) * 1e9)
            # six printed digits
            assert complex(eps) == pytest.approx(complex(t[f"epsr_{f}"][i], -t[f"epsi_{f}"][i]), rel=2e-5)
            assert bool(outside) == (not t["valid_min_ghz"][i] <= float(f) <= t["valid_max_ghz"][i])


def test_water_matches_the_table_at_20_degrees(shared_reference: Path) -> None:
    t = rows(shared_reference / "materials/fresnel_halfspace.csv")
    here = t["material"] == "water_20C"
    eps = water_permittivity(t["freq_ghz"][here] * 1e9, 20.0)
    assert np.allclose(eps, t["epsr"][here] - 1j * t["epsi"][here], rtol=1e-5)


def test_cole_cole_without_broadening_is_debye_and_its_loss_peaks_at_the_relaxation() -> None:
    tau = 1e-11
    peak = cole_cole_permittivity(1.0 / (2.0 * math.pi * tau), 4.0, [(30.0, tau, 0.0)])
    assert complex(peak) == pytest.approx(19.0 - 15.0j, rel=1e-12)
    # sigma/(omega eps0): 1 S/m at 17.98 GHz is 1 by the rounded constant of P.2040
    assert complex(cole_cole_permittivity(17.98e9, 1.0, [], 1.0)) == pytest.approx(1.0 - 1.0j, rel=1e-12)


def test_metal_reflects_as_a_perfect_conductor() -> None:
    te, tm = fresnel(conductor_permittivity(1e7, 77e9), np.radians([0.0, 45.0, 80.0]))
    # a conductor of 1e7 S/m deviates by 2 sqrt(1/|eps|)/cos = 0.0013/cos
    assert np.all(np.abs(te + 1.0) < 0.002)
    assert np.all(np.abs(tm - 1.0) < 0.008)


@given(eps=passive, theta=angles)
def test_passive_half_space_reflects_at_most_what_falls_on_it(eps: complex, theta: float) -> None:
    for r in fresnel(eps, theta):
        assert abs(r) <= 1.0 + 1e-12


@given(eps=passive, theta=st.floats(0.0, 1.57), thickness=st.floats(0.0, 0.05), frequency=st.floats(20e9, 90e9))
def test_slab_keeps_energy(eps: complex, theta: float, thickness: float, frequency: float) -> None:
    r = slab(eps, thickness, theta, frequency)
    for reflected, transmitted in ((r.r_te, r.t_te), (r.r_tm, r.t_tm)):
        assert abs(reflected) ** 2 + abs(transmitted) ** 2 <= 1.0 + 1e-9
    lossless = slab(eps.real + 0.01, thickness, theta, frequency)
    assert abs(lossless.r_te) ** 2 + abs(lossless.t_te) ** 2 == pytest.approx(1.0, abs=1e-9)
    assert abs(lossless.r_tm) ** 2 + abs(lossless.t_tm) ** 2 == pytest.approx(1.0, abs=1e-9)


@given(eps=passive, theta=st.floats(0.0, 1.57), thickness=st.floats(0.0, 0.02), frequency=st.floats(20e9, 90e9))
def test_one_layer_on_air_is_a_slab(eps: complex, theta: float, thickness: float, frequency: float) -> None:
    te, tm = layered([(eps, thickness)], 1.0, theta, frequency)
    want = slab(eps, thickness, theta, frequency)
    assert abs(te - want.r_te) < 1e-8
    assert abs(tm - want.r_tm) < 1e-8


@given(eps=passive, theta=angles)
def test_no_layer_is_the_half_space_and_a_split_layer_is_one_layer(eps: complex, theta: float) -> None:
    # at eps = 1 and grazing both are a difference of equal numbers over their sum: rounding up to 1e-16/cos^2
    if math.cos(theta) > 1e-4:
        assert np.allclose(layered([], eps, theta, 77e9), fresnel(eps, theta), atol=1e-7)
    whole = layered([(3.0 - 0.1j, 2e-3)], eps, theta, 77e9)
    split = layered([(3.0 - 0.1j, 0.7e-3), (3.0 - 0.1j, 1.3e-3)], eps, theta, 77e9)
    assert np.allclose(whole, split, atol=1e-9)


def test_thick_absorber_hides_its_base() -> None:
    on_metal = layered([(3.0 - 1.0j, 1.0)], 1.0 - 1e7j, 0.3, 77e9)
    assert np.allclose(on_metal, fresnel(3.0 - 1.0j, 0.3), atol=1e-12)


def test_brewster_angle_is_a_zero_of_tm_only() -> None:
    te, tm = fresnel(4.0, math.atan(2.0))
    assert abs(tm) < 1e-15
    assert abs(te) == pytest.approx(0.6, abs=1e-12)


def basis(u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the unit vectors of increasing elevation (V) and azimuth (H) for directions (n, 3)."""
    az, el = np.arctan2(u[:, 1], u[:, 0]), np.arcsin(np.clip(u[:, 2] / np.linalg.norm(u, axis=1), -1, 1))
    v = np.stack([-np.sin(el) * np.cos(az), -np.sin(el) * np.sin(az), np.cos(el)], axis=1)
    return v, np.stack([-np.sin(az), np.cos(az), np.zeros_like(az)], axis=1)


def test_facet_backscatter_is_the_dyad_of_its_plane_of_incidence(rng: np.random.Generator) -> None:
    u = rng.normal(size=(500, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    n = rng.normal(size=(500, 3))
    cos = np.abs(np.sum(u * n, axis=1)) / np.linalg.norm(n, axis=1)
    te, tm = fresnel_cos(ASPHALT, cos)
    v, h = basis(u)
    across = np.cross(u, n)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    within = np.cross(across, u)
    fields = {"V": v, "H": h}
    for polarization in ("VV", "HH", "HV", "VH"):
        rx, tx = fields[polarization[0]], fields[polarization[1]]
        want = te * np.sum(rx * across, 1) * np.sum(tx * across, 1) - tm * np.sum(rx * within, 1) * np.sum(
            tx * within, 1
        )
        got = backscatter_reflection(te, tm, n, u * 7.0, polarization)
        assert np.max(np.abs(got - want)) < 1e-12


def test_metal_facet_is_minus_one_in_both_copolar_channels_and_silent_in_the_cross_ones(
    rng: np.random.Generator,
) -> None:
    u, n = rng.normal(size=(200, 3)), rng.normal(size=(200, 3))
    n[0], u[1], n[1] = -u[0], (0.0, 0.0, -1.0), (0.3, 0.1, 1.0)  # normal incidence; straight down
    for polarization, want in (("VV", -1.0), ("HH", -1.0), ("HV", 0.0), ("VH", 0.0)):
        got = backscatter_reflection(-1.0, 1.0, n, u, polarization)
        assert np.max(np.abs(got - want)) < 1e-15


def test_road_ahead_returns_tm_in_vertical_and_te_in_horizontal() -> None:
    u = np.array([[10.0, 3.0, -1.0]])
    te, tm = fresnel_cos(ASPHALT, np.abs(u[:, 2]) / np.linalg.norm(u))
    up = np.array([[0.0, 0.0, 1.0]])
    assert backscatter_reflection(te, tm, up, u, "VV")[0] == pytest.approx(-tm[0], abs=1e-15)
    assert backscatter_reflection(te, tm, up, u, "HH")[0] == pytest.approx(te[0], abs=1e-15)


def test_roughness_factor_squared_is_the_power_factor_and_matches_4_1_db() -> None:
    k = 2.0 * math.pi * 77e9 / 299_792_458.0
    assert 20 * math.log10(float(coherent_factor(k, 0.3e-3, 1.0))) == pytest.approx(-4.07, abs=0.01)
    assert float(coherent_factor(k, 0.3e-3, 0.0)) == 1.0
    # Rayleigh criterion at 77 GHz and normal incidence: 0.487 mm
    assert float(rayleigh_height(3.8934e-3, 1.0)) == pytest.approx(0.4867e-3, rel=1e-4)
    assert np.isinf(rayleigh_height(3.8934e-3, 0.0))


def test_bad_input_says_what_is_allowed() -> None:
    with pytest.raises(InputError, match="did you mean 'concrete'"):
        p2040_permittivity("concret", 77e9)
    with pytest.raises(InputError, match="> 0"):
        p2040_permittivity("concrete", 0.0)
    with pytest.raises(InputError, match="known: HH, HV, VH, VV"):
        backscatter_reflection(-1.0, 1.0, np.ones((1, 3)), np.ones((1, 3)), "RR")
    with pytest.raises(InputError, match=">= 0"):
        layered([(2.0, -1.0)], 1.0, 0.0, 77e9)
    with pytest.raises(InputError, match=">= 0"):
        slab(2.0, -1.0, 0.0, 77e9)
    with pytest.raises(InputError, match="> 0"):
        conductor_permittivity(0.0, 77e9)
