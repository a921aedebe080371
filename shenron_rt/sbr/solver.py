"""The sum over all tubes: coarse cells where surfaces are smooth, finer ones towards their edges."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from .._parallel import map_blocks
from .._typing import ComplexArray, FloatArray, IntArray, NDArray
from ..constants import SPEED_OF_LIGHT
from .cells import Cells, Lattice
from .chain import Chain, sees, trace_chain
from .fields import Fields, fields_along
from .polygon import polygon_integral
from .rim import Pieces, Rim
from .surface import Surface
from .tubes import is_tube, tube_echoes
from .views import Views

__all__ = ["Settings", "scattered"]

#: Cells worked on at once: bounds memory.
CHUNK = 1 << 17


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
    surface: Surface, lit: Views, frequency_hz: FloatArray, settings: Settings, receivers: Views | None = None
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

    Returns
    -------
    (f, a, 2, 2) complex
        Receive V, H by transmit V, H, for every view; its modulus squared is the RCS [m].
    """
    seen = lit if receivers is None else receivers
    total = np.zeros((len(frequency_hz), len(seen), 2, 2), dtype=np.complex128)
    lattice, chunks = _lattice(surface, lit, settings)
    for cells in chunks:
        while len(cells):
            cells = _level(surface, lit, receivers, frequency_hz, settings, lattice, cells, total)
    wavenumber = 2.0 * np.pi * frequency_hz / SPEED_OF_LIGHT
    total *= wavenumber[:, None, None, None] / (2.0 * np.sqrt(np.pi))
    return total


def _lattice(surface: Surface, lit: Views, settings: Settings) -> tuple[Lattice, Iterator[Cells]]:
    """Return lattices that cover the silhouettes, shifted at random, and their cells in chunks."""
    mesh = surface.mesh
    points = mesh.vertices[np.unique(mesh.faces)] - surface.centre
    x, y = points @ lit.horizontal.T, points @ lit.vertical.T
    if lit.distance is not None:
        # onto the plane through the centre, along rays from the radar
        ahead = lit.toward @ surface.centre
        away = points @ lit.toward.T
        scale = (lit.distance - ahead) / np.maximum(lit.distance - ahead - away, 1e-9)
        side = np.stack([lit.horizontal @ surface.centre, lit.vertical @ surface.centre])
        x, y = (x + side[0]) * scale - side[0], (y + side[1]) * scale - side[1]
    low, high = np.stack([x.min(axis=0), y.min(axis=0)], axis=1), np.stack([x.max(axis=0), y.max(axis=0)], axis=1)
    shift = np.random.default_rng(settings.seed).random((len(lit), 2))
    low = low - (0.5 + 0.5 * shift) * settings.step
    counts = np.ceil((high - low) / settings.step + 0.25).astype(np.int64)
    return Lattice(low, settings.step), _chunks(counts)


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


def _level(
    surface: Surface,
    lit: Views,
    receivers: Views | None,
    frequency_hz: FloatArray,
    settings: Settings,
    lattice: Lattice,
    cells: Cells,
    total: ComplexArray,
) -> Cells:
    """Add what the tubes among some cells send, and return the quarters of the rest (or nothing, at the last level)."""
    view, ij, corner = cells.corners()
    x, y = lattice.points(view, ij, cells.level)
    rays = lit.launch(view, x, y, surface.centre, surface.radius)
    chain = trace_chain(surface, lit, rays, settings.max_bounces, receivers is None)
    shortest = SPEED_OF_LIGHT / float(frequency_hz.max())
    found, pending = _sort(chain, cells, corner, shortest)
    monostatic = receivers is None
    rim = Rim(surface, lit, chain, settings.max_bounces, monostatic, lattice, cells.select(pending), corner[pending])
    pieces, left = rim.cut(shortest, cells.level == settings.levels)
    _add(surface, lit, receivers, frequency_hz, chain, corner, found, pieces, total)
    return rim.cells.select(left).quartered()


