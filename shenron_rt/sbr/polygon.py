"""The Fourier integral of a flat polygon, over many small ones at once.

The closed forms the solver is held against have one of their own,
:func:`shenron_rt.physics.canonical.polygon_transform`, so that a mistake here cannot hide.
"""

from __future__ import annotations

import numpy as np

from .._typing import ComplexArray, FloatArray

__all__ = ["polygon_integral"]

#: Phase over a polygon below which its second-order expansion is exact to 1e-6 of the area, and above which the
#: contour form, whose rounding grows with the inverse of the phase, is as exact [rad].
_SMALL = 2e-2


def polygon_integral(vertices: FloatArray, gradient: FloatArray) -> ComplexArray:
    """Integrate exp(-j g . x) over polygons.

    Parameters
    ----------
    vertices : (n, m, 2) float
        Corners in order; counter-clockwise counts as positive area.
    gradient : (n, 2) float
        g, radians per unit of the coordinates.

    Returns
    -------
    (n,) complex
        Signed area at g = 0.

    Notes
    -----
    By Gauss' theorem (j / g^2) sum over edges e of (g x e) sinc(g . e / 2) exp(-j g . c), c the middle of the edge; for
    small phases the area times 1 - j g . m1 - (g . M2 . g) / 2 with the first and second moments.

    References
    ----------
    .. [1] W. B. Gordon, "Far-field approximations to the Kirchhoff-Helmholtz representations of scattered fields",
       IEEE Trans. Antennas Propag. 23(4), 1975.
    """
    x, y = np.ascontiguousarray(vertices.transpose(2, 1, 0))
    gx, gy = gradient.T
    phase = x * gx + y * gy
    following = _rolled(phase)
    half, middle = 0.5 * (following - phase), 0.5 * (following + phase)
    weight = (gx * (_rolled(y) - y) - gy * (_rolled(x) - x)) * np.sinc(half / np.pi)
    square = gx * gx + gy * gy
    size = np.abs(phase - phase[0]).max(axis=0)
    settled = size > _SMALL
    contour: ComplexArray = (weight * np.sin(middle)).sum(axis=0) + 1j * (weight * np.cos(middle)).sum(axis=0)
    contour /= np.where(settled, square, 1.0)
    small = np.flatnonzero(~settled)
    contour[small] = _series(x[:, small], y[:, small], phase[:, small])
    return contour


def _series(x: FloatArray, y: FloatArray, phase: FloatArray) -> ComplexArray:
    """Return (n,) integrals over polygons (m, n) whose phases differ little.

    Triangles from the first corner to each edge: over one with phases 0, a, b at its corners the mean phase is
    (a + b) / 3, the mean square (a^2 + ab + b^2) / 6.
    """
    right, up, a = x - x[0], y - y[0], phase - phase[0]
    b = _rolled(a)
    piece = 0.5 * (right * _rolled(up) - up * _rolled(right))
    series = (piece * (1.0 - 1j * (a + b) / 3.0 - (a * a + a * b + b * b) / 12.0)).sum(axis=0)
    return np.asarray(np.exp(-1j * phase[0]) * series)


def _rolled(values: FloatArray) -> FloatArray:
    """Return what the next corner has, in the place of each."""
    return np.concatenate([values[1:], values[:1]])
