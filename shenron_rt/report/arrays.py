"""Arrays as text inside a page: little-endian bytes in base64, one element each, decoded when first looked at."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np

from .._typing import ArrayLike, FloatArray, IntArray, NDArray
from ..runs import plain

__all__ = ["Arrays", "decoded", "encoded_levels", "script_json"]

#: Types a page may hold, by the names its scripts know.
_TYPES = {"u1": np.uint8, "i2": np.int16, "i4": np.int32, "u4": np.uint32, "f4": np.float32, "f8": np.float64}


class Arrays:
    """Named arrays of a page: those it begins with, and those that may come after it is shown."""

    def __init__(self) -> None:
        self._first: list[str] = []
        self._later: list[str] = []

    def add(self, name: str, values: ArrayLike, kind: str, *, later: bool = False) -> None:
        """Add an array.

        Parameters
        ----------
        name : str
            Unique in the page.
        values : array_like
            Any shape.
        kind : str
            ``u1``, ``i2``, ``i4``, ``u4``, ``f4`` or ``f8``: what it is stored as.
        later : bool
            The first picture can do without it.
        """
        array = np.ascontiguousarray(values, dtype=np.dtype(_TYPES[kind]).newbyteorder("<"))
        shape = ",".join(str(n) for n in array.shape)
        text = base64.b64encode(array.tobytes()).decode("ascii")
        self._put(f'type="text/plain" id="{name}" data-kind="{kind}" data-shape="{shape}"', text, later)

    def add_json(self, name: str, value: Any, *, later: bool = False) -> None:
        """Add plain values."""
        self._put(f'type="application/json" id="{name}"', script_json(value), later)

    def _put(self, attributes: str, text: str, later: bool) -> None:
        (self._later if later else self._first).append(f"<script {attributes}>{text}</script>")

    def html(self, *, later: bool = False) -> str:
        """Return the elements of either kind, one a line."""
        return "\n".join(self._later if later else self._first)


def script_json(value: Any) -> str:
    """Return JSON that no text in it can end or comment out the element it stands in; not finite becomes null."""
    text = json.dumps(plain(value), separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    for character in "<>&\u2028\u2029":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def decoded(text: str, kind: str, shape: str) -> NDArray[Any]:
    """Return the array behind the text, ``data-kind`` and ``data-shape`` of an element: what the page's scripts do."""
    flat = np.frombuffer(base64.b64decode(text), dtype=np.dtype(_TYPES[kind]).newbyteorder("<"))
    return flat.reshape([int(n) for n in shape.split(",")])


def encoded_levels(level_db: FloatArray, low: float, step_db: float) -> IntArray:
    """Return levels as 0 to 255 steps above ``low``; what lies outside is clipped."""
    return np.clip(np.rint((level_db - low) / step_db), 0, 255).astype(np.uint8)
