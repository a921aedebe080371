"""Which bodies of a scene a viewer gets."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from .poses import PlacedBody

__all__ = ["MAX_TRIANGLES", "drawable"]

_log = logging.getLogger(__name__)

#: Triangles that a viewer in a browser draws smoothly; a point of a message takes 27 bytes.
MAX_TRIANGLES = 1_000_000


def drawable(bodies: Sequence[PlacedBody], limit: int = MAX_TRIANGLES) -> list[PlacedBody]:
    """Return as many bodies as a viewer can take, the smallest first choice; what is left out is logged.

    Parameters
    ----------
    bodies : sequence of PlacedBody
    limit : int
        Triangles of all together.
    """
    sizes = np.array([len(b.faces) for b in bodies], dtype=np.int64)
    order = np.argsort(sizes, kind="stable")
    kept = set(order[np.cumsum(sizes[order]) <= limit].tolist())
    left = [f"{b.label} ({len(b.faces)})" for k, b in enumerate(bodies) if k not in kept]
    if left:
        _log.warning("more than %d triangles: the viewer gets no mesh of %s", limit, ", ".join(left))
    return [b for k, b in enumerate(bodies) if k in kept]
