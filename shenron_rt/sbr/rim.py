"""Cells that no single tube fills: what each of their corner rays has of them.

Where two corners see different surfaces, the place between them at which one turns into the other is found by halving.
The cell is cut along these places, so that a straight edge is followed exactly: a plate's side lobes are made there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .._typing import BoolArray, FloatArray, IntArray, NDArray
from .cells import Cells, Lattice
from .chain import Chain, trace_chain
from .fields import Fields, radiated
from .surface import Surface
from .tubes import PAIRS, in_line, receive_basis
from .vectors import dot
from .views import Views

__all__ = ["Echoes", "Pieces", "Rim"]

#: Halvings of the side of a cell to find where an edge crosses it: a clean one, to 1/512 of the side, and others.
HALVINGS, ROUGH_HALVINGS = 8, 5
#: How far an edge may run from the straight line between two cuts, in sides of the cell.
_TOLERANCE = 1.0 / 256.0
_PLACE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


class Echoes(NamedTuple):
    """What pieces send to a receiver, but for the wavenumber.

    Parameters
    ----------
    strength : (n, 2, 2)
        Receive V, H by transmit V, H, for a unit of area of the lattice.
    path : (n,) float
        There and back at the corner, less twice the distance [m].
    outline : (n, 4, 2) float
    gradient : (n, 2) float
        Of the path over the lattice.
    view : (n,) int
        Row of the receivers.
    """

    strength: NDArray[np.inexact]
    path: FloatArray
    outline: FloatArray
    gradient: FloatArray
    view: IntArray


@dataclass(frozen=True, eq=False)
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

    ray: IntArray
    done: IntArray
    outline: FloatArray

    def __len__(self) -> int:
        return len(self.ray)

    def select(self, rows: slice) -> Pieces:
        """Return some of the pieces."""
        return Pieces(self.ray[rows], self.done[rows], self.outline[rows])

    @classmethod
    def joined(cls, parts: Sequence[Pieces]) -> Pieces:
        """Return the pieces of several cuts."""
        return cls(*(np.concatenate([getattr(p, name) for p in parts]) for name in ("ray", "done", "outline")))

    def echoes(
        self, lit: Views, seen: Views, chain: Chain, order: int, fields: Fields, view: IntArray, free: FloatArray
    ) -> Echoes:
        """Return what the pieces that have a hit of this order send to a receiver.

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
        """
        bounce = chain.bounces[order]
        row = bounce.row_of[self.ray]
        here = np.flatnonzero((row >= 0) & (self.done <= order))
        row = row[here]
        direction, normal, position = bounce.direction[row], bounce.normal[row], bounce.position[row]
        spread, along = lit.spread(bounce.path[row]), dot(normal, direction)
        u, v = (
            (a - (dot(normal, a) / along)[:, None] * direction) * spread[:, None]
            for a in (bounce.across_u[row], bounce.across_v[row])
        )
        area = np.cross(u, v)
        area *= np.sign(dot(area, normal))[:, None]
        toward, back, decay = seen.seen_from(position, view[row])
        receive = receive_basis(seen, view[row], toward)
        leaving = None if fields.leaving is None else fields.leaving[row]
        strength = radiated(fields.arriving[row], leaving, direction, normal, area, toward, receive)
        strength = strength * (free[row] * lit.decay(bounce.path[row]) * decay)[:, None, None]
        gradient = np.stack([dot(direction - toward, u), dot(direction - toward, v)], axis=1)
        return Echoes(strength, bounce.path[row] + back, self.outline[here], gradient, view[row])


@dataclass(frozen=True, eq=False)
class Rim:
    """Cells that are not tubes, with the rays at their corners.

    Parameters
    ----------
    surface : Surface
    lit : Views
    chain : Chain
    max_bounces : int
    monostatic : bool
        As the chain was traced.
    lattice : Lattice
    cells : Cells
    corner : (n, 4) int
        Rays of the chain.
    """

    surface: Surface
    lit: Views
    chain: Chain
    max_bounces: int
    monostatic: bool
    lattice: Lattice
    cells: Cells
    corner: IntArray

    def cut(self, wavelength: float, all_of_them: bool) -> tuple[Pieces, IntArray]:
        """Cut the cells that one straight edge crosses, and return their pieces and the rows of the others.

        Parameters
        ----------
        wavelength : float
            The shortest [m].
        all_of_them : bool
            Cut the others too, as well as may be.
        """
        signature = self.chain.signature
        following = np.roll(self.corner, -1, axis=1)
        crossed = signature[self.corner] != signature[following]
        row = np.arange(len(self.cells))
        if not all_of_them:
            row = np.flatnonzero(crossed.sum(axis=1) == 2)
            row = row[self._is_flat(row, wavelength)]
        sides = crossed[row]
        share = np.full(sides.shape, 0.5)
        share[sides], clean_sides = self._shares(
            self.corner[row][sides], following[row][sides], None if all_of_them else wavelength
        )
        if not all_of_them:
            clean = np.ones(sides.shape, dtype=bool)
            clean[sides] = clean_sides
            kept = np.flatnonzero(clean.all(axis=1))
            kept = kept[self._is_straight(row[kept], sides[kept], share[kept])]
            row, sides, share = row[kept], sides[kept], share[kept]
        left = np.delete(np.arange(len(self.cells)), row)
        return Pieces(
            self.corner[row].reshape(-1), np.repeat(self.cells.done[row], 4), self._outlines(sides, share)
        ), left

    def _is_flat(self, row: IntArray, wavelength: float) -> BoolArray:
        """Return whether corners that see the same surfaces see one plane of each."""
        corner, signature = self.corner[row], self.chain.signature
        flat = np.ones(len(row), dtype=bool)
        for a, b in PAIRS:
            alike = np.flatnonzero(signature[corner[:, a]] == signature[corner[:, b]])
            for order, bounce in enumerate(self.chain.bounces):
                first, second = bounce.row_of[corner[alike, a]], bounce.row_of[corner[alike, b]]
                alike, first, second = (x[first >= 0] for x in (alike, first, second))
                flat[alike] &= in_line(bounce, first, second, wavelength, order == 0)
        return flat

    def _is_straight(self, row: IntArray, crossed: BoolArray, share: FloatArray) -> BoolArray:
        """Return whether the edge between two cuts runs straight: what is seen changes across their middle."""
        at = _PLACE + share[:, :, None] * (np.roll(_PLACE, -1, axis=0) - _PLACE)
        ends = at[crossed].reshape(-1, 2, 2)
        along = ends[:, 1] - ends[:, 0]
        length = np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
        aside = _TOLERANCE / length * np.stack([-along[:, 1], along[:, 0]], axis=1)
        side = self.lattice.step / 2**self.cells.level
        corner = self.corner[row]
        zero = corner[:, 0]
        marks = self.chain.signature[corner]
        seen = []
        for sign in (1.0, -1.0):
            place = side * (ends.mean(axis=1) + sign * aside)
            rays = self.chain.rays
            x, y = rays.x[zero] + place[:, 0], rays.y[zero] + place[:, 1]
            seen.append(self._trace(rays.view[zero], x, y).signature)
        first = marks[:, 0]
        other = np.where(marks[:, 1] != first, marks[:, 1], np.where(marks[:, 2] != first, marks[:, 2], marks[:, 3]))
        straight: BoolArray = (seen[0] == first) & (seen[1] == other) | (seen[0] == other) & (seen[1] == first)
        return straight

    def _outlines(self, crossed: BoolArray, share: FloatArray) -> FloatArray:
        """Return the outlines of the pieces: from the corner along its two sides and to where the cuts meet."""
        at = _PLACE + share[:, :, None] * (np.roll(_PLACE, -1, axis=0) - _PLACE)  # on the side from k to k + 1
        weight = crossed / np.maximum(crossed @ np.ones(4), 1.0)[:, None]
        weight[~crossed.any(axis=1)] = 0.25  # of four sides that meet at their middles
        middle = np.einsum("nk,nki->ni", weight, at)
        outline = np.zeros((len(at), 4, 4, 2))
        for k in range(4):
            outline[:, k, 1], outline[:, k, 2], outline[:, k, 3] = (
                p - _PLACE[k] for p in (at[:, k], middle, at[:, k - 1])
            )
        outline *= self.lattice.step / 2**self.cells.level
        return outline.reshape(-1, 4, 2)

    def _shares(self, a: IntArray, b: IntArray, wavelength: float | None) -> tuple[FloatArray, BoolArray]:
        """Return the share of the way from rays a to b at which what a sees ends, and whether the place is clean.

        It is where what b sees begins there, and a and b see one plane each as far as there; not tested without a
        wavelength.
        """
        rays, signature = self.chain.rays, self.chain.signature
        low, high = np.minimum(a, b), np.maximum(a, b)  # a side belongs to two cells, which must agree
        pair, back = np.unique(low.astype(np.int64) * len(rays) + high, return_inverse=True)
        start, end = np.divmod(pair, len(rays))
        near, far = np.zeros(len(pair)), np.ones(len(pair))
        for _ in range(ROUGH_HALVINGS if wavelength is None else HALVINGS):
            middle = 0.5 * (near + far)
            same = self._probe(start, end, middle).signature == signature[start]
            near, far = np.where(same, middle, near), np.where(same, far, middle)
        clean = np.ones(len(pair), dtype=bool)
        if wavelength is not None:
            clean &= self._reaches(start, self._probe(start, end, near), wavelength)
            clean &= self._reaches(end, self._probe(start, end, far), wavelength)
        share = (0.5 * (near + far))[back.reshape(-1)]
        return np.where(a < b, share, 1.0 - share), clean[back.reshape(-1)]

    def _probe(self, start: IntArray, end: IntArray, share: FloatArray) -> Chain:
        rays = self.chain.rays
        x = rays.x[start] + share * (rays.x[end] - rays.x[start])
        y = rays.y[start] + share * (rays.y[end] - rays.y[start])
        return self._trace(rays.view[start], x, y)

    def _trace(self, view: IntArray, x: FloatArray, y: FloatArray) -> Chain:
        probe = self.lit.launch(view, x, y, self.surface.centre, self.surface.radius)
        return trace_chain(self.surface, self.lit, probe, self.max_bounces, self.monostatic)

    def _reaches(self, ray: IntArray, probe: Chain, wavelength: float) -> BoolArray:
        """Return whether rays see the same planes as the probes beside them."""
        same: BoolArray = probe.signature == self.chain.signature[ray]
        for order, (bounce, other) in enumerate(zip(self.chain.bounces, probe.bounces, strict=False)):
            hit = np.flatnonzero(same & (bounce.row_of[ray] >= 0))
            rows = bounce.row_of[ray[hit]], other.row_of[hit]
            same[hit] &= in_line(bounce, *rows, wavelength, order == 0, other)
        return same
