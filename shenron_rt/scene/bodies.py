"""The meshes of a scene as bodies: tags, materials and planes of their faces, and the parts that move by themselves."""

from __future__ import annotations

import functools
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from .._typing import FloatArray, IntArray
from ..config.loader import resolve_path
from ..config.materials import MaterialTable, load_materials
from ..config.scene import MeshSource, Scene
from ..errors import InputError, did_you_mean
from ..tags import SemanticTag, parse_tag
from .articulation import Link, articulated
from .mesh import TaggedMesh
from .rounded import Rounding

__all__ = ["Body", "load_bodies", "source_mesh"]


@dataclass(frozen=True, eq=False)
class Body:
    """One mesh of a scene, rigid or of rigid links, with all that the tracer needs of its faces.

    Parameters
    ----------
    object_id : int
        0 = static.
    source : MeshSource
        Its entry in the scene.
    mesh : TaggedMesh
        In the body's own frame, every link where it is before it has moved.
    tag : (f,) uint8
    material : (f,) uint16
        Index into the material names of the world.
    plane : (f,) int32
        Equal for faces of one plane and one material.
    patch : (f,) float
        Area of all faces of that plane [m^2].
    links : tuple of Link
        The first moves with the body.
    face_link : (f,) int32
    vertex_link : (v,) int32
    """

    object_id: int
    source: MeshSource
    mesh: TaggedMesh
    tag: IntArray
    material: IntArray
    plane: IntArray
    patch: FloatArray
    links: tuple[Link, ...]
    face_link: IntArray
    vertex_link: IntArray

    @property
    def moves(self) -> bool:
        """Whether any of it ever does, in the world."""
        return bool(getattr(self.source, "moves", False)) or len(self.links) > 1

    @functools.cached_property
    def bend(self) -> FloatArray:
        """(f,) mean angle between each face and those beside it where they bend by less than 60 degrees [rad]."""
        a, b = self.mesh.adjacent
        normal = self.mesh.face_normal
        angle = np.arccos(np.clip(np.abs(np.einsum("ij,ij->i", normal[a], normal[b])), 0.0, 1.0))
        smooth = angle < np.pi / 3
        faces, angles = np.concatenate([a[smooth], b[smooth]]), np.tile(angle[smooth], 2)
        count = np.bincount(faces, minlength=self.mesh.n_faces)
        return np.asarray(np.bincount(faces, angles, self.mesh.n_faces) / np.maximum(count, 1))


def source_mesh(source: MeshSource, folder: Path) -> TaggedMesh:
    """Load the mesh of a scene entry with its tags resolved, in the body's own frame.

    Raises
    ------
    NotFoundError, InputError, ConfigError
        As the readers and the resolver raise them.
    """
    if isinstance(source.mesh, TaggedMesh):
        return source.mesh
    if source.shape is not None:
        return _shape(source.shape)
    file = resolve_path(str(source.mesh), folder, f"mesh of {source.name or 'a part'}")
    manifest = None if source.resolve is None else resolve_path(str(source.resolve), folder, "resolve")
    stamp = (file.stat().st_mtime_ns, 0 if manifest is None else manifest.stat().st_mtime_ns)
    policy: Literal["error", "warn"] = "warn" if source.tag else source.unlabelled
    return _file(file, source.mesh_frame, source.units, manifest, source.carla_tags, policy, stamp)


@functools.lru_cache(maxsize=128)
def _shape(text: str) -> TaggedMesh:
    from .shapes import make_shape

    return make_shape(text)


@functools.lru_cache(maxsize=128)
def _file(
    file: Path,
    mesh_frame: str,
    units: str | float,
    manifest: Path | None,
    carla_tags: str,
    unlabelled: Literal["error", "warn"],
    stamp: tuple[int, int],
) -> TaggedMesh:
    from .readers import read_mesh
    from .resolver import resolve_tags

    mesh = read_mesh(file, mesh_frame=mesh_frame, units=units)
    return resolve_tags(mesh, manifest=manifest, carla_tags=carla_tags, unlabelled=unlabelled)


