"""Corners of perfectly conducting plates at right angles: bounces by optics, currents by physical optics, all exact."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise, permutations
from typing import NamedTuple

import numpy as np

from ..._typing import ArrayLike, ComplexArray, FloatArray
from ...errors import InputError, did_you_mean
from ._look import Look, look_from
from .polygon import clip_convex, polygon_area, polygon_transform

__all__ = [
    "TRIHEDRALS",
    "Corner",
    "dihedral_corner",
    "dihedral_scattering_matrix",
    "trihedral_corner",
    "trihedral_scattering_matrix",
]

#: Kinds of trihedral by the outline of their plates: right isosceles triangle, square, quarter disc.
TRIHEDRALS = ("triangular", "square", "circular")

#: Cosine to a plate's normal below which no wave reaches it: half a micrometre on a plate of 500 m.
_GRAZING = 1e-9
#: Arcs of quarter discs become chords whose sagitta is this part of a wavelength.
_CHORD = 1.0 / 1600.0


class Corner(NamedTuple):
    """Convex plates in coordinate planes of a frame of their own.

    Plate i lies in the plane x_i = 0, faces +x_i and reaches no negative x_j where j is another plate. ``outlines[i]``
    (n, 2) [m] runs counter-clockwise in the coordinates (x_{i+1}, x_{i+2}), indices modulo 3. ``axes`` (3, 3): rows are
    the frame's axes in the target's frame.
    """

    outlines: tuple[FloatArray, ...]
    axes: FloatArray


def dihedral_corner(a: float, b: float, h: float) -> Corner:
    """Return the dihedral with its seam of length h on z, plate a along azimuth -45 deg, plate b along +45 [m]."""
    for name, value in (("a", a), ("b", b), ("h", h)):
        _positive(f"dihedral's {name}", value)
    z = 0.5 * h
    s = math.sqrt(0.5)
    # x_0 runs out along plate a, x_1 along plate b, x_2 up: plate b is number 0 and plate a number 1
    plate_b = np.array([[0.0, -z], [b, -z], [b, z], [0.0, z]])
    plate_a = np.array([[-z, 0.0], [z, 0.0], [z, a], [-z, a]])
    return Corner((plate_b, plate_a), np.array([[s, -s, 0.0], [s, s, 0.0], [0.0, 0.0, 1.0]]))


def trihedral_corner(kind: str, leg: float, wavelength: float) -> Corner:
    """Return a trihedral with apex at the origin, boresight +x and one inner edge in the x-z plane with z > 0.

    ``wavelength`` [m] sets how finely the arcs of ``circular`` are cut; their polygons have the quarter disc's area.
    """
    if kind not in TRIHEDRALS:
        raise InputError(f"unknown trihedral {kind!r}; {did_you_mean(kind, TRIHEDRALS)}")
    _positive("trihedral's leg", leg)
    if kind == "triangular":
        rim = np.array([[leg, 0.0], [0.0, leg]])
    elif kind == "square":
        rim = np.array([[leg, 0.0], [leg, leg], [0.0, leg]])
    else:
        chord = min(math.sqrt(8.0 * _CHORD * wavelength / leg), math.pi / 64.0)
        n = math.ceil(0.5 * math.pi / chord)
        angle = np.linspace(0.0, 0.5 * math.pi, n + 1)
        step = 0.5 * math.pi / n
        rim = leg * math.sqrt(step / math.sin(step)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    outline = np.concatenate([np.zeros((1, 2)), rim])
    # (x, y, z) of the plates' frame = Rz(45 deg) Ry(-35.26 deg) (x, y, z) of the target's
    x, y, z = math.sqrt(1.0 / 3.0), math.sqrt(0.5), math.sqrt(1.0 / 6.0)
    return Corner((outline,) * 3, np.array([[x, -y, -z], [x, y, -z], [x, 0.0, 2.0 * z]]))


def _positive(what: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"{what} is {value!r} m; give a length above 0")


def chains(plates: int, bounces: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
    """Yield the ordered plates of every path with one of these numbers of bounces: no plate is met twice."""
    for order in bounces:
        yield from permutations(range(plates), order)


def footprint(corner: Corner, chain: tuple[int, ...], source: FloatArray, at_infinity: bool) -> FloatArray:
    """Return the part of the last plate that is lit by way of the others, (m, n, 2) [m] in its own coordinates.

    ``source`` (m, 3): where the wave comes from, in the corner's frame: a point [m], or a direction ``at_infinity``.
    """
    lit = np.broadcast_to(corner.outlines[chain[0]], (len(source), *corner.outlines[chain[0]].shape))
    for here, there in pairwise(chain):
        source = source * np.where(np.arange(3) == here, -1.0, 1.0)  # its image behind the plate
        point = np.zeros((*lit.shape[:2], 3))
        point[..., (here + 1) % 3], point[..., (here + 2) % 3] = lit[..., 0], lit[..., 1]
        ray = -source[:, None, :] if at_infinity else point - source[:, None, :]
        point = point - point[..., there, None] / ray[..., there, None] * ray
        flat = np.stack([point[..., (there + 1) % 3], point[..., (there + 2) % 3]], axis=-1)
        lit = clip_convex(flat, corner.outlines[there])
    return lit


def incident(chain: tuple[int, ...], direction: FloatArray, field: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return direction (..., 3) and fields (..., p, 3) of the wave that meets the last plate: E' = -E + 2 n (n.E)."""
    for plate in chain[:-1]:
        mirror = np.where(np.arange(3) == plate, -1.0, 1.0)
        direction, field = direction * mirror, -field * mirror
    return direction, field


