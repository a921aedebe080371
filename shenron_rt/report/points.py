"""Detections and echoes of a page: all frames in one array each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from .._typing import FloatArray
from ..dsp import DETECTION_DTYPE, Detections
from ..plot._style import dbm
from ..returns import Returns
from .arrays import Arrays

__all__ = ["DETECTION_COLUMNS", "add_detections", "add_echoes", "sampled_echoes"]

#: Rows of ``<radar>.detections``: columns of ``detections.csv``, angles in rad as there. Ids stand in an array of
#: their own: float32 has seven digits, ids up to ten.
DETECTION_COLUMNS = tuple(n for n in DETECTION_DTYPE.names or () if n not in ("elevation_valid", "object_id"))
#: Echoes weaker than the strongest of a run by more than this look the same [dB].
_ECHO_SPAN_DB = 60.0


def add_detections(arrays: Arrays, prefix: str, found: Sequence[Detections | None]) -> dict[str, Any]:
    """Add the detections of a radar, frame by frame.

    Parameters
    ----------
    arrays : Arrays
        Gets ``<prefix>.detections``, (columns, n) float32, ``<prefix>.detection_id``, (n,) float64,
        ``<prefix>.detection_ghost``, (n,) uint8, and ``<prefix>.detection_chain``, (n,) uint32 rows of ``chains``.
    prefix : str
    found : sequence

    Returns
    -------
    dict
        ``start``: where the rows of each frame begin, and n; ``chains``: the different chains.
    """
    tables = [np.zeros(0, DETECTION_DTYPE) if d is None else d.table for d in found]
    table = np.concatenate(tables)
    arrays.add(f"{prefix}.detections", np.stack([table[name].astype(np.float64) for name in DETECTION_COLUMNS]), "f4")
    arrays.add(f"{prefix}.detection_id", table["object_id"], "f8")
    known = [d for d in found if d is not None]
    arrays.add(f"{prefix}.detection_ghost", np.concatenate([np.zeros(0, bool), *(d.ghost for d in known)]), "u1")
    chains, row = np.unique(np.concatenate([np.zeros(0, "U1"), *(d.chain for d in known)]), return_inverse=True)
    arrays.add(f"{prefix}.detection_chain", row, "u4")
    return {"start": _starts(tables), "chains": chains.tolist()}


def sampled_echoes(returns: Returns | None, most: int) -> tuple[FloatArray, FloatArray, int] | None:
    """Return position (n, 3) [m] and power (n,) [dBm] of every k-th echo, and k; None where power means nothing."""
    if returns is None or not returns.calibrated:
        return None
    lit = np.flatnonzero(np.abs(returns.amplitude) > 0)
    every = max(1, math.ceil(len(lit) / most))
    lit = lit[::every]
    return returns.position[lit], dbm(np.abs(returns.amplitude[lit]) ** 2), every


def add_echoes(
    arrays: Arrays, prefix: str, sampled: Sequence[tuple[FloatArray, FloatArray, int] | None]
) -> dict[str, Any] | None:
    """Add what :func:`sampled_echoes` gave of every frame, and return how to read it.

    Parameters
    ----------
    arrays : Arrays
        Gets ``<prefix>.echoes``, (n, 3) int16 steps of ``step_m`` in the radar frame, and ``<prefix>.echo_level``, (n,)
        uint8, 255 at ``top_dbm`` and 0 at ``span_db`` below it.
    prefix : str
    sampled : sequence

    Returns
    -------
    dict or None
        ``start``, ``step_m``, ``top_dbm``, ``span_db``, ``every``; None where no frame has echoes.
    """
    if not any(s is not None and len(s[1]) for s in sampled):
        return None
    places = [np.zeros((0, 3)) if s is None else s[0] for s in sampled]
    position = np.concatenate(places)
    level = np.concatenate([np.zeros(0) if s is None else s[1] for s in sampled])
    top = float(np.ceil(level.max()))
    step = max(float(np.abs(position).max()) / 32767, 1e-3)
    arrays.add(f"{prefix}.echoes", np.rint(position / step), "i2", later=True)
    code = np.clip(np.rint((level - top) / _ECHO_SPAN_DB * 255 + 255), 0, 255)
    arrays.add(f"{prefix}.echo_level", code, "u1", later=True)
    every = max(s[2] for s in sampled if s is not None)
    return {"start": _starts(places), "step_m": step, "top_dbm": top, "span_db": _ECHO_SPAN_DB, "every": every}


def _starts(rows: Sequence[Any]) -> list[int]:
    return [0, *(int(n) for n in np.cumsum([len(r) for r in rows]))]
