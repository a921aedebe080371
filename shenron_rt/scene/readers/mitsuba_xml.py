"""Mitsuba 3 scene files as ray tracers of radio channels ship them: mesh files with a material id each.

Only geometry and material names are taken: shapes of type ply, obj and stl, their ``to_world`` and their bsdf
reference. DOCTYPE and entities are refused, files must lie below the scene's folder.
"""

from __future__ import annotations

import re
import xml.parsers.expat
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from ..._typing import FloatArray
from ...errors import InputError
from ._raw import RawMesh, placed, read_bytes
from .obj import read_obj
from .ply import read_ply
from .stl import read_stl

__all__ = ["read_mitsuba_xml"]

_READERS: dict[str, Callable[[Path], RawMesh]] = {"ply": read_ply, "obj": read_obj, "stl": read_stl}
_NUMBERS = re.compile(r"[\s,]+")


def read_mitsuba_xml(file: Path) -> RawMesh:
    """Read the shapes of a scene; a part's object is the shape's id, its material the bsdf's id, its file the mesh's.

    Raises
    ------
    InputError, NotFoundError
        DOCTYPE or entities, shapes that are not mesh files, files outside the folder or missing.
    """
    root = _parse(file)
    if root.tag != "scene":
        raise InputError(f"{file}: a Mitsuba <scene> is needed, got <{root.tag}>")
    meshes = [_shape(file, shape) for shape in root.iter("shape")]
    if not meshes:
        raise InputError(f"{file}: no shapes in this scene")
    first_vertex = np.cumsum([0, *(len(m.vertices) for m in meshes[:-1])])
    first_part = np.cumsum([0, *(len(m.parts) for m in meshes[:-1])])
    return RawMesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces.astype(np.int64) + k for m, k in zip(meshes, first_vertex, strict=True)]),
        np.concatenate([m.part.astype(np.int64) + k for m, k in zip(meshes, first_part, strict=True)]),
        tuple(p for m in meshes for p in m.parts),
    )


def _parse(file: Path) -> ET.Element:
    content = read_bytes(file)

    def refuse(*_: object) -> None:
        raise InputError(f"{file}: DOCTYPE and entities are not allowed in a scene file; remove them")

    guard = xml.parsers.expat.ParserCreate()
    guard.StartDoctypeDeclHandler = refuse
    guard.EntityDeclHandler = refuse
    try:
        guard.Parse(content, True)
        return ET.fromstring(content)
    except (xml.parsers.expat.ExpatError, ET.ParseError) as error:
        raise InputError(f"{file}: not well-formed XML: {error}") from None


def _shape(file: Path, shape: ET.Element) -> RawMesh:
    name, kind = shape.get("id") or shape.get("name") or "", shape.get("type", "")
    if kind not in _READERS:
        raise InputError(f"{file}: shape {name!r} is of type {kind!r}; only {', '.join(_READERS)} meshes are read")
    text = next((s.get("value") for s in shape.findall("string") if s.get("name") == "filename"), None)
    if not text:
        raise InputError(f"{file}: shape {name!r} has no filename")
    mesh_file = file.parent / text
    if not mesh_file.resolve().is_relative_to(file.parent.resolve()):
        raise InputError(f"{file}: {text!r} of shape {name!r} lies outside the scene's folder")
    raw = _READERS[kind](mesh_file)
    bsdf = next((e for e in (*shape.findall("ref"), *shape.findall("bsdf")) if e.get("id")), None)
    material = "" if bsdf is None else bsdf.get("id", "")
    matrix = _to_world(file, name, shape)
    faces = raw.faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else raw.faces
    parts = tuple(replace(p, object=p.object or name, material=material or p.material) for p in raw.parts)
    return replace(raw, vertices=placed(raw.vertices, matrix), faces=faces, parts=parts)


def _to_world(file: Path, name: str, shape: ET.Element) -> FloatArray:
    result = np.eye(4)
    for transform in shape.findall("transform"):
        for step in transform:
            try:
                result = _step(step) @ result  # Mitsuba applies the steps in the order written
            except ValueError:
                raise InputError(f"{file}: shape {name!r}: cannot read <{step.tag}> {dict(step.attrib)}") from None
    return result


def _step(step: ET.Element) -> FloatArray:
    result = np.eye(4)
    if step.tag == "matrix":
        values = np.array([float(v) for v in _NUMBERS.split(step.get("value", "").strip())])
        size = 4 if values.size == 16 else 3
        result[:size, :size] = values.reshape(size, size)
        return result
    default = 1.0 if step.tag == "scale" else 0.0
    vector = step.get("value")
    xyz = np.array([float(step.get(axis, default)) for axis in "xyz"])
    if vector is not None:
        xyz = np.broadcast_to([float(v) for v in _NUMBERS.split(vector.strip())], (3,)).astype(np.float64)
    if step.tag == "translate":
        result[:3, 3] = xyz
    elif step.tag == "scale":
        result[:3, :3] = np.diag(xyz)
    elif step.tag == "rotate":
        result[:3, :3] = _rotation(xyz, np.radians(float(step.get("angle", "0"))))
    else:
        raise ValueError(step.tag)
    return result


def _rotation(axis: FloatArray, angle: float) -> FloatArray:
    """Return the right-handed rotation about an axis (Rodrigues)."""
    length = float(np.linalg.norm(axis))
    if length == 0:
        raise ValueError("rotate without an axis")
    x, y, z = axis / length
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K))
