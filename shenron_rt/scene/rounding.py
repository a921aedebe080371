"""Meshes whose facets stand for a round surface: the surface back from them, as finely as a wavelength asks.

Every edge becomes a quadratic curve that leaves its ends at right angles to the normals there, and every face the
quadratic patch between its three curves (Nagata). An edge that two smooth surfaces share keeps to the tangent planes of
both, so that the rim of a cylinder stays on the cap. Patches are cut where they leave their chords, edge by edge, so
that neighbours agree and no crack opens.

References
----------
.. [1] T. Nagata, "Simple local interpolation of surfaces using normal vectors", Computer Aided Geometric Design 22(4),
   2005.
.. [2] N. Max, "Weights for computing vertex normals from facet normals", J. Graphics Tools 4(2), 1999.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._typing import BoolArray, FloatArray, IntArray
from ..errors import InputError
from .mesh import TaggedMesh
from .smooth import smooth_groups

__all__ = ["TooManyFacesError", "round_mesh"]

#: Normals at an edge that differ by less than about this are one: a curve of second degree cannot turn both ways [rad].
_ALIKE = 0.06
#: Longest distance of a curve's bend from its chord, in lengths of the chord: beyond it the normals contradict it.
_MOST_BEND = 0.125
#: Faces beyond which a mesh is refused.
_MOST_FACES = 20_000_000


class TooManyFacesError(InputError):
    """The round surface needs more faces than are allowed."""


def round_mesh(
    mesh: TaggedMesh, tolerance_m: float, *, below_deg: float = 30.0, most_faces: int | None = None
) -> TaggedMesh:
    """Return a mesh with its round surfaces cut finely; what is flat stays as it is.

    Parameters
    ----------
    mesh : TaggedMesh
        Its vertices stay where they are.
    tolerance_m : float
        How far the new facets may lie from the round surface [m]. For echoes, wavelength / 128 leaves phases of
        0.1 rad.
    below_deg : float
        Faces that meet at less than this belong to one round surface, as do those connected through such; edges that
        bend more stay edges. 0 to 90.
    most_faces : int, optional
        Of the result; a finer one is refused while it is made. 20 million.

    Returns
    -------
    TaggedMesh
        Parts and their order as before.

    Raises
    ------
    InputError
        A tolerance or an angle out of bounds; as :class:`TooManyFacesError` where more faces are needed.

    Notes
    -----
    Normals come from the facets, weighted as in [2]_, for each round surface by itself; those a file gives are not
    read.
    """
    if not (np.isfinite(tolerance_m) and tolerance_m > 0.0):
        raise InputError(f"round_mesh: tolerance_m {tolerance_m}; a finite length above 0 is needed [m]")
    if not 0.0 < below_deg <= 90.0:
        raise InputError(f"round_mesh: below_deg {below_deg}; allowed: above 0, to 90")
    patch = _patches(mesh, np.radians(below_deg))
    face, place = _cut(patch, tolerance_m, _MOST_FACES if most_faces is None else most_faces)
    points = _at(mesh.vertices[mesh.faces][face[:, None]], patch[face[:, None]], place)
    corners = np.arange(3 * len(face)).reshape(-1, 3)
    loose = replace(mesh, vertices=points.reshape(-1, 3), faces=corners, part=mesh.part[face])
    _, first, faces = np.unique(loose.corner, return_index=True, return_inverse=True)
    return replace(loose, vertices=loose.vertices[first], faces=faces.reshape(-1, 3))


def _patches(mesh: TaggedMesh, below: float) -> FloatArray:
    """Return (f, 3, 3) the bends c of the curves x(t) = a + (b - a) t - c t (1 - t) along the edges of each face."""
    corner, group = mesh.corner, smooth_groups(mesh, below=below)
    normal = _corner_normals(mesh, corner, group)
    following = np.roll(corner, -1, axis=1)
    low, high = np.minimum(corner, following), np.maximum(corner, following)
    _, edge = np.unique(low * (int(corner.max()) + 1) + high, return_inverse=True)
    edge = edge.ravel()
    chord = (np.roll(mesh.vertices[mesh.faces], -1, axis=1) - mesh.vertices[mesh.faces]).reshape(-1, 3)
    # n . c = n . d where the curve leaves, -n . d where it arrives: least squares over the faces that share the edge
    matrix, wanted = np.zeros((int(edge.max()) + 1, 3, 3)), np.zeros((int(edge.max()) + 1, 3))
    for n, sign in ((normal, 1.0), (np.roll(normal, -1, axis=1), -1.0)):
        n = n.reshape(-1, 3)
        np.add.at(matrix, edge, n[:, :, None] * n[:, None, :])
        np.add.at(wanted, edge, sign * np.einsum("ei,ei->e", n, chord)[:, None] * n)
    bend = _least_squares(matrix, wanted)[edge]
    too_far = np.linalg.norm(bend, axis=1) > 4.0 * _MOST_BEND * np.linalg.norm(chord, axis=1)
    bend[too_far] = 0.0
    return bend.reshape(-1, 3, 3)


def _corner_normals(mesh: TaggedMesh, corner: IntArray, group: IntArray) -> FloatArray:
    """Return (f, 3, 3) unit normals of the smooth surfaces at the corners of faces, either side.

    Faces there may be wound either way: they are turned to the axis along which they agree best. The weights make the
    normals of any mesh with its vertices on a sphere exact.
    """
    _, place = np.unique(corner * (int(group.max()) + 1) + group[:, None], return_inverse=True)
    place, n = place.ravel(), int(place.max()) + 1
    points = mesh.vertices[mesh.faces]
    ahead, behind = np.roll(points, -1, axis=1) - points, np.roll(points, 1, axis=1) - points
    lengths = np.einsum("fki,fki->fk", ahead, ahead) * np.einsum("fki,fki->fk", behind, behind)
    weight = (2.0 * mesh.face_area[:, None] / lengths).ravel()  # sine of the angle over the sides [2]
    normal = np.repeat(mesh.face_normal, 3, axis=0)
    square = np.zeros((n, 3, 3))
    np.add.at(square, place, weight[:, None, None] * normal[:, :, None] * normal[:, None, :])
    axis = np.linalg.eigh(square)[1][:, :, 2]
    turned = np.sign(np.einsum("ci,ci->c", normal, axis[place])) * weight
    total: FloatArray = np.stack([np.bincount(place, turned * normal[:, k], n) for k in range(3)], axis=1)
    total /= np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)
    return np.asarray(total[place].reshape(-1, 3, 3))


def _least_squares(matrix: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return (n, 3) the shortest c with matrix c = wanted, leaving out directions the normals hardly tell apart."""
    size, axis = np.linalg.eigh(matrix)
    along = np.einsum("nik,ni->nk", axis, wanted)
    clear = size > (_ALIKE / 2.0) ** 2 * size[:, 2:]
    part = np.divide(along, size, out=np.zeros_like(along), where=clear)
    return np.asarray(np.einsum("nik,nk->ni", axis, part))


