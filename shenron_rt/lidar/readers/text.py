"""Text tables: six columns, or seven with the radial velocity, separated by spaces or commas."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np

from ...errors import InputError
from ._raw import COLUMNS, RawPoints, from_fields, require_points, table_columns, whole_numbers

__all__ = ["looks_like_text", "read_text_points"]

_TEXT = frozenset(b"0123456789+-.eE,; \t\r\nabcdfghijklmnopqrstuvwxyzABCDFGHIJKLMNOPQRSTUVWXYZ_#/[]()%")


def looks_like_text(head: bytes) -> bool:
    """Return whether the first bytes of a file are a table in text."""
    return bool(head) and set(head) <= _TEXT


def read_text_points(file: Path, content: bytes) -> RawPoints:
    """Read a table; a first line of names is used, without one the order is x, y, z, [v,] cos, id, tag.

    Parameters
    ----------
    file : path
        For messages.
    content : bytes
        The whole file.

    Raises
    ------
    InputError
        Rows that are not numbers, a wrong number of columns, an empty table.
    """
    text = content.decode("ascii", errors="replace").replace(",", " ").replace(";", " ")
    first, _, rest = text.lstrip().partition("\n")
    names = first.lstrip("# ").split()
    titled = bool(names) and not _is_number(names[0])
    body = rest if titled else text
    require_points(file, len(body.strip()))
    try:
        rows = np.loadtxt(io.StringIO(body), dtype=np.float64, ndmin=2)
    except ValueError as error:
        raise InputError(f"{file}: read as a text table: {error}; is the file cut short?") from None
    if titled and len(names) == rows.shape[1]:
        columns = {name: rows[:, k] for k, name in enumerate(names)}
    else:
        columns = table_columns(file, rows)
    counted = {name.lower() for what in ("object_id", "tag") for name in COLUMNS[what]}
    columns = {name: whole_numbers(c) if name.lower() in counted else c for name, c in columns.items()}
    velocity = ", with velocity" if rows.shape[1] == 7 else ""
    return from_fields(file, columns, f"text table{velocity}")


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
