"""The bars of examples/rcs_bars as test cases: the docs' table and the tests measure with the same code."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest
from rcs_bars.bars import Bar


def gated(module: ModuleType, *, slow: bool) -> list[object]:
    """Return the bars with a limit: all of them, or those that are quick enough for the default tests."""
    bars: tuple[Bar, ...] = module.BARS
    gates = (b for b in bars if callable(b.limits) or any(x.most is not None for x in b.limits))
    return [pytest.param(b, id=b.key) for b in gates if slow or not b.slow]


def hold(bar: Bar, request: pytest.FixtureRequest, *, quick: bool) -> None:
    """Measure a bar and fail with every limit that it breaks, by value or by what finer rays change."""
    shared = Path() if bar.needs is None else request.getfixturevalue(f"shared_{bar.needs}").parent
    figures, _ = bar.figures(shared, quick=quick)
    broken = [
        f"{f.limit}: {f.value:.4f} {bar.unit}, bar {f.limit.most:g}; finer rays change it by {f.change or 0.0:.4f}"
        for f in figures
        if not f.holds
    ]
    assert not broken, f"{bar.what} against {bar.reference}: " + "; ".join(broken)
