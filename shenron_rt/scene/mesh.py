"""Triangle meshes whose faces know which part, and so which tag and material, they belong to."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from .._typing import ArrayLike, BoolArray, FloatArray, IntArray
from ..errors import InputError
from ..frames import Pose
from ..tags import SemanticTag

__all__ = ["Part", "TaggedMesh", "build_mesh", "concatenate"]

_log = logging.getLogger(__name__)

# Twice the area over the squared longest edge, below which a face has no usable normal: rounding in float64 already
# turns the normal of such a sliver by more than a degree.
_SLIVER = 1e-13
# Coordinates beyond this are rubbish in any unit, and their products would overflow.
_FARTHEST = 1e12


@dataclass(frozen=True)
class Part:
    """One run of faces: its names in the file, and what they were resolved to.

    Parameters
    ----------
    object, group, material, file : str
        Names as in the file; empty where it has none.
    tag : SemanticTag
        ``Unlabeled`` until resolved.
    rule, evidence : str
        Which rule of the resolver gave the tag, and the text it rests on.
    em_material : str or None
        Name of an entry of the material table; None means "by tag".
    declared_tag : int, str or None
        A tag the file itself carries for these faces, in the numbering of the CARLA that wrote it.
    declared_material : str or None
        A material the file itself declares (glTF extras).
    """

    object: str = ""
    group: str = ""
    material: str = ""
    file: str = ""
    tag: SemanticTag = SemanticTag.Unlabeled
    rule: str = ""
    evidence: str = ""
    em_material: str | None = None
    declared_tag: int | str | None = None
    declared_material: str | None = None

    @property
    def label(self) -> str:
        """The name to show: the object, else the group, else the material, else the file."""
        return self.object or self.group or self.material or self.file or "(nameless)"


@dataclass(frozen=True, eq=False)
class TaggedMesh:
    """Triangles in ROS axes with a part for each.

    Parameters
    ----------
    vertices : (v, 3) float64
        Metres, x forward, y left, z up.
    faces : (f, 3) int32
        Rows of ``vertices``. Winding is kept right-handed outward where the file had it so, but nothing may rely on
        it: real exports mix windings, so every surface counts as two-sided.
    part : (f,) int32
        Rows of ``parts``.
    parts : tuple of Part
    repaired : mapping of str to int
        What was changed while reading, for example ``{"degenerate_faces": 3}``.

    Raises
    ------
    InputError
        NaN or infinite vertices, no faces, indices out of range, wrong shapes.
    """

    vertices: FloatArray
    faces: IntArray
    part: IntArray
    parts: tuple[Part, ...]
    repaired: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        where = self.parts[0].file if self.parts and self.parts[0].file else "mesh"
        vertices = np.array(self.vertices, dtype=np.float64)
        faces = _as_int32(self.faces, where, "faces")
        part = _as_int32(self.part, where, "part")
        _check_arrays(where, vertices, faces, part, len(self.parts))
        for name, array in (("vertices", vertices), ("faces", faces), ("part", part)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "parts", tuple(self.parts))
        object.__setattr__(self, "repaired", MappingProxyType(dict(self.repaired)))

    @property
    def n_faces(self) -> int:
        """Number of triangles."""
        return int(self.faces.shape[0])

    @cached_property
    def _cross(self) -> FloatArray:
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        return np.asarray(np.cross(b - a, c - a), dtype=np.float64)

    @cached_property
    def face_area(self) -> FloatArray:
        """(f,) area of each triangle [m^2]."""
        return np.asarray(0.5 * np.linalg.norm(self._cross, axis=1))

    @cached_property
    def face_normal(self) -> FloatArray:
        """(f, 3) unit normal by the right-hand rule of the winding; zero for a face without area."""
        length = np.linalg.norm(self._cross, axis=1, keepdims=True)
        normal: FloatArray = np.divide(self._cross, length, out=np.zeros_like(self._cross), where=length > 0)
        return normal

    @cached_property
    def face_tag(self) -> IntArray:
        """(f,) uint8 tag of each triangle."""
        return np.array([int(p.tag) for p in self.parts], dtype=np.uint8)[self.part]

    @cached_property
    def corner(self) -> IntArray:
        """(f, 3) numbers of the places the corners are at; vertices at one place count as one."""
        scale = max(float(np.abs(self.vertices).max()), 1e-9)
        place = np.round(self.vertices / scale * 1e8).astype(np.int64)
        order = np.lexsort(place.T)
        new = (np.diff(place[order], axis=0, prepend=place[order[:1]]) != 0).any(axis=1)
        number = np.empty(len(place), dtype=np.int64)
        number[order] = np.cumsum(new)
        return number[self.faces]

    @cached_property
    def adjacent(self) -> tuple[IntArray, IntArray]:
        """Pairs of faces that share an edge, (m,) and (m,); vertices at one place count as one.

        Faces that meet three or more at an edge are paired one after the other.
        """
        a, b = self.corner, np.roll(self.corner, -1, axis=1)
        edge = (np.minimum(a, b) * (int(self.corner.max()) + 1) + np.maximum(a, b)).ravel()
        order = np.argsort(edge, kind="stable")
        face = (order // 3).astype(np.int64)
        shared = np.flatnonzero(np.diff(edge[order]) == 0)
        return face[shared], face[shared + 1]

    @cached_property
    def bounds(self) -> FloatArray:
        """(2, 3) lowest and highest corner of the used vertices [m]."""
        used = self.vertices[np.unique(self.faces)]
        return np.stack([used.min(axis=0), used.max(axis=0)])

    @property
    def part_area(self) -> FloatArray:
        """(len(parts),) area of each part [m^2]."""
        return np.asarray(np.bincount(self.part, weights=self.face_area, minlength=len(self.parts)), dtype=np.float64)

    @property
    def part_faces(self) -> IntArray:
        """(len(parts),) int64 number of triangles of each part."""
        return np.bincount(self.part, minlength=len(self.parts))

    def part_bounds(self) -> FloatArray:
        """Return (len(parts), 2, 3) lowest and highest corner of each part [m]; NaN for a part without faces."""
        low = np.full((len(self.parts), 3), np.inf)
        high = np.full((len(self.parts), 3), -np.inf)
        rows, corners = np.repeat(self.part, 3), self.vertices[self.faces.ravel()]
        np.minimum.at(low, rows, corners)
        np.maximum.at(high, rows, corners)
        box = np.stack([low, high], axis=1)
        return np.where(np.isfinite(box), box, np.nan)

    def transformed(self, transform: Pose | ArrayLike) -> TaggedMesh:
        """Return the mesh moved by a pose or a 4x4 (or 3x3) matrix; a mirroring matrix also flips the winding."""
        if isinstance(transform, Pose):
            return replace(self, vertices=transform.apply(self.vertices))
        matrix = np.asarray(transform, dtype=np.float64)
        if matrix.shape not in ((3, 3), (4, 4)) or not np.all(np.isfinite(matrix)):
            raise InputError(f"transform: a finite 4x4 or 3x3 matrix is needed, got shape {matrix.shape}")
        linear, shift = matrix[:3, :3], (matrix[:3, 3] if matrix.shape == (4, 4) else np.zeros(3))
        det = float(np.linalg.det(linear))
        if matrix.shape == (4, 4) and not np.array_equal(matrix[3], [0, 0, 0, 1]):
            raise InputError(f"transform: the last row must be 0 0 0 1, got {matrix[3].tolist()}")
        if abs(det) < 1e-12 * max(1e-300, float(np.abs(linear).max())) ** 3:
            raise InputError("transform: the matrix is singular (it flattens the mesh)")
        return replace(
            self,
            vertices=self.vertices @ linear.T + shift,
            faces=self.faces[:, ::-1] if det < 0 else self.faces,
        )

    def with_parts(self, parts: Sequence[Part]) -> TaggedMesh:
        """Return the same triangles with other parts, one for each existing part."""
        if len(parts) != len(self.parts):
            raise InputError(f"with_parts: {len(self.parts)} parts are needed, got {len(parts)}")
        return replace(self, parts=tuple(parts))

    def select(self, keep: BoolArray) -> TaggedMesh:
        """Return the triangles where ``keep`` (f,) is true, without the vertices and parts nothing uses any more."""
        mask = np.asarray(keep, dtype=bool)
        if mask.shape != (self.n_faces,):
            raise InputError(f"select: a mask of shape ({self.n_faces},) is needed, got {mask.shape}")
        if not mask.any():
            raise InputError("select: no triangle is left")
        used_vertices, faces = np.unique(self.faces[mask], return_inverse=True)
        used_parts, part = np.unique(self.part[mask], return_inverse=True)
        return replace(
            self,
            vertices=self.vertices[used_vertices],
            faces=faces.reshape(-1, 3),
            part=part,
            parts=tuple(self.parts[k] for k in used_parts),
        )


def _as_int32(values: ArrayLike, where: str, what: str) -> IntArray:
    array = np.asarray(values)
    if array.size and array.dtype.kind not in "iu":
        raise InputError(f"{where}: {what} must be integers, got {array.dtype}")
    if array.size and int(array.max()) > np.iinfo(np.int32).max:
        raise InputError(f"{where}: {what} holds {int(array.max())}, more than 32-bit indices can address")
    return np.array(array, dtype=np.int32)


def _check_arrays(where: str, vertices: FloatArray, faces: IntArray, part: IntArray, n_parts: int) -> None:
    if vertices.ndim != 2 or vertices.shape[-1] != 3:
        raise InputError(f"{where}: vertices must have shape (v, 3), got {vertices.shape}")
    bad = int(np.count_nonzero(~(np.abs(vertices) < _FARTHEST).all(axis=1)))
    if bad:
        raise InputError(
            f"{where}: {bad} of {len(vertices)} vertices are NaN or infinite (or beyond {_FARTHEST:g}); repair the mesh"
        )
    if faces.size == 0:
        raise InputError(f"{where}: the mesh has no triangles; point clouds and line sets cannot reflect")
    if faces.ndim != 2 or faces.shape[1] != 3:
        raise InputError(f"{where}: faces must have shape (f, 3), got {faces.shape}")
    outside = (faces < 0) | (faces >= len(vertices))
    if outside.any():
        raise InputError(
            f"{where}: {int(outside.any(axis=1).sum())} faces name vertices that do not exist "
            f"(index {int(faces[outside][0])}, allowed 0 to {len(vertices) - 1})"
        )
    if part.shape != (len(faces),):
        raise InputError(f"{where}: part must have shape ({len(faces)},), got {part.shape}")
    if part.min() < 0 or part.max() >= n_parts:
        raise InputError(f"{where}: part holds {int(part.max())}, allowed 0 to {n_parts - 1}")


def build_mesh(
    vertices: ArrayLike,
    faces: ArrayLike,
    parts: Sequence[Part] | Part = Part(),
    part: ArrayLike | None = None,
    repaired: Mapping[str, int] | None = None,
) -> TaggedMesh:
    """Make a mesh and drop the faces that have no area, counted in ``repaired`` and logged.

    Parameters
    ----------
    vertices : (v, 3) array_like
        ROS axes [m].
    faces : (f, 3) array_like of int
    parts : Part or sequence of Part
    part : (f,) array_like of int, optional
        Row of ``parts`` for each face; all 0 when absent.
    repaired : mapping, optional
        Repairs already made by a reader.

    Raises
    ------
    InputError
        As :class:`TaggedMesh`, or every face is degenerate.
    """
    known = (parts,) if isinstance(parts, Part) else tuple(parts)
    triangles = np.asarray(faces)
    if triangles.size == 0:
        triangles = np.zeros((0, 3), dtype=np.int32)
    rows = np.zeros(len(triangles), dtype=np.int32) if part is None else np.asarray(part)
    whole = TaggedMesh(np.asarray(vertices, dtype=np.float64), triangles, rows, known, dict(repaired or {}))
    degenerate = _degenerate(whole)
    count = int(degenerate.sum())
    if not count:
        return whole
    where = known[0].file or "mesh"
    if count == whole.n_faces:
        raise InputError(f"{where}: all {count} triangles have no area; is the mesh flattened or scaled to nothing?")
    _log.warning("%s: dropped %d of %d triangles that have no area", where, count, whole.n_faces)
    counts = dict(whole.repaired)
    counts["degenerate_faces"] = counts.get("degenerate_faces", 0) + count
    kept = replace(whole, faces=whole.faces[~degenerate], part=whole.part[~degenerate], repaired=counts)
    return kept if kept.part_faces.all() else kept.select(np.ones(kept.n_faces, dtype=bool))


def _degenerate(mesh: TaggedMesh) -> BoolArray:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    longest = np.max([np.sum((q - p) ** 2, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    return np.asarray(2.0 * mesh.face_area <= _SLIVER * longest)


def concatenate(meshes: Sequence[TaggedMesh]) -> TaggedMesh:
    """Join meshes into one; parts, vertices and repair counts are kept, equal parts are not merged."""
    if not meshes:
        raise InputError("concatenate: at least one mesh is needed")
    vertex_start = np.cumsum([0, *(len(m.vertices) for m in meshes[:-1])])
    part_start = np.cumsum([0, *(len(m.parts) for m in meshes[:-1])])
    counts: dict[str, int] = {}
    for mesh in meshes:
        for key, value in mesh.repaired.items():
            counts[key] = counts.get(key, 0) + value
    return TaggedMesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces.astype(np.int64) + k for m, k in zip(meshes, vertex_start, strict=True)]),
        np.concatenate([m.part.astype(np.int64) + k for m, k in zip(meshes, part_start, strict=True)]),
        tuple(p for m in meshes for p in m.parts),
        counts,
    )
