"""Real meshes through ``sweep_rcs``: the median level stands, whatever the rays' spacing and the triangulation."""

from __future__ import annotations

import pytest
from rcs_bars import vehicles
from rcs_tools import Bar, gated, hold


@pytest.mark.slow
@pytest.mark.parametrize("bar", gated(vehicles, slow=True))
def test_median_over_aspects_stands(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=False)
