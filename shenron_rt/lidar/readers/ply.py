"""PLY point clouds: CARLA's ``save_to_disk`` (ASCII), and what other tools make of it (binary, other type names)."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..._typing import NDArray
from ...errors import InputError
from ._raw import RawPoints, from_fields, require_points, whole_numbers

__all__ = ["read_ply_points"]

# Both spellings occur: the names of 1994, and the sized ones CARLA writes.
_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_END = b"end_header"


class _Header(NamedTuple):
    order: str  # "" is ASCII
    points: int
    properties: list[tuple[str, str]]
    body: int


def read_ply_points(file: Path, content: bytes) -> RawPoints:
    """Read the vertices of a PLY file.

    Parameters
    ----------
    file : path
        For messages.
    content : bytes
        The whole file.

    Raises
    ------
    InputError
        A broken header, a wrong number of points, a file cut short, plain LiDAR, an empty cloud.
    """
    header = _header(file, content)
    require_points(file, header.points)
    columns = _ascii(file, content, header) if header.order == "" else _binary(file, content, header)
    return from_fields(file, columns, f"PLY, {'binary' if header.order else 'ASCII'}")


def _header(file: Path, content: bytes) -> _Header:
    end = content.find(_END)
    if end < 0:
        raise InputError(f"{file}: the PLY header has no end_header; the file is cut short or not PLY")
    newline = content.find(b"\n", end)
    body = len(content) if newline < 0 else newline + 1
    order, count, properties, element = "?", -1, [], ""
    for line in content[:end].decode("ascii", errors="replace").splitlines()[1:]:
        words = line.split() or ["comment"]
        if words[0] == "format" and len(words) > 1:
            order = _FORMATS.get(words[1], "?")
        elif words[0] == "element" and len(words) == 3:
            if element and element != "vertex" and count < 0:
                raise InputError(f"{file}: element {element} stands before element vertex; save the vertices alone")
            element = words[1]
            if element == "vertex":
                if not words[2].isdigit():
                    raise InputError(f"{file}: element vertex {words[2]}: a count is needed")
                count = int(words[2])
        elif words[0] == "property" and element == "vertex":
            if len(words) != 3 or words[1] not in _TYPES:
                raise InputError(f"{file}: {line.strip()!r}: a scalar type ({', '.join(_TYPES)}) and a name are needed")
            properties.append((words[2], _TYPES[words[1]]))
    if order == "?" or count < 0:
        raise InputError(f"{file}: the PLY header needs a format (ascii or binary) and an element vertex")
    return _Header(order, count, properties, body)


def _ascii(file: Path, content: bytes, header: _Header) -> dict[str, NDArray[Any]]:
    text = content[header.body :]
    width = len(header.properties)
    try:
        rows = (
            np.loadtxt(io.BytesIO(text), dtype=np.float64, ndmin=2, comments=None)
            if text.strip()
            else np.zeros((0, width))
        )
    except ValueError as error:
        raise InputError(f"{file}: rows that are not {width} numbers ({error}); is the file cut short?") from None
    if rows.shape != (header.points, width):
        raise InputError(
            f"{file}: the header promises {header.points} points of {width} values, the file holds {rows.shape[0]} of "
            f"{rows.shape[1]}; it is cut short or was edited"
        )
    columns = {name: rows[:, k] for k, (name, _) in enumerate(header.properties)}
    return {
        name: whole_numbers(columns[name]) if kind[0] in "iu" else columns[name] for name, kind in header.properties
    }


def _binary(file: Path, content: bytes, header: _Header) -> dict[str, NDArray[Any]]:
    record = np.dtype([(name, header.order + kind) for name, kind in header.properties])
    held = (len(content) - header.body) // record.itemsize
    if held < header.points:
        raise InputError(f"{file}: the header promises {header.points} points, the file holds {held}; it is cut short")
    rows = np.frombuffer(content, record, header.points, header.body)
    return {name: rows[name] for name, _ in header.properties}
