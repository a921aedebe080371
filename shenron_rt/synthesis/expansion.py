"""Low-rank form of exp(j psi) for small residual phases: few transforms with shared points instead of one exact sum.

A residual phase psi(q, g) = sum_i a_i x_i(q) b_i(g) separates into parameters x of an echo q and shapes b of a sample g,
both within [-1, 1]. The exponential series gives exp(j psi) as a sum of monomials in x times monomials in b; a singular
value decomposition over the echoes that are there then finds the few combinations of both that matter.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._typing import ComplexArray, FloatArray

__all__ = ["MAX_AMPLITUDE", "LowRank", "monomial", "rank", "series_orders"]

#: Largest amplitude of a factor [rad]; beyond it the frame is cut into shorter blocks.
MAX_AMPLITUDE = 3.0
_ORDER_LIMIT = 40
#: Columns of a matrix product: small enough that BLAS stays on one thread, so bytes do not depend on its threads.
_COLUMNS = 2048

Orders = tuple[int, ...]


def rank(amplitude: float, tolerance: float) -> int:
    """Number of terms that one factor exp(j A x b) needs: abs(J_p(A)) <= (A/2)^p / p! (Abramowitz and Stegun 9.1.62)."""
    for p in range(1, _ORDER_LIMIT):
        if 2 * (amplitude / 2) ** p / math.factorial(p) <= tolerance:
            return p
    return _ORDER_LIMIT


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
        (p_1, p_2 ...) of every term kept, the largest first; (0, 0 ...) always leads.
    """
    # factors cut at tolerance / 100 leave products whose sum is a small part of the tolerance
    factors = [_factor_weights(a, tolerance / 100) for a in amplitudes]
    terms = [
        (math.prod(w[p] for w, p in zip(factors, orders, strict=True)), orders)
        for orders in itertools.product(*(range(len(w)) for w in factors))
    ]
    terms.sort(key=lambda item: (sum(item[1]) > 0, -item[0], item[1]))
    left = 0.0
    while len(terms) > 1 and left + terms[-1][0] <= 0.9 * tolerance:
        left += terms.pop()[0]
    return [orders for _, orders in terms]


def _factor_weights(amplitude: float, tolerance: float) -> list[float]:
    weights = [1.0]
    for p in range(1, _ORDER_LIMIT):
        weights.append(amplitude**p / math.factorial(p))
        if p > amplitude and weights[-1] <= tolerance:
            return weights[:-1]
    return weights


def monomial(values: Sequence[FloatArray], orders: Orders, known: dict[Orders, FloatArray]) -> FloatArray:
    """Return prod_i values_i^p_i, reusing the monomial of one order less from ``known``, which it extends."""
    if orders not in known:
        i = next((i for i, p in enumerate(orders) if p), None)
        if i is None:
            known[orders] = np.ones_like(values[0])
        else:
            less = tuple(p - (j == i) for j, p in enumerate(orders))
            known[orders] = values[i] * monomial(values, less, known) if any(less) else values[i]
    return known[orders]


@dataclass(frozen=True)
class LowRank:
    """Exp(j psi(q, g)) = sum_r (sum_l orders_l(x_q) left[l, r]) (sum_l right[r, l] orders_l(b_g)).

    Parameters
    ----------
    orders : list of tuple of int
        The L monomials.
    left : (L, R) complex
    right : (R, L) complex
    """

    orders: list[Orders]
    left: ComplexArray
    right: ComplexArray

    @classmethod
    def fit(
        cls, amplitudes: Sequence[float], parameters: Sequence[FloatArray], shapes: Sequence[FloatArray], tolerance: float
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
            return cls(orders, np.ones((1, 1), np.complex128), np.ones((1, 1), np.complex128))
        scale = np.array([math.prod(a**p / math.factorial(p) for a, p in zip(amplitudes, o, strict=True)) for o in orders])
        scale = scale * np.array([1j ** (sum(o) % 4) for o in orders])
        known_x: dict[Orders, FloatArray] = {}
        known_b: dict[Orders, FloatArray] = {}
        x = np.stack([monomial(parameters, o, known_x) for o in orders], axis=1)
        b = np.stack([monomial(shapes, o, known_b) for o in orders], axis=1) * (scale / np.sqrt(len(shapes[0])))
        q_x, r_x = np.linalg.qr(x)
        _, r_b = np.linalg.qr(b.conj())
        u, s, vh = np.linalg.svd(r_x @ r_b.conj().T)
        # row r of tails: RMS error of every echo where r terms are kept
        parts = np.abs(q_x @ u) ** 2 * s**2
        tails = np.sqrt(np.maximum(np.cumsum(parts[:, ::-1], axis=1)[:, ::-1], 0.0)).max(axis=0)
        kept = max(1, int(np.count_nonzero(tails > tolerance)))
        left = r_b.conj().T @ vh[:kept].conj().T
        right = (u[:, :kept].conj().T @ r_x) * scale / s[:kept, None]
        return cls(orders, left, right)

    def strengths(self, amplitude: ComplexArray, parameters: Sequence[FloatArray]) -> ComplexArray:
        """Return amplitude_q times the left factor, (R, n), in the precision of ``amplitude``."""
        if len(self.orders) == 1:
            return amplitude[None] * self.left.astype(amplitude.dtype)
        matrix = np.concatenate([self.left.T.real, self.left.T.imag]).astype(amplitude.real.dtype)
        out = np.empty((self.left.shape[1], len(amplitude)), dtype=amplitude.dtype)
        rows = np.empty((len(self.orders), _COLUMNS), dtype=matrix.dtype)
        for first in range(0, len(amplitude), _COLUMNS):
            part = slice(first, first + _COLUMNS)
            _fill(rows, self.orders, [x[part] for x in parameters])
            both = matrix @ rows[:, : len(amplitude[part])]
            factor = out[:, part]
            factor.real, factor.imag = both[: len(out)], both[len(out) :]
            factor *= amplitude[part]
        return out

    def waves(self, shapes: Sequence[FloatArray]) -> ComplexArray:
        """Return the right factor at samples, (R, n)."""
        matrix = np.concatenate([self.right.real, self.right.imag])
        out = np.empty((len(self.right), len(shapes[0])), dtype=np.complex128)
        rows = np.empty((len(self.orders), _COLUMNS))
        for first in range(0, out.shape[1], _COLUMNS):
            part = slice(first, first + _COLUMNS)
            _fill(rows, self.orders, [b[part] for b in shapes])
            both = matrix @ rows[:, : out[:, part].shape[1]]
            out[:, part].real, out[:, part].imag = both[: len(out)], both[len(out) :]
        return out


def _fill(rows: FloatArray, orders: list[Orders], values: Sequence[FloatArray]) -> None:
    """Write the monomials of ``values`` into the rows, each from one of lower order where that is among them."""
    known: dict[Orders, FloatArray] = {}
    for row, o in zip(rows, orders, strict=True):
        row[: len(values[0])] = monomial(values, o, known)
