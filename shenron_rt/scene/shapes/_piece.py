"""Building blocks of the ready-made shapes: a piece of surface, and the few ways to make one."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from ..._typing import ArrayLike, FloatArray, IntArray
from ...tags import SemanticTag

__all__ = [
    "LATTICE",
    "SAGITTA",
    "Piece",
    "Wheel",
    "box",
    "ellipsoid",
    "fine_edge",
    "geodesic",
    "geodesic_frequency",
    "grid",
    "join",
    "polygon",
    "revolve",
    "segments",
    "tube",
    "weld",
]

#: Largest distance between a facet and the curved surface it stands for [m]: a 600th of the wavelength at 77 GHz. Its
#: two-way phase, 0.02 rad, stays below what any other step of the chain adds.
SAGITTA = 6.5e-6
#: Longest facet on canonical bodies [m]. Flat facets repeat an error with their period d; an echo of order m of that
#: lattice comes back where 2 d sin(angle) = m lambda, so with d below lambda/2 at 81 GHz, 1.85 mm, there is none.
LATTICE = 1.7e-3

_SMALLEST_RING = 12


@dataclass(frozen=True)
class Wheel:
    """A wheel of a ready-made vehicle: it turns about an axle along y.

    Parameters
    ----------
    part : str
        Pattern that the names of its pieces match, ``*`` for any text.
    center : (3,) float
        Of its hub, frame of the shape [m].
    radius : float
        [m].
    """

    part: str
    center: tuple[float, float, float]
    radius: float


@dataclass(frozen=True)
class Piece:
    """A named patch of surface in the frame of its shape.

    Parameters
    ----------
    name : str
        Part name within the shape, such as ``"windscreen"``.
    material : str
        Name in the material catalogue.
    tag : SemanticTag
    vertices : (v, 3) float64 ndarray
        Metres, frame of the shape.
    faces : (f, 3) int32 ndarray
        Counter-clockwise seen from outside.
    """

    name: str
    material: str
    tag: SemanticTag
    vertices: FloatArray
    faces: IntArray

    def moved(self, xyz: ArrayLike, rotation: ArrayLike | None = None) -> Piece:
        """Return the piece turned by a (3, 3) rotation about the origin, then shifted by ``xyz`` [m]."""
        turned = self.vertices if rotation is None else self.vertices @ np.asarray(rotation, dtype=np.float64).T
        return replace(self, vertices=turned + np.asarray(xyz, dtype=np.float64))

    def mirrored(self) -> Piece:
        """Return the mirror image in y = 0, still facing outward."""
        return replace(self, vertices=self.vertices * [1.0, -1.0, 1.0], faces=self.faces[:, ::-1].copy())


def join(*patches: tuple[FloatArray, IntArray]) -> tuple[FloatArray, IntArray]:
    """Put (vertices, faces) patches into one pair without welding them."""
    offsets = np.cumsum([0, *(len(v) for v, _ in patches[:-1])])
    vertices = np.concatenate([v for v, _ in patches])
    faces = np.concatenate([f + o for (_, f), o in zip(patches, offsets, strict=True)]).astype(np.int32)
    return vertices, faces


def grid(points: ArrayLike, *, wrap: bool = False) -> tuple[FloatArray, IntArray]:
    """Triangulate a lattice of points.

    Parameters
    ----------
    points : (m, n, 3) array_like
        Metres. Facets face (step along n) x (step along m), so a lattice that runs counter-clockwise along n and
        upward along m faces outward.
    wrap : bool
        Join the last column to the first.

    Returns
    -------
    vertices : (m * n, 3) float64
    faces : (f, 3) int32
        Without the triangles that two coincident corners leave empty (poles of a sphere).
    """
    lattice = np.asarray(points, dtype=np.float64)
    m, n = lattice.shape[:2]
    index = np.arange(m * n).reshape(m, n)
    if wrap:
        index = np.concatenate([index, index[:, :1]], axis=1)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=2).reshape(-1, 3)
    vertices = lattice.reshape(-1, 3)
    p, q, r = (vertices[faces[:, k]] for k in range(3))
    area = 0.5 * np.linalg.norm(np.cross(q - p, r - p), axis=1)
    keep = area > 1e-12 * max(float(area.max(initial=0.0)), 1e-300)
    return vertices, faces[keep].astype(np.int32)


def segments(radius: float, edge: float | None = None) -> int:
    """Return into how many chords a circle of ``radius`` [m] is cut: no longer than ``edge`` or :func:`fine_edge`."""
    return max(_SMALLEST_RING, int(np.ceil(2.0 * np.pi * radius / (fine_edge(radius) if edge is None else edge))))


def fine_edge(radius: float) -> float:
    """Return the facet length [m] at which physical optics no longer tells a curved surface from its facets."""
    return float(min(np.sqrt(8.0 * radius * SAGITTA), LATTICE))


def polygon(radius: float, n: int) -> FloatArray:
    """Return the (n, 2) corners of the regular polygon that has the *area* of the circle of ``radius`` [m].

    Equal area keeps the specular peak of a disc, 4 pi A^2 / lambda^2, and the mean surface of a cylinder exact.
    """
    angle = 2.0 * np.pi * np.arange(n) / n
    circumradius = radius * np.sqrt(2.0 * np.pi / (n * np.sin(2.0 * np.pi / n)))
    corners: FloatArray = circumradius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return corners


def revolve(profile: ArrayLike, n: int) -> tuple[FloatArray, IntArray]:
    """Turn a profile about z.

    Parameters
    ----------
    profile : (m, 2) array_like
        Radius and height [m], from the bottom up; radius 0 at an end closes it. Facets face away from the axis.
    n : int
        Segments around.
    """
    curve = np.asarray(profile, dtype=np.float64)
    unit = polygon(1.0, n)
    ring = np.broadcast_to(unit, (len(curve), n, 2)) * curve[:, :1, None]
    height = np.broadcast_to(curve[:, 1, None, None], (len(curve), n, 1))
    return weld(*grid(np.concatenate([ring, height], axis=2), wrap=True))


def tube(path: ArrayLike, radius: ArrayLike, n: int) -> tuple[FloatArray, IntArray]:
    """Sweep a circle along a path and cap both ends.

    Parameters
    ----------
    path : (m, 3) array_like
        Centre line [m]; it must not run along the direction between its own side vectors (any gently bent path is
        fine).
    radius : float or (m,) array_like
        Metres.
    n : int
        Segments around.
    """
    centre = np.asarray(path, dtype=np.float64)
    r = np.broadcast_to(np.asarray(radius, dtype=np.float64), len(centre))
    along = np.gradient(centre, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    helper = np.eye(3)[int(np.argmin(np.abs(centre[-1] - centre[0])))]
    side = np.cross(helper, along)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(along, side)
    unit = polygon(1.0, n)
    ring = centre[:, None] + r[:, None, None] * (unit[:, :1] * side[:, None] + unit[:, 1:] * up[:, None])
    first, last = np.repeat(centre[None, :1], n, axis=1), np.repeat(centre[None, -1:], n, axis=1)
    return weld(*grid(np.concatenate([first, ring, last]), wrap=True))


def box(length: float, width: float, height: float) -> tuple[FloatArray, IntArray]:
    """Return a closed box centred at the origin, sides along x, y, z [m], 12 triangles."""
    bits = np.array([[i & 1, (i >> 1) & 1, (i >> 2) & 1] for i in range(8)], dtype=np.float64)
    quads = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    return (bits - 0.5) * [length, width, height], faces


def geodesic_frequency(radius: float, edge: float | None = None) -> int:
    """Return the subdivision of the icosahedron with a mean edge up to ``edge`` or :func:`fine_edge` [m]."""
    wanted = fine_edge(radius) if edge is None else edge
    # 20 n^2 facets of side s cover 4 pi r^2; an equilateral triangle has sqrt(3)/4 s^2.
    return max(1, int(np.ceil(radius * np.sqrt(4.0 * np.pi / (20.0 * np.sqrt(3.0) / 4.0)) / wanted)))


def geodesic(frequency: int) -> tuple[FloatArray, IntArray]:
    """Return a closed sphere of 20 n^2 nearly equal triangles, its volume that of the unit ball.

    Parameters
    ----------
    frequency : int
        n, the number of parts each edge of the icosahedron is cut into.
    """
    golden = (1.0 + np.sqrt(5.0)) / 2.0
    pairs = [(s, t * golden) for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
    corners = np.array([p for s, t in pairs for p in ((0.0, s, t), (s, t, 0.0), (t, 0.0, s))])
    gap = np.linalg.norm(corners[:, None] - corners[None], axis=2)
    near = np.abs(gap - 2.0) < 1e-9
    triples = np.array(list(itertools.combinations(range(12), 3)))
    i, j, k = triples.T
    base = triples[near[i, j] & near[j, k] & near[i, k]]
    a, b, c = (corners[base[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    base[inward] = base[inward][:, ::-1]
    n = frequency
    i, j = (g.ravel() for g in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
    i, j = i[i + j <= n], j[i + j <= n]
    weights = np.stack([n - i - j, i, j], axis=1) / n
    number = np.full((n + 2, n + 2), -1)
    number[i, j] = np.arange(len(i))
    up = np.stack([number[i, j], number[i + 1, j], number[i, j + 1]], axis=1)
    down = np.stack([number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]], axis=1)
    local = np.concatenate([up[(up >= 0).all(axis=1)], down[(down >= 0).all(axis=1)]])
    points = np.einsum("tk,fkc->ftc", weights, corners[base])
    points /= np.linalg.norm(points, axis=2, keepdims=True)
    faces = (local[None] + len(i) * np.arange(20)[:, None, None]).reshape(-1, 3)
    vertices, welded = weld(points.reshape(-1, 3), faces.astype(np.int32))
    p, q, r = (vertices[welded[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->i", p, np.cross(q, r)).sum() / 6.0
    return vertices * (4.0 * np.pi / 3.0 / volume) ** (1.0 / 3.0), welded


def ellipsoid(semi_axes: ArrayLike, frequency: int, centre: ArrayLike = (0.0, 0.0, 0.0)) -> tuple[FloatArray, IntArray]:
    """Return a closed ellipsoid: semi-axes along x, y, z [m], 20 n^2 triangles with corners on the surface."""
    vertices, faces = geodesic(frequency)
    vertices /= np.linalg.norm(vertices, axis=1, keepdims=True)
    return vertices * np.asarray(semi_axes, dtype=np.float64) + np.asarray(centre, dtype=np.float64), faces


def weld(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Merge vertices closer than a billionth of the extent; order of first appearance by position."""
    extent = float(np.ptp(vertices, axis=0).max())
    cell = np.round(vertices / (1e-9 * extent)) + 0.0
    _, first, inverse = np.unique(cell, axis=0, return_index=True, return_inverse=True)
    merged = inverse.reshape(-1)[faces].astype(np.int32)
    distinct = (merged[:, 0] != merged[:, 1]) & (merged[:, 1] != merged[:, 2]) & (merged[:, 2] != merged[:, 0])
    return vertices[first], merged[distinct]
