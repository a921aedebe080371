"""What must not matter to ``sweep_rcs``: direction of travel, triangulation, spacing, pose, size, backend, threads."""

from __future__ import annotations

import pytest
from rcs_tools import Bar, gated, hold

from rcs_bars import invariants


@pytest.mark.parametrize("bar", gated(invariants, slow=False))
def test_what_must_not_matter_does_not(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=True)


@pytest.mark.slow
@pytest.mark.parametrize("bar", gated(invariants, slow=True))
def test_what_must_not_matter_does_not_at_every_sample(bar: Bar, request: pytest.FixtureRequest) -> None:
    hold(bar, request, quick=False)
