"""Ready-made shapes, from a text: canonical radar targets, road furniture, plants, people, vehicles."""

from __future__ import annotations

import math

import numpy as np

from ..mesh import Part, TaggedMesh
from . import canonical, people, road, vegetation
from ._piece import Piece, Wheel
from ._text import Recipe, parse
from .bicycle import bicycle, bicycle_wheels, ridden
from .car import car, car_wheels
from .truck import truck, truck_wheels

__all__ = ["SHAPES", "Wheel", "make_jointed", "make_shape", "wheels_of"]

#: Every shape by name.
SHAPES: dict[str, Recipe] = {
    "plate": Recipe(canonical.plate, ("a", "b")),
    "disc": Recipe(canonical.disc, ("r",), {"edge": math.nan}),
    "sphere": Recipe(canonical.sphere, ("r",), {"edge": math.nan}),
    "cylinder": Recipe(canonical.cylinder, ("r", "l"), {"edge": math.nan}),
    "box": Recipe(canonical.box_shape, ("l", "w", "h")),
    "dihedral": Recipe(canonical.dihedral, ("a", "b", "h")),
    "trihedral": Recipe(canonical.trihedral, ("a",), {"edge": math.nan}, forms=("triangular", "square", "circular")),
    "ground": Recipe(road.ground, ("l", "w")),
    "wall": Recipe(road.wall, ("l", "h"), {"t": 0.3}),
    "pole": Recipe(road.pole, (), {"h": 6.0, "r": 0.08}),
    "guard_rail": Recipe(road.guard_rail, (), {"l": 20.0, "h": 0.75}),
    "tree": Recipe(vegetation.tree, (), {"h": 8.0, "crown": math.nan}),
    "car": Recipe(car),
    "truck": Recipe(truck),
    "bicycle": Recipe(bicycle),
    "pedestrian": Recipe(people.pedestrian, (), {"h": 1.75, "stride": 0.6}),
}


def wheels_of(name: str) -> tuple[Wheel, ...]:
    """Return the wheels of a ready-made shape; none where it has none."""
    known = {"car": car_wheels, "truck": truck_wheels, "bicycle": bicycle_wheels}
    return known[name]() if name in known else ()


def make_jointed(text: str) -> tuple[TaggedMesh, float]:
    """Return a ready-made shape in pieces that can move by themselves, and its height [m].

    The pedestrian stands straight and is cut at hips, knees, shoulders and elbows; the bicycle has a piece for each
    rim and tyre; all others are as they are.

    Raises
    ------
    InputError
        As :func:`make_shape`.
    """
    name, parameters = parse(text, SHAPES)
    if name == "pedestrian":
        height = float(parameters.get("h", SHAPES[name].optional["h"]))
        mesh = _assemble(name, str(text).strip(), people.walker(height))
    else:
        mesh = _assemble(name, text, ridden()) if name == "bicycle" else make_shape(text)
    return mesh, float(mesh.bounds[1, 2])


def make_shape(text: str) -> TaggedMesh:
    """Build a ready-made shape.

    Parameters
    ----------
    text : str
        ``name``, then after a colon sizes in metres as ``AxBxC`` or ``key=value``, separated by commas; see
        :data:`SHAPES` for names and keys.

    Returns
    -------
    TaggedMesh
        In the shape's own frame (ROS axes): canonical targets about or from the origin as the interface says, all
        else standing on z = 0, vehicles and people facing +x. Each part has a tag and the name of its material.

    Raises
    ------
    InputError
        An unknown shape or parameter, a missing or unusable size; the message lists what is allowed.

    Examples
    --------
    >>> mesh = make_shape("plate:0.2x0.1")
    >>> mesh.n_faces, round(float(mesh.face_area.sum()), 6), mesh.parts[0].em_material
    (2, 0.02, 'metal')
    """
    name, parameters = parse(text, SHAPES)
    return _assemble(name, str(text).strip(), SHAPES[name].build(**parameters))


def _assemble(name: str, text: str, pieces: list[Piece]) -> TaggedMesh:
    offsets = np.cumsum([0, *(len(p.vertices) for p in pieces[:-1])])
    parts = tuple(
        Part(object=name, group=p.name, material=p.material, file=text, tag=p.tag, rule="shape", em_material=p.material)
        for p in pieces
    )
    return TaggedMesh(
        vertices=np.concatenate([p.vertices for p in pieces]),
        faces=np.concatenate([p.faces + int(k) for p, k in zip(pieces, offsets, strict=True)]),
        part=np.repeat(np.arange(len(pieces), dtype=np.int32), [len(p.faces) for p in pieces]),
        parts=parts,
    )
