"""Spheres and cylinders through ``sweep_rcs``: physical optics of the lit part, Mie, two directions at once."""

from __future__ import annotations

import pytest
from rcs_bars import curved
from rcs_tools import Bar, gated, hold


@pytest.mark.parametrize("bar", gated(curved, slow=False))
def test_curved_bodies_hold_their_bars(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=True)


@pytest.mark.slow
@pytest.mark.parametrize("bar", gated(curved, slow=True))
def test_curved_bodies_hold_their_bars_at_every_sample(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=False)
