"""Tags from names, manifests and dumps: every rule, every trap."""

from __future__ import annotations

import csv
import gzip
import json
import logging
from pathlib import Path

import numpy as np
import pytest
import yaml

from shenron_rt.errors import ConfigError, InputError, NotFoundError
from shenron_rt.resources import package_folder
from shenron_rt.scene.lexicon import _MATERIAL_PHRASES, split_words
from shenron_rt.scene.mesh import Part, TaggedMesh, build_mesh
from shenron_rt.scene.resolver import coverage, load_tagged_mesh, resolution_table, resolve_tags
from shenron_rt.scene.resolver_manifest import TagManifest, load_manifest
from shenron_rt.scene.resolver_names import classify_name, join_key
from shenron_rt.tags import SemanticTag, parse_tag


def strips(*parts: Part, sides: tuple[float, ...] = ()) -> TaggedMesh:
    """One right triangle for each part; areas side^2 / 2 [m^2]."""
    size = sides or (1.0,) * len(parts)
    points = np.concatenate([[[0, 3 * k, 0], [s, 3 * k, 0], [0, 3 * k + s, 0]] for k, s in enumerate(size)])
    faces = np.arange(3 * len(parts)).reshape(-1, 3)
    return build_mesh(points, faces, parts, np.arange(len(parts)))


def resolved(part: Part, **options) -> Part:
    options.setdefault("unlabelled", "warn")
    return resolve_tags(strips(part), **options).parts[0]


# --- single names

KIND = {"material_path": "material", "obj_material": "material", "blueprint": "blueprint"}


def test_real_carla_names_get_the_right_tag(shared_data: Path) -> None:
    rows = list(csv.DictReader((shared_data / "carla_names" / "names.csv").read_text().splitlines()))
    wrong = []
    for row in rows:
        got = classify_name(row["name"], KIND.get(row["kind"], "object"))  # type: ignore[arg-type]
        if got.tag is not parse_tag(row["expected_label"]):
            wrong.append(f"{row['kind']} {row['name']}: {got}, expected {row['expected_label']}")
    assert len(rows) == 58
    assert len(wrong) <= 0.05 * len(rows), "\n".join(wrong)
    assert not [w for w in wrong if w.startswith("trap")], "\n".join(wrong)


CLASSES = {
    "carModels": "Car", "vanModels": "Car", "truckModels": "Truck", "busModels": "Bus", "bicycleModels": "Bicycle",
    "motorcycleModels": "Motorcycle",
}  # fmt: skip


def test_every_vehicle_blueprint_gets_its_class_by_id_and_as_a_mesh_name(shared_data: Path) -> None:
    # carModels ... are CARLA's own base types as recorded from a 0.9.16 server
    with gzip.open(shared_data / "carla_blueprint_dims" / "blueprints_0.9.16.json.gz") as file:
        ids = json.load(file)["ids"]
    checked = 0
    for group, expected in CLASSES.items():
        for name in ids[group]:
            mesh_name = "SM_" + name.removeprefix("vehicle.").replace(".", "_")
            assert classify_name(name, "blueprint").tag.name == expected, name
            assert classify_name(mesh_name).tag.name == expected, mesh_name
            checked += 1
    assert checked == 41
    for name in ids["walkerModels"]:
        assert classify_name(name, "blueprint").tag is SemanticTag.Pedestrians


@pytest.mark.parametrize(
    ("name", "tag"),
    [
        ("SM_StreetLight_01", "Poles"), ("streetlight", "Poles"), ("SM_Carpet_02", "None"), ("SM_Scar", "None"),
        ("SM_Bush_11", "Vegetation"), ("Bus_H", "Bus"), ("SM_Trailer_2", "Truck"), ("SM_Polestar2_prop", "Car"),
        ("SM_TrafficLightPole_02", "Poles"), ("SM_TrafficLight_02", "TrafficLight"), ("SM_BusStop_03", "Static"),
        ("SM_GuardRail_04", "GuardRail"), ("SM_RailTrack", "RailTrack"), ("SM_Wallet_01", "None"),
        ("SM_Town03_Bridge_Pillar", "Bridge"), ("StaticMeshActor_12_StaticMeshComponent0_box", "None"),
        ("StaticMeshActor_7", "None"), ("Cyclist_2", "Rider"), ("SM_Bicycle_2", "Bicycle"), ("", "None"),
        ("Road_Curb_Town05_7", "Sidewalks"), ("Map_Roads_Marking_4Node", "RoadLines"), ("Terrain_Town01_2", "Terrain"),
        ("Road_Grass_Town02_1", "Terrain"), ("Road_Crosswalk_3_mesh", "Roads"), ("Broad_Roadster", "None"),
    ],
)  # fmt: skip
def test_words_decide_and_substrings_never_do(name: str, tag: str) -> None:
    assert classify_name(name).tag is parse_tag(tag)


