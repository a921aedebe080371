"""NumPy files: structured arrays, tables of floats with ids as bits or as values, SimBEV's ``.npz``."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from ..._typing import NDArray
from ...errors import InputError
from ._raw import RECORD, RawPoints, from_fields, from_matrix, require_points

__all__ = ["read_npy_points", "read_npz_points"]


def read_npy_points(file: Path, content: bytes) -> RawPoints:
    """Read a ``.npy`` array of any of the kinds that are in use.

    Parameters
    ----------
    file : path
        For messages.
    content : bytes
        The whole file.

    Raises
    ------
    InputError
        A file cut short, an array of objects, or of a shape that is no frame.
    """
    try:
        array = np.load(io.BytesIO(content), allow_pickle=False)
    except (ValueError, EOFError, OSError) as error:
        raise InputError(f"{file}: not a .npy array that can be read; is it cut short? ({error})") from None
    return _points(file, np.asarray(array), ".npy")


def read_npz_points(file: Path, content: bytes) -> RawPoints:
    """Read an ``.npz`` whose only array, or array ``data``, is a frame (SimBEV).

    Parameters
    ----------
    file : path
        For messages.
    content : bytes
        The whole file.

    Raises
    ------
    InputError
        No such array, or what :func:`read_npy_points` raises.
    """
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            names = archive.files
            key = "data" if "data" in names else names[0] if len(names) == 1 else ""
            array = archive[key] if key else None
    except (ValueError, EOFError, OSError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(f"{file}: not an .npz that can be read; is it cut short? ({error})") from None
    if array is None:
        raise InputError(f"{file}: arrays {', '.join(names)}; a frame is in an array 'data' (SimBEV), or the only one")
    return _points(file, np.asarray(array), ".npz")


def _points(file: Path, array: NDArray[Any], kind: str) -> RawPoints:
    require_points(file, array.size)
    if array.dtype.names:
        flat = array.reshape(-1)
        return from_fields(file, {name: flat[name] for name in array.dtype.names}, f"structured {kind}")
    if array.dtype == np.uint8 and array.ndim == 1:  # np.frombuffer(raw_data, np.uint8)
        from .raw_bin import read_raw_points

        return read_raw_points(file, array.tobytes())
    if array.dtype.kind not in "fiu":
        raise InputError(
            f"{file}: an array of {array.dtype}; numbers, or the fields {', '.join(RECORD.names or ())}, are needed"
        )
    if array.ndim == 1 and array.size % 6 == 0:  # np.frombuffer(raw_data, "f4") without its reshape
        array = array.reshape(-1, 6)
    return from_matrix(file, array, f"{array.dtype} {kind}")
