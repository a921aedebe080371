"""The sum over all tubes: coarse cells where surfaces are smooth, finer ones towards their edges."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from .._parallel import map_blocks
from .._typing import BoolArray, ComplexArray, FloatArray, IntArray
from ..constants import SPEED_OF_LIGHT
from .cells import Cells, Lattice, covering
from .chain import Chain, sees, trace_chain
from .facets import facet_echoes
from .fields import Fields, fields_along
from .polygon import polygon_integral
from .rim import Pieces, Rim
from .sums import by_view
from .surface import Surface
from .tubes import is_tube, tube_echoes
from .views import Views

__all__ = ["CHUNK", "Settings", "scattered"]

#: Cells worked on at once: bounds memory.
CHUNK = 1 << 18
#: Level from which on the cells of a view are only quartered while there are no more of them than this: a corner has
#: edges that meet at few points, which do not average out, a duct or a car has them everywhere.
_COARSE, _FEW = 3, 512


@dataclass(frozen=True)
class Settings:
    """How finely to integrate.

    Parameters
    ----------
    step : float
        Side of the coarsest cells [m].
    levels : int
        How often they may be quartered.
    max_bounces : int
    seed : int
        Of the shift of the lattices.
    """

    step: float
    levels: int
    max_bounces: int
    seed: int = 0


def scattered(
    surface: Surface,
    lit: Views,
    frequency_hz: FloatArray,
    settings: Settings,
    receivers: Views | None = None,
    progress: Callable[[float], None] | None = None,
) -> ComplexArray:
    """Return the complex scattering amplitudes of a target.

    Parameters
    ----------
    surface : Surface
    lit : Views
        Where the light comes from; also where it is received, without ``receivers``.
    frequency_hz : (f,) float
    settings : Settings
    receivers : Views, optional
        Then ``lit`` is a single view.
    progress : callable, optional
        Is told the share that is done, in [0, 1].

    Returns
    -------
    (f, a, 2, 2) complex
        Receive V, H by transmit V, H, for every view; its modulus squared is the RCS [m].
    """
    seen = lit if receivers is None else receivers
    total = np.zeros((len(frequency_hz), len(seen), 2, 2), dtype=np.complex128)
    done = facet_echoes(surface, lit, receivers, frequency_hz, settings.step, total)
    if not (done.all() and (surface.convex or settings.max_bounces == 1)):
        lattice, counts = covering(surface, lit, settings.step, settings.seed)
        run = _Sum(surface, lit, receivers, frequency_hz, settings, lattice, done, total)
        n, so_far = int(counts.prod(axis=1).sum()), 0
        for cells in _chunks(counts):
            run.add(cells)
            so_far += len(cells)
            if progress is not None:
                progress(so_far / n)
    wavenumber = 2.0 * np.pi * frequency_hz / SPEED_OF_LIGHT
    total *= wavenumber[:, None, None, None] / (2.0 * np.sqrt(np.pi))
    return total


def _chunks(counts: IntArray) -> Iterator[Cells]:
    """Yield the cells of level 0, several views at once or a view in several parts."""
    waiting: list[tuple[int, IntArray]] = []
    size = 0
    for view, (columns, rows) in enumerate(counts.tolist()):
        band = max(1, CHUNK // columns)
        for first in range(0, rows, band):
            ij = np.stack(
                [a.ravel() for a in np.meshgrid(np.arange(columns), np.arange(first, min(first + band, rows)))], axis=1
            )
            if size and size + len(ij) > CHUNK:
                yield _join(waiting)
                waiting, size = [], 0
            waiting.append((view, ij))
            size += len(ij)
    if waiting:
        yield _join(waiting)


def _join(parts: list[tuple[int, IntArray]]) -> Cells:
    view = np.repeat(np.array([v for v, _ in parts]), [len(ij) for _, ij in parts])
    return Cells(0, view, np.concatenate([ij for _, ij in parts]), np.zeros(len(view), dtype=np.int64))


@dataclass(frozen=True, eq=False)
class _Sum:
    """What cells add to the amplitudes.

    Parameters
    ----------
    surface, lit, receivers, frequency_hz, settings
        As of :func:`scattered`.
    lattice : Lattice
    by_facets : (a, g) bool
        Smooth surfaces whose first bounce is in the amplitudes already, for every view of the receivers.
    total : (f, a, 2, 2) complex
        Is added to, but for the wavenumber.
    """

    surface: Surface
    lit: Views
    receivers: Views | None
    frequency_hz: FloatArray
    settings: Settings
    lattice: Lattice
    by_facets: BoolArray
    total: ComplexArray

    def add(self, cells: Cells) -> None:
        """Add some cells: the tubes among them, and the quarters of the rest in the same way."""
        waiting = [cells]
        while waiting:
            left = self._level(waiting.pop())
            waiting += [left.select(np.arange(i, min(i + CHUNK, len(left)))) for i in range(0, len(left), CHUNK)]

    def _level(self, cells: Cells) -> Cells:
        """Add what the tubes among cells of a level send, and return the quarters of the others, if they have any."""
        view, ij, corner = cells.corners()
        x, y = self.lattice.points(view, ij, cells.level)
        surface, most = self.surface, self.settings.max_bounces
        rays = self.lit.launch(view, x, y, surface.centre, surface.radius)
        monostatic = self.receivers is None
        chain = trace_chain(surface, self.lit, rays, most, monostatic)
        shortest = SPEED_OF_LIGHT / float(self.frequency_hz.max())
        found, pending = self._sort(chain, cells, corner, shortest)
        last = self._is_last(cells, pending)
        left = cells.select(pending[:0])
        cut: list[Pieces] = []
        for rows, all_of_them in ((pending[~last], False), (pending[last], True)):
            if not len(rows) and cut:
                continue
            rim = Rim(surface, self.lit, chain, most, monostatic, self.lattice, cells.select(rows), corner[rows])
            pieces, uncut = rim.cut(shortest, all_of_them)
            cut.append(pieces)
            left = left if all_of_them else rim.cells.select(uncut)
        self._echoes(chain, corner, found, Pieces.joined(cut))
        return left.quartered()

    def _is_last(self, cells: Cells, pending: IntArray) -> BoolArray:
        """Return which pending cells are not to be quartered: at the finest level, or where a view has many of them."""
        if cells.level == self.settings.levels:
            return np.ones(len(pending), dtype=bool)
        if cells.level < _COARSE:
            return np.zeros(len(pending), dtype=bool)
        view = cells.view[pending]
        return np.asarray(np.bincount(view, minlength=1)[view] > _FEW)

    def _sort(self, chain: Chain, cells: Cells, corner: IntArray, wavelength: float) -> tuple[list[IntArray], IntArray]:
        """Return the cells that are tubes at each bounce, and those that need a closer look.

        Sets ``cells.done`` of the latter.
        """
        alive = np.arange(len(cells))
        found, pending = [], []
        for order, bounce in enumerate(chain.bounces):
            rows = bounce.row_of[corner[alive]]
            first, second, third, fourth = (rows >= 0).T
            whole = np.flatnonzero(first & second & third & fourth)
            tube = np.zeros(len(alive), dtype=bool)
            tube[whole] = is_tube(bounce, rows[whole], wavelength, order == 0)
            touched = first | second | third | fourth
            if order == 0:
                touched |= self.lattice.holds_tip(cells)
            unclear = alive[touched & ~tube]
            cells.done[unclear] = np.maximum(cells.done[unclear], order)
            if order == 0 and self.settings.max_bounces == 1:
                unclear = unclear[self._matters(chain)[corner[unclear]].any(axis=1)]
            pending.append(unclear)
            alive = alive[tube]
            found.append(alive[cells.done[alive] <= order])
        return found, np.sort(np.concatenate(pending)) if pending else np.zeros(0, dtype=np.int64)

    def _matters(self, chain: Chain) -> BoolArray:
        """Return (n_rays,) whether a ray has hits that are not by facets already."""
        first = chain.bounces[0]
        by_facets = self.by_facets if self.receivers is None else np.atleast_2d(self.by_facets.all(axis=0))
        matters = np.zeros(len(chain.rays), dtype=bool)
        matters[first.ray] = ~by_facets[chain.rays.view[first.ray], self.surface.group[first.face]]
        return matters

    def _echoes(self, chain: Chain, corner: IntArray, found: list[IntArray], pieces: Pieces) -> None:
        fields: list[Fields] = []
        for number, frequency in enumerate(self.frequency_hz.tolist()):
            k = 2.0 * np.pi * frequency / SPEED_OF_LIGHT
            if not fields or not self.surface.conducts:
                fields = fields_along(self.surface, self.lit, chain, frequency)
            for order in range(len(chain.bounces)):
                for seen, view, free in self._receptions(chain, order):
                    here = self.lit, seen, chain, order, fields[order], view, free

                    def tubes(
                        rows: slice, here: _Here = here, k: float = k, cell: IntArray = found[order]
                    ) -> ComplexArray:
                        return _of_tubes(*here, corner[cell[rows]], k)

                    def rims(rows: slice, here: _Here = here, k: float = k) -> ComplexArray:
                        return _of_pieces(*here, pieces.select(rows), k)

                    for part in (*map_blocks(tubes, len(found[order])), *map_blocks(rims, len(pieces))):
                        self.total[number] += part

    def _receptions(self, chain: Chain, order: int) -> Iterator[tuple[Views, IntArray, FloatArray]]:
        """Yield the receivers, the row of each hit in them, and whether it is seen from there and counts."""
        bounce, surface = chain.bounces[order], self.surface
        if self.receivers is None:
            view = chain.rays.view[bounce.ray]
            free = bounce.free.astype(np.float64)
            if order == 0:
                free[self.by_facets[view, surface.group[bounce.face]]] = 0.0
            yield self.lit, view, free
            return
        lifted = bounce.position + surface.lift * bounce.normal
        for number in range(len(self.receivers)):
            view = np.full(len(bounce), number)
            free = sees(surface, self.receivers, lifted, bounce.normal, view).astype(np.float64)
            if order == 0:
                free[self.by_facets[number, surface.group[bounce.face]]] = 0.0
            yield self.receivers, view, free


#: Illumination, reception, rays, order of the bounce, its fields, the row of each hit in the receivers, whether it is
#: seen from there.
_Here: TypeAlias = tuple[Views, Views, Chain, int, Fields, IntArray, FloatArray]


def _of_tubes(
    lit: Views, seen: Views, chain: Chain, order: int, fields: Fields, view: IntArray, free: FloatArray,
    corner: IntArray, k: float,
) -> ComplexArray:  # fmt: skip
    rows, first = chain.bounces[order].row_of[corner], chain.bounces[0].row_of[corner]
    at = view[rows[:, 0]]
    strength, path, along_u, along_v = tube_echoes(
        lit, seen, chain, order, rows, first, fields, at, free[rows].mean(axis=1)
    )
    lobe = np.sinc(k / (2.0 * np.pi) * along_u) * np.sinc(k / (2.0 * np.pi) * along_v)
    return by_view(strength, lobe * np.exp(-1j * k * path), at, len(seen))


def _of_pieces(
    lit: Views, seen: Views, chain: Chain, order: int, fields: Fields, view: IntArray, free: FloatArray,
    pieces: Pieces, k: float,
) -> ComplexArray:  # fmt: skip
    echoes = pieces.echoes(lit, seen, chain, order, fields, view, free)
    lobe = polygon_integral(echoes.outline, k * echoes.gradient)
    return by_view(echoes.strength, lobe * np.exp(-1j * k * echoes.path), echoes.view, len(seen))
