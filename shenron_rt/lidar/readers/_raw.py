"""What every reader returns: the columns as they stand in the file, nothing translated or flipped."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..._typing import FloatArray, IntArray, NDArray
from ...errors import InputError

__all__ = [
    "COLUMNS",
    "RECORD",
    "RawPoints",
    "from_fields",
    "from_matrix",
    "record_points",
    "require_points",
    "table_columns",
    "whole_numbers",
]

#: One point of ``sensor.lidar.ray_cast_semantic``, packed, little endian (LibCarla ``SemanticLidarData.h``).
RECORD = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("CosAngle", "<f4"), ("ObjIdx", "<u4"), ("ObjTag", "<u4")])
#: What people call the columns: save_to_disk, the C++ struct and ROS bridge, the LAZ extra dimensions.
COLUMNS = {
    "cos": ("CosAngle", "cos_inc_angle", "cos_inc", "cosine", "cos_incidence"),
    "object_id": ("ObjIdx", "object_idx", "obj_idx", "index", "id", "object_id"),
    "tag": ("ObjTag", "object_tag", "obj_tag", "sem_tag", "tag"),
    "range_rate": ("v", "velocity", "radial_velocity"),
}
#: Bits of whole numbers viewed as float32 stay below this (2.3e8 does); no value-cast id or tag lies there but 0.
_BITS_BELOW = 1e-30


@dataclass(frozen=True)
class RawPoints:
    """Columns of a file.

    Parameters
    ----------
    xyz : (n, 3) float
        In the file's axes [m].
    cos : (n,) float
        The incidence column, unchecked.
    object_id, tag : (n,) uint32
        Tags in the file's numbering.
    layout : str
        What the file was taken for.
    range_rate : (n,) float or None
        The velocity column of the seven-column list, positive = receding [m/s].
    notes : tuple of str
        What the reader had to do.
    """

    xyz: FloatArray
    cos: FloatArray
    object_id: IntArray
    tag: IntArray
    layout: str
    range_rate: FloatArray | None = None
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.xyz)


def record_points(records: NDArray[Any], layout: str) -> RawPoints:
    """Return the columns of an array of :data:`RECORD`."""
    xyz = np.stack([records[axis] for axis in "xyz"], axis=1).astype(np.float64)
    cos = records["CosAngle"].astype(np.float64)
    return RawPoints(xyz, cos, records["ObjIdx"].astype(np.uint32), records["ObjTag"].astype(np.uint32), layout, None)


def from_fields(file: Path, fields: dict[str, NDArray[Any]], layout: str) -> RawPoints:
    """Return the columns of named arrays, by any of the names in :data:`COLUMNS`.

    Raises
    ------
    InputError
        A column that is not there, with what a plain LiDAR frame lacks.
    """
    lower = {name.lower(): name for name in fields}
    found = {
        what: next((fields[lower[n.lower()]] for n in names if n.lower() in lower), None)
        for what, names in COLUMNS.items()
    }
    missing = [axis for axis in "xyz" if axis not in lower]
    missing += [COLUMNS[what][0] for what in ("cos", "object_id", "tag") if found[what] is None]
    if missing:
        plain = " It looks like a plain LiDAR frame:" if "ObjTag" in missing else ""
        raise InputError(
            f"{file}: {', '.join(missing)} missing; it has {', '.join(fields) or 'nothing'}.{plain} semantic LiDAR "
            "(sensor.lidar.ray_cast_semantic) has x, y, z, CosAngle, ObjIdx, ObjTag"
        )
    cos, identity, tag, rate = found["cos"], found["object_id"], found["tag"], found["range_rate"]
    assert cos is not None
    assert identity is not None
    assert tag is not None
    ids, notes = as_unsigned(file, identity, "ObjIdx")
    tags, more = as_unsigned(file, tag, "ObjTag")
    return RawPoints(
        xyz=np.stack([np.asarray(fields[lower[axis]], dtype=np.float64) for axis in "xyz"], axis=1),
        cos=np.asarray(cos, dtype=np.float64),
        object_id=ids,
        tag=tags,
        layout=layout,
        range_rate=None if rate is None else np.asarray(rate, dtype=np.float64),
        notes=tuple(dict.fromkeys(notes + more)),
    )


def from_matrix(file: Path, table: NDArray[Any], layout: str) -> RawPoints:
    """Return the columns of an (n, 6) or (n, 7) array of numbers."""
    velocity = ", with velocity" if table.ndim == 2 and table.shape[1] == 7 else ""
    return from_fields(file, table_columns(file, table), f"{layout}{velocity}")


def table_columns(file: Path, table: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Return the named columns of an (n, 6) or (n, 7) array."""
    if table.ndim != 2 or table.shape[1] not in (6, 7):
        raise InputError(
            f"{file}: shape {table.shape}; a semantic LiDAR frame is (n, 6): x, y, z, cos, id, tag, or (n, 7) with the "
            "radial velocity before cos. Plain LiDAR (n, 4) has no tags"
        )
    names = ["x", "y", "z", *(["v"] if table.shape[1] == 7 else []), "CosAngle", "ObjIdx", "ObjTag"]
    return {name: table[:, k] for k, name in enumerate(names)}


def whole_numbers(column: NDArray[Any]) -> NDArray[Any]:
    """Return a column of text as integers where all of it is whole; else as it is, for the refusal that follows."""
    if np.all(np.isfinite(column)) and np.all(column == np.rint(column)):
        return column.astype(np.int64)
    return column


def as_unsigned(file: Path, column: NDArray[Any], name: str) -> tuple[IntArray, tuple[str, ...]]:
    """Return whole numbers as uint32; bits that were viewed as floats are viewed back, never cast.

    Raises
    ------
    InputError
        Fractions, negative numbers, or not finite ones.
    """
    values = np.asarray(column)
    if values.dtype.kind in "iu":
        return _in_range(file, values, name).astype(np.uint32), ()
    if not np.all(np.isfinite(values)):
        raise InputError(f"{file}: {name} has {int(np.sum(~np.isfinite(values)))} values that are not finite")
    note = ("ids and tags recovered from the bits of denormal floats",)
    if values.dtype == np.float32:
        # compared as bits: arithmetic may flush denormals to zero, where a library has switched that on
        bits = np.ascontiguousarray(values).view(np.uint32)
        if 0 < int(bits.max(initial=0)) < int(np.float32(_BITS_BELOW).view(np.uint32)):
            return bits, note
    top = float(np.abs(values).max(initial=0.0))
    if 0.0 < top < _BITS_BELOW:  # widened to float64, where the value is bits x 2^-149 and no denormal
        counted = np.rint(values.astype(np.float64) * 2.0**149)
        return _in_range(file, counted, name).astype(np.uint32), note
    whole = np.rint(values)
    if np.any(whole != values):
        bad = values[whole != values]
        raise InputError(
            f"{file}: {name} is fractional in {bad.size} rows (first {float(bad[0]):g}); ids and tags are whole "
            "numbers. Was the frame averaged or resampled?"
        )
    return _in_range(file, whole, name).astype(np.uint32), (("ids and tags stored as float values",) if top else ())


def _in_range(file: Path, values: NDArray[Any], name: str) -> NDArray[Any]:
    if values.size and (values.min() < 0 or values.max() > 2**32 - 1):
        raise InputError(f"{file}: {name} from {values.min():g} to {values.max():g}; 0 to 4294967295 is possible")
    return values


def require_points(file: Path, count: int) -> None:
    """Refuse an empty cloud."""
    if count == 0:
        raise InputError(f"{file}: no points (N = 0); was the sensor's range (CARLA's default is 10 m) too short?")
