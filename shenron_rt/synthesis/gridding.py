"""Type-3 nonuniform transforms in their three steps, of which the last is taken once for many sums.

A sum c_q exp(j (x_q s + y_q t)) over points q, at targets s and t within [-1, 1], is

1. spread onto a grid of spacing h = pi / UPSAMPLING, g_k = sum_q c_q phi(x_q / h - k_x) phi(y_q / h - k_y),
2. summed as a Fourier series at the targets, sum_k g_k exp(j h (k_x s + k_y t)),
3. divided by the kernel's Fourier transform, F(h s) F(h t).

FINUFFT has the first step (``spreadinterponly``) and the second (type 2); its own type 3 does all three, and prepares
the third anew, at every call. The kernel phi is known by what the first step makes of a point; the error of the sum
follows from it, as every point is seen again wherever the series repeats itself.

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
from numpy.typing import DTypeLike, NDArray

from .._typing import ComplexArray, FloatArray

__all__ = ["SPACING", "Kernel", "series"]

#: Oversampling of the grid: the kernels of FINUFFT are one cell narrower than at 2, for every accuracy.
UPSAMPLING = 2.3
SPACING = math.pi / UPSAMPLING
#: Share of the tolerance that the series gets: its error is then a small part.
SERIES_SHARE = 0.2
#: Oversampling of the series, its finest tolerance, and oversampling beyond. The grid is small, so that a wider kernel
#: costs less.
SERIES_UPSAMPLING, SERIES_FINEST, SERIES_FINE_UPSAMPLING = 1.25, 1e-9, 2.0
#: Side of the grid on which the kernel is looked at; more than the widest kernel.
_SIDE = 32
#: Degree of the polynomial in the square of the angle for the reciprocal of the kernel's transform.
_DEGREE = 20
#: Finest tolerance FINUFFT is asked for, in digits.
_FINEST = 14

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
    error : float
        RMS error of the sum over points anywhere, relative to sqrt(sum of abs(c)^2), without rounding.
    reciprocal : Chebyshev
        1 / F of the square of the angle.
    """

    tolerance: float
    single: bool
    width: int
    error: float
    reciprocal: Chebyshev

    @classmethod
    def reaching(cls, error: float, single: bool) -> Kernel:
        """Return the narrowest kernel whose RMS error, relative to sqrt(sum of abs(c)^2), is below ``error``."""
        digits = range(max(1, math.floor(-math.log10(error))), _FINEST)
        found = (k for k in (_kernel(d, single) for d in digits) if k.error <= error)
        return next(found, None) or _kernel(_FINEST, single)

    def spread(self, x: FloatArray, y: FloatArray, strength: ComplexArray, out: ComplexArray) -> None:
        """Spread points at angles within [-pi, pi), the ends of the grid, onto the grid ``out``, and nothing else.

        ``out`` is of the precision of the kernel.
        """
        _spread(self.tolerance, self.single, x, y, strength, out)

    @property
    def dtype(self) -> DTypeLike:
        """Of the grids it fills."""
        return _types(self.single)[1]

    def correction(self, angle: FloatArray) -> FloatArray:
        """Return 1 / F of h s, or h t."""
        found: FloatArray = self.reciprocal(angle**2)
        return found


def _spread(
    tolerance: float, single: bool, x: FloatArray, y: FloatArray, strength: ComplexArray, out: ComplexArray
) -> None:
    import finufft

    real, complex_ = _types(single)
    strength = strength.astype(complex_, copy=False)
    count = 1 if strength.ndim == 1 else len(strength)
    plan = finufft.Plan(
        1, out.shape[-2:], count, tolerance, 1, dtype=complex_, upsampfac=UPSAMPLING, spreadinterponly=1, **_OPTIONS
    )
    plan.setpts(x.astype(real, copy=False), y.astype(real, copy=False))
    plan.execute(strength, out=out)


@functools.cache
def _kernel(digits: int, single: bool) -> Kernel:
    """Return the kernel that FINUFFT takes for a tolerance of 10^-digits."""
    tolerance, cell = 10.0**-digits, 2 * np.pi / _SIDE

    def look(offset: FloatArray) -> NDArray[np.float64]:
        """Spread points some cells off the centre of a grid, each alone."""
        alone = np.eye(len(offset), dtype=np.complex128)
        grids = np.empty((len(offset), _SIDE, _SIDE), dtype=_types(single)[1])
        _spread(tolerance, single, offset * cell, 0 * offset, alone, grids)
        return grids.real.astype(np.float64)

    # a third of a cell off, every cell the point reaches lies well inside the kernel
    width = int(np.count_nonzero(look(np.array([1 / 3, 1 / 3]))[0, :, _SIDE // 2]))
    # the kernel is a polynomial on every cell
    node, weight = np.polynomial.legendre.leggauss(16)
    offset = np.add.outer(np.arange(width) + (1 - width) / 2, node / 2).ravel()
    values = look(offset)[:, _SIDE // 2, _SIDE // 2] / np.sqrt(look(np.zeros(2))[0, _SIDE // 2, _SIDE // 2])
    values *= np.tile(weight / 2, width)

    def transform(angle: FloatArray) -> FloatArray:
        found: FloatArray = np.cos(np.multiply.outer(angle, offset)) @ values
        return found

    def reciprocal(square: FloatArray) -> FloatArray:
        found: FloatArray = 1 / transform(np.sqrt(np.maximum(square, 0.0)))
        return found

    angle = np.linspace(0, SPACING, 64)
    again = [transform(angle + 2 * np.pi * turns) for turns in (-3, -2, -1, 1, 2, 3)]
    error = math.sqrt(2 * float(np.mean(np.sum(np.square(again), axis=0) / transform(angle) ** 2)))
    fitted = Chebyshev.interpolate(reciprocal, _DEGREE, [0, SPACING**2])
    return Kernel(tolerance, single, width, error, fitted.trim(fitted.coef[0] * tolerance / 100))


def series(
    tolerance: float, single: bool, shape: tuple[int, int], s: FloatArray, t: FloatArray
) -> Callable[[ComplexArray], ComplexArray]:
    """Return the function that sums a grid of ``shape`` as a Fourier series at targets s and t within [-1, 1].

    ``tolerance`` is that of the kernel that fills the grid.
    """
    import finufft

    real, complex_ = _types(single)
    asked = SERIES_SHARE * tolerance
    upsampling = SERIES_UPSAMPLING if asked >= SERIES_FINEST else SERIES_FINE_UPSAMPLING
    plan = finufft.Plan(2, shape, 1, asked, 1, dtype=complex_, upsampfac=upsampling, **_OPTIONS)
    plan.setpts((SPACING * s).astype(real), (SPACING * t).astype(real))

    def at_targets(grid: ComplexArray) -> ComplexArray:
        sums: ComplexArray = plan.execute(grid.astype(complex_, copy=False))
        return sums

    return at_targets
