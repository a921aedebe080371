"""glTF 2.0 and GLB: node, mesh and material names, ``extras``, node transforms and GPU instances.

A reader of its own, because names, extras and instances are what the tags rest on, and general readers rename or merge
them. Khronos glTF 2.0 specification, and the extension EXT_mesh_gpu_instancing that Unreal's exporter writes for
instanced meshes.
"""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from ..._typing import FloatArray, IntArray
from ...errors import InputError
from ..mesh import Part
from ._gltf_buffers import Buffers, load_buffers
from ._raw import RawMesh, as_float64, placed, read_bytes

__all__ = ["read_gltf"]

_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942
_COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")
_MAX_DEPTH = 200


def read_gltf(file: Path) -> RawMesh:
    """Read a ``.glb`` or ``.gltf`` file: the default scene's triangles in file axes, one part for a node's primitive.

    ``extras.carla_tag`` and ``extras.material`` of a primitive, mesh, node or glTF material are kept as declared.

    Raises
    ------
    InputError, NotFoundError
        Not glTF 2.0, compressed geometry, buffers outside the file's folder, broken references.
    """
    document, chunk = _document(file)
    for name in document.get("extensionsRequired", ()):
        if name in _COMPRESSED:
            raise InputError(f"{file}: geometry is compressed ({name}); export again without compression")
    try:
        buffers = load_buffers(file, document, chunk)
        walker = _Walker(file, document, buffers)
        scenes = document.get("scenes")
        roots = scenes[document.get("scene", 0)].get("nodes", []) if scenes else _roots(document)
        for root in roots:
            walker.visit(root, np.eye(4), "", None, 0)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{file}: broken glTF structure ({type(error).__name__}: {error})") from None
    return walker.mesh()


def _document(file: Path) -> tuple[dict[str, Any], bytes]:
    content = read_bytes(file)
    chunk = b""
    text = content
    if len(content) >= 20 and struct.unpack_from("<I", content)[0] == _MAGIC:
        length, kind = struct.unpack_from("<II", content, 12)
        text = content[20 : 20 + length]
        if kind != _JSON or len(text) < length:
            raise InputError(f"{file}: the GLB container is cut short")
        at = 20 + length
        if at + 8 <= len(content):
            size, kind = struct.unpack_from("<II", content, at)
            chunk = content[at + 8 : at + 8 + size] if kind == _BIN else b""
    try:
        document = json.loads(text)
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"{file}: not a glTF file ({error})") from None
    if not isinstance(document, dict) or not str(document.get("asset", {}).get("version", "")).startswith("2"):
        raise InputError(f"{file}: glTF 2.x is needed, got version {document.get('asset', {}).get('version')!r}")
    return document, chunk


def _roots(document: dict[str, Any]) -> list[int]:
    nodes = document.get("nodes", [])
    children = {c for n in nodes for c in n.get("children", ())}
    return [k for k in range(len(nodes)) if k not in children]


