"""Type-3 nonuniform transforms in their three steps, of which the last is taken once for many sums.

A sum c_q exp(j (x_q s + y_q t)) over points q, at targets s and t within [-1, 1], is

1. spread onto a grid of spacing h = pi / UPSAMPLING, g_k = sum_q c_q phi(x_q / h - k_x) phi(y_q / h - k_y),
2. summed as a Fourier series at the targets, sum_k g_k exp(j h (k_x s + k_y t)),
3. divided by the kernel's Fourier transform, F(h s) F(h t).

FINUFFT has the first step (``spreadinterponly``) and the second (type 2); its own type 3 does all three, and prepares
the third anew, at every call. The kernel phi is known by what the first step makes of a point.

References
----------
J.-Y. Lee and L. Greengard, J. Comput. Phys. 206 (2005) 1-5. A. Barnett, J. Magland and L. af Klinteberg, SIAM J. Sci.
Comput. 41 (2019) C479-C504, section 3.3.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.typing import NDArray

from .._typing import ComplexArray, FloatArray

__all__ = ["SPACING", "Kernel", "series"]

#: Oversampling of the grid: a wider grid costs less than the wider kernel a smaller one needs.
UPSAMPLING = 2.0
SPACING = math.pi / UPSAMPLING
#: RMS error of the sum over the tolerance FINUFFT is given; measured, 0.53 to 0.93 from 1e-2 to 1e-10.
ERROR_OVER_TOLERANCE = 0.95
#: Share of the tolerance that the series gets: its error is then a small part.
SERIES_SHARE = 0.3
#: Oversampling of the series, and its finest tolerance. The grid is small, so that the wider kernel costs less.
SERIES_UPSAMPLING, SERIES_FINEST = 1.25, 1e-9
#: Side of the grid on which the kernel is looked at; more than the widest kernel.
_SIDE = 32
#: Degree of the polynomial in the square of the angle for the reciprocal of the kernel's transform.
_DEGREE = 20

_OPTIONS = {"nthreads": 1, "spread_sort": 0, "showwarn": 0}


def _types(single: bool) -> tuple[type[np.floating[Any]], type[np.complexfloating[Any, Any]]]:
    return (np.float32, np.complex64) if single else (np.float64, np.complex128)


@dataclass(frozen=True)
class Kernel:
    """A kernel to spread points with.

    Parameters
    ----------
    tolerance : float
        What FINUFFT is asked for.
    single : bool
        Single precision.
    width : int
        Cells a point is spread over, in each direction.
    reciprocal : Chebyshev
        1 / F of the square of the angle.
    """

    tolerance: float
    single: bool
    width: int
    reciprocal: Chebyshev

    @classmethod
    def reaching(cls, error: float, single: bool) -> Kernel:
        """Return the narrowest kernel whose RMS error, relative to sqrt(sum of abs(c)^2), is below ``error``."""
        return _kernel(max(1, math.ceil(math.log10(ERROR_OVER_TOLERANCE / error))), single)

    def spread(self, shape: tuple[int, int], x: FloatArray, y: FloatArray, strength: ComplexArray) -> ComplexArray:
        """Spread points at angles within [-pi, pi), the ends of the grid, onto a grid of ``shape``."""
        return _spread(self.tolerance, self.single, shape, x, y, strength)

    def correction(self, s: FloatArray, t: FloatArray) -> FloatArray:
        """Return 1 / (F(h s) F(h t))."""
        found: FloatArray = self.reciprocal((SPACING * s) ** 2) * self.reciprocal((SPACING * t) ** 2)
        return found


def _spread(
    tolerance: float, single: bool, shape: tuple[int, int], x: FloatArray, y: FloatArray, strength: ComplexArray
) -> ComplexArray:
    import finufft

    real, complex_ = _types(single)
    strength = strength.astype(complex_, copy=False)
    count = 1 if strength.ndim == 1 else len(strength)
    plan = finufft.Plan(
        1, shape, count, tolerance, 1, dtype=complex_, upsampfac=UPSAMPLING, spreadinterponly=1, **_OPTIONS
    )
    plan.setpts(x.astype(real, copy=False), y.astype(real, copy=False))
    found: ComplexArray = plan.execute(strength)
    return found


@functools.cache
def _kernel(digits: int, single: bool) -> Kernel:
    """Return the kernel that FINUFFT takes for a tolerance of 10^-digits."""
    tolerance, cell = 10.0**-digits, 2 * np.pi / _SIDE

    def look(offset: FloatArray) -> NDArray[np.float64]:
        """Spread points some cells off the centre of a grid, each alone."""
        alone = np.eye(len(offset), dtype=np.complex128)
        return _spread(tolerance, single, (_SIDE, _SIDE), offset * cell, 0 * offset, alone).real.astype(np.float64)

    # a third of a cell off, every cell the point reaches lies well inside the kernel
    width = int(np.count_nonzero(look(np.array([1 / 3, 1 / 3]))[0, :, _SIDE // 2]))
    nodes, weights = np.polynomial.legendre.leggauss(2 * width + 8)
    offset = nodes * width / 2
    values = look(offset)[:, _SIDE // 2, _SIDE // 2] / np.sqrt(look(np.zeros(2))[0, _SIDE // 2, _SIDE // 2])
    values *= weights * width / 2

    def reciprocal(square: FloatArray) -> FloatArray:
        found: FloatArray = 1 / (np.cos(np.sqrt(np.maximum(square, 0.0))[:, None] * offset) @ values)
        return found

    found = Chebyshev.interpolate(reciprocal, _DEGREE, [0, SPACING**2])
    return Kernel(tolerance, single, width, found.trim(found.coef[0] * tolerance / 100))


def series(
    tolerance: float, single: bool, shape: tuple[int, int], s: FloatArray, t: FloatArray
) -> Callable[[ComplexArray], ComplexArray]:
    """Return the function that sums a grid of ``shape`` as a Fourier series at targets s and t within [-1, 1].

    ``tolerance`` is that of the kernel that fills the grid.
    """
    import finufft

    real, complex_ = _types(single)
    asked = SERIES_SHARE * tolerance
    upsampling = SERIES_UPSAMPLING if asked >= SERIES_FINEST else UPSAMPLING
    plan = finufft.Plan(2, shape, 1, asked, 1, dtype=complex_, upsampfac=upsampling, **_OPTIONS)
    plan.setpts((SPACING * s).astype(real), (SPACING * t).astype(real))

    def at_targets(grid: ComplexArray) -> ComplexArray:
        sums: ComplexArray = plan.execute(grid.astype(complex_, copy=False))
        return sums

    return at_targets
