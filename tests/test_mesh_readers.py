"""Mesh files of every format (glTF has a file of its own), made here so that each fact is known exactly."""

from __future__ import annotations

import base64
import json
import logging
import struct
from pathlib import Path

import numpy as np
import pytest
from mesh_files import gltf, write

from shenron_rt.errors import InputError, NotFoundError
from shenron_rt.scene.readers import MESH_SUFFIXES, read_mesh

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


# --- OBJ


def test_old_exporter_layout_keeps_actors_that_share_a_component_name(tmp_path) -> None:
    text = ""
    for k, actor in enumerate(("BP_Wall_1", "BP_Fence_2")):
        text += f"o {actor}\ng StaticMeshComponent0\nv {k} 0 0\nv {k} 1 0\nv {k} 0 1\nusemtl block\n"
        text += f"f {3 * k + 1} {3 * k + 2} {3 * k + 3}\n"
    mesh = read_mesh(write(tmp_path, "town.obj", text))
    assert [(p.object, p.group) for p in mesh.parts] == [
        ("BP_Wall_1", "StaticMeshComponent0"),
        ("BP_Fence_2", "StaticMeshComponent0"),
    ]
    assert mesh.part.tolist() == [0, 1]


def test_new_exporter_layout_keeps_the_actor_over_its_components(tmp_path) -> None:
    text = TRIANGLE + (
        "g BP_Wall_1\no BP_Wall_1_C0_box\nusemtl block\nf 1 2 3\no BP_Wall_1_C1_mesh\nf 3 2 1\n"
        "g Road_Road_2\no Road_Road_2_C0_mesh\nusemtl road\nf 1 2 3\n"
    )
    mesh = read_mesh(write(tmp_path, "town.obj", text))
    assert [(p.group, p.object, p.material) for p in mesh.parts] == [
        ("BP_Wall_1", "BP_Wall_1_C0_box", "block"),
        ("BP_Wall_1", "BP_Wall_1_C1_mesh", "block"),
        ("Road_Road_2", "Road_Road_2_C0_mesh", "road"),
    ]


def test_an_object_without_group_does_not_inherit_the_last_ones(tmp_path) -> None:
    mesh = read_mesh(write(tmp_path, "a.obj", TRIANGLE + "o A\ng G\nf 1 2 3\no B\nf 1 2 3\n"))
    assert [(p.object, p.group) for p in mesh.parts] == [("A", "G"), ("B", "")]


def test_material_names_survive_without_a_material_library(tmp_path) -> None:
    mesh = read_mesh(write(tmp_path, "a.obj", "mtllib absent.mtl\n" + TRIANGLE + "usemtl glass\nf 1 2 3\n"))
    assert mesh.parts[0].material == "glass"


def test_polygons_negative_indices_textures_crlf_continuations_and_comments(tmp_path) -> None:
    text = "\r\n".join(
        [
            "# a square of one quad, then a pentagon by negative indices",
            "v 0 0 0 1.0 0.5 0.5", "v 1 0 0", "\tv 1 1 0", "v 0 1 0", "vt 0 0", "vn 0 0 1",
            "f 1/1/1 2/1/1 3//1 4 # quad", "v -1 0.5 0", "s 1", "f -5 -4 \\", " -3 -2 -1", "",
        ]
    )  # fmt: skip
    mesh = read_mesh(write(tmp_path, "a.obj", text))
    assert mesh.n_faces == 2 + 3
    assert mesh.faces.max() == 4
    # unit square; pentagon = square + triangle of base 1 and height 1
    assert mesh.face_area[:2].sum() == pytest.approx(1.0, abs=1e-15)
    assert mesh.face_area[2:].sum() == pytest.approx(1.5, abs=1e-15)
    assert (mesh.face_normal[:, 2] == 1).all()