@pytest.mark.parametrize(
    ("path", "tag"),
    [
        ("/Game/Carla/Static/Vehicles/4Wheeled/X/SM_Box.SM_Box", "Car"),  # plural of 0.9.13
        ("/Game/Carla/static/pole/PoweLine/SM_A", "Poles"),
        ("/Game/Carla/Static/Props/Fence/SM_Thing", "Other"),
        ("/Game/Carla/Static/Stone/SM_Thing", "Rock"),
        ("/Game/CustomMaps/T/Static/DrivingLane/SM_DrivingLane_1", "Roads"),  # no tag folder: the words decide
        ("/Game/Carla/Static/PoleDance/SM_Thing", "None"),
    ],
)
def test_asset_folder_is_an_exact_word(path: str, tag: str) -> None:
    assert classify_name(path).tag is parse_tag(tag)


def test_unknown_kind_of_name_is_refused() -> None:
    with pytest.raises(InputError, match="unknown kind of name 'mesh'"):
        classify_name("a", "mesh")  # type: ignore[arg-type]


def test_words_split_at_humps_digits_and_separators() -> None:
    assert split_words("SM_HTMLRoad2Wall-left.v01") == ["sm", "html", "road", "2", "wall", "left", "v", "01"]


@pytest.mark.parametrize(
    "name",
    ["SM_Wall_3", "SM_Wall_3_SM_0", "SM_Wall_Inst_2_1", "SM_Wall_LOD2",
     "{40ce66ca-c817-425b-8802-17cdbd76371f}SM_WallNode",
     "SM_Wall_4_StaticMeshComponent0_convex"],
)  # fmt: skip
def test_counters_and_component_suffixes_do_not_part_a_name_from_its_dump_entry(name: str) -> None:
    assert join_key(name) == "sm_wall"


# --- the order of the rules


def test_rules_hit_in_their_order_and_leave_their_evidence(tmp_path) -> None:
    """One part that every rule knows differently; each rule's evidence is removed in turn."""
    names = {
        "object": "SM_Tree_1", "group": "/Game/C/Static/Bus/Road_Sidewalk_X", "material": "road",
        "file": "x/SM_Wall.obj", "declared_tag": 14,
    }  # fmt: skip
    manifest = TagManifest(version=1, parts=({"match": {"object": "SM_Tree_1"}, "tag": "Water"},))
    dump = [{"name": "SM_Tree", "type": 26}]
    seen = []
    for change in ({}, {"m": None}, {"declared_tag": None}, {"d": None}, {"group": "Road_Sidewalk_X"}, {"group": ""},
                   {"object": ""}, {"material": "block"}, {"file": "t/Poles/x7.obj"}, {"file": "x7.obj"}):  # fmt: skip
        manifest = None if "m" in change else manifest
        dump = None if "d" in change else dump
        names |= {k: v for k, v in change.items() if k in names}
        part = resolved(Part(**names), manifest=manifest, environment_objects=dump)
        seen.append((part.rule, part.tag.name))
        assert part.evidence
    assert seen == [
        ("1 manifest", "Water"), ("2 in the file", "Car"), ("3 environment object", "Bridge"), ("4 asset path", "Bus"),
        ("5 RoadRunner token", "Sidewalks"), ("6 words", "Vegetation"), ("7 material", "Roads"),
        ("8 file name", "Walls"), ("8 folder", "Poles"), ("9 none", "Unlabeled"),
    ]  # fmt: skip


