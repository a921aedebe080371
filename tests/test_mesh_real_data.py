"""The real meshes: CARLA-style exports, vehicles, street furniture, a ray tracer's street canyon."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from shenron_rt.frames import Pose
from shenron_rt.scene.mesh import TaggedMesh, concatenate
from shenron_rt.scene.mesh_hints import mesh_hints
from shenron_rt.scene.readers import read_mesh
from shenron_rt.scene.resolver import coverage, resolve_tags
from shenron_rt.tags import SemanticTag, parse_tag, tag_table

TOWN = ("carla_exporter_style/Town01_patch.obj", "carla_exporter")
TOWN_GLB = ("carla_exporter_style/Town01_patch_ue_gltf_layout.glb", "ue_gltf")


def load(folder: Path, name: str, **options) -> TaggedMesh:
    return resolve_tags(read_mesh(folder / name, **options))


def expected_rows(folder: Path) -> dict[str, dict[str, str]]:
    text = (folder / "carla_exporter_style" / "Town01_patch.expected.csv").read_text()
    return {row["object"]: row for row in csv.DictReader(text.splitlines())}


@pytest.mark.parametrize(("file", "frame"), [TOWN, TOWN_GLB])
def test_all_40_objects_of_the_town_get_their_tag(shared_data: Path, file: str, frame: str) -> None:
    mesh = load(shared_data, file, mesh_frame=frame)
    rows = expected_rows(shared_data)
    actor = [p.group if file.endswith(".obj") else p.object for p in mesh.parts]
    assert sorted(actor) == sorted(rows)
    assert {a: p.tag.name for a, p in zip(actor, mesh.parts, strict=True)} == {
        a: r["label_0914"] for a, r in rows.items()
    }
    assert all(parse_tag(r["label_0914"]) is tag_table("0.9.13").tag(int(r["tag_0913"])) for r in rows.values())
    # faces without area are the only ones missing
    assert mesh.n_faces + mesh.repaired["degenerate_faces"] == sum(int(r["n_tri"]) for r in rows.values())
    assert coverage(mesh).unlabelled_area_m2 == 0
    assert mesh_hints(mesh) == []


def test_both_town_exports_lie_at_the_same_place(shared_data: Path) -> None:
    obj, glb = (load(shared_data, file, mesh_frame=frame) for file, frame in (TOWN, TOWN_GLB))
    # the GLB holds float32 (half an ulp at 280 m is 1.5e-5 m), the OBJ six decimals
    assert np.allclose(obj.bounds, glb.bounds, atol=2e-5)
    # README, file axes x 145..279.6, y 0..12, z -31..61.5: y up, so ROS y = -z
    assert np.allclose(obj.bounds, [[145, -61.5, 0], [279.6, 31, 12]], atol=0.05)
    mine = {p.group: b for p, b in zip(obj.parts, obj.part_bounds(), strict=True)}
    for part, box in zip(glb.parts, glb.part_bounds(), strict=True):
        assert np.allclose(box, mine[part.object], atol=2e-5), part.object


def test_rails_stand_on_the_ground_and_roads_face_up(shared_data: Path) -> None:
    mesh = load(shared_data, TOWN[0], mesh_frame=TOWN[1])
    road = mesh.face_tag == SemanticTag.Roads
    assert np.average(np.abs(mesh.face_normal[road, 2]), weights=mesh.face_area[road]) > 0.99
    car = next(b for p, b in zip(mesh.parts, mesh.part_bounds(), strict=True) if p.tag is SemanticTag.Car)
    assert 1.3 < np.ptp(car[:, 2]) < 2.6


def test_town_with_the_wrong_axes_or_unit_is_noticed(shared_data: Path) -> None:
    file = shared_data / TOWN[0]
    assert "looks like y-up" in mesh_hints(resolve_tags(read_mesh(file)))[0]
    assert "metres read as cm" in mesh_hints(resolve_tags(read_mesh(file, mesh_frame="ue_obj_cm")))[0]
    in_cm = resolve_tags(read_mesh(file, mesh_frame="carla_exporter", units=100.0))
    assert "looks like cm" in mesh_hints(in_cm)[0]


def test_chrono_sedan_has_all_its_triangles_and_stands_on_four_wheels(shared_data: Path) -> None:
    folder = "chrono_vehicles/sedan/"
    chassis = load(shared_data, folder + "sedan_chassis_vis.obj")
    assert chassis.n_faces == 39_170 - 182
    assert chassis.repaired == {"degenerate_faces": 182}
    assert {p.tag for p in chassis.parts} == {SemanticTag.Car}
    assert len({p.material for p in chassis.parts}) == 12
    wheel = concatenate([load(shared_data, folder + name) for name in ("sedan_tire.obj", "sedan_rim.obj")])
    assert {p.tag for p in wheel.parts} == {SemanticTag.Car}
    assert "rubber" in {p.em_material for p in wheel.parts}
    # axles at x = +-1.388 (README of the set); track and hub height only have to put the wheels under the body
    places = [Pose((x, y, -0.05)) for x in (1.388, -1.388) for y in (0.76, -0.76)]
    car = concatenate([chassis, *(wheel.transformed(p) for p in places)])
    assert car.n_faces == 75_314 - 182
    assert np.allclose(np.ptp(chassis.bounds, axis=0), [4.89, 1.85, 1.47], atol=0.01)
    assert mesh_hints(car) == []


VEHICLES = {
    "chrono_vehicles/sedan/sedan_chassis_vis.obj": "Car",
    "chrono_vehicles/sedan/sedan_chassis_col.obj": "Car",
    "chrono_vehicles/citybus/CityBus_Vis.obj": "Bus",
    "chrono_vehicles/citybus/CityBus_Col.obj": "Bus",
    "chrono_vehicles/truck/truck_chassis.obj": "Truck",
    "chrono_vehicles/truck/truck_chassis_col.obj": "Truck",
    "gazebo_road_objects/converted_m/hatchback.ply": "Car",
    "gazebo_road_objects/converted_m/hatchback.stl": "Car",
    "gazebo_road_objects/converted_m/suv.ply": "Car",
    "gazebo_road_objects/converted_m/pickup.ply": "Car",
    "gazebo_road_objects/converted_m/bus.ply": "Bus",
    "sionna_scenes/low_poly_car.ply": "Car",
}


@pytest.mark.parametrize(("file", "tag"), VEHICLES.items())
def test_upright_vehicles_pass_and_the_same_ones_laid_down_or_in_cm_do_not(
    shared_data: Path, file: str, tag: str
) -> None:
    mesh = load(shared_data, file)
    assert {p.tag.name for p in mesh.parts} == {tag}
    assert [h for h in mesh_hints(mesh) if "inside out" not in h] == []
    y_up = mesh.transformed([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    assert any("looks like y-up" in h for h in mesh_hints(y_up))
    in_cm = mesh.transformed(100.0 * np.eye(3))
    assert any("looks like cm" in h for h in mesh_hints(in_cm))


FURNITURE = {
    "jersey_barrier": "GuardRail", "lamp_post": "Poles", "stop_sign": "TrafficSigns", "construction_barrel": "Dynamic",
    "construction_cone": "Dynamic", "fire_hydrant": "Static", "oak_tree": "Vegetation", "pine_tree": "Vegetation",
    "house_1": "Buildings",
}  # fmt: skip


@pytest.mark.parametrize(("name", "tag"), FURNITURE.items())
def test_street_furniture_is_known_by_its_file_name(shared_data: Path, name: str, tag: str) -> None:
    mesh = load(shared_data, f"gazebo_road_objects/converted_m/{name}.ply")
    assert [(p.tag.name, p.rule) for p in mesh.parts] == [(tag, "8 file name")]


@pytest.mark.parametrize(
    ("name", "scale", "yaw_deg"), [("bus", "cm", 90), ("hatchback", "inch", 90), ("suv", 0.06, -90)]
)  # scale and yaw of the models' own model.sdf
def test_gazebo_originals_become_the_converted_twins_by_unit_and_turn(
    shared_data: Path, name: str, scale: str | float, yaw_deg: float
) -> None:
    file = shared_data / "gazebo_road_objects" / "original" / name / f"{name}.obj"
    mesh = read_mesh(file, mesh_frame=_turn(yaw_deg), units=scale)
    twin = read_mesh(shared_data / "gazebo_road_objects" / "converted_m" / f"{name}.ply")
    assert mesh.n_faces == twin.n_faces
    # the twins are float32 and centred, so sizes and areas agree, places do not: 1e-6 of 12 m is 12 um
    assert np.allclose(np.ptp(mesh.bounds, axis=0), np.ptp(twin.bounds, axis=0), rtol=1e-5)
    assert mesh.face_area.sum() == pytest.approx(twin.face_area.sum(), rel=1e-5)
    unturned = resolve_tags(read_mesh(file, units=scale))
    assert any("actors face +x" in h for h in mesh_hints(unturned))
    assert any("looks like" in h for h in mesh_hints(resolve_tags(read_mesh(file))))


def _turn(yaw_deg: float) -> np.ndarray:
    return Pose(ypr_deg=(yaw_deg, 0, 0)).rotation


def test_sionna_street_canyon_has_its_buildings_cars_and_floor(shared_data: Path) -> None:
    mesh = load(shared_data, "sionna_scenes/simple_street_canyon_with_cars/simple_street_canyon_with_cars.xml")
    count = {tag: sum(p.tag.name == tag for p in mesh.parts) for tag in ("Buildings", "Car", "Ground")}
    assert count == {"Buildings": 6, "Car": 8, "Ground": 1}
    assert len(mesh.parts) == 15
    assert all(p.material.startswith("mat-itu_") for p in mesh.parts)
    assert {p.em_material for p in mesh.parts if p.tag is SemanticTag.Car} == {"metal"}
    assert mesh.part_faces[[p.tag is SemanticTag.Buildings for p in mesh.parts]].tolist() == [12] * 6
    assert np.allclose(np.ptp(mesh.bounds, axis=0)[:2], [186, 121], atol=0.5)


def test_milk_truck_without_node_names_is_known_by_mesh_file_and_material(shared_data: Path) -> None:
    # Its front is +x in the file's y-up axes, which is what the Unreal-style preset expects.
    mesh = load(shared_data, "gltf_milk_truck/CesiumMilkTruck.glb", mesh_frame="ue_gltf")
    assert mesh.n_faces == 3624
    assert {p.tag for p in mesh.parts} == {SemanticTag.Truck}
    assert [(p.material, p.em_material) for p in mesh.parts] == [
        ("truck", None), ("glass", "glass"), ("window_trim", "glass"), ("wheels", "rubber"), ("wheels", "rubber"),
    ]  # fmt: skip
    assert mesh_hints(mesh) == []
    as_is = load(shared_data, "gltf_milk_truck/CesiumMilkTruck.glb")
    assert any("looks like y-up" in h for h in mesh_hints(as_is))


def test_canonical_shapes_have_their_areas(shared_data: Path) -> None:
    folder = shared_data / "canonical"
    assert read_mesh(folder / "plate_100mm.obj").face_area.sum() == pytest.approx(0.01, rel=1e-9)
    assert read_mesh(folder / "plate_5000mm.obj").face_area.sum() == pytest.approx(25.0, rel=1e-9)
    sphere = read_mesh(folder / "sphere_r100mm_ico5.ply")
    # 20480 inscribed facets: the area falls short by about (edge/r)^2/8 with edge = r * sqrt(16 pi / (20480 sqrt 3))
    assert sphere.face_area.sum() == pytest.approx(4 * np.pi * 0.01, rel=3e-4)
    for file in sorted([*folder.glob("*.obj"), *folder.glob("*.ply")]):
        assert not read_mesh(file).repaired


def test_semantic_lidar_frame_is_not_a_mesh(shared_data: Path) -> None:
    with pytest.raises(ValueError, match="read_semantic_lidar"):
        read_mesh(next((shared_data / "semlidar_synth_town01").glob("*.ply")))


def test_human_body_needs_a_tag_from_outside(shared_data: Path) -> None:
    mesh = read_mesh(shared_data / "makehuman_body" / "body.ply")
    with pytest.raises(ValueError, match="100 % of the mesh area has no tag"):
        resolve_tags(mesh)
    manifest = {"version": 1, "parts": [{"match": {"file": "body.ply"}, "tag": "Pedestrians"}]}
    from shenron_rt.scene.resolver_manifest import TagManifest

    assert resolve_tags(mesh, manifest=TagManifest(**manifest)).parts[0].tag is SemanticTag.Pedestrians
