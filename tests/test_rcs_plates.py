"""Plates, discs and boxes through ``sweep_rcs``: exact physical optics, nulls, full wave."""

from __future__ import annotations

import pytest
from rcs_bars import flat
from rcs_tools import Bar, gated, hold


@pytest.mark.parametrize("bar", gated(flat, slow=False))
def test_flat_bodies_hold_their_bars(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=True)


@pytest.mark.slow
@pytest.mark.parametrize("bar", gated(flat, slow=True))
def test_flat_bodies_hold_their_bars_at_every_sample(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=False)
