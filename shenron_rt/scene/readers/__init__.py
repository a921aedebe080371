"""Read meshes of several formats into :class:`~shenron_rt.scene.mesh.TaggedMesh`."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from ..._typing import ArrayLike
from ...errors import InputError, NotFoundError
from ..mesh import TaggedMesh, build_mesh
from ..mesh_frames import mesh_matrix
from ._raw import RawMesh
from .gltf import read_gltf
from .mitsuba_xml import read_mitsuba_xml
from .obj import read_obj
from .ply import read_ply
from .stl import read_stl

__all__ = ["MESH_SUFFIXES", "read_mesh"]

_READERS: dict[str, Callable[[Path], RawMesh]] = {
    ".glb": read_gltf,
    ".gltf": read_gltf,
    ".obj": read_obj,
    ".ply": read_ply,
    ".stl": read_stl,
    ".xml": read_mitsuba_xml,
}

#: File name endings that :func:`read_mesh` takes.
MESH_SUFFIXES = tuple(_READERS)


def read_mesh(
    path: str | os.PathLike[str], *, mesh_frame: str | ArrayLike = "ros_z_up", units: str | float = "m"
) -> TaggedMesh:
    """Read a mesh file and bring it to ROS axes in metres; tags are not resolved yet.

    Parameters
    ----------
    path : path
        OBJ, glTF/GLB, PLY, STL, or a Mitsuba/Sionna scene in XML.
    mesh_frame : str or (4, 4) array_like
        Who wrote the file: a preset of :data:`~shenron_rt.scene.mesh_frames.MESH_FRAMES`, or a matrix.
    units : str or float
        ``"m"``, ``"cm"``, ``"mm"``, ``"inch"``, or metres per file unit.

    Returns
    -------
    TaggedMesh
        Faces without area are dropped, counted and logged.

    Raises
    ------
    NotFoundError
        No such file.
    InputError
        Unknown ending, preset or unit (with the allowed ones), NaN vertices, no faces, broken content.
    """
    file = Path(path)
    matrix = mesh_matrix(mesh_frame, units)
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        hint = "; convert FBX and USD to .glb first (Blender, or usd-core)" if file.suffix.lower() != "" else ""
        raise InputError(f"{file}: unknown mesh format {file.suffix!r}; known: {', '.join(sorted(_READERS))}{hint}")
    if not file.is_file():
        raise NotFoundError(f"mesh file {str(file)!r} does not exist")
    raw = reader(file)
    return build_mesh(raw.vertices, raw.faces, raw.parts, raw.part, raw.repaired).transformed(matrix)
