"""First bounces of surfaces whose facets are all seen whole or not at all: the exact integral over each facet.

Cells of a lattice of rays have their edges in the plane of the fronts; facets have theirs on the body. Where nothing
hides part of a facet its own outline is the better one: no edge has to be searched for, and the limb of a round body,
where cells see depth change by wavelengths, is as exact as its middle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._parallel import map_blocks
from .._typing import BoolArray, ComplexArray, FloatArray, IntArray
from ..constants import SPEED_OF_LIGHT
from .chain import Bounce, Chain, dot
from .fields import Fields, fields_along, radiated
from .polygon import polygon_integral
from .sight import PARTLY, WHOLE, Sight
from .subdivide import subdivided
from .sums import by_view
from .surface import Surface
from .tubes import receive_basis
from .views import Rays, Views

__all__ = ["facet_echoes"]

#: How far the path to a corner of a part of a facet may deviate from linear, in wavelengths; its mean is taken out.
_STRAIGHT = 1.0 / 32.0
#: Facets times views looked at, and integrated, at once: bounds memory.
_AT_ONCE = 1 << 21
_BATCH = 1 << 18


@dataclass(frozen=True, eq=False)
class _Parts:
    """Facets, cut so that the path over each part is nearly linear.

    Parameters
    ----------
    face : (m,) int
    middle, along, across : (m, 3) float
        Centroid [m] and two perpendicular unit vectors of its plane.
    outline : (m, 3, 2) float
        Corners along them, counter-clockwise [m].
    """

    face: IntArray
    middle: FloatArray
    along: FloatArray
    across: FloatArray
    outline: FloatArray


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
    if not sight.possible:
        return done
    parts = _parts(surface, seen, lit, SPEED_OF_LIGHT / float(frequency_hz.max()))
    source = None if receivers is None else sight.of(lit)[0]
    for rows, state in sight.blocks(seen, _AT_ONCE):
        whole, unclear = state == WHOLE, state == PARTLY
        if source is not None:
            whole, unclear = whole & (source == WHOLE), unclear | (source == PARTLY)
        clear = np.ones((len(state), done.shape[1]), dtype=bool)
        view, face = np.nonzero(unclear)
        clear[view, surface.group[face]] = False
        done[rows] = clear
        whole &= clear[:, surface.group]
        view, part = np.nonzero(whole[:, parts.face])
        for start in range(0, len(view), _BATCH):
            some = slice(start, start + _BATCH)
            _add(surface, lit, receivers, frequency_hz, parts, view[some] + rows.start, part[some], total)
    return done


def _parts(surface: Surface, seen: Views, lit: Views, wavelength: float) -> _Parts:
    """Return the facets, cut where waves are spherical."""
    triangles = surface.mesh.vertices[surface.mesh.faces]
    count = np.ones(len(triangles), dtype=np.int64)
    distances = [d for d in (seen.distance, lit.distance) if d is not None]
    if distances:
        size = np.linalg.norm(triangles - triangles.mean(axis=1, keepdims=True), axis=2).max(axis=1)
        # both legs bend by size^2 / (2 R)
        nearest = min(distances) - np.linalg.norm(surface.centre) - surface.radius
        nearest = max(nearest, 0.05 * min(distances))
        count = np.maximum(np.ceil(size / np.sqrt(_STRAIGHT * wavelength * nearest)), 1.0).astype(np.int64)
    pieces, face = subdivided(triangles, count)
    along = pieces[:, 1] - pieces[:, 0]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    across = np.cross(surface.normal[face], along)
    middle = pieces.mean(axis=1)
    corner = pieces - middle[:, None, :]
    outline = np.stack([np.einsum("nki,ni->nk", corner, a) for a in (along, across)], axis=2)
    return _Parts(face, middle, along, across, outline)


def _add(
    surface: Surface,
    lit: Views,
    receivers: Views | None,
    frequency_hz: FloatArray,
    parts: _Parts,
    view: IntArray,
    part: IntArray,
    total: ComplexArray,
) -> None:
    """Add the echoes of some parts of facets."""
    seen = lit if receivers is None else receivers
    source = view if receivers is None else np.zeros(len(view), dtype=np.int64)
    chain = _chain(surface, lit, parts, source, part)
    fields: list[Fields] = []
    for number, frequency in enumerate(frequency_hz.tolist()):
        k = 2.0 * np.pi * frequency / SPEED_OF_LIGHT
        if not fields or not surface.conducts:
            fields = fields_along(surface, lit, chain, frequency)

        def block(rows: slice, k: float = k, fields: Fields = fields[0]) -> ComplexArray:
            return _sum(lit, seen, parts, part[rows], chain.bounces[0], rows, fields, view[rows], k)

        for share in map_blocks(block, len(view)):
            total[number] += share


def _chain(surface: Surface, lit: Views, parts: _Parts, source: IntArray, part: IntArray) -> Chain:
    """Return one hit in the middle of each part, as if a ray had been cast there."""
    middle, face = parts.middle[part], parts.face[part]
    toward, path, _ = lit.seen_from(middle, source)
    normal = surface.normal[face]
    normal = normal * np.where(dot(normal, toward) < 0.0, -1.0, 1.0)[:, None]
    rows, none = np.arange(len(part)), np.zeros((0, 3))
    mark = np.zeros(len(part), dtype=np.uint64)
    lit_all = np.ones(len(part), dtype=bool)
    rays = Rays(source, path, path, middle, -toward, none, none, path)
    bounce = Bounce(rows, rows, rows, middle, -toward, normal, none, none, path, face, lit_all, mark)
    return Chain(rays, (bounce,), mark)


def _sum(
    lit: Views, seen: Views, parts: _Parts, part: IntArray, bounce: Bounce, rows: slice, fields: Fields,
    view: IntArray, k: float,
) -> ComplexArray:  # fmt: skip
    """Return (a, 2, 2) what parts of facets send, by view."""
    direction, normal, position, path = (
        a[rows] for a in (bounce.direction, bounce.normal, bounce.position, bounce.path)
    )
    toward, back, decay = seen.seen_from(position, view)
    leaving = None if fields.leaving is None else fields.leaving[rows]
    receive = receive_basis(seen, view, toward)
    strength = radiated(fields.arriving[rows], leaving, direction, normal, normal, toward, receive)
    along, across, outline = parts.along[part], parts.across[part], parts.outline[part]
    slope = direction - toward
    gradient = k * np.stack([dot(slope, along), dot(slope, across)], axis=1)
    way = path + back
    for views, leg, length in ((lit, direction, path), (seen, toward, back)):
        if views.distance is not None:
            # mean of how much longer a spherical leg is than its tangent: (|x|^2 - (x . leg)^2) / (2 R), and the mean
            # square of a coordinate over a triangle is a twelfth of the sum over its corners, from the centroid
            ahead = outline[:, :, 0] * dot(along, leg)[:, None] + outline[:, :, 1] * dot(across, leg)[:, None]
            way += ((outline**2).sum(axis=(1, 2)) - (ahead**2).sum(axis=1)) / (24.0 * (length + views.distance))
    phasor = polygon_integral(outline, gradient) * np.exp(-1j * k * way)
    # the other side of an open surface is dark
    phasor *= decay * lit.decay(path) * (dot(normal, toward) > 0.0)
    return by_view(strength, phasor, view, len(seen))