def _sort(chain: Chain, cells: Cells, corner: IntArray, wavelength: float) -> tuple[list[IntArray], IntArray]:
    """Return the cells that are tubes at each bounce, and those that need a closer look.

    Sets ``cells.done`` of the latter.
    """
    alive = np.arange(len(cells))
    found, pending = [], []
    for order, bounce in enumerate(chain.bounces):
        rows = bounce.row_of[corner[alive]]
        hits = (rows >= 0).sum(axis=1)
        whole = np.flatnonzero(hits == 4)
        tube = np.zeros(len(alive), dtype=bool)
        tube[whole] = is_tube(bounce, rows[whole], wavelength, order == 0)
        unclear = alive[(hits > 0) & ~tube]
        cells.done[unclear] = np.maximum(cells.done[unclear], order)
        pending.append(unclear)
        alive = alive[tube]
        found.append(alive[cells.done[alive] <= order])
    return found, np.sort(np.concatenate(pending)) if pending else np.zeros(0, dtype=np.int64)


def _add(
    surface: Surface,
    lit: Views,
    receivers: Views | None,
    frequency_hz: FloatArray,
    chain: Chain,
    corner: IntArray,
    found: list[IntArray],
    pieces: Pieces,
    total: ComplexArray,
) -> None:
    fields: list[Fields] = []
    for number, frequency in enumerate(frequency_hz.tolist()):
        k = 2.0 * np.pi * frequency / SPEED_OF_LIGHT
        if not fields or not surface.conducts:
            fields = fields_along(surface, lit, chain, frequency)
        for order in range(len(chain.bounces)):
            for seen, view, free in _receptions(surface, lit, receivers, chain, order):
                here = lit, seen, chain, order, fields[order], view, free

                def tubes(rows: slice, here: _Here = here, k: float = k, cell: IntArray = found[order]) -> ComplexArray:
                    return _of_tubes(*here, corner[cell[rows]], k)

                def rims(rows: slice, here: _Here = here, k: float = k) -> ComplexArray:
                    return _of_pieces(*here, pieces.select(rows), k)

                for part in (*map_blocks(tubes, len(found[order])), *map_blocks(rims, len(pieces))):
                    total[number] += part


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
    return _by_view(strength, lobe * np.exp(-1j * k * path), at, len(seen))


def _of_pieces(
    lit: Views, seen: Views, chain: Chain, order: int, fields: Fields, view: IntArray, free: FloatArray,
    pieces: Pieces, k: float,
) -> ComplexArray:  # fmt: skip
    echoes = pieces.echoes(lit, seen, chain, order, fields, view, free)
    lobe = polygon_integral(echoes.outline, k * echoes.gradient)
    return _by_view(echoes.strength, lobe * np.exp(-1j * k * echoes.path), echoes.view, len(seen))


def _receptions(
    surface: Surface, lit: Views, receivers: Views | None, chain: Chain, order: int
) -> Iterator[tuple[Views, IntArray, FloatArray]]:
    """Yield the receivers, the row of each hit in them, and whether it sees them."""
    bounce = chain.bounces[order]
    if receivers is None:
        yield lit, chain.rays.view[bounce.ray], bounce.free.astype(np.float64)
        return
    lifted = bounce.position + surface.lift * bounce.normal
    for number in range(len(receivers)):
        view = np.full(len(bounce), number)
        yield receivers, view, sees(surface, receivers, lifted, bounce.normal, view).astype(np.float64)


def _by_view(strength: NDArray[np.inexact], phasor: ComplexArray, view: IntArray, n: int) -> ComplexArray:
    """Return (n, 2, 2) sums of echoes by view, in the order of the echoes."""
    values = (strength.reshape(-1, 4) * phasor[:, None]).T
    sums = [np.bincount(view, c.real, n) + 1j * np.bincount(view, c.imag, n) for c in np.ascontiguousarray(values)]
    return np.stack(sums, axis=1).reshape(n, 2, 2)
