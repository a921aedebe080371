"""Dielectrics through ``sweep_rcs``, and the coefficients they reflect by."""

from __future__ import annotations

import pytest
from rcs_bars import dielectric
from rcs_tools import Bar, gated, hold


@pytest.mark.parametrize("bar", gated(dielectric, slow=False))
def test_dielectrics_hold_their_bars(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=True)


@pytest.mark.slow
@pytest.mark.parametrize("bar", gated(dielectric, slow=True))
def test_dielectrics_hold_their_bars_at_every_sample(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=False)
