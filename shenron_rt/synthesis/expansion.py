"""Low-rank form of exp(j psi) for small residual phases: few transforms with shared points instead of one exact sum.

A residual phase psi(q, g) = sum_i x_i(q) b_i(g) separates into parameters x of an echo q and known functions b of a
sample g. The Jacobi-Anger expansion of every factor, exp(j A x b) = sum_p eps_p j^p J_p(A b) T_p(x) with abs(x) <= 1,
eps_0 = 1, eps_p = 2 (Abramowitz and Stegun 9.1.44), turns it into a short sum of products, each a transform.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from .._typing import ComplexArray, FloatArray

__all__ = ["bessel", "chebyshev", "order_weights", "rank", "select_terms"]

#: Largest amplitude of a factor [rad]; beyond it the frame is cut into shorter blocks.
MAX_AMPLITUDE = 3.0
_ORDER_LIMIT = 40


def order_weights(amplitude: float, tolerance: float) -> list[float]:
    """Bound of the terms p = 0, 1 ... of one factor, while they exceed ``tolerance``.

    abs(J_p(z)) <= (z / 2)^p / p! for p >= 0 (Abramowitz and Stegun 9.1.62).
    """
    weights = [1.0]
    for p in range(1, _ORDER_LIMIT):
        weight = min(2 * (amplitude / 2) ** p / math.factorial(p), 2.0)
        if weight <= tolerance:
            break
        weights.append(weight)
    return weights


def rank(amplitude: float, tolerance: float) -> int:
    """Terms one factor of this amplitude needs."""
    return len(order_weights(amplitude, tolerance))


def select_terms(amplitudes: Sequence[float], tolerance: float) -> list[tuple[int, ...]]:
    """Choose the products to keep so that the sum of the bounds of all others stays below ``tolerance``.

    Parameters
    ----------
    amplitudes : sequence of float
        A of every factor [rad].
    tolerance : float

    Returns
    -------
    list of tuple of int
        Orders (p_1, p_2 ...) of every product kept, the largest first; (0, 0 ...) is always there.
    """
    # factors cut at tolerance / 100 leave products whose sum is a small part of the tolerance
    weights = [order_weights(a, tolerance / 100) for a in amplitudes]
    products = [(math.prod(w), p) for w, p in _products(weights)]
    products.sort(key=lambda item: (-item[0], item[1]))
    left = 0.0
    while len(products) > 1 and left + products[-1][0] <= 0.9 * tolerance:
        left += products.pop()[0]
    return [orders for _, orders in products]


def _products(weights: list[list[float]]) -> list[tuple[tuple[float, ...], tuple[int, ...]]]:
    orders = itertools.product(*(range(len(w)) for w in weights))
    return [(tuple(w[p] for w, p in zip(weights, ps, strict=True)), ps) for ps in orders]


def chebyshev(x: FloatArray, count: int) -> list[FloatArray]:
    """Return T_1(x) ... T_{count - 1}(x) behind a scalar T_0 placeholder, by recurrence."""
    values: list[FloatArray] = [np.ones(1, dtype=x.dtype), x]
    while len(values) < count:
        values.append(2 * x * values[-1] - values[-2])
    return values[:count]


def bessel(z: FloatArray, count: int) -> list[ComplexArray]:
    """Return eps_p j^p J_p(z) for p = 0 ... count - 1 and abs(z) <= 2 MAX_AMPLITUDE, by the ascending series.

    J_p(z) = (z/2)^p sum_m (-z^2/4)^m / (m! (m + p)!) (Abramowitz and Stegun 9.1.10); at abs(z) = 6 the largest term is
    5e1, so cancellation leaves 1e-14.
    """
    top = float(np.max(np.abs(z), initial=0.0)) / 2
    square = -(z * z) / 4
    out: list[ComplexArray] = []
    for p in range(count):
        terms = 1
        while top ** (2 * terms) / (math.factorial(terms) * math.factorial(terms + p)) > 1e-17:
            terms += 1
        value = np.full_like(z, 1 / (math.factorial(terms) * math.factorial(terms + p)))
        for m in range(terms - 1, -1, -1):
            value = value * square + 1 / (math.factorial(m) * math.factorial(m + p))
        out.append((1 if p == 0 else 2) * 1j**p * (value * (z / 2) ** p))
    return out
