"""Tubes between four rays that hit one smooth surface: which there are, and what their footprints radiate.

The path along the four corner rays is exact; between them it is taken as bilinear, so that it is continuous from tube
to tube and exact on flat surfaces. The amplitude follows from the area of the tube: what its walls enclose is
conserved, on curved surfaces too, where facets tilt the corner rays apart.
"""

from __future__ import annotations

import numpy as np

from .._typing import BoolArray, FloatArray, IntArray, NDArray
from .chain import Bounce, Chain
from .fields import Fields, radiated
from .vectors import alike, dot
from .views import Views

__all__ = ["PAIRS", "footprint", "in_line", "is_tube", "receive_basis", "tube_echoes"]

#: How far a corner may lie from the tangent plane at another, in wavelengths.
FLAT = 1.0 / 64.0
#: How far the path to a corner may deviate from linear, from another corner, in wavelengths.
STRAIGHT = 1.0 / 32.0
#: Pairs of corners that are compared: the sides and the diagonals.
PAIRS = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3))


def is_tube(bounce: Bounce, rows: IntArray, wavelength: float, first: bool) -> BoolArray:
    """Return which sets of four hits bound one tube.

    Parameters
    ----------
    bounce : Bounce
    rows : (n, 4) int
        Rows of it.
    wavelength : float
        The shortest [m].
    first : bool
        Whether this is the first bounce, before which fronts cannot be bent.

    Returns
    -------
    (n,) bool
    """
    mark = bounce.signature[rows]
    same = alike(mark)
    check = np.flatnonzero(same & ~_on_one_facet(bounce, rows) if first else same)
    fits = np.ones(len(check), dtype=bool)
    for a, b in PAIRS:
        fits &= in_line(bounce, rows[check, a], rows[check, b], wavelength, first)
    same[check] = fits
    return same


def in_line(
    bounce: Bounce, a: IntArray, b: IntArray, wavelength: float, first: bool, other: Bounce | None = None
) -> BoolArray:
    """Return (n,) whether hits a and b lie so near one plane, and their fronts are so flat, that one tube holds both.

    Hits b are rows of ``other`` where it is given.
    """
    other = other or bounce
    step = other.position[b] - bounce.position[a]
    fits: BoolArray = np.abs(dot(bounce.normal[a], step)) <= FLAT * wavelength
    fits &= np.abs(dot(other.normal[b], step)) <= FLAT * wavelength
    if not first:
        longer = other.path[b] - bounce.path[a]
        for here, row in ((bounce, a), (other, b)):
            fits &= np.abs(longer - dot(here.direction[row], step)) <= STRAIGHT * wavelength
    return fits


def footprint(bounce: Bounce, rows: IntArray) -> FloatArray:
    """Return (n, 3) vector areas of the quadrangles between four hits, as their order turns [m^2]."""
    position = bounce.position
    return np.asarray(
        0.5 * np.cross(position[rows[:, 2]] - position[rows[:, 0]], position[rows[:, 3]] - position[rows[:, 1]])
    )


def receive_basis(views: Views, view: IntArray, toward: FloatArray) -> FloatArray:
    """Return (n, 2, 3) unit vectors V and H of receivers, transverse to the directions they see points under."""
    basis = np.stack([views.vertical, views.horizontal], axis=1)[view]
    if views.distance is None:
        return basis
    basis = basis - np.einsum("npi,ni->np", basis, toward)[:, :, None] * toward[:, None, :]
    return np.asarray(basis / np.linalg.norm(basis, axis=2, keepdims=True))


