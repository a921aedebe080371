"""Low-rank form of exp(j psi) for small residual phases: few transforms with shared points instead of one exact sum.

A residual phase psi(q, g) = sum_i a_i x_i(q) b_i(g) separates into parameters x of an echo q and shapes b of a
sample g, both within [-1, 1]. The exponential series gives exp(j psi) as a sum of monomials in x times monomials in b;
a singular value decomposition over the echoes that are there then finds the few combinations of both that matter.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._typing import ComplexArray, FloatArray, IntArray, NDArray

__all__ = ["MAX_AMPLITUDE", "LowRank", "monomials", "ranks", "series_orders"]

#: Largest amplitude of a factor [rad]; beyond it the frame is cut into shorter blocks.
MAX_AMPLITUDE = 3.0
_ORDER_LIMIT = 40
#: Largest m k n of a matrix product (m, k) @ (k, n), and largest m n of a factorisation, for which OpenBLAS stays on
#: one thread. Bytes then do not depend on its threads, which would wait for each other wherever the cores have other
#: work.
_PRODUCT, _FACTORISED = 1 << 16, 1 << 13
#: Columns of monomials at once: they stay in the cache.
_COLUMNS = 2048

Orders = tuple[int, ...]


def ranks(amplitude: FloatArray, tolerance: float) -> IntArray:
    """Return how many terms exp(j A x b) needs: abs(J_p(A)) <= (A/2)^p / p! (Abramowitz and Stegun 9.1.62).

    For A up to :data:`MAX_AMPLITUDE`, where that bound falls from order to order.
    """
    needed, bound = np.ones(amplitude.shape, dtype=np.int64), amplitude
    for p in range(2, _ORDER_LIMIT):
        needed += bound > tolerance
        bound = bound * amplitude / (2 * p)
    return needed


def series_orders(amplitudes: Sequence[float], tolerance: float) -> list[Orders]:
    """Choose the terms prod_i (j a_i x_i b_i)^p_i / p_i! to keep so that all others sum to less than ``tolerance``.

    Parameters
    ----------
    amplitudes : sequence of float
        a of every factor [rad].
    tolerance : float

    Returns
    -------
    list of tuple of int
        (p_1, p_2 ...) of every term kept, by total order; with a term comes the one it is a multiple of.
    """
    # factors cut at tolerance / 100 leave products whose sum is a small part of the tolerance
    factors = [_factor_weights(a, tolerance / 100) for a in amplitudes]
    terms = [
        (math.prod(w[p] for w, p in zip(factors, orders, strict=True)), orders)
        for orders in itertools.product(*(range(len(w)) for w in factors))
    ]
    terms.sort(key=lambda item: (any(item[1]), -item[0], item[1]))
    left = 0.0
    while len(terms) > 1 and left + terms[-1][0] <= 0.9 * tolerance:
        left += terms.pop()[0]
    kept = {orders for _, orders in terms}
    for orders in list(kept):
        while any(orders):
            orders = _less(orders)[0]
            kept.add(orders)
    return sorted(kept, key=lambda orders: (sum(orders), orders))


def _less(orders: Orders) -> tuple[Orders, int]:
    """Return the term that times one factor makes this one, and the factor's index."""
    i = next(i for i, p in enumerate(orders) if p)
    return tuple(p - (j == i) for j, p in enumerate(orders)), i


def _factor_weights(amplitude: float, tolerance: float) -> list[float]:
    weights = [1.0]
    for p in range(1, _ORDER_LIMIT):
        weights.append(amplitude**p / math.factorial(p))
        if p > amplitude and weights[-1] <= tolerance:
            return weights[:-1]
    return weights


def monomials(values: Sequence[FloatArray], orders: list[Orders], out: FloatArray) -> FloatArray:
    """Write prod_i values_i^p_i of every term of :func:`series_orders` into the rows of ``out``, and return it."""
    return _fill(values, _steps(orders), out)


def _steps(orders: list[Orders]) -> list[tuple[int, int]]:
    """Return, for every term but the first, the row of the term it is a multiple of and the factor between them."""
    place = {o: i for i, o in enumerate(orders)}
    return [(place[less], i) for less, i in map(_less, orders[1:])]


def _fill(values: Sequence[FloatArray], steps: list[tuple[int, int]], out: FloatArray) -> FloatArray:
    out[0] = 1.0
    for row, (less, i) in enumerate(steps, start=1):
        np.multiply(values[i], out[less], out=out[row])
    return out