def test_a_hundred_thousand_faces_of_two_forms_are_read(tmp_path) -> None:
    n = 225  # 2 * 224^2 = 100,352 faces
    x, y = np.meshgrid(np.arange(n), np.arange(n))
    lines = [f"v {a} {b} 0.125" for a, b in zip(x.ravel(), y.ravel(), strict=True)]
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1) + 1).ravel()
    lines += [f"f {a}/1/1 {a + 1}/1/1 {a + n + 1}/1/1\nf {a}//1 {a + n + 1}//1 {a + n}//1" for a in corner.tolist()]
    file = write(tmp_path, "grid.obj", "\n".join(lines))
    mesh = read_mesh(file)
    assert mesh.n_faces == 100_352
    assert mesh.face_area.sum() == pytest.approx(224**2, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TRIANGLE, "no faces"),
        ("f 1 2 3\n", "without any vertex"),
        (TRIANGLE + "f 1 2 4\n", r"1 face corners name vertices that do not exist \(first: 4, the file has 1 to 3\)"),
        (TRIANGLE + "f 0 1 2\n", "first: 0"),
        (TRIANGLE + "f -4 1 2\n", "first: -4"),
        (TRIANGLE + "f 1 2\n", "2 corners"),
        (TRIANGLE + "f a b c\n", "face line cannot be read"),
        ("v 0 0\nv 1 0 0\nf 1 2 1\n", "vertex line cannot be read"),
        ("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "1 of 3 vertices are NaN"),
        ("", "empty"),
    ],
)
def test_broken_obj_files_say_what_is_wrong(tmp_path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_mesh(write(tmp_path, "bad.obj", text))


# --- PLY

PLY_VERTICES = "ply\nformat {f} 1.0\nelement vertex 4\nproperty {t} x\nproperty {t} y\nproperty {t} z\n"
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)


@pytest.mark.parametrize("name", ["ObjTag", "tag"])
@pytest.mark.parametrize(("order", "word"), [("<", "binary_little_endian"), (">", "binary_big_endian")])
def test_binary_ply_with_a_tag_for_each_face(tmp_path, order: str, word: str, name: str) -> None:
    header = PLY_VERTICES.format(f=word, t="double")
    header += f"element face 2\nproperty list uchar int vertex_indices\nproperty uint {name}\nend_header\n"
    body = SQUARE.astype(order + "f8").tobytes()
    body += struct.pack(order + "B3iI", 3, 0, 1, 2, 14) + struct.pack(order + "B3iI", 3, 0, 2, 3, 7)
    mesh = read_mesh(write(tmp_path, "a.ply", header.encode() + body))
    assert [mesh.parts[k].declared_tag for k in mesh.part] == [14, 7]
    assert mesh.face_area.tolist() == [0.5, 0.5]


def test_binary_ply_with_triangles_and_quads_mixed(tmp_path) -> None:
    header = PLY_VERTICES.format(f="binary_little_endian", t="float32")
    header += "element face 2\nproperty list uint8 int32 vertex_index\nproperty uint8 tag\nend_header\n"
    body = SQUARE.astype("<f4").tobytes() + struct.pack("<B3iB", 3, 0, 1, 2, 1) + struct.pack("<B4iB", 4, 0, 1, 2, 3, 2)
    mesh = read_mesh(write(tmp_path, "a.ply", header.encode() + body))
    assert [mesh.parts[k].declared_tag for k in mesh.part] == [1, 2, 2]
    assert mesh.face_area.sum() == 1.5


