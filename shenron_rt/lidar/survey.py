"""What a file of semantic LiDAR is, before anyone says how its tags are numbered or where its y axis points."""

from __future__ import annotations

import os

import numpy as np

from ..errors import InputError
from .evidence import suggest_from_points
from .grid import estimate_grid
from .read import check_points, scan_frame
from .readers import read_points

__all__ = ["survey_points"]


def survey_points(path: str | os.PathLike[str]) -> str:
    """Check what needs no further word of a file, and say what its points suggest for the rest.

    Parameters
    ----------
    path : path
        Any layout of :func:`shenron_rt.read_semantic_lidar`.

    Returns
    -------
    str
        Layout, points, grid, tag table and axes that the points suggest, each with how it is known.

    Raises
    ------
    InputError
        Points that cannot be semantic LiDAR under any table or axes.
    NotFoundError
    """
    raw, clipped = check_points(read_points(path), str(path))
    table = suggest_from_points(raw)
    axes = scan_frame(raw)
    try:
        grid = str(estimate_grid(raw.xyz, str(path)))
    except InputError:
        grid = "no angular grid about the origin: merged, resampled, or the origin is not the sensor"
    actors = len(np.unique(raw.object_id[raw.object_id > 0]))
    parts = [
        raw.layout,
        f"{len(raw)} points, {actors} actors",
        f"--tag-table {table.table or '?'} ({table.evidence})",
        f"--frame {axes or '?'} ({'the scan runs so' if axes else 'the order of the points does not tell'})",
        grid,
    ]
    return "; ".join([*parts, *raw.notes, *([f"{clipped} cosines clipped"] if clipped else [])])
