"""Two simulations, or a simulation and a recording, of the same radar: where they differ, and why."""

from __future__ import annotations

from .compare import Comparison, compare

__all__ = ["Comparison", "compare"]
