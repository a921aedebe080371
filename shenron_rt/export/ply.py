"""Stanford PLY point files: vertices with every field of a point."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .points import Points

__all__ = ["ply_bytes", "write_ply"]

_TYPES = {"f4": "float", "f8": "double", "i4": "int", "u4": "uint", "i2": "short", "u2": "ushort", "u1": "uchar"}


def ply_bytes(points: Points, *, binary: bool = True, comments: tuple[str, ...] = ()) -> bytes:
    """Return a PLY file whose vertices are (n,) records.

    Parameters
    ----------
    points : (n,) structured array
        One field a property.
    binary : bool
        Little-endian records; otherwise lines of text that read back to the same float32.
    comments : tuple of str
        Lines of the header.
    """
    names = list(points.dtype.names or ())
    properties = [f"property {_TYPES[points.dtype[n].str[1:]]} {n}" for n in names]
    form = "binary_little_endian" if binary else "ascii"
    head = ["ply", f"format {form} 1.0", *(f"comment {c}" for c in comments), f"element vertex {len(points)}"]
    header = "".join(f"{line}\n" for line in [*head, *properties, "end_header"]).encode()
    if binary:
        return header + np.ascontiguousarray(points).tobytes()
    lines = [" ".join(f"{v:.9g}" if isinstance(v, float) else str(v) for v in row) for row in points.tolist()]
    return header + "".join(f"{line}\n" for line in lines).encode()


def write_ply(path: Path, points: Points, *, binary: bool = True, comments: tuple[str, ...] = ()) -> None:
    """Write a PLY file; see :func:`ply_bytes`."""
    path.write_bytes(ply_bytes(points, binary=binary, comments=comments))
