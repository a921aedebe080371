"""Small mesh files written by the tests, so that each fact of them is known exactly."""

from __future__ import annotations

import base64
from pathlib import Path

import numpy as np


def write(folder: Path, name: str, content: str | bytes) -> Path:
    file = folder / name
    file.write_bytes(content.encode() if isinstance(content, str) else content)
    return file


def gltf(
    nodes: list[dict], *, roots=(0,), extra: dict | None = None, tail: bytes = b"", views=(), accessors=()
) -> dict:
    """A document whose mesh 0 is the unit right triangle in x, y with material ``M_Glass``."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4").tobytes()
    index = np.array([0, 1, 2, 0], dtype="<u2").tobytes()
    data = points + index + tail
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(roots)}],
        "nodes": nodes,
        "materials": [{"name": "M_Glass"}],
        "meshes": [{"name": "tri", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
            *accessors,
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 6},
            *views,
        ],
        "buffers": [{"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}],
    }
    return {**document, **(extra or {})}
