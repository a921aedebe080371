"""How the scatterers of two sides fill space: occupancy, area by tag, cosines."""

from __future__ import annotations

import numpy as np

from .._typing import FloatArray, IntArray
from ..scatterers import Scatterers
from ..tags import SemanticTag
from .record import Record

__all__ = ["compare_clouds"]

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
    both = len(np.intersect1d(cells_a, cells_b, assume_unique=True))
    either = len(cells_a) + len(cells_b) - both
    share = (lambda n: n / either) if either else (lambda n: 0.0)
    return Record(
        occupancy=Record(
            voxel_m=voxel_m,
            cells_a=len(cells_a),
            cells_b=len(cells_b),
            cells_both=both,
            share_both=share(both),
            share_a_only=share(len(cells_a) - both),
            share_b_only=share(len(cells_b) - both),
        ),
        tags=_by_tag(a, b),
        cosine=Record(a=_quantiles(a.cos_incidence), b=_quantiles(b.cos_incidence)),
        rows_a=len(a),
        rows_b=len(b),
    )


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
