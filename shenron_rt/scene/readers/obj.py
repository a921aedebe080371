"""Wavefront OBJ, keeping the object, group and material name of every face.

General readers drop ``o`` names, and ``usemtl`` names where the material library is absent, as it is in CARLA's
exports; these names are all that says what a surface is. CARLA writes two layouts: up to 0.9.14 ``o <actor>`` then
``g <component>`` (many actors share one component name), later ``g <actor>`` then ``o <actor>_<component>_mesh``.
Whichever statement comes first in a file is taken as the outer one, and a new outer name ends the inner one.
"""

from __future__ import annotations

from itertools import chain
from pathlib import Path

import numpy as np

from ..._typing import FloatArray, IntArray
from ...errors import InputError
from ..mesh import Part
from ._polygons import fan
from ._raw import RawMesh, read_bytes

__all__ = ["read_obj"]


class _Names:
    """Object, group and material in force, and a row number for each combination that has faces."""

    def __init__(self, file: str) -> None:
        self._file = file
        self._now = {"o": "", "g": "", "usemtl": ""}
        self._outer: str | None = None
        self._rows: dict[tuple[str, str, str], int] = {}

    def set(self, key: str, name: str) -> None:
        if key != "usemtl":
            self._outer = self._outer or key
            if key == self._outer:
                self._now["g" if key == "o" else "o"] = ""
        # "g" alone and 3ds Max's "default" mean no group
        self._now[key] = "" if name in ("default", "(null)") else name

    @property
    def row(self) -> int:
        key = (self._now["o"], self._now["g"], self._now["usemtl"])
        return self._rows.setdefault(key, len(self._rows))

    @property
    def parts(self) -> tuple[Part, ...]:
        return tuple(Part(object=o, group=g, material=m, file=self._file) for o, g, m in self._rows)


def read_obj(file: Path) -> RawMesh:
    """Read an OBJ file; polygons become triangle fans, textures, normals and material libraries are not needed.

    Raises
    ------
    InputError, NotFoundError
        Lines that cannot be read, indices out of range, missing file.
    """
    text = read_bytes(file).decode("utf-8", errors="replace").replace("\\\r\n", " ").replace("\\\n", " ")
    names = _Names(str(file))
    vertex_lines: list[str] = []
    face_lines: list[str] = []
    face_rows: list[int] = []
    vertices_before: list[int] = []
    row = -1
    for line in text.splitlines():
        start = line[:2]
        if start == "v ":
            vertex_lines.append(line)
        elif start == "f ":
            if row < 0:
                row = names.row
            face_lines.append(line)
            face_rows.append(row)
            vertices_before.append(len(vertex_lines))
        elif start not in ("vt", "vn", "# ", "s "):
            words = line.split(None, 1)
            if not words:
                continue
            if words[0] in ("o", "g", "usemtl"):
                names.set(words[0], words[1].strip() if len(words) > 1 else "")
                row = -1
            elif words[0] == "v":
                vertex_lines.append(line)
            elif words[0] == "f":
                row = names.row
                face_lines.append(line)
                face_rows.append(row)
                vertices_before.append(len(vertex_lines))
    if not face_lines:
        raise InputError(f"{file}: no faces in this OBJ file ({len(vertex_lines)} vertices)")
    vertices = _vertices(file, vertex_lines)
    faces, source = _faces(file, face_lines, np.array(vertices_before), len(vertices))
    return RawMesh(vertices, faces, np.array(face_rows)[source], names.parts)


def _vertices(file: Path, lines: list[str]) -> FloatArray:
    if not lines:
        raise InputError(f"{file}: faces without any vertex")
    try:
        # columns 1 to 3 of "v x y z [w | r g b]"; loadtxt parses in C
        return np.asarray(np.loadtxt(lines, usecols=(1, 2, 3), ndmin=2, comments="#"), dtype=np.float64)
    except (ValueError, IndexError) as error:
        raise InputError(f"{file}: a vertex line cannot be read: {error}") from None


def _faces(file: Path, lines: list[str], before: IntArray, n_vertices: int) -> tuple[IntArray, IntArray]:
    """Return (t, 3) zero-based triangles and (t,) the face line each came from."""
    corners = [line.partition("#")[0].split()[1:] for line in lines]
    count = np.fromiter(map(len, corners), dtype=np.int64, count=len(corners))
    if count.min() < 3:
        bad = int(np.argmin(count))
        raise InputError(f"{file}: face {bad + 1} has {count[bad]} corners, at least 3 are needed: {lines[bad]!r}")
    try:
        flat = np.fromiter(
            (int(c.partition("/")[0]) for c in chain.from_iterable(corners)), dtype=np.int64, count=int(count.sum())
        )
    except ValueError as error:
        raise InputError(f"{file}: a face line cannot be read: {error}") from None
    # 1-based from the start of the file; negative counts back from the last vertex read so far
    index = np.where(flat > 0, flat - 1, np.repeat(before, count) + flat)
    wrong = (flat == 0) | (index < 0) | (index >= n_vertices)
    if wrong.any():
        raise InputError(
            f"{file}: {int(wrong.sum())} face corners name vertices that do not exist "
            f"(first: {int(flat[wrong][0])}, the file has 1 to {n_vertices})"
        )
    return fan(index, count)
