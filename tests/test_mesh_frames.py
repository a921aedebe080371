"""Axes and units of mesh files."""

from __future__ import annotations

import numpy as np
import pytest

from shenron_rt.errors import InputError
from shenron_rt.frames import from_carla_points
from shenron_rt.scene.mesh_frames import MESH_FRAMES, UNITS, mesh_matrix

POINT_UE_M = np.array([11.0, 5.0, 2.0])  # 11 m ahead, 5 m to the RIGHT, 2 m up in Unreal's left-handed frame

# How each writer lays out Unreal's X, Y, Z in its columns: CarlaExporter.cpp, StaticMeshExporterOBJ, GLTFCoreUtilities,
# FbxDataConverter, LibCarla Mesh.cpp
WRITERS = {
    "carla_exporter": lambda p: p[[0, 2, 1]],
    "ue_obj_cm": lambda p: 100.0 * p[[0, 2, 1]],
    "ue_gltf": lambda p: p[[0, 2, 1]],
    "ue_fbx_cm": lambda p: 100.0 * p * [1, -1, 1],
    "libcarla": lambda p: p,
}


@pytest.mark.parametrize("preset", sorted(WRITERS))
def test_every_unreal_writer_leads_to_the_same_ros_point(preset: str) -> None:
    column = WRITERS[preset](POINT_UE_M)
    got = mesh_matrix(preset) @ [*column, 1.0]
    assert np.allclose(got[:3], from_carla_points(POINT_UE_M), atol=1e-12)  # y flipped once: 5 m to the left is -5


def test_only_the_left_handed_layout_mirrors() -> None:
    sign = {name: np.sign(np.linalg.det(mesh_matrix(name)[:3, :3])) for name in MESH_FRAMES}
    assert {n for n, s in sign.items() if s < 0} == {"libcarla"}


def test_gltf_standard_faces_z_with_y_up() -> None:
    assert np.array_equal(mesh_matrix("gltf_y_up")[:3, :3] @ [0, 0, 1], [1, 0, 0])  # forward
    assert np.array_equal(mesh_matrix("gltf_y_up")[:3, :3] @ [0, 1, 0], [0, 0, 1])  # up
    assert np.array_equal(mesh_matrix("gltf_y_up")[:3, :3] @ [1, 0, 0], [0, 1, 0])  # glTF: -x is right


def test_blender_export_keeps_blenders_own_axes() -> None:
    # Blender's default export writes (x, z, -y)
    assert np.array_equal(mesh_matrix("blender")[:3, :3] @ [1, 3, -2], [1, 2, 3])


@pytest.mark.parametrize(("units", "metres"), [*UNITS.items(), (0.06, 0.06), ("0.06", 0.06)])
def test_units_scale(units: str | float, metres: float) -> None:
    assert np.allclose(mesh_matrix("ros_z_up", units)[:3, :3], metres * np.eye(3), rtol=1e-15)


def test_cm_presets_are_not_scaled_twice() -> None:
    assert np.array_equal(mesh_matrix("ue_obj_cm", "cm"), mesh_matrix("ue_obj_cm"))
    with pytest.raises(InputError, match="already says centimetres"):
        mesh_matrix("ue_obj_cm", "mm")


def test_explicit_matrix_applies_after_the_unit() -> None:
    matrix = [[0, -1, 0, 10], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    assert np.allclose(mesh_matrix(matrix, "cm") @ [100, 0, 0, 1], [10, 1, 0, 1])
    assert np.array_equal(mesh_matrix(np.eye(3)), np.eye(4))


def test_unknown_preset_lists_the_known() -> None:
    with pytest.raises(InputError, match=r"did you mean 'carla_exporter'\? known: blender, carla_exporter, gltf_y_up"):
        mesh_matrix("carla_export")


@pytest.mark.parametrize("units", ["furlong", 0.0, -1.0, float("nan")])
def test_bad_units_are_refused(units: str | float) -> None:
    with pytest.raises(InputError, match="units"):
        mesh_matrix("ros_z_up", units)


def test_bad_matrix_is_refused() -> None:
    with pytest.raises(InputError, match=r"shape \(2, 2\)"):
        mesh_matrix([[1, 0], [0, 1]])