def tube_echoes(
    lit: Views,
    seen: Views,
    chain: Chain,
    order: int,
    rows: IntArray,
    first: IntArray,
    fields: Fields,
    view: IntArray,
    free: FloatArray,
) -> tuple[NDArray[np.inexact], FloatArray, FloatArray, FloatArray]:
    """Return what tubes send to a receiver, but for the wavenumber.

    Parameters
    ----------
    lit, seen : Views
        Where the light comes from, and where it is received.
    chain : Chain
    order : int
    rows, first : (n, 4) int
        Their corners, rows of this bounce and of the first.
    fields : Fields
        At the hits of this bounce.
    view : (n,) int
        Row of ``seen``.
    free : (n,) float
        Share of the corners that see the receiver.

    Returns
    -------
    strength : (n, 2, 2)
        Receive V, H by transmit V, H [m^2].
    path : (n,) float
        Mean there and back, less twice the distance [m].
    along_u, along_v : (n,) float
        By how much it grows over the tube [m].
    """
    bounce, one = chain.bounces[order], chain.bounces[0]
    corner = [bounce.position[rows[:, k]] for k in range(4)]
    middle = 0.25 * (corner[0] + corner[1] + corner[2] + corner[3])
    direction = bounce.direction[rows[:, 0]] if order == 0 else _mean_direction(bounce, rows)
    area = 0.5 * np.cross(corner[2] - corner[0], corner[3] - corner[1])
    through = dot(area, direction)
    gain = free.astype(np.complex128 if order > 0 else np.float64)
    if lit.distance is not None:
        gain *= lit.decay(one.path[first].mean(axis=1))
    if order > 0:
        before = dot(footprint(one, first), one.direction[first[:, 0]]) * (-1.0) ** order
        ratio = before / np.where(through == 0.0, np.inf, through)
        # a negative ratio is a tube turned inside out by a focus, which advances the phase by a quarter turn
        gain *= np.sqrt(ratio.astype(np.complex128))
    area *= -np.sign(through)[:, None]
    normal = area / np.maximum(np.linalg.norm(area, axis=1), 1e-300)[:, None]
    toward, _, decay = seen.seen_from(middle, view)
    receive = receive_basis(seen, view, toward)
    arriving = _field(fields.arriving, rows, order)
    leaving = None if fields.leaving is None else _field(fields.leaving, rows, order)
    strength = radiated(arriving, leaving, direction, normal, area, toward, receive)
    strength = strength * (gain * decay)[:, None, None]
    path = [bounce.path[rows[:, k]] + seen.seen_from(corner[k], view)[1] for k in range(4)]
    along_u = 0.5 * (path[1] + path[2] - path[0] - path[3])
    along_v = 0.5 * (path[3] + path[2] - path[0] - path[1])
    total = 0.25 * (path[0] + path[1] + path[2] + path[3])
    bent = np.flatnonzero(~_on_one_facet(bounce, rows)) if order == 0 else np.arange(len(rows))
    total[bent] -= _bulge(bounce, rows[bent], toward[bent]) / 12.0
    return strength, total, along_u, along_v


def _on_one_facet(bounce: Bounce, rows: IntArray) -> BoolArray:
    return alike(bounce.face[rows])


def _mean_direction(bounce: Bounce, rows: IntArray) -> FloatArray:
    total = np.asarray(sum(bounce.direction[rows[:, k]] for k in range(4)))
    total /= np.linalg.norm(total, axis=1)[:, None]
    return total


def _field(values: NDArray[np.inexact], rows: IntArray, order: int) -> NDArray[np.inexact]:
    """Return the mean over corners; what has not bounced yet is the same at all of them."""
    if order == 0 and not np.iscomplexobj(values):
        return values[rows[:, 0]]
    return np.asarray(0.25 * (values[rows[:, 0]] + values[rows[:, 1]] + values[rows[:, 2]] + values[rows[:, 3]]))


def _bulge(bounce: Bounce, rows: IntArray, toward: FloatArray) -> FloatArray:
    """Return (n,) second derivatives of the path over tubes, along u and v together [m].

    The path between two hits a and b a step apart has the slopes g . t at its ends, g = direction - toward, t the step
    laid onto the tangent plane along the ray. Its mean lies a twelfth of their difference below that of the ends.
    """
    total = np.zeros(len(rows))
    for p, q in ((0, 1), (3, 2), (0, 3), (1, 2)):
        a, b = rows[:, p], rows[:, q]
        step = bounce.position[b] - bounce.position[a]
        slope = [
            dot(d - toward, step - d * (dot(n, step) / dot(n, d))[:, None])
            for n, d in ((bounce.normal[r], bounce.direction[r]) for r in (a, b))
        ]
        total += 0.5 * (slope[1] - slope[0])
    return total
