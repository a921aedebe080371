"""Hints on axes, units and handedness, on shapes whose fault is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shenron_rt.scene.mesh import Part, TaggedMesh, build_mesh, concatenate
from shenron_rt.scene.mesh_hints import mesh_hints
from shenron_rt.tags import SemanticTag as Tag

FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def box(size: tuple[float, float, float], tag: Tag, name: str = "", at: tuple[float, ...] = (0, 0, 0)) -> TaggedMesh:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * size + at
    return build_mesh(corners, FACES, Part(object=name, tag=tag))


def street() -> TaggedMesh:
    road = build_mesh([[0, -5, 0], [50, -5, 0], [50, 5, 0], [0, 5, 0]], [[0, 1, 2], [0, 2, 3]], Part(tag=Tag.Roads))
    walls = [box((10, 1, 8), Tag.Buildings, f"B_{k}", (20 * k, y, 0)) for k, y in enumerate((8, -9, 30))]
    return concatenate([road, *walls])


def mirrored(mesh: TaggedMesh) -> TaggedMesh:
    """The fault itself: y changes sign and nobody turns the faces."""
    return replace(mesh, vertices=mesh.vertices * [1, -1, 1])


def test_a_sound_street_gives_no_hint() -> None:
    assert mesh_hints(street()) == []


@pytest.mark.parametrize(("unit", "scale"), [("cm", 100.0), ("mm", 1000.0)])
def test_units_are_told_by_the_size_of_a_car(unit: str, scale: float) -> None:
    assert f"looks like {unit}" in mesh_hints(box((4.7 * scale, 1.9 * scale, 1.5 * scale), Tag.Car))[0]


def test_a_size_that_no_unit_explains_is_called_unusual() -> None:
    assert (
        "unusual size: a Pedestrians object is 0.5 x 0.5 x 30 m" in mesh_hints(box((0.5, 0.5, 30), Tag.Pedestrians))[0]
    )


def test_a_car_in_many_parts_counts_as_one() -> None:
    halves = [box((2.3, 1.9, 1.5), Tag.Car, "front", (2.3, 0, 0)), box((2.3, 1.9, 1.5), Tag.Car, "rear")]
    assert mesh_hints(concatenate(halves)) == []
    # two cars 3 m apart are two, not one of 12 m
    assert mesh_hints(concatenate([*halves, box((4.6, 1.9, 1.5), Tag.Car, "next", (7.6, 0, 0))])) == []


def test_roads_on_edge_are_told() -> None:
    turned = street().transformed([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    assert "looks like y-up: roads" in mesh_hints(turned)[0]
    assert "looks like x-up" in mesh_hints(street().transformed([[0, 0, 1], [0, 1, 0], [-1, 0, 0]]))[0]


def test_a_hillside_road_is_no_fault() -> None:
    c, s = np.cos(np.radians(12)), np.sin(np.radians(12))
    assert mesh_hints(street().transformed([[c, 0, -s], [0, 1, 0], [s, 0, c]])) == []


def test_mirroring_without_turning_the_faces_is_told_by_inward_windings() -> None:
    hints = mesh_hints(mirrored(street()))
    assert len(hints) == 1
    assert "3 of 3 closed parts have inward winding" in hints[0]
    assert mesh_hints(street().transformed(np.diag([1.0, -1.0, 1.0]))) == []  # turned properly: nothing to see


def test_road_strips_alone_tell_it_by_facing_down() -> None:
    road = street()
    road = road.select(road.face_tag == Tag.Roads)
    assert mesh_hints(road) == []
    assert "face down" in mesh_hints(mirrored(road))[0]


def test_open_shells_give_no_evidence_of_winding() -> None:
    open_box = box((10, 1, 8), Tag.Buildings)
    open_box = mirrored(open_box.select(np.arange(12) > 0))
    assert mesh_hints(open_box) == []


def test_a_properly_turned_but_mirrored_town_is_told_only_by_carlas_own_positions() -> None:
    town = street()
    wrong = town.transformed(np.diag([1.0, -1.0, 1.0]))
    centres = {p.object: b.mean(axis=0) for p, b in zip(town.parts, town.part_bounds(), strict=True) if p.object}
    # CARLA's y points right
    dump = [{"name": n, "location": {"x": c[0], "y": -c[1], "z": c[2]}} for n, c in centres.items()]
    assert mesh_hints(town, environment_objects=dump) == []
    assert mesh_hints(wrong) == []
    assert "mirrored: 3 objects lie at CARLA's y" in mesh_hints(wrong, environment_objects=dump)[0]
    nested = [{"name": e["name"], "transform": {"location": list(e["location"].values())}} for e in dump]
    assert "mirrored" in mesh_hints(wrong, environment_objects=nested)[0]


def test_a_lone_car_that_stands_on_end_or_faces_sideways_is_told() -> None:
    assert "longest side is y" in mesh_hints(box((1.9, 4.7, 1.5), Tag.Car))[0]
    assert "stands on end" in mesh_hints(box((1.9, 1.5, 4.7), Tag.Car))[0]
    assert "unusual height: the Car is 2.8 m" in mesh_hints(box((4.7, 1.9, 2.8), Tag.Car))[0]
