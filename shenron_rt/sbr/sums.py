"""Sums of echoes."""

from __future__ import annotations

import numpy as np

from .._typing import ComplexArray, IntArray, NDArray

__all__ = ["by_view"]


def by_view(strength: NDArray[np.inexact], phasor: ComplexArray, view: IntArray, n: int) -> ComplexArray:
    """Return (n, 2, 2) sums of echoes by view, in the order of the echoes.

    Parameters
    ----------
    strength : (m, 2, 2)
    phasor : (m,) complex
    view : (m,) int
        Row of the sums.
    n : int
    """
    values = (strength.reshape(-1, 4) * phasor[:, None]).T
    sums = [np.bincount(view, c.real, n) + 1j * np.bincount(view, c.imag, n) for c in np.ascontiguousarray(values)]
    return np.stack(sums, axis=1).reshape(n, 2, 2)