def test_gutter_with_material_road_is_a_sidewalk() -> None:
    part = resolved(Part(object="Road_Gutter_Town01_2", material="road"))
    assert part.tag is SemanticTag.Sidewalks
    assert part.em_material is None  # the exporter's class is no material


def test_old_layout_names_the_actor_and_not_its_component() -> None:
    part = resolved(Part(object="SM_StopSign_3", group="StaticMeshComponent0", material="block"))
    assert part.tag is SemanticTag.TrafficSigns


def test_file_naming_of_third_parties_and_a_folder_that_merely_contains_a_word() -> None:
    assert resolved(Part(file="twin/KIVI_Poles.fbx")).tag is SemanticTag.Poles
    assert resolved(Part(file="twin/Static/Fence/x.ply")).tag is SemanticTag.Fences
    assert resolved(Part(file="test_car_import/x.ply")).tag is SemanticTag.Unlabeled


def test_declared_numbers_follow_the_named_table_and_unknown_ones_are_refused() -> None:
    assert resolved(Part(declared_tag=7), carla_tags="0.9.13").tag is SemanticTag.Roads
    assert resolved(Part(declared_tag=7), carla_tags="0.9.14").tag is SemanticTag.TrafficLight
    assert resolved(Part(declared_tag="GuardRail")).tag is SemanticTag.GuardRail
    with pytest.raises(InputError, match=r"town\.ply.*does not list 41"):
        resolved(Part(declared_tag=41, file="town.ply"))


# --- environment objects


def test_dump_joins_by_full_name_first_and_by_stem_only_where_entries_agree() -> None:
    dump = [
        {"name": "Thing_1_SM_0", "type": "Buildings"},
        {"name": "Thing_2_SM_0", "type": "CityObjectLabel.Walls"},
        {"name": "Other_1_SM_0", "type": 5},
        {"name": "Other_2_SM_0", "type": 5},
    ]
    mesh = strips(Part(object="Thing_1_SM_0"), Part(object="Thing_9"), Part(object="Other_9_StaticMeshComponent0_mesh"))
    tags = [p.tag.name for p in resolve_tags(mesh, environment_objects=dump, unlabelled="warn").parts]
    assert tags == ["Buildings", "Unlabeled", "Fences"]


def test_dump_file_and_its_errors(tmp_path) -> None:
    file = tmp_path / "env.json"
    file.write_text(json.dumps({"map": "Town01", "objects": [{"name": "Thing_1", "type": 1}]}))
    assert resolved(Part(object="Thing_1"), environment_objects=file, carla_tags="0.9.13").tag is SemanticTag.Buildings
    with pytest.raises(NotFoundError):
        resolved(Part(), environment_objects=tmp_path / "absent.json")
    file.write_text('[{"name": "a"}]')
    with pytest.raises(InputError, match="entry 0 needs name and type"):
        resolved(Part(), environment_objects=file)
    file.write_text("{")
    with pytest.raises(InputError, match="not JSON"):
        resolved(Part(), environment_objects=file)


# --- manifest

MANIFEST = """
version: 1
carla_tags: "0.9.13"
frame: {preset: carla_exporter}
defaults: {unlabelled: warn, max_unlabelled_area: 0.5}
parts:
  - {match: {file: "*_Poles.*"}, tag: Poles}
  - {match: {object_regex: "^BP_RepSpline.*"}, tag: GuardRail, material: steel}
  - {match: {object: "BP_RepSpline9"}, tag: 11}
  - {match: {material: "glass"}, material: acrylic}
  - {match: {object: "Plane"}, tag: None}
actors:
  - {id: 101, mesh: sedan.obj, mesh_frame: ros_z_up, tag: Car, location: [218, 2, 0], velocity: [8, 0, 0]}
"""


