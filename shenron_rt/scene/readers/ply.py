"""PLY triangle meshes, ASCII or binary, with an optional tag for each face (property ``ObjTag`` or ``tag``)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..._typing import FloatArray, IntArray
from ...errors import InputError
from ..mesh import Part
from ._polygons import fan
from ._raw import RawMesh, as_float64, read_bytes

__all__ = ["read_ply"]

# Both spellings occur: the 1994 names, and the sized ones that most writers use now.
_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip
_INDEX_NAMES = ("vertex_indices", "vertex_index")
_TAG_NAMES = ("objtag", "tag")


@dataclass(frozen=True)
class _Property:
    name: str
    kind: str
    count_kind: str = ""  # set for a list


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[_Property]


def read_ply(file: Path) -> RawMesh:
    """Read a PLY mesh; polygons become triangle fans, other elements and properties are skipped.

    Raises
    ------
    InputError, NotFoundError
        A point cloud (no faces), a broken header, a file cut short, or fractional tags.
    """
    content = read_bytes(file)
    byte_order, elements, body = _header(file, content)
    columns = _ascii(file, elements, body) if byte_order == "" else _binary(file, elements, body, byte_order)
    vertex, face = columns.get("vertex", {}), columns.get("face", {})
    if not all(axis in vertex for axis in "xyz"):
        raise InputError(f"{file}: element vertex needs the properties x, y, z; got {', '.join(vertex) or 'none'}")
    index = next((face[name] for name in _INDEX_NAMES if name in face), None)
    if index is None or not len(index[0]):
        raise InputError(
            f"{file}: no faces in this PLY file ({len(vertex['x'])} vertices); is it a point cloud? "
            "Semantic LiDAR frames are read by read_semantic_lidar"
        )
    count, flat = index
    if count.min() < 3:
        raise InputError(f"{file}: a face has {int(count.min())} corners, at least 3 are needed")
    faces, source = fan(flat.astype(np.int64), count.astype(np.int64))
    vertices = np.stack([as_float64(vertex[axis]) for axis in "xyz"], axis=1)
    parts, part = _parts(file, face)
    return RawMesh(vertices, faces, part[source] if part is not None else np.zeros(len(faces), dtype=np.int32), parts)


def _parts(file: Path, face: dict[str, Any]) -> tuple[tuple[Part, ...], IntArray | None]:
    """Return one part for each tag among the faces, or a single part where the file has no tags."""
    column = next((v for name, v in face.items() if name.lower() in _TAG_NAMES and not isinstance(v, tuple)), None)
    if column is None:
        return (Part(file=str(file)),), None
    tags = np.asarray(column)
    if tags.dtype.kind == "f" and not np.array_equal(tags, np.round(tags)):
        raise InputError(f"{file}: face tags are fractional ({tags[tags != np.round(tags)][0]!r}); write them as uint")
    values, part = np.unique(tags.astype(np.int64), return_inverse=True)
    return tuple(Part(file=str(file), declared_tag=int(v)) for v in values), part.reshape(-1)


def _header(file: Path, content: bytes) -> tuple[str, list[_Element], bytes]:
    """Return the byte order ("" for ASCII), the elements, and what follows the header."""
    end = content.find(b"end_header")
    stop = content.find(b"\n", end)
    if not content.startswith(b"ply") or end < 0 or stop < 0:
        raise InputError(f"{file}: not a PLY file (it must start with 'ply' and have an 'end_header' line)")
    order: str | None = None
    elements: list[_Element] = []
    for line in content[:end].decode("latin-1").splitlines()[1:]:
        words = line.split()
        try:
            if words[:1] == ["format"]:
                order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[words[1]]
            elif words[:1] == ["element"]:
                elements.append(_Element(words[1], int(words[2]), []))
            elif words[:2] == ["property", "list"]:
                elements[-1].properties.append(_Property(words[4], _TYPES[words[3]], _TYPES[words[2]]))
            elif words[:1] == ["property"]:
                elements[-1].properties.append(_Property(words[2], _TYPES[words[1]]))
        except (KeyError, IndexError, ValueError):
            raise InputError(f"{file}: PLY header line {line!r} cannot be read") from None
    if order is None or any(e.count < 0 for e in elements):
        raise InputError(f"{file}: the PLY header has no format line or a negative count")
    return order, elements, content[stop + 1 :]


def _binary(file: Path, elements: list[_Element], body: bytes, order: str) -> dict[str, dict[str, Any]]:
    columns: dict[str, dict[str, Any]] = {}
    offset = 0
    for element in elements:
        try:
            columns[element.name], offset = _binary_element(element, body, offset, order)
        except (ValueError, IndexError):
            raise InputError(f"{file}: the file ends inside element {element.name} ({element.count} rows)") from None
    return columns


def _binary_element(element: _Element, body: bytes, offset: int, order: str) -> tuple[dict[str, Any], int]:
    """Read one element, as a table where every list has the length of the first row's, else row by row."""
    fields: list[tuple[Any, ...]] = []
    at = offset
    lengths = {}
    for p in element.properties:
        if p.count_kind:
            n = int(np.frombuffer(body, order + p.count_kind, 1, at)[0]) if element.count else 0
            lengths[p.name] = n
            fields += [("n_" + p.name, order + p.count_kind), (p.name, order + p.kind, (n,))]
            at += np.dtype(p.count_kind).itemsize + n * np.dtype(p.kind).itemsize
        else:
            fields.append((p.name, order + p.kind))
            at += np.dtype(p.kind).itemsize
    row = np.dtype(fields)
    fits = offset + row.itemsize * element.count <= len(body)
    table = np.frombuffer(body, row, element.count, offset) if fits and fields else np.zeros(0, row)
    if all(fits and np.all(table["n_" + name] == n) for name, n in lengths.items()) and (fits or not lengths):
        if not fits:
            raise ValueError("short")
        columns: dict[str, Any] = {p.name: table[p.name] for p in element.properties if not p.count_kind}
        for name, n in lengths.items():
            columns[name] = (np.full(element.count, n), table[name].reshape(-1))
        return columns, offset + row.itemsize * element.count
    return _mixed_rows(element, body, offset, order)


