"""Buffers, views and accessors of glTF 2.0 (specification section 3.6)."""

from __future__ import annotations

import base64
import binascii
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from ..._typing import IntArray, NDArray
from ...errors import InputError
from ._raw import read_bytes

__all__ = ["Buffers", "load_buffers"]

_COMPONENT = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
# Accessors without a buffer view are zeros, so their size is not bounded by the size of the file.
_MAX_IMPLICIT = 1 << 24
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclass(frozen=True)
class Buffers:
    """The binary data of a document, and typed access to it."""

    document: dict[str, Any]
    blobs: tuple[bytes, ...]

    def accessor(self, index: int) -> tuple[NDArray[Any], dict[str, Any]]:
        """Return an accessor's (n, width) values, de-quantised where it is normalised, and its description."""
        entry = self.document["accessors"][index]
        kind, width, count = np.dtype(_COMPONENT[entry["componentType"]]), _WIDTH[entry["type"]], int(entry["count"])
        if "bufferView" in entry:
            values = self._view(entry["bufferView"], entry.get("byteOffset", 0), kind, width, count)
        elif count > _MAX_IMPLICIT:
            raise InputError(f"a glTF accessor asks for {count} zeros without data, at most {_MAX_IMPLICIT} are made")
        else:
            values = np.zeros((count, width), kind)
        if "sparse" in entry:
            values = self._with_sparse(values, entry["sparse"], kind, width)
        if entry.get("normalized"):
            # signed -128 and -127 both mean -1 (section 3.6.2.2)
            return np.maximum(values.astype(np.float64) / np.iinfo(kind).max, -1.0), entry
        return values, entry

    def _view(self, index: int, offset: int, kind: np.dtype[Any], width: int, count: int) -> NDArray[Any]:
        view = self.document["bufferViews"][index]
        start = int(view.get("byteOffset", 0)) + int(offset)
        row = kind.itemsize * width
        stride = int(view.get("byteStride", row))
        blob = self.blobs[view["buffer"]]
        if count and (min(start, stride) < 0 or start + stride * (count - 1) + row > len(blob)):
            raise InputError(f"a glTF accessor reaches past the end of its buffer ({len(blob)} bytes)")
        if not count:
            return np.zeros((0, width), kind)
        return np.ndarray((count, width), kind, blob, start, (stride, kind.itemsize)).copy()

    def _with_sparse(
        self, values: NDArray[Any], sparse: dict[str, Any], kind: np.dtype[Any], width: int
    ) -> NDArray[Any]:
        count = int(sparse["count"])
        where, what = sparse["indices"], sparse["values"]
        index_kind = np.dtype(_COMPONENT[where["componentType"]])
        rows: IntArray = self._view(where["bufferView"], where.get("byteOffset", 0), index_kind, 1, count).reshape(-1)
        changed = values.copy()
        changed[rows] = self._view(what["bufferView"], what.get("byteOffset", 0), kind, width, count)
        return changed


def load_buffers(file: Path, document: dict[str, Any], chunk: bytes) -> Buffers:
    """Return the buffers: the GLB chunk, base64 data, or files in the folder of the document (never above it)."""
    blobs = []
    for number, buffer in enumerate(document.get("buffers", ())):
        uri = buffer.get("uri")
        if uri is None:
            if number or not chunk:
                raise InputError(f"{file}: buffer {number} has no data")
            blobs.append(chunk)
        elif str(uri).startswith("data:"):
            try:
                blobs.append(base64.b64decode(str(uri).partition(",")[2], validate=True))
            except binascii.Error as error:
                raise InputError(f"{file}: buffer {number}: bad base64 data ({error})") from None
        else:
            beside = file.parent / unquote(str(uri))
            if not beside.resolve().is_relative_to(file.parent.resolve()):
                raise InputError(f"{file}: buffer {str(uri)!r} lies outside the file's folder; put it beside the file")
            blobs.append(read_bytes(beside))
    return Buffers(document, tuple(blobs))