def test_manifest_exact_before_regex_before_glob(tmp_path, caplog) -> None:
    file = tmp_path / "town.tags.yaml"
    file.write_text(MANIFEST)
    mesh = strips(
        Part(object="BP_RepSpline5_Inst_0_0", file="KIVI_Poles.fbx"),
        Part(object="x", group="BP_RepSpline9", file="KIVI_Poles.fbx"),
        Part(object="x", file="KIVI_Poles.fbx"),
        Part(object="SM_House_1", material="glass"),
        Part(object="Plane"),
    )
    with caplog.at_level(logging.WARNING):
        parts = resolve_tags(mesh, manifest=file).parts
    # 11 is Walls in the numbering the manifest names
    assert [p.tag.name for p in parts] == ["GuardRail", "Walls", "Poles", "Buildings", "Unlabeled"]
    assert [p.em_material for p in parts] == ["steel", "steel", None, "acrylic", None]
    assert parts[0].evidence == "parts[1]: object_regex ^BP_RepSpline.*"
    assert "no tag" not in caplog.text  # "tag: None" is a statement, not a gap
    assert load_manifest(file).frame.mesh_frame == "carla_exporter"


def test_manifest_entry_that_matches_nothing_is_reported(caplog) -> None:
    manifest = TagManifest(version=1, parts=({"match": {"object": "SM_Hosue"}, "tag": "Buildings"},))
    with caplog.at_level(logging.WARNING):
        resolved(Part(object="SM_House"), manifest=manifest)
    assert "parts[0] (object SM_Hosue) matches no part" in caplog.text


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("  - {match: {object: a}, tag: Buildng}", r"town\.yaml:3: parts\.0\.tag.*unknown tag 'Buildng'; did you mean"),
        ("  - {match: {object: a}}", "give a tag, a material or both"),
        ("  - {match: {}, tag: Car}", "at least one of object"),
        ("  - {match: {object_regex: '('}, tag: Car}", "not a regular expression"),
        ("  - {match: {name: a}, tag: Car}", "Extra inputs"),
    ],
)
def test_broken_manifest_names_line_and_key(tmp_path, line: str, message: str) -> None:
    file = tmp_path / "town.yaml"
    file.write_text(f"version: 1\nparts:\n{line}\n")
    with pytest.raises(ConfigError, match=message):
        load_manifest(file)


def test_manifest_frame_is_checked(tmp_path) -> None:
    file = tmp_path / "town.yaml"
    file.write_text("version: 1\nframe: {preset: carla}\n")
    with pytest.raises(ConfigError, match="unknown mesh_frame 'carla'"):
        load_manifest(file)


def test_manifest_frame_is_used_unless_the_caller_names_one(tmp_path) -> None:
    mesh_file = tmp_path / "wall.obj"
    mesh_file.write_text("v 100 0 0\nv 100 200 0\nv 100 0 300\nf 1 2 3\n")  # y up, cm
    manifest = tmp_path / "wall.yaml"
    manifest.write_text("version: 1\nframe: {preset: ue_obj_cm}\n")
    assert load_tagged_mesh(mesh_file, manifest=manifest).bounds.tolist() == [[1, -3, 0], [1, 0, 2]]
    explicit = load_tagged_mesh(mesh_file, manifest=manifest, mesh_frame="ros_z_up", units="cm")
    assert explicit.bounds.tolist() == [[1, 0, 0], [1, 2, 3]]
    assert load_tagged_mesh(mesh_file).bounds.tolist() == [[100, 0, 0], [100, 200, 300]]


def test_tags_given_by_the_program_stay_and_resolving_twice_changes_nothing() -> None:
    mesh = strips(
        Part(object="hull", tag=SemanticTag.Truck, em_material="metal"), Part(object="Plane"), Part(object="SM_Sign")
    )
    once = resolve_tags(mesh, unlabelled="warn")
    assert [(p.tag.name, p.em_material) for p in once.parts] == [
        ("Truck", "metal"), ("Unlabeled", "concrete"), ("TrafficSigns", None),
    ]  # fmt: skip
    assert resolve_tags(once, unlabelled="warn").parts == once.parts
    with pytest.raises(InputError, match="'Plane'"):
        resolve_tags(once)


# --- policy


def test_unlabelled_area_above_the_limit_is_an_error_that_names_the_part() -> None:
    mesh = strips(Part(object="SM_House"), Part(object="Plane"), sides=(1.0, 0.5))
    with pytest.raises(InputError, match=r"20 % of the mesh area.*allowed are 5 %: 'Plane' \(0\.125 m\^2\)"):
        resolve_tags(mesh)
    assert resolve_tags(mesh, max_unlabelled_area=0.2).n_faces == 2


