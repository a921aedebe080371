"""``raw_data`` of a measurement written to a file: 24-byte records and nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..._typing import NDArray
from ...errors import InputError
from ._raw import RECORD, RawPoints, record_points

__all__ = ["read_raw_points"]

#: Tags fit a byte, cosines lie in [-1, 1]: other data read as records miss this in nearly every row.
_PLAUSIBLE = 0.5


def read_raw_points(file: Path, content: bytes) -> RawPoints:
    """Read 24-byte records.

    Parameters
    ----------
    file : path
        For messages.
    content : bytes
        The whole file.

    Raises
    ------
    InputError
        A length that is no multiple of 24, or records that cannot be points.
    """
    if len(content) % RECORD.itemsize:
        records = np.frombuffer(content, RECORD, len(content) // RECORD.itemsize)
        hint = "cut short" if len(records) and _share(records) > _PLAUSIBLE else "not semantic LiDAR"
        raise InputError(
            f"{file}: {len(content)} bytes are no whole number of 24-byte records (x, y, z, cos, id, tag); the file is "
            f"{hint}"
        )
    records = np.frombuffer(content, RECORD)
    if len(records) and _share(records) < _PLAUSIBLE:
        raise InputError(
            f"{file}: read as 24-byte records, {100 * (1 - _share(records)):.0f} % of the points have a cosine outside "
            "[-1, 1] or a tag above 255; plain LiDAR has 16-byte records and no tags, and cannot be used"
        )
    return record_points(records, "raw 24-byte records")


def _share(records: NDArray[Any]) -> float:
    with np.errstate(invalid="ignore"):
        good = (np.abs(records["CosAngle"]) <= 1.01) & (records["ObjTag"] <= 255)
    # a NaN cosine is a broken point of the right layout; the checks that follow name it
    return float(np.mean(good | np.isnan(records["CosAngle"])))
