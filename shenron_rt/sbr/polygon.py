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
    following = np.roll(vertices, -1, axis=1)
    edge, middle = following - vertices, 0.5 * (vertices + following)
    along, at = _times(edge, gradient), _times(middle, gradient)
    square = np.einsum("ni,ni->n", gradient, gradient)
    size = np.abs(_times(vertices, gradient) - _times(vertices[:, :1], gradient)).max(axis=1)
    settled = size > _SMALL
    across = gradient[:, None, 0] * edge[:, :, 1] - gradient[:, None, 1] * edge[:, :, 0]
    terms = across * np.sinc(along / (2.0 * np.pi)) * np.exp(-1j * at)
    contour = 1j / np.where(settled, square, 1.0) * terms.sum(axis=1)
    # Triangles from the first corner to each edge: over one with phases 0, a, b at its corners the mean phase is
    # (a + b) / 3, the mean square (a^2 + ab + b^2) / 6.
    start = _times(vertices[:, :1], gradient)[:, 0]
    a = _times(vertices, gradient) - start[:, None]
    b = _times(following, gradient) - start[:, None]
    local = vertices - vertices[:, :1]
    next_local = following - vertices[:, :1]
    piece = 0.5 * (local[:, :, 0] * next_local[:, :, 1] - local[:, :, 1] * next_local[:, :, 0])
    series = (piece * (1.0 - 1j * (a + b) / 3.0 - (a * a + a * b + b * b) / 12.0)).sum(axis=1)
    result: ComplexArray = np.where(settled, contour, np.exp(-1j * start) * series)
    return result


def _times(points: FloatArray, gradient: FloatArray) -> FloatArray:
    values: FloatArray = points[:, :, 0] * gradient[:, None, 0] + points[:, :, 1] * gradient[:, None, 1]
    return values