def test_unlabelled_area_below_the_limit_or_by_choice_is_a_warning_with_the_fallback(caplog) -> None:
    mesh = strips(Part(object="SM_House"), Part(object="Plane"), sides=(1.0, 0.2))  # 0.02 / 0.52 = 3.85 %
    with caplog.at_level(logging.WARNING):
        part = resolve_tags(mesh, fallback_material="brick").parts[1]
    assert "3.85 % of the mesh area has no tag and no material and is taken as brick" in caplog.text
    assert (part.tag, part.rule, part.em_material) == (SemanticTag.Unlabeled, "9 none", "brick")


def test_a_part_with_a_material_but_no_tag_is_labelled_enough() -> None:
    part = resolve_tags(strips(Part(object="Plane", material="itu_metal"))).parts[0]
    assert (part.tag, part.em_material) == (SemanticTag.Unlabeled, "metal")


def test_bad_policy_is_refused() -> None:
    with pytest.raises(InputError, match="'error' or 'warn'"):
        resolve_tags(strips(Part(object="SM_House")), unlabelled="ignore")  # type: ignore[arg-type]


def test_sky_is_dropped_and_counted() -> None:
    mesh = resolve_tags(strips(Part(object="BP_Sky"), Part(object="SM_House")))
    assert [p.object for p in mesh.parts] == ["SM_House"]
    assert mesh.repaired == {"sky_faces": 1}
    with pytest.raises(InputError, match="sky"):
        resolve_tags(strips(Part(object="BP_Sky")))


def test_table_and_coverage_add_up() -> None:
    mesh = strips(Part(object="SM_House"), Part(object="Plane"), Part(object="BP_Wall"), sides=(2.0, 1.0, 1.0))
    done = resolve_tags(mesh, unlabelled="warn")
    rows = resolution_table(done)
    assert [(r.part, r.tag.name, r.triangles, r.area_m2) for r in rows] == [
        ("SM_House", "Buildings", 1, 2.0), ("Plane", "Unlabeled", 1, 0.5), ("BP_Wall", "Walls", 1, 0.5),
    ]  # fmt: skip
    total = coverage(done)
    assert total.area_by_tag_m2 == {"Unlabeled": 0.5, "Buildings": 2.0, "Walls": 0.5}
    assert total.unlabelled_share == pytest.approx(0.5 / 3.0, rel=1e-15)
    assert str(total).startswith("83.3 % of 3.0 m^2 labelled: 2 of 3 parts")


# --- materials


@pytest.mark.parametrize(
    ("material", "expected"),
    [("itu_metal", "metal"), ("mat-itu_glass", "glass"), ("MI_CarPaint_Charger", "car_paint"), ("SUV_Wheels", "rubber"),
     ("MI_Concrete_Barrier", "concrete"), ("block", None), ("road", None), ("lambert15SG", None)],
)  # fmt: skip
def test_material_words_set_the_material(material: str, expected: str | None) -> None:
    assert resolved(Part(object="SM_House", material=material)).em_material == expected


def test_a_material_of_the_file_beats_its_name_and_a_name_beats_a_piece() -> None:
    assert resolved(Part(object="Tire_FL", material="MI_Steel", declared_material="plastic")).em_material == "plastic"
    assert resolved(Part(object="Tire_FL", material="MI_Steel")).em_material == "metal"
    assert resolved(Part(object="Car_Tire_FL", material="Material.001")).em_material == "rubber"


def test_itu_name_without_an_entry_is_reported(caplog) -> None:
    with caplog.at_level(logging.WARNING):
        assert resolved(Part(object="SM_House", material="itu_marble")).em_material is None
    assert "'itu_marble' is not known" in caplog.text


def test_every_material_of_the_lexicon_is_in_the_default_table() -> None:
    table = yaml.safe_load((package_folder("materials") / "automotive.yaml").read_text())
    assert set(_MATERIAL_PHRASES) <= set(table["materials"])


def test_every_tag_a_name_can_get_has_a_material() -> None:
    from shenron_rt.config.materials import load_materials

    table = load_materials("automotive")
    assert classify_name("SM_Rock_3").tag is SemanticTag.Rock  # a name may say it under any numbering
    for tag in SemanticTag:
        assert table.for_tag(tag.name) in table.materials
