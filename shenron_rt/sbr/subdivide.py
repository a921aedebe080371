"""Triangles cut into smaller ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .._typing import FloatArray, IntArray

__all__ = ["clipped", "shortened"]

#: Shortest side of a needle, in what sides may measure.
_THIN = 0.6


def shortened(
    triangles: FloatArray, longest: Callable[[FloatArray], FloatArray], most: int
) -> tuple[FloatArray, IntArray] | None:
    """Cut triangles until their sides are short enough: halves of wide ones, slices of needles.

    Parameters
    ----------
    triangles : (n, 3, d) float
        Corners, and anything else that is linear over a triangle after the first three columns.
    longest : callable
        (m, 3, 3) corners to (m,) the most that a side may measure [m].
    most : int
        Triangles to end with.

    Returns
    -------
    smaller : (m, 3, d) float
        Wound as the given ones.
    row : (m,) int
        The triangle that each is part of. None where there would be too many.
    """
    row, count = np.arange(len(triangles)), 0
    done: list[tuple[FloatArray, IntArray]] = []
    while len(triangles):
        place = triangles[:, :, :3]
        side = np.linalg.norm(np.roll(place, -1, axis=1) - place, axis=2)
        limit = longest(place)
        long = side.max(axis=1) > limit
        needle = long & (side.min(axis=1) <= _THIN * limit)
        wide = long & ~needle
        slices = np.ceil(side[needle].max(axis=1) / (np.sqrt(1.0 - _THIN**2) * limit[needle])).astype(np.int64)
        count += int((~long).sum()) + int((2 * slices - 1).sum())
        if count + 2 * int(wide.sum()) > most:
            return None
        done.append((triangles[~long], row[~long]))
        cut, of = _sliced(_from_side(triangles[needle], side[needle].argmin(axis=1)), slices)
        done.append((cut, row[needle][of]))
        a, b, c = np.moveaxis(_from_side(triangles[wide], side[wide].argmax(axis=1)), 1, 0)
        middle = 0.5 * (a + b)
        triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
        row = np.tile(row[wide], 2)
    pieces, rows = zip(*done, strict=True)
    return np.concatenate(pieces), np.concatenate(rows)


def _from_side(triangles: FloatArray, first: IntArray) -> FloatArray:
    """Return triangles with their corners turned so that a side is the first."""
    turn = (first[:, None] + np.arange(3)) % 3
    return np.take_along_axis(triangles, turn[:, :, None], axis=1)


def _sliced(triangles: FloatArray, count: IntArray) -> tuple[FloatArray, IntArray]:
    """Cut triangles across, along their first sides, into so many slices; all but the one at the tip become two."""
    row = np.repeat(np.arange(len(triangles)), count)
    step = np.arange(len(row)) - np.repeat(np.cumsum(count) - count, count)
    base, other, tip = np.moveaxis(triangles[row], 1, 0)
    near, far = ((step + k)[:, None] / count[row][:, None] for k in (0, 1))
    a, b, c, d = (tip + share * (end - tip) for share, end in ((near, base), (far, base), (far, other), (near, other)))
    square = step > 0
    pieces = np.concatenate([np.stack([b, c, a], axis=1), np.stack([a, c, d], axis=1)[square]])
    return pieces, np.concatenate([row, row[square]])


def clipped(triangles: FloatArray, height: FloatArray) -> tuple[FloatArray, IntArray]:
    """Cut off what lies below zero.

    Parameters
    ----------
    triangles : (n, 3, d) float
        Anything that is linear over a triangle: places, normals.
    height : (n, 3) float
        At the corners; linear too.

    Returns
    -------
    above : (m, 3, d) float
        Wound as the given ones.
    row : (m,) int
        The triangle that each is part of.
    """
    up = height > 0.0
    count = up.sum(axis=1)
    whole, one, two = (np.flatnonzero(count == c) for c in (3, 1, 2))
    pieces, rows = [triangles[whole]], [whole]
    for row, lone in ((one, up), (two, ~up)):
        first = lone[row].argmax(axis=1)
        turn = (first[:, None] + np.arange(3)) % 3  # the corner that is alone on its side first
        corner = np.take_along_axis(triangles[row], turn[:, :, None], axis=1)
        level = np.take_along_axis(height[row], turn, axis=1)
        share = level[:, :1] / (level[:, :1] - level[:, 1:])
        cut = corner[:, :1] + share[:, :, None] * (corner[:, 1:] - corner[:, :1])
        if row is one:
            pieces.append(np.concatenate([corner[:, :1], cut], axis=1))
            rows.append(row)
        else:
            pieces.append(np.stack([cut[:, 0], corner[:, 1], corner[:, 2]], axis=1))
            pieces.append(np.stack([cut[:, 0], corner[:, 2], cut[:, 1]], axis=1))
            rows += [row, row]
    return np.concatenate(pieces), np.concatenate(rows)
