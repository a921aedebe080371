"""Arithmetic of rows: vectors and short tuples, one a ray."""

from __future__ import annotations

from typing import Any

from .._typing import BoolArray, FloatArray, NDArray

__all__ = ["alike", "dot", "mirrored"]


def dot(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Return the (n,) scalar products of rows, complex ones unconjugated."""
    result: NDArray[Any] = a[:, 0] * b[:, 0]
    result += a[:, 1] * b[:, 1]
    result += a[:, 2] * b[:, 2]
    return result


def alike(values: NDArray[Any]) -> BoolArray:
    """Return (n,) whether the four numbers of a row are equal; NumPy reduces along short rows slowly."""
    first, second, third, fourth = values.T
    same: BoolArray = (first == second) & (second == third) & (third == fourth)
    return same


def mirrored(vector: FloatArray, normal: FloatArray) -> FloatArray:
    """Return (n, 3) vectors as the mirror with a unit normal shows them."""
    return vector - 2.0 * dot(vector, normal)[:, None] * normal
