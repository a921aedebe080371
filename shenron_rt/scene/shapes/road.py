"""Things along a road: ground, wall, pole, guard rail. Bases on z = 0, centred in x and y."""

from __future__ import annotations

import numpy as np

from ...tags import SemanticTag
from ._piece import Piece, box, grid, revolve, segments

__all__ = ["ground", "guard_rail", "pole", "wall"]

# W-beam of EN 1317 / AASHTO M 180 type rails: 312 mm tall, 81 mm deep, two crests (common catalogue dimensions).
_BEAM_HEIGHT = 0.312
_BEAM_DEPTH = 0.081
# Strips of 1.3 mm across waves of 15 mm radius: sagittas of 14 um, a phase of 0.05 rad there and back at 77 GHz.
_BEAM_ROWS = 241
_POST_SPACING = 2.0


def ground(l: float, w: float) -> list[Piece]:  # noqa: E741 - the interface's name
    """Return a level ground in z = 0 facing up: ``l`` along x, ``w`` along y [m], asphalt, two triangles."""
    x, y = l / 2.0, w / 2.0
    lattice = np.array([[[-x, -y, 0.0], [x, -y, 0.0]], [[-x, y, 0.0], [x, y, 0.0]]])
    return [Piece("ground", "asphalt", SemanticTag.Ground, *grid(lattice))]


def wall(l: float, h: float, t: float = 0.3) -> list[Piece]:  # noqa: E741 - the interface's name
    """Return a closed concrete wall: ``l`` along x, ``t`` thick along y, ``h`` tall from z = 0 [m]."""
    vertices, faces = box(l, t, h)
    return [Piece("wall", "concrete", SemanticTag.Walls, vertices + np.array([0.0, 0.0, h / 2.0]), faces)]


def pole(h: float = 6.0, r: float = 0.08) -> list[Piece]:
    """Return a closed round metal pole of height ``h`` and radius ``r`` [m]."""
    n = segments(r)
    vertices, faces = revolve([[0.0, 0.0], [r, 0.0], [r, h], [0.0, h]], n)
    return [Piece("pole", "metal", SemanticTag.Poles, vertices, faces)]


def guard_rail(l: float = 20.0, h: float = 0.75) -> list[Piece]:  # noqa: E741 - the interface's name
    """Return a steel guard rail of length ``l`` along x, top edge at ``h`` [m], traffic side -y.

    A W-beam of 312 mm x 81 mm as an open sheet, on box posts every 2 m.
    """
    s = np.linspace(0.0, 1.0, _BEAM_ROWS)
    # Two crests toward the traffic and a valley between: one and a half periods would leave the edges forward.
    y = -0.5 * _BEAM_DEPTH * (1.0 - np.cos(4.0 * np.pi * s))
    z = h - _BEAM_HEIGHT * (1.0 - s)
    lattice = np.stack([np.stack([np.full_like(s, x), y, z], axis=1) for x in (-l / 2.0, l / 2.0)], axis=1)
    pieces = [Piece("beam", "metal", SemanticTag.GuardRail, *grid(lattice))]
    count = max(2, int(np.floor(l / _POST_SPACING)) + 1)
    width, depth = 0.06, 0.10
    vertices, faces = box(width, depth, h)
    reach = min(l / 2.0 - width / 2.0, (count - 1) * _POST_SPACING / 2.0)
    for k, x in enumerate(np.linspace(-reach, reach, count)):
        shifted = vertices + np.array([float(x), depth / 2.0, h / 2.0])
        pieces.append(Piece(f"post {k + 1}", "metal", SemanticTag.GuardRail, shifted, faces))
    return pieces
