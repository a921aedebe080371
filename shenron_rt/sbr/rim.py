"""Cells that no single tube fills: what each of their corner rays has of them.

Where two corners see different surfaces, the place between them at which one turns into the other is found by halving.
The cell is cut along these places, so that a straight edge is followed exactly: a plate's side lobes are made there.
"""

from __future__ import annotations

import numpy as np

from .._typing import FloatArray, IntArray, NDArray
from ..physics.polygon import polygon_integral
from .cells import Cells, Lattice
from .chain import Chain, dot, trace_chain
from .fields import Fields, radiated
from .surface import Surface
from .tubes import receive_basis
from .views import Views

__all__ = ["Pieces", "pieces_of"]

#: Halvings of the side of a cell.
HALVINGS = 6


class Pieces:
    """The shares of cells, one for each of their corners.

    Parameters
    ----------
    ray : (n,) int
        The corner ray.
    done : (n,) int
        Bounces that are integrated already.
    outline : (n, 4, 2) float
        Counter-clockwise, from the corner, along H and V [m].
    """

    def __init__(self, ray: IntArray, done: IntArray, outline: FloatArray) -> None:
        self.ray, self.done, self.outline = ray, done, outline

    def echoes(
        self, lit: Views, seen: Views, chain: Chain, order: int, fields: Fields, view: IntArray, free: FloatArray
    ) -> tuple[NDArray[np.inexact], FloatArray, FloatArray, FloatArray, IntArray]:
        """Return what the pieces send to a receiver, but for the wavenumber.

        Parameters
        ----------
        lit, seen : Views
        chain : Chain
        order : int
            0 for the first bounce.
        fields : Fields
            At its hits.
        view : (m,) int
            Row of ``seen`` for each hit of this bounce.
        free : (m,) float
            Whether each sees the receiver.

        Returns
        -------
        strength : (k, 2, 2)
            For a unit of area of the lattice.
        path : (k,) float
            There and back at the corner, less twice the distance [m].
        outline : (k, 4, 2) float
        gradient : (k, 2) float
            Of the path over the lattice.
        view : (k,) int
            Row of ``seen``.
        """
        bounce = chain.bounces[order]
        row = bounce.row_of[self.ray]
        here = np.flatnonzero((row >= 0) & (self.done <= order))
        row = row[here]
        direction, normal, position = bounce.direction[row], bounce.normal[row], bounce.position[row]
        spread = lit.spread(bounce.path[row])
        along = dot(normal, direction)
        u, v = (
            (a - (dot(normal, a) / along)[:, None] * direction) * spread[:, None]
            for a in (bounce.across_u[row], bounce.across_v[row])
        )
        area = np.cross(u, v)
        area *= np.sign(dot(area, normal))[:, None]
        toward, back, decay = seen.seen_from(position, view[row])
        receive = receive_basis(seen, view[row], toward)
        strength = radiated(
            fields.arriving[row], fields.leaving[row], direction, normal, area, toward, receive
        ) * (free[row] * lit.decay(bounce.path[row]) * decay)[:, None, None]
        gradient = np.stack([dot(direction - toward, u), dot(direction - toward, v)], axis=1)
        return strength, bounce.path[row] + back, self.outline[here], gradient, view[row]


def pieces_of(
    surface: Surface, lit: Views, chain: Chain, cells: Cells, corner: IntArray, lattice: Lattice, monostatic: bool, max_bounces: int
) -> Pieces:
    """Cut cells among their corner rays.

    Parameters
    ----------
    surface : Surface
    lit : Views
    chain : Chain
        Of the corner rays.
    cells : Cells
    corner : (n, 4) int
        Their corner rays.
    lattice : Lattice
    monostatic : bool
    max_bounces : int
        Of the chain.
    """
    side = lattice.step / 2**cells.level
    place = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    following = np.roll(corner, -1, axis=1)
    crossed = chain.signature[corner] != chain.signature[following]
    share = np.full(corner.shape, 0.5)
    share[crossed] = _shares(surface, lit, chain, corner[crossed], following[crossed], lattice, cells, monostatic, max_bounces)
    at = place + share[:, :, None] * (np.roll(place, -1, axis=0) - place)  # (n, 4, 2), on the side from k to k + 1
    count = crossed.sum(axis=1)
    cuts = (at * crossed[:, :, None]).sum(axis=1) / np.maximum(count, 1)[:, None]
    middle = np.where(count[:, None] > 0, cuts, 0.5)
    outline = np.stack(
        [
            np.stack([np.zeros_like(middle), at[:, k] - place[k], middle - place[k], at[:, k - 1] - place[k]], axis=1)
            for k in range(4)
        ],
        axis=1,
    )
    return Pieces(corner.reshape(-1), np.repeat(cells.done, 4), side * outline.reshape(-1, 4, 2))


def _shares(
    surface: Surface, lit: Views, chain: Chain, a: IntArray, b: IntArray, lattice: Lattice, cells: Cells, monostatic: bool, max_bounces: int
) -> FloatArray:
    """Return (n,) share of the way from ray a to ray b at which what a sees ends."""
    first, last = np.minimum(a, b), np.maximum(a, b)
    pair, back = np.unique(first.astype(np.int64) * len(chain.rays) + last, return_inverse=True)
    start, end = np.divmod(pair, len(chain.rays))
    rays = chain.rays
    view = rays.view[start]
    x0, y0 = chain.rays.x[start], chain.rays.y[start]
    x1, y1 = chain.rays.x[end], chain.rays.y[end]
    low, high = np.zeros(len(pair)), np.ones(len(pair))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        probe = lit.launch(view, x0 + middle * (x1 - x0), y0 + middle * (y1 - y0), surface.centre, surface.radius)
        seen = trace_chain(surface, lit, probe, max_bounces, monostatic).signature
        same = seen == chain.signature[start]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    share = (0.5 * (low + high))[back.reshape(-1)]
    return np.where(a < b, share, 1.0 - share)
