"""Which detections are the same: assignment inside gates of resolution cells."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .._typing import FloatArray, IntArray
from ..dsp import Detections
from ..dsp.angle import azimuth_channels, sine_grid
from ..io.recorded import PointCloud
from .record import Record

if TYPE_CHECKING:
    from ..config.profile import RadarProfile

__all__ = ["Gate", "match_detections", "pool_matches"]

#: Cost of a pair outside the gate; any set of pairs inside is cheaper than one of these.
_FORBIDDEN = 1e6


@dataclass(frozen=True)
class Gate:
    """How far apart two detections of one thing may be.

    Parameters
    ----------
    range_m : float
    velocity_mps : float
    sine : float
        Of azimuth, in which an array's resolution is constant.
    velocity_span_mps : float
        Unambiguous span, 2 v_max: velocities are compared modulo this; infinite for none.
    """

    range_m: float
    velocity_mps: float
    sine: float
    velocity_span_mps: float = math.inf

    @classmethod
    def of(cls, profile: RadarProfile, cells: float) -> Gate:
        """Return the gate of so many resolution cells of a profile."""
        channels = azimuth_channels(profile.positions_m, profile.wavelength_m)
        grid = sine_grid(profile.positions_m[channels], profile.wavelength_m)
        step = float(grid[1] - grid[0]) if len(grid) > 1 else 2.0
        return cls(
            cells * profile.range_resolution_m,
            cells * profile.velocity_resolution_mps,
            cells * step,
            2 * profile.bursts[0].max_velocity_mps,
        )


def match_detections(a: Detections | PointCloud, b: Detections | PointCloud, gate: Gate) -> Record:
    """Pair the detections of two sides so that the sum of squared, gate-normalised distances is least.

    Returns
    -------
    Record
        ``matched`` (indices and errors, B minus A), ``missed`` (in A only), ``extra`` (in B only), ``errors``
        (count, mean, std, rms, median and largest magnitude of each), ``gate``.
    """
    from scipy.optimize import linear_sum_assignment

    dr, dv, ds = _differences(a, b, gate)
    parts = np.stack([dr / gate.range_m, dv / gate.velocity_mps, ds / gate.sine])
    allowed = np.all(np.abs(parts) <= 1.0, axis=0)
    cost = np.where(allowed, np.sum(parts**2, axis=0), _FORBIDDEN)
    rows, columns = linear_sum_assignment(cost)
    kept = allowed[rows, columns]
    rows, columns = rows[kept], columns[kept]
    d_azimuth = np.degrees(b.azimuth[columns] - a.azimuth[rows])
    errors = {
        "range_m": dr[rows, columns],
        "velocity_mps": dv[rows, columns],
        "azimuth_deg": d_azimuth,
        "snr_db": b.snr_db[columns] - a.snr_db[rows],
    }
    matched = [
        Record(
            a=int(i),
            b=int(j),
            object_id=_object(a, int(i), _object(b, int(j), None)),
            range_m=float(a.range[i]),
            azimuth_deg=math.degrees(float(a.azimuth[i])),
            velocity_mps=float(a.velocity[i]),
            **{f"{name}_error": float(value[k]) for name, value in errors.items()},
        )
        for k, (i, j) in enumerate(zip(rows, columns, strict=True))
    ]
    return Record(
        matched=matched,
        missed=_rest(a, rows),
        extra=_rest(b, columns),
        errors=Record({name: _statistics(value) for name, value in errors.items()}),
        gate=Record(range_m=gate.range_m, velocity_mps=gate.velocity_mps, azimuth_sine=gate.sine),
    )


def pool_matches(frames: Sequence[tuple[int, Record]]) -> Record:
    """Return the matches of all frames together, each record with its ``frame``; detections match within a frame.

    Parameters
    ----------
    frames : sequence of (int, Record)
        Frame and what :func:`match_detections` returned.
    """
    lists = {
        kind: [Record(r, frame=number) for number, found in frames for r in found[kind]]
        for kind in ("matched", "missed", "extra")
    }
    first = frames[0][1]
    errors = {
        name: _statistics(np.array([m[f"{name}_error"] for m in lists["matched"]], dtype=np.float64))
        for name in first.errors
    }
    return Record(**lists, errors=Record(errors), gate=first.gate)


def _differences(
    a: Detections | PointCloud, b: Detections | PointCloud, gate: Gate
) -> tuple[FloatArray, FloatArray, FloatArray]:
    dr = b.range[None, :] - a.range[:, None]
    dv = b.velocity[None, :] - a.velocity[:, None]
    if math.isfinite(gate.velocity_span_mps):
        half = gate.velocity_span_mps / 2
        dv = (dv + half) % gate.velocity_span_mps - half
    return dr, dv, np.sin(b.azimuth)[None, :] - np.sin(a.azimuth)[:, None]


def _object(side: Detections | PointCloud, row: int, default: int | None) -> int | None:
    return int(side.object_id[row]) if isinstance(side, Detections) else default


def _rest(side: Detections | PointCloud, used: IntArray) -> list[Record]:
    left = np.setdiff1d(np.arange(len(side)), used)
    return [
        Record(
            index=int(i),
            object_id=_object(side, int(i), None),
            range_m=float(side.range[i]),
            azimuth_deg=math.degrees(float(side.azimuth[i])),
            velocity_mps=float(side.velocity[i]),
            snr_db=float(side.snr_db[i]),
        )
        for i in left
    ]


def _statistics(value: FloatArray) -> Record:
    finite = value[np.isfinite(value)]
    if not finite.size:
        return Record(count=0, mean=None, std=None, rms=None, median=None, largest=None)
    return Record(
        count=int(finite.size),
        mean=float(finite.mean()),
        std=float(finite.std()),
        rms=float(np.sqrt(np.mean(finite**2))),
        median=float(np.median(finite)),
        largest=float(np.abs(finite).max()),
    )