def test_ascii_ply(tmp_path) -> None:
    text = (
        PLY_VERTICES.format(f="ascii", t="float")
        + "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
    text += "\n".join(" ".join(map(str, row)) for row in SQUARE) + "\n4 0 1 2 3\n"
    mesh = read_mesh(write(tmp_path, "a.ply", text.replace("\n", "\r\n")))
    assert mesh.n_faces == 2
    assert mesh.parts[0].declared_tag is None


def test_point_cloud_ply_is_sent_to_the_lidar_reader(tmp_path) -> None:
    text = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float32 x\nproperty float32 y\nproperty float32 z\n"
    text += "property float32 CosAngle\nproperty uint32 ObjIdx\nproperty uint32 ObjTag\nend_header\n1 2 3 0.5 0 7\n"
    with pytest.raises(InputError, match="read_semantic_lidar"):
        read_mesh(write(tmp_path, "frame.ply", text))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda b: b[:-1], "ends inside element face"),
        (lambda b: b.replace(b"ply\n", b"plx\n"), "not a PLY file"),
        (lambda b: b.replace(b"int vertex_indices", b"foo vertex_indices"), "header line"),
        (lambda b: b.replace(b"property float x", b"property float a"), "x, y, z"),
    ],
)
def test_broken_ply_files_say_what_is_wrong(tmp_path, change, message: str) -> None:
    header = PLY_VERTICES.format(f="binary_little_endian", t="float")
    header += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    whole = header.encode() + SQUARE.astype("<f4").tobytes() + struct.pack("<B3i", 3, 0, 1, 2)
    assert read_mesh(write(tmp_path, "ok.ply", whole)).n_faces == 1
    with pytest.raises(InputError, match=message):
        read_mesh(write(tmp_path, "bad.ply", change(whole)))


# --- STL


