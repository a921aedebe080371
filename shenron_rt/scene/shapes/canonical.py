"""Bodies with a closed-form radar cross section: plate, disc, sphere, cylinder, box, dihedral, trihedrals.

Frames are those of the reference tables' counterparts in the interface: plates lie in y-z and face +x; corners open
toward +x with seam or apex at the origin; round bodies and boxes are centred there.
"""

from __future__ import annotations

import numpy as np

from ..._typing import FloatArray, IntArray
from ...errors import InputError
from ...frames import rotation_matrix
from ...tags import SemanticTag
from ._piece import Piece, box, geodesic, geodesic_frequency, polygon, segments

__all__ = ["box_shape", "cylinder", "dihedral", "disc", "plate", "sphere", "trihedral"]

# A sphere finer than this is a typing error in `edge`, not a wish: 2 million facets need 0.5 GB while tracing.
_MOST_FACETS = 2_000_000
# Without `edge` no sphere takes more than 20 * 128^2 facets; from r = 0.18 m on they are longer than LATTICE.
_FINEST_DEFAULT = 128

_QUAD = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)


def _metal(name: str, surface: tuple[FloatArray, IntArray]) -> Piece:
    vertices, faces = surface
    return Piece(name, "metal", SemanticTag.Other, np.asarray(vertices, dtype=np.float64), faces.astype(np.int32))


def plate(a: float, b: float) -> list[Piece]:
    """Return a plate in the y-z plane facing +x: ``a`` along y, ``b`` along z [m]."""
    y, z = a / 2.0, b / 2.0
    corners = np.array([[0.0, -y, -z], [0.0, y, -z], [0.0, y, z], [0.0, -y, z]])
    return [_metal("plate", (corners, _QUAD))]


def disc(r: float, edge: float | None = None) -> list[Piece]:
    """Return a disc of radius ``r`` [m] in the y-z plane facing +x, its area exactly pi r^2."""
    n = segments(r, edge)
    rim = np.column_stack([np.zeros(n), polygon(r, n)])
    return [_metal("disc", _fan(rim, np.zeros(3)))]


def sphere(r: float, edge: float | None = None) -> list[Piece]:
    """Return a sphere of radius ``r`` [m] about the origin.

    Facets are nearly equal triangles with a mean side of ``edge`` [m]; by default below half a wavelength at 81 GHz
    and so flat that the sagitta s^2 / (8 r) stays under a 600th of the wavelength: 101 k facets at r = 0.1 m.
    """
    n = geodesic_frequency(r, edge)
    if edge is None:
        n = min(n, _FINEST_DEFAULT)
    if 20 * n * n > _MOST_FACETS:
        raise InputError(f"sphere: edge={edge:g} m asks for {20 * n * n} facets; at most {_MOST_FACETS} are built")
    vertices, faces = geodesic(n)
    return [_metal("sphere", (vertices * r, faces))]


def cylinder(r: float, l: float, edge: float | None = None) -> list[Piece]:  # noqa: E741 - the interface's name
    """Return a capped cylinder about the origin, axis z, radius ``r``, length ``l`` [m]."""
    n = segments(r, edge)
    ring = polygon(r, n)
    low = np.column_stack([ring, np.full(n, -l / 2.0)])
    high = np.column_stack([ring, np.full(n, l / 2.0)])
    here, there = np.arange(n), (np.arange(n) + 1) % n
    centre_low, centre_high = np.full(n, 2 * n), np.full(n, 2 * n + 1)
    faces = np.concatenate(
        [
            np.stack([here, there, n + there], axis=1),
            np.stack([here, n + there, n + here], axis=1),
            np.stack([centre_low, there, here], axis=1),
            np.stack([centre_high, n + here, n + there], axis=1),
        ]
    )
    ends = np.array([[0.0, 0.0, -l / 2.0], [0.0, 0.0, l / 2.0]])
    return [_metal("cylinder", (np.concatenate([low, high, ends]), faces))]


def box_shape(l: float, w: float, h: float) -> list[Piece]:  # noqa: E741 - the interface's name
    """Return a closed box about the origin: ``l`` along x, ``w`` along y, ``h`` along z [m]."""
    return [_metal("box", box(l, w, h))]


def dihedral(a: float, b: float, h: float) -> list[Piece]:
    """Return two plates at right angles, seam of length ``h`` on z through the origin, open toward +x [m].

    Plate ``a`` runs along azimuth -45 deg, plate ``b`` along +45 deg; both face the inside of the corner.
    """
    out_a, out_b = (np.array([np.cos(t), np.sin(t), 0.0]) for t in np.radians([-45.0, 45.0]))
    bottom, top = np.array([0.0, 0.0, -h / 2.0]), np.array([0.0, 0.0, h / 2.0])
    plate_a = np.array([bottom, top, top + a * out_a, bottom + a * out_a])
    plate_b = np.array([bottom, bottom + b * out_b, top + b * out_b, top])
    return [_metal("plate a", (plate_a, _QUAD)), _metal("plate b", (plate_b, _QUAD))]


def trihedral(form: str, a: float, edge: float | None = None) -> list[Piece]:
    """Return three plates at right angles, apex at the origin, boresight +x, inner edges of length ``a`` [m].

    ``form`` is ``triangular``, ``square`` or ``circular``. One inner edge lies in the x-z plane with z > 0; the frame
    of the reference tables, plates in the coordinate planes, is Rz(45) Ry(-35.264) of this one.
    """
    if form == "triangular":
        outline = np.array([[a, 0.0], [0.0, a]])
    elif form == "square":
        outline = np.array([[a, 0.0], [a, a], [0.0, a]])
    else:
        n = max(3, segments(a, edge) // 4)
        # The corner stays at radius a; area a^2 n sin(pi/2n)/2 is within 1e-4 of the quarter disc at the default.
        angle = np.linspace(0.0, np.pi / 2.0, n + 1)
        outline = a * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    tilt = np.degrees(np.arctan(np.sqrt(0.5)))
    to_here = rotation_matrix([45.0, tilt, 0.0]).T
    flat = np.concatenate([np.zeros((1, 2)), outline])
    faces = np.stack([np.zeros(len(outline) - 1), np.arange(1, len(outline)), np.arange(2, len(flat))], axis=1)
    pieces = []
    for normal_axis, name in enumerate(("plate x", "plate y", "plate z")):
        corner = np.zeros((len(flat), 3))
        # Cyclic order of the two in-plane axes makes each plate face the inside of the corner.
        corner[:, (normal_axis + 1) % 3], corner[:, (normal_axis + 2) % 3] = flat[:, 0], flat[:, 1]
        pieces.append(_metal(name, (corner @ to_here.T, faces.astype(np.int32))))
    return pieces


def _fan(rim: FloatArray, centre: FloatArray) -> tuple[FloatArray, IntArray]:
    """Triangles from a centre to consecutive rim points (n, 3), counter-clockwise as the rim runs."""
    n = len(rim)
    here = np.arange(n)
    faces = np.stack([np.full(n, n), here, (here + 1) % n], axis=1)
    return np.concatenate([rim, centre[None]]), faces
