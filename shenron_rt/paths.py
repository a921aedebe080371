"""Paths: ways from a radar over several surfaces and back, each the width of one ray's tube."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, Self

import numpy as np

from ._typing import BoolArray, FloatArray, IntArray, NDArray
from .errors import InputError

__all__ = ["Paths"]

#: Parameters that are not one array with a row a path and a column a hit.
_PER_PATH = {"count": (), "radiates": (), "two_way": (), "area": (3,), "slope": (2,), "curvature": (3,), "rcs": ()}


@dataclass(frozen=True, eq=False)
class Paths:
    """Ways with two bounces or more, in the frame of one radar, mid-frame; b is the most hits of any of them.

    Parameters
    ----------
    count : (n,) uint8
        Hits of each; columns beyond them hold zeros.
    point, normal, velocity : (n, b, 3) float
        The hits of the ray in the middle of the tube [m], unit normals on the side that is lit, velocities relative to
        the radar [m/s].
    material : (n, b) uint16
        Index into the names of the scatterers' materials.
    object_id : (n, b) uint32
    tag : (n, b) uint8
    radiates : (n,) uint8
        Column of the hit whose current is integrated; what comes after it are mirrors on the way back.
    two_way : (n,) bool
        Whether the path stands for its reverse, too, whose echo is the same by reciprocity.
    area : (n, 3) float
        Vector area of the footprint that radiates, on the lit side, for a unit of u and v, which run from -1 to 1 over
        the tube [m^2].
    slope : (n, 2) float
        Derivatives of the whole way there and back over u and v [m].
    curvature : (n, 3) float
        Second derivatives: uu, vv, uv [m].
    rcs : (n,) float
        Where a point target radiates, not a footprint: its RCS [m^2]. NaN elsewhere.
    """

    count: IntArray
    point: FloatArray
    normal: FloatArray
    velocity: FloatArray
    material: IntArray
    object_id: IntArray
    tag: IntArray
    radiates: IntArray
    two_way: BoolArray
    area: FloatArray
    slope: FloatArray
    curvature: FloatArray
    rcs: FloatArray

    def __post_init__(self) -> None:
        n, b = self.object_id.shape
        for field in fields(self):
            shape: tuple[int, ...] = (n, *_PER_PATH.get(field.name, (b,)))
            if field.name in ("point", "normal", "velocity"):
                shape = (n, b, 3)
            if np.shape(getattr(self, field.name)) != shape:
                got = np.shape(getattr(self, field.name))
                raise InputError(f"Paths.{field.name}: shape {shape} is needed, got {got}")

    def __len__(self) -> int:
        return len(self.count)

    def __repr__(self) -> str:
        longest = int(self.count.max(initial=0))
        return f"Paths({len(self)} over up to {longest} surfaces)"

    @classmethod
    def none(cls) -> Self:
        """Return no paths at all."""
        return cls.join([])

    @classmethod
    def join(cls, parts: Sequence[Paths]) -> Self:
        """Return the paths of all parts, one after the other."""
        most = max([2, *(p.object_id.shape[1] for p in parts)])
        columns: dict[str, NDArray[Any]] = {}
        empty = _empty(most)
        for field in fields(cls):
            values = [empty[field.name]]
            for part in parts:
                value = getattr(part, field.name)
                if field.name not in _PER_PATH:
                    missing = most - value.shape[1]
                    value = np.pad(value, [(0, 0), (0, missing)] + [(0, 0)] * (value.ndim - 2))
                values.append(value)
            columns[field.name] = np.concatenate(values).astype(empty[field.name].dtype, copy=False)
        return cls(**columns)

    def select(self, rows: IntArray | BoolArray | slice) -> Self:
        """Return some of the paths."""
        return type(self)(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    @cached_property
    def hit(self) -> BoolArray:
        """(n, b) whether a path has this many hits."""
        return np.asarray(np.arange(self.object_id.shape[1]) < self.count[:, None])

    @cached_property
    def last(self) -> FloatArray:
        """(n, 3) the last hit [m]."""
        return np.asarray(self.point[np.arange(len(self)), self.count.astype(np.int64) - 1])

    @property
    def source(self) -> FloatArray:
        """(n, 3) the hit that radiates [m]."""
        return np.asarray(self.point[np.arange(len(self)), self.radiates])

    @cached_property
    def legs(self) -> FloatArray:
        """(n, b + 1, 3) vectors from the radar to the first hit, from hit to hit, and back from the last one [m]."""
        zero = np.zeros((len(self), 1, 3))
        points = np.where(self.hit[:, :, None], self.point, 0.0)
        return np.asarray(np.diff(np.concatenate([zero, points, zero], axis=1), axis=1))

    @cached_property
    def way(self) -> FloatArray:
        """(n,) length there and back [m]."""
        return np.asarray(np.linalg.norm(self.legs, axis=2).sum(axis=1))

    @cached_property
    def there(self) -> FloatArray:
        """(n,) length from the radar to the hit that radiates [m]."""
        length = np.linalg.norm(self.legs, axis=2)
        return np.asarray(np.where(np.arange(length.shape[1]) <= self.radiates[:, None], length, 0.0).sum(axis=1))

    @cached_property
    def departure(self) -> FloatArray:
        """(n, 3) unit vectors in which the paths leave the radar."""
        return _unit(self.point[:, 0])

    @cached_property
    def arrival(self) -> FloatArray:
        """(n, 3) unit vectors from the radar to the last hits, where the paths come back from."""
        return _unit(self.last)

    @cached_property
    def range_rate(self) -> FloatArray:
        """(n,) half the rate at which the way grows [m/s].

        Each hit contributes V . (arriving - leaving unit vector); where it slides on its surface does not count, as
        the way is stationary there.
        """
        legs = self.legs
        length = np.linalg.norm(legs, axis=2, keepdims=True)
        unit = np.divide(legs, length, out=np.zeros_like(legs), where=length > 0)
        return np.asarray(0.5 * np.einsum("nbi,nbi->n", self.velocity, unit[:, :-1] - unit[:, 1:]))

    @cached_property
    def image_velocity(self) -> tuple[FloatArray, FloatArray]:
        """(n, 3) velocities of the images of the hit that radiates [m/s]: as transmitters see it, and as receivers do.

        The image of a point of velocity v in a plane of normal n that moves with V has v - 2 n (n . (v - V)). Along
        the line of sight that holds for mirrors that turn, too; the turning of their images about the radar is left
        out.
        """
        source = self.velocity[np.arange(len(self)), self.radiates]
        out, back = source, source
        columns = range(self.object_id.shape[1])
        for order in reversed(columns):
            out = np.where((order < self.radiates)[:, None], self._imaged(out, order), out)
        for order in columns:
            behind = (order > self.radiates) & self.hit[:, order]
            back = np.where(behind[:, None], self._imaged(back, order), back)
        return np.asarray(out), np.asarray(back)

    def _imaged(self, velocity: FloatArray, order: int) -> FloatArray:
        normal = self.normal[:, order]
        across = np.einsum("ni,ni->n", normal, velocity - self.velocity[:, order])
        return np.asarray(velocity - 2.0 * across[:, None] * normal)

    @cached_property
    def owner(self) -> tuple[IntArray, IntArray]:
        """(n,) object id and tag: of the hit that radiates, unless it is static (id 0); then of the last that is not.

        Where all are static: of the last hit.
        """
        column = np.arange(self.object_id.shape[1])
        named = self.hit & (self.object_id > 0)
        last = np.where(named, column, -1).max(axis=1)
        row, source = np.arange(len(self)), self.radiates.astype(np.int64)
        pick = np.where(last >= 0, last, self.count.astype(np.int64) - 1)
        pick = np.where(named[row, source], source, pick)
        return self.object_id[row, pick], self.tag[row, pick]


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), 1e-12))


def _empty(most: int) -> dict[str, NDArray[Any]]:
    shapes = {
        "count": ((), np.uint8), "point": ((most, 3), np.float64), "normal": ((most, 3), np.float64),
        "velocity": ((most, 3), np.float64), "material": ((most,), np.uint16), "object_id": ((most,), np.uint32),
        "tag": ((most,), np.uint8), "radiates": ((), np.uint8), "two_way": ((), np.bool_), "area": ((3,), np.float64),
        "slope": ((2,), np.float64), "curvature": ((3,), np.float64), "rcs": ((), np.float64),
    }  # fmt: skip
    return {name: np.zeros((0, *shape), dtype=dtype) for name, (shape, dtype) in shapes.items()}
