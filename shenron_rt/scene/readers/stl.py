"""STL, binary or ASCII: triangles without names, one solid name at best."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ..._typing import FloatArray
from ...errors import InputError
from ..mesh import Part
from ._raw import RawMesh, as_float64, read_bytes

__all__ = ["read_stl"]

_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_HEADER = 84  # 80 bytes of text and the number of triangles


def read_stl(file: Path) -> RawMesh:
    """Read an STL file; corners at the same place become one vertex.

    Raises
    ------
    InputError, NotFoundError
        Neither layout fits, no triangles, missing file.
    """
    content = read_bytes(file)
    # A binary file may start with "solid" too; only the size tells for sure.
    count = int.from_bytes(content[80:_HEADER], "little") if len(content) >= _HEADER else -1
    if count >= 0 and len(content) == _HEADER + count * _ROW.itemsize:
        corners, name = as_float64(np.frombuffer(content, _ROW, count, _HEADER)["corners"]).reshape(-1, 3), ""
    elif content.lstrip()[:5].lower() == b"solid":
        corners, name = _ascii(file, content.decode("latin-1"))
    else:
        raise InputError(f"{file}: not an STL file (its size does not fit {count} triangles, and it is not ASCII)")
    if not len(corners):
        raise InputError(f"{file}: no triangles in this STL file")
    vertices, index = np.unique(corners, axis=0, return_inverse=True)
    part = Part(object=name, file=str(file))
    return RawMesh(vertices, index.reshape(-1, 3), np.zeros(len(corners) // 3, dtype=np.int32), (part,))


def _ascii(file: Path, text: str) -> tuple[FloatArray, str]:
    name = text.split("\n", 1)[0].strip()[5:].strip()
    lines = re.findall(r"^\s*vertex\s+(.+)$", text, flags=re.MULTILINE)
    try:
        corners = np.loadtxt(lines, ndmin=2).astype(np.float64) if lines else np.zeros((0, 3))
    except ValueError as error:
        raise InputError(f"{file}: a vertex line cannot be read: {error}") from None
    if corners.shape[1] != 3 or len(corners) % 3:
        raise InputError(f"{file}: {len(corners)} vertex lines of {corners.shape[1]} numbers do not make triangles")
    return corners, name
