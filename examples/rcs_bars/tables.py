"""Reference tables as columns, and where they are."""

from __future__ import annotations

import csv
import functools
import os
from pathlib import Path

import numpy as np

from shenron_rt.constants import SPEED_OF_LIGHT


def shared_folder() -> Path | None:
    """Return the folder of reference tables: ``SHENRON_RT_SHARED``, or ``shared`` beside the checkout."""
    named = os.environ.get("SHENRON_RT_SHARED")
    folder = Path(named) if named else Path(__file__).resolve().parents[3] / "shared"
    return folder if folder.is_dir() else None


@functools.cache
def columns(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a table, as numbers where they can be; lines that begin with # are comments."""
    with path.open(encoding="utf-8") as file:
        table = list(csv.DictReader(line for line in file if not line.startswith("#")))
    result: dict[str, np.ndarray] = {}
    for key in table[0]:
        values = [row[key] for row in table]
        try:
            result[key] = np.array(values, dtype=np.float64)
        except ValueError:
            result[key] = np.array(values)
    return result


def rows(table: dict[str, np.ndarray], **equal: str | float) -> dict[str, np.ndarray]:
    """Return the rows of a table at which columns have these values."""
    keep = np.logical_and.reduce([table[key] == value for key, value in equal.items()])
    return {key: column[keep] for key, column in table.items()}


def wavelength(ghz: float) -> float:
    """Return the wavelength [m]."""
    return SPEED_OF_LIGHT / (ghz * 1e9)