@dataclass(frozen=True)
class LowRank:
    """Exp(j psi(q, g)) = sum_r (sum_l orders_l(x_q) left[l, r]) (sum_l right[r, l] orders_l(b_g)).

    Parameters
    ----------
    orders : list of tuple of int
        The L monomials.
    left : (L, R) complex
    right : (R, L) complex
    weights : (R,) float
        Largest share of a term in exp(j psi), RMS over the samples, among the echoes it was fitted to.
    """

    orders: list[Orders]
    left: ComplexArray
    right: ComplexArray
    weights: FloatArray

    @classmethod
    def fit(
        cls,
        amplitudes: Sequence[float],
        parameters: Sequence[FloatArray],
        shapes: Sequence[FloatArray],
        tolerance: float,
    ) -> LowRank:
        """Find the smallest R whose RMS error over the samples is below ``tolerance`` for every echo given.

        Parameters
        ----------
        amplitudes : (I,) float
            a of every factor [rad].
        parameters : I arrays (n_echoes,)
            x of a choice of echoes that holds the extremes.
        shapes : I arrays (n_samples,)
            b at a choice of samples that represents all.
        tolerance : float
        """
        orders = series_orders(amplitudes, tolerance / 10)
        if len(orders) == 1:
            one = np.ones((1, 1), dtype=np.complex128)
            return cls(orders, one, one, np.ones(1))
        scale = np.array(
            [math.prod(a**p / math.factorial(p) for a, p in zip(amplitudes, o, strict=True)) for o in orders]
        )
        turn = np.array([1j ** (sum(o) % 4) for o in orders])
        x = monomials(parameters, orders, np.empty((len(orders), len(parameters[0])))).T
        b = monomials(shapes, orders, np.empty((len(orders), len(shapes[0])))).T * (scale / np.sqrt(len(shapes[0])))
        r_x, r_b = _triangle(x), _triangle(b)
        u, s, vh = np.linalg.svd(_product(r_x * turn, r_b.T), full_matrices=False)
        left = turn[:, None] * _product(r_b.T, vh.conj().T)
        # row r of tails: RMS error of every echo where r terms are kept
        parts = np.abs(_product(left.T, x.T).T) ** 2
        tails = np.sqrt(np.cumsum(parts[:, ::-1], axis=1)[:, ::-1]).max(axis=0)
        kept = max(1, int(np.count_nonzero(tails > tolerance)))
        right = _product(u[:, :kept].conj().T, r_x) * (turn * scale) / s[:kept, None]
        return cls(orders, left[:, :kept], right, np.sqrt(parts[:, :kept].max(axis=0)))

    def strengths(self, amplitude: ComplexArray, parameters: Sequence[FloatArray]) -> ComplexArray:
        """Return amplitude_q times the left factor, (R, n), in the precision of ``amplitude``."""
        if len(self.orders) == 1:
            return amplitude[None] * self.left.astype(amplitude.dtype)
        out = np.empty((len(self.right), len(amplitude)), dtype=amplitude.dtype)
        _combine(self.left.T, self.orders, parameters, out)
        out *= amplitude
        return out

    def waves(self, shapes: Sequence[FloatArray], count: int) -> ComplexArray:
        """Return the right factor at ``count`` samples, (R, count)."""
        if len(self.orders) == 1:
            return np.repeat(self.right, count, axis=1)
        out = np.empty((len(self.right), count), dtype=np.complex128)
        _combine(self.right, self.orders, shapes, out)
        return out


def _product(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Return a @ b, some columns of b at a time."""
    step = max(1, _PRODUCT // a.size)
    return np.concatenate([a @ b[:, first : first + step] for first in range(0, b.shape[1], step)], axis=1)


def _triangle(x: FloatArray) -> FloatArray:
    """Return R of x = QR, (min(m, n), n), from some rows of x at a time."""
    r, count = x[:0], x.shape[1]
    step = max(16, _FACTORISED // count - count)
    for first in range(0, len(x), step):
        _, r = np.linalg.qr(np.concatenate([r, x[first : first + step]]))
    return r


def _combine(matrix: ComplexArray, orders: list[Orders], values: Sequence[FloatArray], out: ComplexArray) -> None:
    """Write matrix (R, L) times the monomials (L, n) into ``out``, some columns at a time."""
    parts = np.concatenate([matrix.real, matrix.imag]).astype(out.real.dtype)
    steps, buffer = _steps(orders), np.empty((len(orders), _COLUMNS), dtype=parts.dtype)
    for first in range(0, out.shape[1], _COLUMNS):
        columns = slice(first, first + _COLUMNS)
        cells = out[:, columns]
        terms = _fill([v[columns] for v in values], steps, buffer[:, : cells.shape[1]])
        both = _product(parts, terms)
        cells.real, cells.imag = both[: len(out)], both[len(out) :]
