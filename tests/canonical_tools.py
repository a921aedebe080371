"""Reference tables of radar targets as columns, and what the tests of the canonical references share."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np

from shenron_rt.constants import SPEED_OF_LIGHT

#: Tables print four decimals of dB; their last digit and its rounding.
PRINTED = 1e-4
#: Tables write -120 dBsm for nothing.
FLOOR = -119.9


def columns(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a table, numeric where they can be."""
    with path.open() as file:
        table = list(csv.DictReader(line for line in file if not line.startswith("#")))
    result = {}
    for key in table[0]:
        values = [row[key] for row in table]
        try:
            result[key] = np.array(values, dtype=np.float64)
        except ValueError:
            result[key] = np.array(values)
    return result


def wavelength(ghz: float | str) -> float:
    return SPEED_OF_LIGHT / (float(ghz) * 1e9)


def dbsm(amplitude: np.ndarray | complex) -> np.ndarray:
    """Return 20 log10 |amplitude|, not below the tables' floor."""
    return 20.0 * np.log10(np.maximum(np.abs(amplitude), 1e-6))


def basis(azimuth: np.ndarray, elevation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the direction (..., 3) and V, H (..., 2, 3) there: unit vectors of increasing elevation and azimuth."""
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    v = np.stack([-se * ca, -se * sa, ce], axis=-1)
    h = np.stack([-sa, ca, np.zeros_like(ca)], axis=-1)
    return np.stack([ce * ca, ce * sa, se], axis=-1), np.stack([v, h], axis=-2)


def angles(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return azimuth and elevation of unit vectors (..., 3)."""
    return np.arctan2(direction[..., 1], direction[..., 0]), np.arcsin(np.clip(direction[..., 2], -1.0, 1.0))


def _turn(angle: float, axis: int) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = c, -s, s, c
    return matrix


#: direction in the trihedral tables' frame = TO_TABLE @ direction in ours.
TO_TABLE = _turn(math.radians(45.0), 2) @ _turn(-math.atan(math.sqrt(0.5)), 1)


def in_table_frame(function, azimuth_deg: np.ndarray, elevation_deg: np.ndarray) -> np.ndarray:
    """Return the scattering matrices of ``function(azimuth, elevation)`` for directions and bases of the tables."""
    u, there = basis(np.radians(azimuth_deg), np.radians(elevation_deg))
    azimuth, elevation = angles(u @ TO_TABLE)
    # a direction on the rim of the octant may come back outside by a rounding; the boundary belongs to the corner
    ours = basis(azimuth, elevation)[1] @ TO_TABLE.T
    q = np.einsum("...ai,...bi->...ab", there, ours)
    return q @ function(azimuth, elevation) @ np.swapaxes(q, -1, -2)
