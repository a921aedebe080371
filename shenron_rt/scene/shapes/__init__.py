"""Ready-made shapes, from a text: canonical radar targets, road furniture, plants, people, vehicles."""

from __future__ import annotations

import math

import numpy as np

from ..mesh import Part, TaggedMesh
from . import canonical, people, road, vegetation
from ._piece import Piece
from ._text import Recipe, parse
from .bicycle import bicycle
from .car import car
from .truck import truck

__all__ = ["SHAPES", "make_shape"]

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
