"""Advice on scenes that the chosen rays cannot resolve."""

from __future__ import annotations

import logging
from collections.abc import Container

import numpy as np

from ..constants import PATTERN_FLOOR_TWO_WAY_DB
from ..frames import spherical
from ..physics.antenna import AntennaPattern
from ..scene.world import World

__all__ = ["advise_thin"]

_log = logging.getLogger(__name__)

#: Objects that get a line each; of thousands in a scene the others get one together.
_MOST = 5

_advised: set[tuple[str, int]] = set()


def advise_thin(world: World, pattern: AntennaPattern, spacing: float, aimed: Container[int]) -> None:
    """Warn, once an object, of those that the common grid may miss: thinner than a cell where they stand.

    Parameters
    ----------
    world : World
    pattern : AntennaPattern
        Objects below its -40 dB two-way do not matter.
    spacing : float
        Angle between rays [rad].
    aimed : container of int
        Bodies that have rays of their own.
    """
    thin: list[tuple[str, int, float, float]] = []
    for b, body in enumerate(world.bodies):
        key = (body.source.name or body.source.shape or "", body.object_id)
        points = world.vertices[world.vertex_start[b] : world.vertex_start[b + 1]]
        if b in aimed or key in _advised or len(points) == 0:
            continue
        nearest = points[np.argmin(np.einsum("ij,ij->i", points, points))]
        distance, azimuth, elevation = spherical(nearest)
        width = float(
            np.sort(np.ptp(body.mesh.bounds, axis=0))[1]
        )  # of a plate its shorter side, of a pole its thickness
        if width < spacing * distance and pattern(azimuth, elevation) ** 2 > 10 ** (PATTERN_FLOOR_TWO_WAY_DB / 10):
            _advised.add(key)
            thin.append((*key, width, float(spacing * distance)))
    for row in thin[:_MOST]:
        _log.warning(
            "object %r (id %d) is %.2g m thick and the rays are %.2g m apart where it stands: its echo is a matter "
            "of chance; give it `aim: 2000` or use more rays",
            *row,
        )
    if len(thin) > _MOST:
        _log.warning("so it is with %d more objects, %r (id %d) the last of them", len(thin) - _MOST, *thin[-1][:2])
