"""Objects of a page: where they truly are, frame by frame, and what the radar receives of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .._typing import FloatArray
from ..frames import spherical
from ..plot.truth import Truth
from ..run_source import RunRadar
from .arrays import Arrays

__all__ = ["TRUTH_COLUMNS", "add_truth"]

#: Rows of ``<radar>.truth`` for each object. Where it is: the mean of its echoes by power (``echoes`` 1), or without an
#: echo the middle of its body (``echoes`` 0).
TRUTH_COLUMNS = ("range_m", "azimuth_deg", "velocity_mps", "x_m", "y_m", "power_dbm", "snr_db", "detected", "echoes")


def add_truth(
    arrays: Arrays,
    prefix: str,
    radar: RunRadar,
    names: Mapping[int, str],
    echoing: Sequence[Sequence[Truth]],
    middles: Mapping[int, FloatArray],
) -> list[dict[str, Any]]:
    """Add ``<prefix>.truth``, (objects, columns, frames) float32, NaN where nothing is known; return the objects.

    Parameters
    ----------
    arrays : Arrays
    prefix : str
    radar : RunRadar
    names : mapping of int to str
        Names by id.
    echoing : sequence of sequence of Truth
        Of every frame.
    middles : mapping of int to (frames, 3) float
        Middles of bodies in the radar frame [m].

    Returns
    -------
    list of dict
        ``id``, ``name``, ``tag``; things with an id of their own first, static surfaces (0) last.
    """
    records = [{int(o["id"]): o for o in frame.record.get("objects", ())} for frame in radar.frames]
    names = {n: str(o["name"]) for record in records for n, o in record.items() if o.get("name")} | dict(names)
    known = set(names) | {n for record in records for n in record} | {t.object_id for frame in echoing for t in frame}
    ids = [*sorted(n for n in known if n > 0), *([0] if 0 in known else [])]
    table = np.full((len(ids), len(TRUTH_COLUMNS), len(radar.frames)), np.nan)
    row = {number: i for i, number in enumerate(ids)}
    times = np.array([f.mid_s for f in radar.frames])
    for number, middle in middles.items():
        if number in row:
            table[row[number], :5] = _of_middle(middle, times)
            table[row[number], 8] = 0
    for k, (frame, record) in enumerate(zip(echoing, records, strict=True)):
        for t in frame:
            table[row[t.object_id], :5, k] = (t.range_m, math.degrees(t.azimuth_rad), t.velocity_mps, t.x, t.y)
            table[row[t.object_id], 8, k] = 1
        for number, levels in record.items():
            table[row[number], 5:8, k] = _received(levels)
    arrays.add(f"{prefix}.truth", table, "f4")
    tags = {n: o["tag"] for record in records for n, o in record.items() if o.get("tag")}
    return [{"id": n, "name": names.get(n, f"object {n}" if n else "static"), "tag": tags.get(n)} for n in ids]


def _received(record: Mapping[str, Any]) -> tuple[float, float, float]:
    power, snr = record.get("power_dbw"), record.get("snr_db")
    return (
        math.nan if power is None else power + 30,
        math.nan if snr is None else snr,
        float(bool(record.get("detected"))),
    )


def _of_middle(middle: FloatArray, times: FloatArray) -> FloatArray:
    """Return the first five columns of a moving point; its range rate is the slope of its range over the frames."""
    distance, azimuth, _ = spherical(middle)
    rising = len(times) > 1 and bool(np.all(np.diff(times) > 0))
    rate = np.gradient(distance, times) if rising else np.full(len(times), np.nan)
    return np.stack([distance, np.degrees(azimuth), rate, middle[:, 0], middle[:, 1]])
