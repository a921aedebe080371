"""First bounces of surfaces whose facets are all seen whole or not at all: the exact integral over each facet.

Cells of a lattice of rays have their edges in the plane of the fronts; facets have theirs on the body. Where nothing
hides part of a facet its own outline is the better one: no edge has to be searched for, and the limb of a round body,
where cells see depth change by wavelengths, is as exact as its middle. A convex body is lit as far as its own normals,
not those of its facets, are turned to the light.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._parallel import map_blocks
from .._typing import BoolArray, ComplexArray, FloatArray, IntArray
from ..constants import SPEED_OF_LIGHT
from .chain import Bounce, Chain
from .fields import Fields, fields_along, radiated
from .parts import Parts, facet_parts
from .polygon import polygon_integral
from .sight import HIDDEN, LIMB, PARTLY, WHOLE, Sight
from .sums import by_view
from .surface import Surface
from .tubes import receive_basis
from .vectors import dot
from .views import Rays, Views

__all__ = ["facet_echoes"]

#: Facets times views looked at, and integrated, at once: bounds memory.
_AT_ONCE = 1 << 21
_BATCH = 1 << 18


def facet_echoes(
    surface: Surface, lit: Views, receivers: Views | None, frequency_hz: FloatArray, step: float, total: ComplexArray
) -> BoolArray:
    """Add the first bounces of the surfaces that facets can do, and say which these are.

    Parameters
    ----------
    surface : Surface
    lit : Views
    receivers : Views or None
        As of :func:`~shenron_rt.sbr.solver.scattered`.
    frequency_hz : (f,) float
    step : float
        Size of what must not be overlooked when it hides a facet [m].
    total : (f, a, 2, 2) complex
        Is added to, but for the wavenumber.

    Returns
    -------
    (a, g) bool
        Whether each smooth surface is done, for every view.
    """
    seen = lit if receivers is None else receivers
    done = np.zeros((len(seen), int(surface.group.max()) + 1), dtype=bool)
    sight = Sight(surface, step)
    parts = facet_parts(surface, [lit, seen], SPEED_OF_LIGHT / float(frequency_hz.max())) if sight.possible else None
    if parts is None:
        return done
    facets = _Facets(surface, lit, seen, receivers is None, frequency_hz, total)
    source = None if receivers is None else sight.of(lit)[0]
    for rows, state in sight.blocks(seen, _AT_ONCE, len(parts.face)):
        if source is not None:  # the lesser of what both see
            state = np.where((state == HIDDEN) | (source == HIDDEN), HIDDEN, np.maximum(state, source))
        clear = np.ones((len(state), done.shape[1]), dtype=bool)
        view, face = np.nonzero(state == PARTLY)
        clear[view, surface.group[face]] = False
        done[rows] = clear
        state = np.where(clear[:, surface.group], state, HIDDEN)[:, parts.face]
        for kind, add in ((WHOLE, facets.add), (LIMB, facets.add_limb)):
            view, part = np.nonzero(state == kind)
            for start in range(0, len(view), _BATCH):
                some = slice(start, start + _BATCH)
                add(parts, part[some], view[some] + rows.start)
    return done


@dataclass(frozen=True, eq=False)
class _Facets:
    """What facets add to the amplitudes; see :func:`facet_echoes`."""

    surface: Surface
    lit: Views
    seen: Views
    monostatic: bool
    frequency_hz: FloatArray
    total: ComplexArray

    def add_limb(self, parts: Parts, part: IntArray, view: IntArray) -> None:
        """Add as much of some parts as is turned to the light and to the receiver; ``view`` is its row."""
        rest, row = parts.turned_to(self.lit, self._source(view), part)
        view = view[row]
        if not self.monostatic:
            rest, row = rest.turned_to(self.seen, view, np.arange(len(view)))
            view = view[row]
        self.add(rest, np.arange(len(view)), view)

    def add(self, parts: Parts, part: IntArray, view: IntArray) -> None:
        """Add the echoes of some parts; ``view`` is the row of the receiver of each."""
        chain = self._chain(parts, part, self._source(view))
        fields: list[Fields] = []
        for number, frequency in enumerate(self.frequency_hz.tolist()):
            k = 2.0 * np.pi * frequency / SPEED_OF_LIGHT
            if not fields or not self.surface.conducts:
                fields = fields_along(self.surface, self.lit, chain, frequency)

            def block(rows: slice, k: float = k, fields: Fields = fields[0]) -> ComplexArray:
                return self._sum(parts, part[rows], chain.bounces[0], rows, fields, view[rows], k)

            for share in map_blocks(block, len(view)):
                self.total[number] += share

    def _source(self, view: IntArray) -> IntArray:
        return view if self.monostatic else np.zeros(len(view), dtype=np.int64)

    def _chain(self, parts: Parts, part: IntArray, source: IntArray) -> Chain:
        """Return one hit in the middle of each part, as if a ray had been cast there."""
        middle, face = parts.middle[part], parts.face[part]
        toward, path, _ = self.lit.seen_from(middle, source)
        normal = self.surface.normal[face]
        outward = self.surface.outward or np.where(dot(normal, toward) < 0.0, -1.0, 1.0)[:, None]
        rows, none = np.arange(len(part)), np.zeros((0, 3))
        mark = np.zeros(len(part), dtype=np.uint64)
        lit_all = np.ones(len(part), dtype=bool)
        rays = Rays(source, path, path, middle, -toward, none, none, path)
        bounce = Bounce(rows, rows, rows, middle, -toward, outward * normal, none, none, path, face, lit_all, mark)
        return Chain(rays, (bounce,), mark)

    def _sum(
        self, parts: Parts, part: IntArray, bounce: Bounce, rows: slice, fields: Fields, view: IntArray, k: float
    ) -> ComplexArray:
        """Return (a, 2, 2) what parts send, by view."""
        direction, normal, path = bounce.direction[rows], bounce.normal[rows], bounce.path[rows]
        toward, back, decay = self.seen.seen_from(bounce.position[rows], view)
        leaving = None if fields.leaving is None else fields.leaving[rows]
        receive = receive_basis(self.seen, view, toward)
        strength = radiated(fields.arriving[rows], leaving, direction, normal, normal, toward, receive)
        along, across, outline = parts.along[part], parts.across[part], parts.outline[part]
        if self.lit.distance is None and self.seen.distance is None:
            slope = direction - toward
            gradient = np.stack([dot(slope, along), dot(slope, across)], axis=1)
            phasor = polygon_integral(outline, k * gradient) * np.exp(-1j * k * (path + back))
        else:
            phasor = self._of_spherical(parts, part, self._source(view), view, k)
        phasor *= decay * self.lit.decay(path)
        if not self.surface.outward:  # the other side of an open surface is dark
            phasor *= dot(normal, toward) > 0.0
        return by_view(strength, phasor, view, len(self.seen))

    def _of_spherical(self, parts: Parts, part: IntArray, source: IntArray, view: IntArray, k: float) -> ComplexArray:
        """Return (n,) integrals of exp(-jk path) over parts of spherical waves.

        The path is exact at the corners and linear between them, so that neighbours agree along their edges. Inside it
        lies lower; that is taken off where the phase stands still, and not where it turns and only edges count.
        """
        corners, outline = parts.corners[part, :, :3], parts.outline[part]
        way, bulge = np.zeros((len(part), 3)), np.zeros(len(part))
        for views, row in ((self.lit, source), (self.seen, view)):
            for number in range(3):
                toward, length, _ = views.seen_from(corners[:, number], row)
                way[:, number] += length
                if views.distance is not None:
                    # (|x|^2 - (x . leg)^2) / (2 R) at x from the centroid: a third of the sum over the corners is the
                    # mean of what they have, a twelfth that of the whole triangle
                    x = outline[:, number]
                    ahead = x[:, 0] * dot(parts.along[part], toward) + x[:, 1] * dot(parts.across[part], toward)
                    bulge += ((x**2).sum(axis=1) - ahead**2) / (8.0 * (length + views.distance))
        moment = np.einsum("nki,nkj->nij", outline, outline)
        gradient = np.linalg.solve(moment, np.einsum("nki,nk->ni", outline, way)[:, :, None])[:, :, 0]
        lobe = polygon_integral(outline, k * gradient)
        area = polygon_integral(outline, np.zeros_like(gradient)).real
        still = np.abs(lobe) / np.maximum(area, 1e-300)
        return np.asarray(lobe * np.exp(-1j * k * (way.mean(axis=1) - still * bulge)))
