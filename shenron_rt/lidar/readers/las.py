"""LAS and LAZ with C-Shenron's extra dimensions ``cosine``, ``index`` and ``sem_tag``."""

from __future__ import annotations

import importlib.util
import io
from pathlib import Path

import numpy as np

from ...errors import InputError
from ._raw import RawPoints, from_fields, require_points

__all__ = ["INSTALL", "read_las_points"]

#: What to run where the optional libraries are missing.
INSTALL = "pip install 'shenron-rt[io]'"


def read_las_points(file: Path, content: bytes) -> RawPoints:
    """Read a LAS or LAZ point cloud.

    Parameters
    ----------
    file : path
        For messages.
    content : bytes
        The whole file.

    Raises
    ------
    InputError
        The optional libraries are not installed, the extra dimensions or points are missing, the file is cut short.
    """
    needed = [name for name in ("laspy", "lazrs") if importlib.util.find_spec(name) is None]
    if needed:
        raise InputError(f"{file}: LAS and LAZ need {' and '.join(needed)}: {INSTALL}")
    import laspy

    try:
        cloud = laspy.read(io.BytesIO(content))
    except Exception as error:  # laspy and lazrs raise errors of their own, bare ones too
        raise InputError(f"{file}: not a LAS or LAZ file that can be read; is it cut short? ({error})") from None
    require_points(file, len(cloud))
    if len(cloud) != cloud.header.point_count:
        raise InputError(
            f"{file}: the header promises {cloud.header.point_count} points, the file holds {len(cloud)}; it is cut "
            "short"
        )
    columns = {axis: np.asarray(getattr(cloud, axis), dtype=np.float64) for axis in "xyz"}
    columns |= {name: np.asarray(cloud[name]) for name in cloud.point_format.extra_dimension_names}
    return from_fields(file, columns, "LAS/LAZ with cosine, index, sem_tag")
