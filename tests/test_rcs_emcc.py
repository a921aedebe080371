"""EMCC targets through ``sweep_rcs``: as near to full wave as exact physical optics is."""

from __future__ import annotations

import pytest
from rcs_bars import emcc
from rcs_tools import Bar, gated, hold


@pytest.mark.parametrize("bar", gated(emcc, slow=False))
def test_emcc_targets_hold_their_bars(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=True)


@pytest.mark.slow
@pytest.mark.parametrize("bar", gated(emcc, slow=True))
def test_emcc_targets_hold_their_bars_at_every_sample(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=False)