def _at(points: FloatArray, bend: FloatArray, place: FloatArray) -> FloatArray:
    """Return places (..., 3) on patches with corners (..., 3, 3) at barycentric coordinates (..., 3)."""
    following = np.roll(place, -1, axis=-1)
    flat = np.einsum("...k,...ki->...i", place, points)
    return np.asarray(flat - np.einsum("...k,...ki->...i", place * following, bend))


def _cut(bend: FloatArray, tolerance: float, most: int) -> tuple[IntArray, FloatArray]:
    """Cut patches at the middles of their edges until none leaves its chord by more than the tolerance.

    Returns
    -------
    face : (m,) int
        The patch each triangle lies on.
    place : (m, 3, 3) float
        Barycentric coordinates of its corners there.
    """
    done: list[tuple[IntArray, FloatArray]] = []
    face = np.arange(len(bend))
    place = np.broadcast_to(np.eye(3), (len(bend), 3, 3))
    count = 0
    while len(face):
        step = np.roll(place, -1, axis=1) - place
        off = np.einsum("mek,mki->mei", step * np.roll(step, -1, axis=2), bend[face]) / 4.0
        open_ = np.linalg.norm(off, axis=2) > tolerance
        fine = ~open_.any(axis=1)
        done.append((face[fine], place[fine]))
        count += int(fine.sum())
        if count + int(open_.sum()) + int((~fine).sum()) > most:  # an open edge makes a face more of its triangle
            raise TooManyFacesError(
                f"round_mesh: a tolerance of {tolerance:g} m needs more than {most} faces; take a larger one"
            )
        face, place = _split(face[~fine], place[~fine], open_[~fine])
    return np.concatenate([f for f, _ in done]), np.concatenate([p for _, p in done])


def _split(face: IntArray, place: FloatArray, open_: BoolArray) -> tuple[IntArray, FloatArray]:
    """Cut triangles in two, three or four at the middles of the edges that are open."""
    number = open_.sum(axis=1)
    # turned so that a single open edge is the first, and the first two are open where two are
    first = np.where(number == 2, (np.argmin(open_, axis=1) + 1) % 3, np.argmax(open_, axis=1))
    order = (first[:, None] + np.arange(3)) % 3
    a, b, c = (place[np.arange(len(place)), order[:, k]] for k in range(3))
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    cuts = {
        1: ((a, ab, c), (ab, b, c)),
        2: ((ab, b, bc), (a, ab, bc), (a, bc, c)),
        3: ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)),
    }
    faces, places = [], []
    for count, triangles in cuts.items():
        rows = np.flatnonzero(number == count)
        faces.append(np.repeat(face[rows], len(triangles)))
        places.append(np.stack([np.stack([p[rows] for p in t], axis=1) for t in triangles], axis=1).reshape(-1, 3, 3))
    return np.concatenate(faces), np.concatenate(places)
