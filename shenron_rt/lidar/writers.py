"""Write a semantic-LiDAR frame as CARLA writes it: PLY, raw records, structured ``.npy``; and its side file."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._typing import NDArray
from ..errors import InputError
from ..frames import to_carla
from .readers import RECORD

if TYPE_CHECKING:
    from .frame import LidarFrame

__all__ = ["carla_records", "write_semantic_lidar"]

#: CARLA's header, character by character (LibCarla ``SemanticLidarData.h``); the count stands in for %d.
_PLY_HEADER = (
    "ply\nformat ascii 1.0\nelement vertex %d\n"
    "property float32 x\nproperty float32 y\nproperty float32 z\nproperty float32 CosAngle\n"
    "property uint32 ObjIdx\nproperty uint32 ObjTag\nend_header\n"
)
#: ``PointCloudIO.h`` writes floats fixed, with four decimals.
_PLY_ROW = "%.4f %.4f %.4f %.4f %d %d"


def carla_records(frame: LidarFrame) -> NDArray[Any]:
    """Return the points as CARLA's 24-byte records: sensor frame, y right, tags of 0.9.14 to 0.9.16.

    Parameters
    ----------
    frame : LidarFrame

    Returns
    -------
    (n,) ndarray
        Fields x, y, z, CosAngle (float32), ObjIdx, ObjTag (uint32), little endian, in the order of the frame.
    """
    records = np.zeros(len(frame.position), dtype=RECORD)
    for axis, column in zip("xyz", to_carla(frame.position).T, strict=True):
        records[axis] = column
    records["CosAngle"] = frame.cos_incidence
    records["ObjIdx"] = frame.object_id
    records["ObjTag"] = frame.tag
    return records


def write_semantic_lidar(path: str | os.PathLike[str], frame: LidarFrame) -> None:
    """Write a frame in the layout that the ending of the file names.

    Parameters
    ----------
    path : path
        ``.ply`` (as ``save_to_disk``), ``.bin`` (``raw_data``) or ``.npy`` (structured array of the same records).
    frame : LidarFrame

    Raises
    ------
    InputError
        Another ending.

    Notes
    -----
    Read back with ``frame="carla"``, ``tag_table="0.9.14"`` and ``origin="sensor"``. ``.bin`` and ``.npy`` hold the
    float32 of each coordinate, exactly; PLY rounds to four decimals, so by at most 0.05 mm and 5e-5 of cosine.
    """
    file = Path(path)
    if (write := _WRITERS.get(file.suffix.lower())) is None:
        raise InputError(
            f"{file}: unknown ending {file.suffix!r}; a semantic LiDAR frame is written as {', '.join(_WRITERS)}"
        )
    write(file, carla_records(frame))


def _ply(file: Path, records: NDArray[Any]) -> None:
    with file.open("w", encoding="ascii", newline="\n") as stream:
        stream.write(_PLY_HEADER % len(records))
        np.savetxt(stream, records, fmt=_PLY_ROW)


def _raw(file: Path, records: NDArray[Any]) -> None:
    file.write_bytes(records.tobytes())


def _npy(file: Path, records: NDArray[Any]) -> None:
    np.save(file, records, allow_pickle=False)


_WRITERS: dict[str, Callable[[Path, NDArray[Any]], None]] = {".ply": _ply, ".bin": _raw, ".npy": _npy}
