"""Arrays on disk: one ``.npz`` per value, written whole or not at all."""

from __future__ import annotations

import os
import tempfile
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..errors import InputError, NotFoundError

__all__ = ["atomic_write", "load_npz", "save_npz"]


def atomic_write(path: str | os.PathLike[str], write: Callable[[IO[bytes]], None]) -> Path:
    """Write a file through a temporary one beside it, so that a reader sees the old or the new file, never half.

    Parameters
    ----------
    path : path
        Where; the folder is made.
    write : callable
        Gets the open binary file.
    """
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            write(file)
        umask = os.umask(0)
        os.umask(umask)
        Path(name).chmod(0o666 & ~umask)
        Path(name).replace(target)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    return target


def save_npz(path: str | os.PathLike[str], arrays: dict[str, Any]) -> Path:
    """Save named arrays; ``None`` is left out, strings become zero-dimensional arrays."""
    kept: dict[str, Any] = {k: np.asarray(v) for k, v in arrays.items() if v is not None}
    return atomic_write(path, lambda file: np.savez(file, **kept))


def load_npz(path: str | os.PathLike[str], required: Iterable[str]) -> dict[str, Any]:
    """Load named arrays; nothing is unpickled.

    Raises
    ------
    NotFoundError
        No such file.
    InputError
        Not an npz file, or one without the required arrays.
    """
    file = Path(path)
    try:
        with np.load(file, allow_pickle=False) as data:
            arrays = {k: data[k] for k in data.files}
    except FileNotFoundError:
        raise NotFoundError(f"{file}: no such file") from None
    except (ValueError, OSError, zipfile.BadZipFile, EOFError) as error:
        raise InputError(f"{file}: not an npz file that can be read ({error})") from None
    missing = sorted(set(required) - set(arrays))
    if missing:
        raise InputError(f"{file}: arrays {missing} are missing; it has {sorted(arrays)}")
    return arrays
