"""sigma0 theory against its table, and the energy bound."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shenron_rt.errors import InputError
from shenron_rt.physics import (
    constant_gamma,
    diffuse_albedo,
    diffuse_budget,
    geometric_optics,
    kirchhoff,
    lambertian,
    limit_sigma0,
    small_perturbation,
)

#: Bar of the acceptance table [dB]; the table prints six digits.
BAR_DB = 0.01
#: The table cuts its own levels off here [dB].
TABLE_FLOOR_DB = -299.0


def test_sigma0_theory_matches_the_table_in_all_five_columns(shared_reference: Path) -> None:
    with (shared_reference / "clutter/sigma0_theory.csv").open() as file:
        table = list(csv.DictReader(line for line in file if not line.startswith("#")))
    compared = dict.fromkeys(("spm_HH", "spm_VV", "kirchhoff_HH", "kirchhoff_VV", "go"), 0)
    for row in table:
        x = {k: float(v) for k, v in row.items() if k not in ("case", "acf")}
        eps, cos = complex(x["epsr"], -x["epsi"]), math.cos(math.radians(x["inc_deg"]))
        acf = {"exp": "exponential", "gauss": "gaussian"}[row["acf"]]
        surface = (eps, x["s_mm"] * 1e-3, x["l_mm"] * 1e-3, acf, x["freq_ghz"] * 1e9, cos)
        got = {
            "spm_HH": small_perturbation(*surface, "HH"),
            "spm_VV": small_perturbation(*surface, "VV"),
            # the table sums 399 terms, too few for gravel at 77 GHz; see the next test
            "kirchhoff_HH": kirchhoff(*surface, "HH", terms=399),
            "kirchhoff_VV": kirchhoff(*surface, "VV", terms=399),
            "go": geometric_optics(eps, math.sqrt(2) * x["s_mm"] / x["l_mm"], cos),
        }
        for column, value in got.items():
            if x[column] > TABLE_FLOOR_DB:  # false for nan
                assert 10 * math.log10(float(value)) == pytest.approx(x[column], abs=BAR_DB), (row["case"], column)
                compared[column] += 1
            elif not math.isnan(x[column]):
                assert float(value) < 1e-29
    assert min(compared.values()) > 60  # of 156 rows: no column passes by being skipped


def test_399_terms_are_enough_but_for_gravel_at_77_ghz_where_the_full_series_is_geometric_optics() -> None:
    # g = (2 k s)^2 = 375 for gravel: the Poisson weights reach to about 375 + 6 sqrt(375) = 491 terms
    gravel = (4.0 - 0.3j, 6e-3, 15e-3, "gaussian", 77e9)
    full, cut = kirchhoff(*gravel, 1.0, "HH"), kirchhoff(*gravel, 1.0, "HH", terms=399)
    optics = geometric_optics(4.0 - 0.3j, math.sqrt(2) * 6 / 15, 1.0)
    assert 10 * math.log10(float(full / optics)) == pytest.approx(0.0, abs=0.02)  # order 1/g
    assert 10 * math.log10(float(cut / optics)) < -0.4
    # the others have g below 42: converged to the bar with 399 terms
    rough_metal = (1.0 - 2.3e6j, 2e-3, 20e-3, "gaussian", 77e9, 1.0, "HH")
    assert float(kirchhoff(*rough_metal, terms=399)) == pytest.approx(float(kirchhoff(*rough_metal)), rel=1e-12)


def test_kirchhoff_tends_to_small_perturbation_for_a_smooth_surface_at_normal_incidence() -> None:
    surface = (5.2 - 0.21j, 1e-6, 1e-3, "exponential", 77e9, 1.0)
    # first order in g = (2 k s)^2 = 1e-5: -g for e^-g, +g/8 for the second term
    assert float(kirchhoff(*surface, "VV") / small_perturbation(*surface, "VV")) == pytest.approx(1.0, abs=2e-5)


def test_kirchhoff_tends_to_geometric_optics_for_a_very_rough_surface() -> None:
    cos = np.cos(np.radians([0.0, 10.0, 20.0]))
    eps, s, length = 1.0 - 1e7j, 20e-3, 100e-3
    series = kirchhoff(eps, s, length, "gaussian", 77e9, cos, "HH")
    # the scalar series lacks the 1/cos^4 of geometric optics beyond its own 1/cos^2: compare at normal incidence
    assert float(series[0] / geometric_optics(eps, math.sqrt(2) * s / length, cos)[0]) == pytest.approx(1.0, rel=0.01)


def test_lambert_albedo_is_a_quarter_of_gamma_at_every_angle() -> None:
    cos = np.cos(np.radians([0.0, 40.0, 89.0]))
    assert np.allclose(diffuse_albedo(lambda c: lambertian(0.4, c), cos), 0.1, rtol=1e-10)


def test_constant_gamma_albedo_is_gamma_over_3_sqrt_cos() -> None:
    # integral of sqrt(mu) is 2/3; the end of the range at grazing, where sqrt bends, limits the rule to 1e-6
    cos = np.array([1.0, 0.25])
    assert np.allclose(diffuse_albedo(lambda c: constant_gamma(0.3, c), cos), 0.1 / np.sqrt(cos), rtol=1e-5)


def test_geometric_optics_conserves_the_power_of_a_gentle_metal_surface_in_its_own_lobe() -> None:
    """All facets of slope p.d.f. p reflect: integral of sigma0 over slopes equals the share that faces each way.

    At normal incidence the backscatter at angle t comes from facets tilted by t, so the integral over solid angle of
    sigma0 cos^4 / (|R|^2 pi) is the integral of the slope density, 1.
    """
    m = 0.1
    theta = np.linspace(0.0, 1.2, 20001)
    density = geometric_optics(1.0 - 1e9j, m, np.cos(theta)) * np.cos(theta) ** 4 / math.pi
    slope_element = np.tan(theta) / np.cos(theta) ** 2
    assert float(np.trapezoid(density * 2 * math.pi * slope_element, theta)) == pytest.approx(1.0, rel=1e-3)


levels = st.floats(1e-4, 30.0)


@settings(deadline=None)
@given(gamma=levels, te=st.floats(0.0, 1.0), tm=st.floats(0.0, 1.0), s=st.floats(0.0, 5e-3), omega=st.floats(0.0, 1.0))
def test_coherent_plus_incoherent_never_exceeds_the_incident_power(
    gamma: float, te: float, tm: float, s: float, omega: float
) -> None:
    k, cross = 1613.8, 0.2
    cos = np.cos(np.radians(np.linspace(0.0, 89.9, 60)))

    def limited(c: np.ndarray) -> np.ndarray:
        return limit_sigma0(
            lambda x: constant_gamma(gamma, x),
            lambda x: diffuse_budget(te, tm, k, s, omega, x),
            c,
            cross_ratio=cross,
        )

    diffuse = diffuse_albedo(limited, cos) * (1.0 + cross)
    coherent = np.exp(-4.0 * (k * s * cos) ** 2)
    for power in (te, tm):
        assert np.all(power * coherent + diffuse <= 1.0 + 1e-9)
        # and without volume scattering the diffuse part is at most what roughness took
        if omega == 0.0:
            assert np.all(diffuse <= power * (1.0 - coherent) + 1e-9)


def test_a_surface_within_its_budget_is_left_alone() -> None:
    cos = np.linspace(0.1, 1.0, 50)
    limited = limit_sigma0(lambda c: lambertian(0.04, c), lambda c: np.full_like(c, 0.02), cos)
    assert np.array_equal(limited, lambertian(0.04, cos))


def test_a_smooth_surface_without_volume_has_no_incoherent_echo() -> None:
    budget = diffuse_budget(0.9, 0.8, 1613.8, 0.0, 0.0, np.ones(3))
    assert np.all(limit_sigma0(lambda c: lambertian(1.0, c), lambda c: budget[0] + 0.0 * c, np.ones(3)) == 0.0)


def test_bad_input_says_what_is_allowed() -> None:
    with pytest.raises(InputError, match="exponential, gaussian"):
        kirchhoff(4.0, 1e-3, 1e-2, "box", 77e9, 1.0, "VV")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="VV, HH"):
        small_perturbation(4.0, 1e-3, 1e-2, "gaussian", 77e9, 1.0, "HV")
    with pytest.raises(InputError, match="0 to 1"):
        diffuse_budget(0.5, 0.5, 1600.0, 0.0, 1.5, 1.0)
    with pytest.raises(InputError, match="> 0"):
        geometric_optics(4.0, 0.0, 1.0)
    with pytest.raises(InputError, match="> 0"):
        kirchhoff(4.0, 1e-3, 1e-2, "gaussian", 0.0, 1.0, "VV")
