"""Delays of echoes near the middle of a block of chirps, and the phases that follow from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike

from .._parallel import map_blocks
from .._typing import ComplexArray, FloatArray, IntArray
from ..constants import SPEED_OF_LIGHT
from .blocks import Block
from .signal import Points, dot

__all__ = ["N_RESIDUALS", "MovedPoints", "Phases"]

TAU = 2 * np.pi
#: Residual phases: curvature of orders 2, 3, 4, and the fast x slow part of the quadratic delay term.
N_RESIDUALS = 4


@dataclass(frozen=True)
class MovedPoints:
    """Echoes at the middle of a block, with the products that every element needs.

    Parameters
    ----------
    amplitude : (n,) complex
    position, velocity : (3, n) float
    range_square, along, speed_square : (n,) float
        p.p, p.v and v.v.
    sent : MovedPoints or None
        As transmitters see them; ``None``: the same.
    """

    amplitude: ComplexArray
    position: FloatArray
    velocity: FloatArray
    range_square: FloatArray
    along: FloatArray
    speed_square: FloatArray
    sent: MovedPoints | None = None

    @classmethod
    def at(cls, points: Points, rows: IntArray, time_s: float) -> MovedPoints:
        """Move some of the points to an instant, seconds from mid-frame."""
        vectors = np.empty((2, 3, len(rows)))
        products = np.empty((3, len(rows)))

        def move(part: slice) -> None:
            chosen = rows[part]
            p, v = vectors[:, :, part]
            v[:] = points.velocity.take(chosen, axis=0).T
            np.multiply(v, time_s, out=p)
            p += points.position.take(chosen, axis=0).T
            for found, a, b in zip(products[:, part], (p, p, v), (p, v, v), strict=True):
                found[:] = dot(a, b)

        map_blocks(move, len(rows))
        sent = None if points.sent is None else cls.at(points.sent, rows, time_s)
        (position, velocity), (square, along, speed) = vectors, products
        return cls(points.amplitude[rows], position, velocity, square, along, speed, sent)

    def __len__(self) -> int:
        return len(self.amplitude)

    def part(self, columns: slice | IntArray) -> MovedPoints:
        """Return some of them."""
        return MovedPoints(
            self.amplitude[columns],
            self.position[:, columns],
            self.velocity[:, columns],
            self.range_square[columns],
            self.along[columns],
            self.speed_square[columns],
            None if self.sent is None else self.sent.part(columns),
        )

    @property
    def outward(self) -> MovedPoints:
        """The echoes as transmitters see them."""
        return self if self.sent is None else self.sent

    def range_derivatives(self, element_m: FloatArray, order: int, dtype: DTypeLike = np.float64) -> list[FloatArray]:
        """Return the distance to an element and its time derivatives up to ``order`` (2 to 4), these in ``dtype``.

        From differentiating r^2 = abs(p + v t - e)^2: r r' = (p - e).v, r'^2 + r r'' = v^2, 3 r' r'' + r r''' = 0.
        """
        if element_m.any():
            square = (-2 * element_m) @ self.position
            square += self.range_square
            square += element_m @ element_m
            along = self.along - element_m @ self.velocity
        else:
            square, along = self.range_square, self.along
        distance = np.sqrt(square)
        r = distance.astype(dtype, copy=False)
        first = along.astype(dtype, copy=False) / r
        second = (self.speed_square.astype(dtype, copy=False) - first * first) / r
        found = [distance, first, second]
        if order > 2:
            ratio = first / r
            found.append(-3 * ratio * second)
        if order > 3:
            found.append(-4 * ratio * found[3] - 3 * second * second / r)
        return found


@dataclass(frozen=True)
class Phases:
    """Phases of echoes at one element pair in one block.

    Parameters
    ----------
    constant : (n,) float
        Cycles.
    fast, slow : (n,) float
        Angular frequencies against the targets of the block [rad/s].
    residuals : list of (n,) float
        Those asked for, each the factor of a shape of the block [rad].
    """

    constant: FloatArray
    fast: FloatArray
    slow: FloatArray
    residuals: list[FloatArray]

    @classmethod
    def of(cls, block: Block, ranges: list[FloatArray], used: tuple[int, ...]) -> Phases:
        """Turn two-way range derivatives [m, m/s ...] into phases; see the formulas of ``nufft``.

        Taylor to Chebyshev on [-h, h]: T^2 = h^2 (1 + C2) / 2, T^3 = h^3 (3 C1 + C3) / 4,
        T^4 = h^4 (3 + 4 C2 + C4) / 8. Derivatives left out by ``ranges`` are negligible; they may be in single
        precision, and so are then the slow frequencies and the residuals.
        """
        h, fc, k = block.half_s, block.clock.window_mid_hz, block.clock.slope_hz_per_s
        d1 = ranges[1] / SPEED_OF_LIGHT
        bend = h**2 / (4 * SPEED_OF_LIGHT) * ranges[2]
        d0 = ranges[0] / SPEED_OF_LIGHT
        d0 += bend
        if len(ranges) > 3:
            d1 += h**2 / (8 * SPEED_OF_LIGHT) * ranges[3]
        if len(ranges) > 4:
            quartic = h**4 / (192 * SPEED_OF_LIGHT) * ranges[4]
            d0 += 3 * quartic
            bend += 4 * quartic
        seen = (fc - k * d0).astype(d1.dtype, copy=False)
        swept = (k * h**2 / 4) * (d1 * d1)
        residuals = []
        for i in used:
            if i == 0:
                residuals.append(TAU * (seen * bend - swept))
            elif i == 1:
                residuals.append(TAU * h**3 / (24 * SPEED_OF_LIGHT) * fc * ranges[3])
            elif i == 2:
                residuals.append(TAU * fc * quartic)
            else:
                residuals.append((TAU * k**2 / fc * block.fast_half_s * h) * d0.astype(d1.dtype, copy=False) * d1)
        constant = d0 * (-k / 2)
        constant += fc
        constant *= d0
        constant -= swept
        slow = seen * d1
        slow *= TAU
        return cls(constant, TAU * k * d0, slow, residuals)