def _mixed_rows(element: _Element, body: bytes, offset: int, order: str) -> tuple[dict[str, Any], int]:
    """Read rows whose lists differ in length; each row's place is known only from the one before."""
    values: dict[str, list[Any]] = {p.name: [] for p in element.properties}
    counts: dict[str, list[int]] = {p.name: [] for p in element.properties if p.count_kind}
    for _ in range(element.count):
        for p in element.properties:
            n = 1
            if p.count_kind:
                n = int(np.frombuffer(body, order + p.count_kind, 1, offset)[0])
                counts[p.name].append(n)
                offset += np.dtype(p.count_kind).itemsize
            values[p.name].append(np.frombuffer(body, order + p.kind, n, offset))
            offset += n * np.dtype(p.kind).itemsize
    joined: dict[str, Any] = {name: np.concatenate(rows) for name, rows in values.items()}
    return {name: (np.array(counts[name]), v) if name in counts else v for name, v in joined.items()}, offset


def _ascii(file: Path, elements: list[_Element], body: bytes) -> dict[str, dict[str, Any]]:
    try:
        numbers = np.array(body.split(), dtype=np.float64)
    except ValueError as error:
        raise InputError(f"{file}: the ASCII body cannot be read: {error}") from None
    columns: dict[str, dict[str, Any]] = {}
    at = 0
    for element in elements:
        try:
            columns[element.name], at = _ascii_element(element, numbers, at)
        except IndexError:
            raise InputError(f"{file}: the file ends inside element {element.name} ({element.count} rows)") from None
    return columns


def _ascii_element(element: _Element, numbers: FloatArray, at: int) -> tuple[dict[str, Any], int]:
    if not any(p.count_kind for p in element.properties):
        width = len(element.properties)
        table = numbers[at : at + width * element.count]
        if table.size < width * element.count:
            raise IndexError
        table = table.reshape(element.count, width)
        columns: dict[str, Any] = {p.name: table[:, k] for k, p in enumerate(element.properties)}
        return columns, at + width * element.count
    values: dict[str, list[FloatArray]] = {p.name: [] for p in element.properties}
    counts: dict[str, list[int]] = {p.name: [] for p in element.properties if p.count_kind}
    for _ in range(element.count):
        for p in element.properties:
            n = 1
            if p.count_kind:
                n, at = int(numbers[at]), at + 1
                counts[p.name].append(n)
            if n < 0 or at + n > numbers.size:
                raise IndexError
            values[p.name].append(numbers[at : at + n])
            at += n
    joined: dict[str, Any] = {name: np.concatenate(rows) if rows else np.zeros(0) for name, rows in values.items()}
    return {name: (np.array(counts[name]), v) if name in counts else v for name, v in joined.items()}, at
