"""What every mesh reader returns, and how all of them open a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..._typing import ArrayLike, FloatArray, IntArray
from ...errors import InputError, NotFoundError
from ..mesh import Part

__all__ = ["RawMesh", "as_float64", "placed", "read_bytes"]


@dataclass(frozen=True)
class RawMesh:
    """Triangles in file coordinates: ``vertices`` (v, 3), ``faces`` (f, 3), ``part`` (f,) rows of ``parts``."""

    vertices: FloatArray
    faces: IntArray
    part: IntArray
    parts: tuple[Part, ...]
    repaired: Mapping[str, int] = field(default_factory=dict)


def as_float64(values: ArrayLike) -> FloatArray:
    """Widen coordinates; a signalling NaN in the file stays a NaN, which the mesh counts and refuses."""
    with np.errstate(invalid="ignore"):
        return np.asarray(values).astype(np.float64)


def placed(vertices: FloatArray, matrix: FloatArray) -> FloatArray:
    """Apply a 4x4 matrix to (n, 3) points; an infinite one becomes NaN, which the mesh counts and refuses."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(vertices @ matrix[:3, :3].T + matrix[:3, 3])


def read_bytes(file: Path) -> bytes:
    """Return the content; :class:`NotFoundError` without the file, :class:`InputError` where it is empty."""
    try:
        content = file.read_bytes()
    except (FileNotFoundError, IsADirectoryError):
        raise NotFoundError(f"mesh file {str(file)!r} does not exist") from None
    if not content:
        raise InputError(f"{file}: the file is empty")
    return content
