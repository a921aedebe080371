"""How the scatterers of two sides fill space: occupancy, area by tag, cosines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._typing import FloatArray, IntArray
from ..scatterers import Scatterers
from ..tags import SemanticTag
from .record import Record

__all__ = ["compare_clouds", "pool_clouds"]

_QUANTILES = (0.1, 0.5, 0.9)


def compare_clouds(a: Scatterers, b: Scatterers, voxel_m: float) -> Record:
    """Return occupancy of a grid, area and cosine per tag.

    Parameters
    ----------
    a, b : Scatterers
        In the frame of the same radar.
    voxel_m : float
        Edge of the grid's cells [m].

    Returns
    -------
    Record
        ``occupancy``: ``share_both``, ``share_a_only``, ``share_b_only`` of the cells that either fills, and within
        those that the other side fills; ``tags``: rows, area and mean cosine of each side; ``cosine``: 10, 50 and 90 %
        quantiles over the rows.
    """
    cells_a, cells_b = (_cells(s.position, voxel_m) for s in (a, b))
    return Record(
        occupancy=_occupancy(
            voxel_m, len(cells_a), len(cells_b), len(np.intersect1d(cells_a, cells_b, assume_unique=True))
        ),
        tags=_by_tag(a, b),
        cosine=Record(a=_quantiles(a.cos_incidence), b=_quantiles(b.cos_incidence)),
        rows_a=len(a),
        rows_b=len(b),
    )


def pool_clouds(frames: Sequence[Record]) -> Record:
    """Return cells and rows of all frames together, areas and quantiles as means over the frames."""
    if len(frames) == 1:
        return frames[0]
    cells = [f.occupancy for f in frames]
    counts = (sum(c[k] for c in cells) for k in ("cells_a", "cells_b", "cells_both"))
    names = dict.fromkeys(t.tag for f in frames for t in f.tags)
    return Record(
        occupancy=_occupancy(cells[0].voxel_m, *counts),
        tags=[_pool_tag([t for f in frames for t in f.tags if t.tag == name], len(frames)) for name in names],
        cosine=Record({side: _pool_quantiles([f.cosine[side] for f in frames]) for side in "ab"}),
        rows_a=sum(f.rows_a for f in frames),
        rows_b=sum(f.rows_b for f in frames),
    )


def _pool_tag(records: Sequence[Record], frames: int) -> Record:
    pooled = Record(tag=records[0].tag)
    for side in "ab":
        rows = [r[f"rows_{side}"] for r in records]
        areas = [r[f"area_m2_{side}"] for r in records]
        cosines = [r[f"mean_cosine_{side}"] or 0.0 for r in records]
        pooled[f"rows_{side}"] = sum(rows)
        pooled[f"area_m2_{side}"] = None if None in areas else sum(areas) / frames
        pooled[f"mean_cosine_{side}"] = float(np.dot(rows, cosines) / sum(rows)) if sum(rows) else None
    return pooled


def _pool_quantiles(quantiles: Sequence[Record | None]) -> Record | None:
    known = [q for q in quantiles if q is not None]
    return Record({k: float(np.mean([q[k] for q in known])) for k in known[0]}) if known else None


def _occupancy(voxel_m: float, a: int, b: int, both: int) -> Record:
    either = max(a + b - both, 1)
    return Record(
        voxel_m=voxel_m, cells_a=a, cells_b=b, cells_both=both,
        share_both=both / either, share_a_only=(a - both) / either, share_b_only=(b - both) / either,
    )  # fmt: skip


def _cells(position: FloatArray, size: float) -> IntArray:
    """Return the sorted keys of the cells that hold a point; 21 bits an axis, +-1 million cells."""
    cell = np.floor(position / size).astype(np.int64) + (1 << 20)
    return np.unique((cell[:, 0] << 42) | (cell[:, 1] << 21) | cell[:, 2])


def _by_tag(a: Scatterers, b: Scatterers) -> list[Record]:
    records = []
    sums = [_sums(s) for s in (a, b)]
    for tag in np.flatnonzero(sums[0][0] + sums[1][0]):
        record = Record(tag=SemanticTag(int(tag)).name)
        for side, (rows, area, cosine) in zip("ab", sums, strict=True):
            record[f"rows_{side}"] = int(rows[tag])
            record[f"area_m2_{side}"] = None if area is None else float(area[tag])
            record[f"mean_cosine_{side}"] = float(cosine[tag] / rows[tag]) if rows[tag] else None
        records.append(record)
    return records


def _sums(s: Scatterers) -> tuple[IntArray, FloatArray | None, FloatArray]:
    tag = s.tag.astype(np.int64)
    area = None if s.area is None else np.bincount(tag, np.nan_to_num(s.area), 256).astype(np.float64)
    return np.bincount(tag, minlength=256), area, np.bincount(tag, s.cos_incidence, 256).astype(np.float64)


def _quantiles(value: FloatArray) -> Record | None:
    if not len(value):
        return None
    return Record(
        {f"q{int(100 * q)}": float(v) for q, v in zip(_QUANTILES, np.quantile(value, _QUANTILES), strict=True)}
    )
