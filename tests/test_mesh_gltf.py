"""glTF documents and containers, made here so that each fact is known exactly."""

from __future__ import annotations

import base64
import json
import struct

import numpy as np
import pytest
from mesh_files import gltf, write

from shenron_rt.errors import InputError, NotFoundError
from shenron_rt.scene.readers import read_mesh


def test_gltf_node_transforms_names_and_extras(tmp_path) -> None:
    half = np.sqrt(0.5)
    nodes = [
        {"name": "BP_Wall", "translation": [10, 0, 0], "children": [1], "extras": {"carla_tag": 4}},
        {
            "name": "Pane",
            "mesh": 0,
            "rotation": [0, 0, half, half],
            "scale": [2, 2, 2],
            "extras": {"material": "glass"},
        },
    ]
    mesh = read_mesh(write(tmp_path, "a.gltf", json.dumps(gltf(nodes))))
    (part,) = mesh.parts
    assert (part.object, part.group, part.material) == ("Pane", "BP_Wall", "M_Glass")
    assert (part.declared_tag, part.declared_material) == (4, "glass")
    # 90 degrees about z: x -> y; float64 all the way, only sqrt(0.5) is rounded
    assert np.allclose(mesh.vertices, [[10, 0, 0], [10, 2, 0], [8, 0, 0]], atol=1e-14)


def test_nameless_node_takes_its_meshs_name(tmp_path) -> None:
    mesh = read_mesh(write(tmp_path, "a.gltf", json.dumps(gltf([{"mesh": 0}]))))
    assert mesh.parts[0].object == "tri"


def test_mirrored_gltf_node_keeps_its_outside_outside(tmp_path) -> None:
    mesh = read_mesh(write(tmp_path, "a.gltf", json.dumps(gltf([{"mesh": 0, "scale": [-1, 1, 1]}]))))
    assert np.array_equal(mesh.face_normal, [[0, 0, 1]])


def test_one_mesh_under_two_nodes_and_gpu_instances_are_all_placed(tmp_path) -> None:
    places = np.array([[0, 0, 5], [0, 0, 6], [0, 0, 7]], dtype="<f4").tobytes()
    instanced = {
        "name": "Barrier_Inst",
        "mesh": 0,
        "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2}}},
    }
    document = gltf(
        [{"mesh": 0}, {"mesh": 0, "translation": [0, 0, 1]}, instanced],
        roots=(0, 1, 2),
        tail=places,
        views=[{"buffer": 0, "byteOffset": 44, "byteLength": 36}],
        accessors=[{"bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC3"}],
    )
    mesh = read_mesh(write(tmp_path, "a.gltf", json.dumps(document)))
    assert sorted(mesh.vertices[mesh.faces[:, 0], 2]) == [0, 1, 5, 6, 7]
    assert len(mesh.parts) == 3


def test_glb_container(tmp_path) -> None:
    document = gltf([{"mesh": 0}])
    data = base64.b64decode(document["buffers"][0].pop("uri").partition(",")[2])
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    whole = struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks
    assert read_mesh(write(tmp_path, "a.glb", whole)).n_faces == 1
    with pytest.raises(InputError, match=r"cut short|past the end"):
        read_mesh(write(tmp_path, "b.glb", whole[:-60]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "without compression"),
        ({"asset": {"version": "1.0"}}, "glTF 2.x is needed"),
        ({"buffers": [{"byteLength": 44, "uri": "../secret.bin"}]}, "outside the file's folder"),
        ({"buffers": [{"byteLength": 44, "uri": "data:;base64,AAAA"}]}, "past the end"),
        ({"accessors": []}, "broken glTF structure"),
        ({"nodes": [{"children": [0, 0]}]}, "form a tree"),
        ({"nodes": [{}]}, "no triangles"),
    ],
)
def test_broken_gltf_files_say_what_is_wrong(tmp_path, change: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_mesh(write(tmp_path, "a.gltf", json.dumps(gltf([{"mesh": 0}], extra=change))))


def test_gltf_buffer_file_that_is_missing_is_not_found(tmp_path) -> None:
    document = gltf([{"mesh": 0}], extra={"buffers": [{"byteLength": 44, "uri": "a.bin"}]})
    with pytest.raises(NotFoundError, match=r"a\.bin"):
        read_mesh(write(tmp_path, "a.gltf", json.dumps(document)))