class _Walker:
    """Walks the node tree and collects world-space triangles and their parts."""

    def __init__(self, file: Path, document: dict[str, Any], buffers: Buffers) -> None:
        self._file, self._doc, self._buffers = file, document, buffers
        self._vertices: list[FloatArray] = []
        self._faces: list[IntArray] = []
        self._part: list[IntArray] = []
        self._parts: list[Part] = []
        self._n_vertices = 0
        self._skipped = 0
        self._seen: set[int] = set()

    def visit(self, index: int, parent: FloatArray, group: str, extras: dict[str, Any] | None, depth: int) -> None:
        if depth > _MAX_DEPTH:
            raise InputError(f"{self._file}: nodes are nested deeper than {_MAX_DEPTH}")
        if index in self._seen:
            raise InputError(f"{self._file}: node {index} has two parents or is its own; glTF nodes form a tree")
        self._seen.add(index)
        node = self._doc["nodes"][index]
        world = parent @ _local_matrix(node)
        merged = {**(extras or {}), **_extras(node)}
        if "mesh" in node:
            instances = node.get("extensions", {}).get("EXT_mesh_gpu_instancing", {}).get("attributes")
            places = world @ _instance_matrices(self._buffers, instances) if instances else world[None]
            self._add(node, self._doc["meshes"][node["mesh"]], places, group, merged)
        for child in node.get("children", ()):
            self.visit(child, world, str(node.get("name", "")) or group, merged, depth + 1)

    def _add(
        self, node: dict[str, Any], mesh: dict[str, Any], places: FloatArray, group: str, extras: dict[str, Any]
    ) -> None:
        for primitive in mesh["primitives"]:
            triangles = self._triangles(primitive)
            if triangles is None:
                self._skipped += 1
                continue
            vertices = as_float64(self._buffers.accessor(primitive["attributes"]["POSITION"])[0])
            material = self._doc["materials"][primitive["material"]] if "material" in primitive else {}
            given = {**_extras(material), **extras, **_extras(mesh), **_extras(primitive)}
            self._parts.append(
                Part(
                    object=str(node.get("name", "")) or str(mesh.get("name", "")),
                    group=group or (str(mesh.get("name", "")) if node.get("name") else ""),
                    material=str(material.get("name", "")),
                    file=str(self._file),
                    declared_tag=given.get("carla_tag"),
                    declared_material=None if given.get("material") is None else str(given["material"]),
                )
            )
            for matrix in places:
                flip = np.linalg.det(matrix[:3, :3]) < 0  # glTF: a mirrored node reverses its winding
                self._vertices.append(placed(vertices, matrix))
                self._faces.append((triangles[:, ::-1] if flip else triangles) + self._n_vertices)
                self._part.append(np.full(len(triangles), len(self._parts) - 1, dtype=np.int32))
                self._n_vertices += len(vertices)

    def _triangles(self, primitive: dict[str, Any]) -> IntArray | None:
        if "indices" in primitive:
            index = self._buffers.accessor(primitive["indices"])[0].reshape(-1).astype(np.int64)
        else:
            index = np.arange(self._doc["accessors"][primitive["attributes"]["POSITION"]]["count"])
        mode = primitive.get("mode", 4)
        if mode == 4:
            return index[: len(index) // 3 * 3].reshape(-1, 3)
        if mode == 5:  # strip: every other triangle is reversed
            strip = np.stack([index[:-2], index[1:-1], index[2:]], axis=1)
            strip[1::2] = strip[1::2, ::-1]
            return strip
        if mode == 6:
            return np.stack([np.full(len(index) - 2, index[0]), index[1:-1], index[2:]], axis=1)
        return None  # points and lines do not reflect

    def mesh(self) -> RawMesh:
        if not self._faces:
            raise InputError(f"{self._file}: no triangles in this glTF file")
        counts = {"skipped_points_or_lines": self._skipped} if self._skipped else {}
        vertices, faces, part = (np.concatenate(x) for x in (self._vertices, self._faces, self._part))
        return RawMesh(vertices, faces, part, tuple(self._parts), counts)


def _extras(item: dict[str, Any]) -> dict[str, Any]:
    extras = item.get("extras")
    return {k: v for k, v in extras.items() if v is not None} if isinstance(extras, dict) else {}


def _local_matrix(node: dict[str, Any]) -> FloatArray:
    if "matrix" in node:
        return np.reshape(np.array(node["matrix"], dtype=np.float64), (4, 4), order="F")  # stored column after column
    composed: FloatArray = _compose(
        np.array([node.get("translation", (0, 0, 0))], dtype=np.float64),
        np.array([node.get("rotation", (0, 0, 0, 1))], dtype=np.float64),
        np.array([node.get("scale", (1, 1, 1))], dtype=np.float64),
    )
    return np.asarray(composed[0], dtype=np.float64)


def _instance_matrices(buffers: Buffers, attributes: dict[str, int]) -> FloatArray:
    columns = {name: as_float64(buffers.accessor(index)[0]) for name, index in attributes.items()}
    n = len(next(iter(columns.values())))
    return _compose(
        columns.get("TRANSLATION", np.zeros((n, 3))),
        columns.get("ROTATION", np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))),
        columns.get("SCALE", np.ones((n, 3))),
    )


def _compose(shift: FloatArray, quaternion: FloatArray, scale: FloatArray) -> FloatArray:
    """Return (n, 4, 4) matrices T R S from (n, 3) shifts, (n, 4) quaternions x y z w and (n, 3) scales."""
    x, y, z, w = (quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)).T
    result = np.tile(np.eye(4), (len(shift), 1, 1))
    result[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], axis=1)
    result[:, 1, :3] = np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], axis=1)
    result[:, 2, :3] = np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=1)
    result[:, :3, :3] *= scale[:, None, :]
    result[:, :3, 3] = shift
    return result
