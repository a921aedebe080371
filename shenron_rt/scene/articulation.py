"""Parts of an actor that move by themselves: turning wheels, swinging limbs, anything that spins about an axis."""

from __future__ import annotations

import fnmatch
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from .._typing import IntArray
from ..config.scene import Actor, MeshSource
from ..errors import InputError
from .gait import walker_limbs
from .mesh import TaggedMesh
from .motion import BodyState
from .odometer import Ride
from .rotations import rotation_exp
from .shapes import make_jointed, make_shape, wheels_of

__all__ = ["Articulated", "Link", "Spin", "articulated"]


class LinkMotion(Protocol):
    """How a part moves in the frame of its body."""

    def at(self, ride: Ride) -> BodyState:
        """Return the motion that takes the part from where the mesh has it to where it is."""
        ...


@dataclass(frozen=True)
class Spin:
    """Rotation about a fixed axis.

    Parameters
    ----------
    center : (3,) float
        A point of the axis, body frame [m].
    axis : (3,) float
        Unit vector; the part turns about it in the right-hand sense.
    radius : float, optional
        Of a wheel that rolls without slipping: it turns at the forward speed of its hub over this [m].
    rate : float
        Of everything else [rad/s].
    """

    center: tuple[float, float, float]
    axis: tuple[float, float, float]
    radius: float | None = None
    rate: float = 0.0

    def at(self, ride: Ride) -> BodyState:
        """Return where the part is in the frame of its body, from where the mesh has it."""
        center, axis = np.array(self.center), np.array(self.axis)
        if self.radius is None:
            angle, rate = self.rate * ride.time, self.rate
        else:  # the hub is beside the middle: in a turn the outer wheel goes further
            left = self.center[1]
            angle = (ride.distance - left * ride.yaw) / self.radius
            rate = (ride.speed - left * ride.yaw_rate) / self.radius
        turned = rotation_exp(np.remainder(angle, 2.0 * np.pi) * axis)
        origin = center - turned @ center
        return BodyState(turned, origin, np.cross(rate * axis, origin - center), rate * axis)


@dataclass(frozen=True)
class Link:
    """A part of a body that is rigid in itself; ``motion`` None moves with the body."""

    name: str
    motion: LinkMotion | None = None


@dataclass(frozen=True, eq=False)
class Articulated:
    """A mesh and its links.

    Parameters
    ----------
    mesh : TaggedMesh
        As it is before any link has moved.
    links : tuple of Link
        The first is the body.
    part_link : (p,) int32
        Row of ``links`` for each part of the mesh.
    """

    mesh: TaggedMesh
    links: tuple[Link, ...]
    part_link: IntArray


def articulated(entry: MeshSource, mesh: TaggedMesh) -> Articulated:
    """Return the links of an entry.

    Parameters
    ----------
    entry : MeshSource
        Ready-made vehicles have wheels and the ready-made pedestrian limbs, where the entry is an actor that moves and
        its ``articulation`` is ``auto``; ``spinning_parts`` are added.
    mesh : TaggedMesh
        Of the entry.

    Raises
    ------
    InputError
        A spinning part whose name no part of the mesh has.
    """
    rules: list[tuple[str, LinkMotion]] = []
    if isinstance(entry, Actor):
        if entry.articulation == "auto" and entry.shape is not None and entry.moves:
            mesh, rules = _jointed(entry.shape)
        rules += [(p.part, _spin(p.center_m, p.axis, p.radius_m, p.rate_deg_s)) for p in entry.spinning_parts]
    links, link_of_part = [Link("body")], np.zeros(len(mesh.parts), dtype=np.int32)
    for pattern, motion in rules:
        mine = [k for k, p in enumerate(mesh.parts) if _is(pattern, p.group) or _is(pattern, p.object)]
        if not mine:
            names = ", ".join(dict.fromkeys(p.group or p.label for p in mesh.parts))
            raise InputError(f"{entry.name or 'actor'}: no part is named {pattern!r}; the mesh has: {names}")
        link_of_part[mine] = len(links)
        links.append(Link(pattern, motion))
    return Articulated(mesh, tuple(links), link_of_part)


def _is(pattern: str, name: str) -> bool:
    return fnmatch.fnmatchcase(name.lower(), pattern.lower())


def _spin(center: tuple[float, ...], axis: tuple[float, ...], radius: float | None, rate_deg_s: float) -> Spin:
    x, y, z = (float(v) for v in np.asarray(axis) / np.linalg.norm(axis))
    cx, cy, cz = (float(v) for v in center)
    return Spin((cx, cy, cz), (x, y, z), radius, float(np.radians(rate_deg_s)))


def _jointed(shape: str) -> tuple[TaggedMesh, list[tuple[str, LinkMotion]]]:
    """Return the mesh of a ready-made shape and the wheels or limbs it has."""
    name = shape.strip().partition(":")[0].strip()
    wheels: list[tuple[str, LinkMotion]] = [
        (w.part, Spin(w.center, (0.0, 1.0, 0.0), radius=w.radius)) for w in wheels_of(name)
    ]
    if not wheels and name != "pedestrian":
        return make_shape(shape), []
    mesh, height = make_jointed(shape)
    return mesh, wheels or list(walker_limbs(height).items())
