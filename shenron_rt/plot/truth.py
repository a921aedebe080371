"""Where the objects of a scene stand, for ticks and crosses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..frames import spherical
from ..returns import Returns

__all__ = ["Truth", "truth_of"]


@dataclass(frozen=True)
class Truth:
    """One object as the radar sees it at mid-frame: power-weighted means over its echoes. SI, azimuth + left.

    Ghosts, which show it where it is not, do not count.
    """

    object_id: int
    name: str
    range_m: float
    azimuth_rad: float
    velocity_mps: float
    x: float
    y: float

    def folded(self, max_velocity_mps: float) -> float:
        """Return the range rate as the radar reports it, in [-v_max, v_max) [m/s]."""
        span = 2 * max_velocity_mps
        return float((self.velocity_mps + max_velocity_mps) % span - max_velocity_mps)


def truth_of(returns: Returns | None, names: Mapping[int, str] | None = None) -> list[Truth]:
    """Return every object with an id of its own, strongest first; the static rest (id 0) has no one place."""
    if returns is None or len(returns) == 0:
        return []
    power = np.where(returns.ghost, 0.0, np.abs(returns.amplitude) ** 2)
    distance, _, _ = spherical(returns.position)
    rate = np.einsum("ij,ij->i", returns.position, returns.velocity) / np.maximum(distance, 1e-9)
    ids, row = np.unique(returns.object_id, return_inverse=True)
    total = np.bincount(row, power)
    columns = np.column_stack([distance, rate, returns.position[:, 0], returns.position[:, 1]])
    sums = np.column_stack([np.bincount(row, power * c) for c in columns.T])
    found = []
    for i in np.argsort(-total):
        if ids[i] == 0 or total[i] <= 0:
            continue
        r, v, x, y = (float(s) for s in sums[i] / total[i])
        name = (names or {}).get(int(ids[i]), f"object {int(ids[i])}")
        found.append(Truth(int(ids[i]), name, r, float(np.arctan2(y, x)), v, x, y))
    return found