def test_binary_and_ascii_stl_agree(tmp_path) -> None:
    corners = np.array([[[0, 0, 0], [1, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [0, 1, 0]]], dtype="<f4")
    rows = b"".join(struct.pack("<3f", 0, 0, 1) + c.tobytes() + b"\0\0" for c in corners)
    # a binary header may start with "solid" as well
    binary = read_mesh(write(tmp_path, "b.stl", b"solid fake".ljust(80) + struct.pack("<I", 2) + rows))
    facets = "".join(
        "facet normal 0 0 1\n outer loop\n"
        + "".join(f"  vertex {x} {y} {z}\n" for x, y, z in c)
        + " endloop\nendfacet\n"
        for c in corners
    )
    text = read_mesh(write(tmp_path, "t.stl", f"solid plate\n{facets}endsolid plate\n"))
    assert np.array_equal(binary.vertices[binary.faces], text.vertices[text.faces])
    assert len(binary.vertices) == 4  # shared corners are one vertex
    assert (text.parts[0].object, binary.parts[0].object) == ("plate", "")


def test_broken_stl_is_refused(tmp_path) -> None:
    with pytest.raises(InputError, match="not an STL file"):
        read_mesh(write(tmp_path, "a.stl", b"\0" * 80 + struct.pack("<I", 3) + b"\0" * 50))
    with pytest.raises(InputError, match="no triangles"):
        read_mesh(write(tmp_path, "b.stl", "solid a\nendsolid a\n"))


# --- Mitsuba scenes

SCENE = (
    '<scene version="3.0.0"><shape type="obj" id="mesh-car_1"><string name="filename" value="{file}"/>{more}</shape>'
    "</scene>"
)


def test_mitsuba_scene_names_by_shape_and_material_by_bsdf(tmp_path) -> None:
    write(tmp_path, "car.obj", TRIANGLE + "f 1 2 3\n")
    more = '<transform name="to_world"><scale value="2"/><rotate z="1" angle="90"/><translate x="5"/></transform>'
    more += '<ref id="mat-itu_metal" name="bsdf"/>'
    mesh = read_mesh(write(tmp_path, "s.xml", SCENE.format(file="car.obj", more=more)))
    assert (mesh.parts[0].object, mesh.parts[0].material) == ("mesh-car_1", "mat-itu_metal")
    assert Path(mesh.parts[0].file).name == "car.obj"
    assert np.allclose(mesh.vertices, [[5, 0, 0], [5, 2, 0], [3, 0, 0]], atol=1e-15)


def test_mitsuba_scene_refuses_entities_escapes_and_foreign_shapes(tmp_path) -> None:
    write(tmp_path, "car.obj", TRIANGLE + "f 1 2 3\n")
    plain = SCENE.format(file="car.obj", more="")
    bomb = '<!DOCTYPE scene [<!ENTITY a "aaaa">]>' + plain
    with pytest.raises(InputError, match="DOCTYPE and entities are not allowed"):
        read_mesh(write(tmp_path, "a.xml", bomb))
    with pytest.raises(InputError, match="outside the scene's folder"):
        read_mesh(write(tmp_path, "b.xml", SCENE.format(file="../car.obj", more="")))
    with pytest.raises(InputError, match="'serialized'; only ply, obj, stl"):
        read_mesh(write(tmp_path, "c.xml", plain.replace('"obj"', '"serialized"')))
    with pytest.raises(NotFoundError, match=r"bus\.obj"):
        read_mesh(write(tmp_path, "d.xml", SCENE.format(file="bus.obj", more="")))
    with pytest.raises(InputError, match="not well-formed"):
        read_mesh(write(tmp_path, "e.xml", plain[:-3]))


# --- the door


def test_missing_file_is_not_found(tmp_path) -> None:
    for suffix in MESH_SUFFIXES:
        with pytest.raises(NotFoundError, match="does not exist"):
            read_mesh(tmp_path / f"absent{suffix}")


def test_unknown_format_lists_the_known_and_says_what_to_do_with_fbx(tmp_path) -> None:
    with pytest.raises(InputError, match=r"known: \.glb, \.gltf, \.obj, \.ply, \.stl, \.xml.*FBX"):
        read_mesh(write(tmp_path, "a.fbx", "x"))


def test_unknown_preset_is_refused_before_reading(tmp_path) -> None:
    with pytest.raises(InputError, match="unknown mesh_frame 'unity'"):
        read_mesh(tmp_path / "absent.obj", mesh_frame="unity")


def test_left_handed_file_arrives_right_handed(tmp_path) -> None:
    # libcarla: x forward, y right, z up; this triangle faces up in the left-handed file (clockwise seen from above)
    file = write(tmp_path, "a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    mesh = read_mesh(file, mesh_frame="libcarla")
    assert mesh.bounds[:, 1].tolist() == [-1, 0]
    assert np.array_equal(mesh.face_normal, [[0, 0, 1]])


def test_degenerate_faces_are_counted_through_the_reader(tmp_path, caplog) -> None:
    with caplog.at_level(logging.WARNING):
        mesh = read_mesh(write(tmp_path, "a.obj", TRIANGLE + "f 1 2 3\nf 1 2 2\n"))
    assert mesh.repaired == {"degenerate_faces": 1}
    assert "dropped 1 of 2 triangles" in caplog.text


@pytest.mark.parametrize("bits", [0x7FA00000, 0x7F800000, 0x7F7FFFFF])  # signalling NaN, infinity, 3.4e38
@pytest.mark.parametrize("suffix", [".stl", ".gltf", ".ply"])
def test_vertices_that_are_no_numbers_are_counted_in_every_binary_format(tmp_path, suffix: str, bits: int) -> None:
    bad = struct.pack("<I", bits)
    points = bad + np.array([0, 0, 1, 0, 0, 0, 1, 0], dtype="<f4").tobytes()
    if suffix == ".stl":
        content = b"\0" * 80 + struct.pack("<I", 1) + b"\0" * 12 + points + b"\0\0"
    elif suffix == ".ply":
        header = PLY_VERTICES.format(f="binary_little_endian", t="float").replace("vertex 4", "vertex 3")
        header += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        content = header.encode() + points + struct.pack("<B3i", 3, 0, 1, 2)
    else:
        document = gltf([{"mesh": 0}])
        data = points + np.array([0, 1, 2, 0], dtype="<u2").tobytes()
        document["buffers"][0]["uri"] = "data:;base64," + base64.b64encode(data).decode()
        content = json.dumps(document).encode()
    with pytest.raises(InputError, match="1 of 3 vertices are NaN or infinite"):
        read_mesh(write(tmp_path, f"a{suffix}", content))