def radiated(plate: int, direction: FloatArray, field: FloatArray, receive: FloatArray) -> FloatArray:
    """Return e.(n x (d x E)), the current's part along the receiver's basis: (..., receive, transmit)."""
    along = np.einsum("...ri,...i->...r", receive, direction)
    across = np.einsum("...ri,...ti->...rt", receive, field)
    return np.asarray(along[..., :, None] * field[..., None, :, plate] - across * direction[..., None, None, plate])


def scattering_matrix(corner: Corner, look: Look, wavelength: float, bounces: tuple[int, ...]) -> ComplexArray:
    """Return the far-field matrices (m, 2, 2) [m] of a corner for directions (m, 3) in the target's frame."""
    k = 2.0 * math.pi / wavelength
    plates = len(corner.outlines)
    u, basis = look.to_radar @ corner.axes.T, look.basis @ corner.axes.T
    total = np.zeros((len(u), 2, 2), dtype=np.complex128)
    for chain in chains(plates, bounces):
        reached = np.all(u[:, list(chain)] > _GRAZING, axis=1)
        towards, receive = u[reached], basis[reached]
        last = chain[-1]
        lit = footprint(corner, chain, towards, at_infinity=True)
        direction, field = incident(chain, -towards, receive)
        w = k * (towards - direction)[:, [(last + 1) % 3, (last + 2) % 3]]
        integral = np.sign(polygon_area(lit)) * polygon_transform(lit, w)
        total[reached] += radiated(last, direction, field, receive) * integral[:, None, None]
    total[np.any(u[:, :plates] < -_GRAZING, axis=1)] = np.nan
    return 2.0 * math.sqrt(math.pi) / wavelength * total


def _sweep(
    corner: Corner, wavelength: float, azimuth: ArrayLike, elevation: ArrayLike, bounces: tuple[int, ...]
) -> ComplexArray:
    look = look_from(azimuth, elevation)
    shape = look.to_radar.shape[:-1]
    flat = Look(*(x.reshape(-1, 3) for x in look))
    return scattering_matrix(corner, flat, wavelength, bounces).reshape(*shape, 2, 2)


def dihedral_scattering_matrix(
    a: float,
    b: float,
    h: float,
    wavelength: float,
    azimuth: ArrayLike,
    elevation: ArrayLike = 0.0,
    *,
    bounces: tuple[int, ...] = (1, 2),
) -> ComplexArray:
    """Return the scattering matrix of a right dihedral, single and double bounce summed coherently.

    Parameters
    ----------
    a, b, h : float
        Widths of the plates along azimuth -45 and +45 deg, and length of their seam on the z axis. [m]
    wavelength : float
        Wavelength. [m]
    azimuth, elevation : array_like
        Direction of the radar seen from the target, broadcast to (...). [rad]
    bounces : tuple of int
        Which numbers of bounces count.

    Returns
    -------
    (..., 2, 2) complex [m]
        Amplitude, |amplitude|^2 = RCS, [receive, transmit] in the order V, H (increasing elevation, azimuth), phase
        referred to the origin. NaN outside -45 to +45 deg of azimuth, where a plate is seen from behind.

    Notes
    -----
    As :func:`trihedral_scattering_matrix`. Across the seam the double bounce has opposite signs in VV and HH.
    """
    return _sweep(dihedral_corner(a, b, h), wavelength, azimuth, elevation, bounces)


def trihedral_scattering_matrix(
    kind: str,
    leg: float,
    wavelength: float,
    azimuth: ArrayLike,
    elevation: ArrayLike = 0.0,
    *,
    bounces: tuple[int, ...] = (1, 2, 3),
) -> ComplexArray:
    """Return the scattering matrix of a trihedral corner, single, double and triple bounces summed coherently.

    Parameters
    ----------
    kind : {"triangular", "square", "circular"}
        Outline of its plates; circular is a quarter disc.
    leg : float
        Length of the inner edges. [m]
    wavelength : float
        Wavelength. [m]
    azimuth, elevation : array_like
        Direction of the radar seen from the apex, broadcast to (...); boresight is 0, 0. [rad]
    bounces : tuple of int
        Which numbers of bounces count.

    Returns
    -------
    (..., 2, 2) complex [m]
        Amplitude, |amplitude|^2 = RCS, [receive, transmit] in the order V, H (increasing elevation, azimuth), phase
        referred to the apex. NaN outside the octant that the plates enclose.

    Raises
    ------
    InputError
        For an unknown kind, or a leg that is not above 0.

    Notes
    -----
    The wave reflects specularly, E' = -E + 2 n (n.E), along every ordered chain of plates. The last plate of a chain
    carries J = 2 n x H on the part that is lit by way of the others: each plate's lit part moves along the ray to the
    next plate and is clipped to it. From inside the octant no plate hides another, from the wave or from the receiver.
    With the incident direction d of the last hit and the direction u to the radar,

        amplitude = (2 sqrt(pi)/lambda) sum over chains of e.(n x (d x E)) * integral of e^{-j k (d - u).r} dA,

    each integral exact (:func:`polygon_transform`). This is what a shooting-and-bouncing-rays solver converges to, not
    the full-wave answer: that differs by 0.1 dB at boresight of a triangular corner of ten wavelengths, by 0.8 dB at
    five, and by 1.5 to 1.9 dB for square corners of six to four. Physical optics is not reciprocal beyond one bounce:
    HV and VH differ, by up to -41 dB of the peak for legs of 26 wavelengths. In a wave that exactly grazes a plate,
    that plate does not take part.

    Arcs of the circular kind are chords with a sagitta of a 1600th of a wavelength: finer ones change no amplitude by
    more than 1e-5 of the largest. 1 s for 185 directions of it, 15 ms for those of the others.
    """
    return _sweep(trihedral_corner(kind, leg, wavelength), wavelength, azimuth, elevation, bounces)
