"""What every mesh reader returns, and how all of them open a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ..._typing import FloatArray, IntArray
from ...errors import InputError, NotFoundError
from ..mesh import Part

__all__ = ["RawMesh", "read_bytes"]


@dataclass(frozen=True)
class RawMesh:
    """Triangles in file coordinates: ``vertices`` (v, 3), ``faces`` (f, 3), ``part`` (f,) rows of ``parts``."""

    vertices: FloatArray
    faces: IntArray
    part: IntArray
    parts: tuple[Part, ...]
    repaired: Mapping[str, int] = field(default_factory=dict)


def read_bytes(file: Path) -> bytes:
    """Return the content; :class:`NotFoundError` without the file, :class:`InputError` where it is empty."""
    try:
        content = file.read_bytes()
    except (FileNotFoundError, IsADirectoryError):
        raise NotFoundError(f"mesh file {str(file)!r} does not exist") from None
    if not content:
        raise InputError(f"{file}: the file is empty")
    return content
