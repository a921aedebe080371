"""Point Cloud Library files (PCD 0.7): one header, then binary or ASCII records."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .points import Points

__all__ = ["pcd_bytes", "write_pcd"]


def pcd_bytes(points: Points, *, binary: bool = True) -> bytes:
    """Return a PCD file of (n,) records of 1, 2, 4 or 8 byte numbers.

    Parameters
    ----------
    points : (n,) structured array
        One field a column.
    binary : bool
        Packed little-endian records; otherwise lines of text that read back to the same float32.

    Notes
    -----
    The header is that of version 0.7: FIELDS, SIZE, TYPE (F float, I signed, U unsigned), COUNT, WIDTH, HEIGHT 1,
    VIEWPOINT (translation, then quaternion w x y z: the sensor stands at the origin), POINTS, DATA.
    """
    names = list(points.dtype.names or ())
    kinds = [points.dtype[n] for n in names]
    header = "\n".join(
        [
            "# .PCD v0.7 - Point Cloud Data file format",
            "VERSION 0.7",
            f"FIELDS {' '.join(names)}",
            f"SIZE {' '.join(str(k.itemsize) for k in kinds)}",
            f"TYPE {' '.join(k.kind.upper() for k in kinds)}",
            f"COUNT {' '.join('1' for _ in kinds)}",
            f"WIDTH {len(points)}",
            "HEIGHT 1",
            "VIEWPOINT 0 0 0 1 0 0 0",
            f"POINTS {len(points)}",
            f"DATA {'binary' if binary else 'ascii'}",
            "",
        ]
    ).encode()
    if binary:
        return header + np.ascontiguousarray(points).tobytes()
    # nine significant digits are enough to tell any two float32 apart
    lines = [" ".join(f"{v:.9g}" if isinstance(v, float) else str(v) for v in row) for row in points.tolist()]
    return header + "".join(f"{line}\n" for line in lines).encode()


def write_pcd(path: Path, points: Points, *, binary: bool = True) -> None:
    """Write a PCD file; see :func:`pcd_bytes`."""
    path.write_bytes(pcd_bytes(points, binary=binary))
