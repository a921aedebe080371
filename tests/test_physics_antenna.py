"""Antenna patterns: half-power definition, floor, table."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shenron_rt.errors import InputError
from shenron_rt.physics import AntennaPattern, CosinePattern, GaussianPattern, IsotropicPattern, TabulatedPattern

widths = st.floats(math.radians(1.0), math.radians(170.0))


@given(az=widths, el=widths)
def test_half_the_full_width_is_exactly_half_the_power_in_each_cut(az: float, el: float) -> None:
    for pattern in (GaussianPattern(az, el), CosinePattern(az, el)):
        assert float(pattern(0.0, 0.0)) == 1.0
        for sign in (-1.0, 1.0):
            assert float(pattern(sign * az / 2, 0.0)) == pytest.approx(0.5, rel=1e-12)
            assert float(pattern(0.0, sign * el / 2)) == pytest.approx(0.5, rel=1e-12)
        # product form
        assert float(pattern(az / 2, el / 2)) == pytest.approx(0.25, rel=1e-12)


def test_the_full_width_is_12_db_down_one_way_in_a_gaussian() -> None:
    pattern = GaussianPattern(math.radians(60.0), math.radians(20.0))
    # twice the half-width: 2^-(2^2)
    assert float(pattern(math.radians(60.0), 0.0)) == pytest.approx(1 / 16, rel=1e-12)


def test_patterns_broadcast_and_satisfy_the_protocol() -> None:
    table = TabulatedPattern((-1.0, 0.0, 1.0), (-20.0, 3.0, -20.0), (-0.5, 0.5), (0.0, 0.0))
    for pattern in (IsotropicPattern(), GaussianPattern(1.0, 0.5), CosinePattern(1.0, 0.5), table):
        assert isinstance(pattern, AntennaPattern)
        gain = pattern(np.linspace(-math.pi, math.pi, 7)[:, None], np.zeros(3))
        assert gain.shape == (7, 3)
        assert gain.dtype == np.float64
        assert np.all((gain >= 0.0) & (gain <= 1.0))


def test_cosine_pattern_is_dark_behind() -> None:
    assert float(CosinePattern(1.0, 1.0)(math.pi * 0.75, 0.0)) == 0.0


def test_table_is_normalised_interpolated_in_db_and_holds_its_ends() -> None:
    pattern = TabulatedPattern.from_deg([(-60, -17), (0, 3), (60, -17)], [(-20, -6), (0, 0), (20, -6)])
    level = 10 * np.log10(pattern(np.radians([0.0, 30.0, 60.0, 90.0]), 0.0))
    assert np.allclose(level, [0.0, -10.0, -20.0, -20.0], atol=1e-12)
    assert 10 * np.log10(float(pattern(np.radians(30.0), np.radians(10.0)))) == pytest.approx(-13.0)


def test_bad_patterns_are_refused() -> None:
    with pytest.raises(InputError, match="beamwidth_az"):
        GaussianPattern(0.0, 1.0)
    with pytest.raises(InputError, match="beamwidth_el"):
        CosinePattern(1.0, math.pi)
    with pytest.raises(InputError, match="strictly increasing"):
        TabulatedPattern((0.0, 0.0), (1.0, 2.0), (0.0, 1.0), (0.0, 0.0))
    with pytest.raises(InputError, match="two or more"):
        TabulatedPattern((0.0,), (1.0,), (0.0, 1.0), (0.0, 0.0))
