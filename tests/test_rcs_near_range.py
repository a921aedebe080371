"""Targets at a finite range through ``sweep_rcs``: tables, exact sums, surface integrals, a wall."""

from __future__ import annotations

import pytest
from rcs_bars import near_range
from rcs_tools import Bar, gated, hold


@pytest.mark.parametrize("bar", gated(near_range, slow=False))
def test_near_targets_hold_their_bars(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=True)


@pytest.mark.slow
@pytest.mark.parametrize("bar", gated(near_range, slow=True))
def test_near_targets_hold_their_bars_at_every_sample(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=False)
