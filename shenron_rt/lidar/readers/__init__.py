"""Readers of semantic LiDAR frames, one layout a file; a file is told by its content, not by its name."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from ...errors import InputError, NotFoundError
from ._raw import RECORD, RawPoints, require_points
from .las import read_las_points
from .numpy_files import read_npy_points, read_npz_points
from .ply import read_ply_points
from .raw_bin import read_raw_points
from .text import looks_like_text, read_text_points

__all__ = ["RECORD", "RawPoints", "read_points"]

_Reader = Callable[[Path, bytes], RawPoints]
#: First bytes of a file and what reads it.
_MAGIC: tuple[tuple[bytes, _Reader], ...] = (
    (b"ply", read_ply_points),
    (b"\x93NUMPY", read_npy_points),
    (b"PK\x03\x04", read_npz_points),
    (b"LASF", read_las_points),
)
_HEAD = 512


def read_points(path: str | os.PathLike[str]) -> RawPoints:
    """Read the points of a file of any known layout.

    Parameters
    ----------
    path : path
        CARLA's PLY, raw 24-byte records, ``.npy``, ``.npz``, LAS, LAZ, or a table in text.

    Raises
    ------
    NotFoundError, InputError
    """
    file = Path(path)
    try:
        content = file.read_bytes()
    except FileNotFoundError:
        raise NotFoundError(f"{file}: no such file") from None
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from None
    require_points(file, len(content))
    for magic, reader in _MAGIC:
        if content.startswith(magic):
            return reader(file, content)
    reader = read_text_points if looks_like_text(content[:_HEAD]) else read_raw_points
    return reader(file, content)
