"""Di- and trihedrals through ``sweep_rcs``: exact sums over bounces on tables and off axis, full wave."""

from __future__ import annotations

import pytest
from rcs_bars import corners
from rcs_tools import Bar, gated, hold


@pytest.mark.parametrize("bar", gated(corners, slow=False))
def test_corners_hold_their_bars(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=True)


@pytest.mark.slow
@pytest.mark.parametrize("bar", gated(corners, slow=True))
def test_corners_hold_their_bars_at_every_sample(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=False)