def load_bodies(scene: Scene) -> tuple[tuple[Body, ...], MaterialTable]:
    """Load every mesh of a scene, round it where that is asked for, and give each face its tag and material.

    Raises
    ------
    InputError
        An unknown material or tag, naming the part; more triangles than rounding may make.
    """
    materials = load_materials(scene.materials)
    names = list(materials.materials)
    entries, rounding = [*scene.static, *scene.actors], Rounding(scene)
    bodies = (_body(entry, scene.folder, materials, names, rounding) for entry in entries)
    return tuple(body for body in bodies if body is not None), materials


def _body(
    entry: MeshSource, folder: Path, materials: MaterialTable, names: list[str], rounding: Rounding
) -> Body | None:
    """Return one entry's body without its sky, or None where that is all it has."""
    parts = articulated(entry, source_mesh(entry, folder))
    mesh = parts.mesh
    wanted = entry.tag and parse_tag(entry.tag)
    tags = [wanted or part.tag for part in mesh.parts]
    material_of = [
        entry.material or part.em_material or materials.for_tag(tag.name)
        for part, tag in zip(mesh.parts, tags, strict=True)
    ]
    for part, material in zip(mesh.parts, material_of, strict=True):
        if material not in names:
            where = f"{entry.name or 'mesh'}, part {part.label!r}"
            raise InputError(f"{where}: unknown material {material!r}; {did_you_mean(str(material), names)}")
    index = np.array([names.index(str(m)) for m in material_of], dtype=np.uint16)
    part_tag = np.array([int(t) for t in tags], dtype=np.uint8)
    keep = part_tag[mesh.part] != int(SemanticTag.Sky)
    if not keep.any():
        return None
    if not keep.all():
        mesh = replace(mesh, faces=mesh.faces[keep], part=mesh.part[keep])
    mesh = rounding.of(entry, mesh)
    tag = part_tag[mesh.part]
    mesh, vertex_link, plane, patch = _surfaces(mesh, tuple(index.tolist()), tuple(parts.part_link.tolist()))
    object_id, face_link = int(getattr(entry, "id", 0)), parts.part_link[mesh.part]
    return Body(object_id, entry, mesh, tag, index[mesh.part], plane, patch, parts.links, face_link, vertex_link)


def _surfaces(
    mesh: TaggedMesh, part_material: tuple[int, ...], part_link: tuple[int, ...]
) -> tuple[TaggedMesh, IntArray, IntArray, FloatArray]:
    """Return the mesh with its links apart, the link of each vertex, and plane and patch of each face."""
    face_link = np.array(part_link, dtype=np.int32)[mesh.part]
    apart, vertex_link = _unshared(mesh, face_link)
    plane = _planes(apart, np.array(part_material, dtype=np.uint16)[mesh.part], face_link)
    patch: FloatArray = np.bincount(plane, weights=apart.face_area)[plane].astype(np.float64)
    return apart, vertex_link, plane, patch


def _unshared(mesh: TaggedMesh, face_link: IntArray) -> tuple[TaggedMesh, IntArray]:
    """Return the mesh with a copy of each vertex for each link that uses it, and the link of each vertex."""
    if not face_link.any():
        return mesh, np.zeros(len(mesh.vertices), dtype=np.int32)
    corner = np.column_stack([np.repeat(face_link, 3).astype(np.int64), mesh.faces.ravel()])
    used, index = np.unique(corner, axis=0, return_inverse=True)
    split = replace(mesh, vertices=mesh.vertices[used[:, 1]], faces=index.reshape(-1, 3).astype(np.int32))
    return split, used[:, 0].astype(np.int32)


def _planes(mesh: TaggedMesh, material: IntArray, link: IntArray) -> IntArray:
    """Return (f,) int32, equal for faces of one link and material that lie in one plane, to a micrometre."""
    normal = mesh.face_normal
    # either side of a plane is the same plane: make the largest component positive
    largest = np.take_along_axis(normal, np.abs(normal).argmax(axis=1)[:, None], axis=1)
    normal = normal * np.where(largest < 0, -1.0, 1.0)
    offset = np.einsum("ij,ij->i", normal, mesh.vertices[mesh.faces[:, 0]])
    columns = [np.round(normal * 1e7), np.round(offset * 1e6), material.astype(np.float64), link.astype(np.float64)]
    key = np.column_stack(columns).astype(np.int64)
    rows = np.ascontiguousarray(key).view(np.dtype((np.void, key.dtype.itemsize * key.shape[1])))
    _, plane = np.unique(rows.ravel(), return_inverse=True)
    return plane.astype(np.int32)
