"""The mesh value: validation, transforms, joining."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from shenron_rt.errors import InputError
from shenron_rt.frames import Pose
from shenron_rt.scene.mesh import Part, TaggedMesh, build_mesh, concatenate
from shenron_rt.tags import SemanticTag

CORNERS = np.array([[x, y, z] for x in (0.0, 2.0) for y in (0.0, 3.0) for z in (0.0, 5.0)])
# outward windings of the box 2 x 3 x 5 whose corner k is (k & 4, k & 2, k & 1)
BOX = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
     [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def box() -> TaggedMesh:
    return build_mesh(CORNERS, BOX, Part(object="box", tag=SemanticTag.Car))


def signed_volume(mesh: TaggedMesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def test_areas_normals_and_bounds_of_a_box() -> None:
    mesh = box()
    # 12 sums of a few products of order 10: 1e-14 relative is a few ulp
    assert mesh.face_area.sum() == pytest.approx(2 * (6 + 10 + 15), rel=1e-14)
    assert signed_volume(mesh) == pytest.approx(30, rel=1e-14)
    outward = np.einsum("ij,ij->i", mesh.face_normal, mesh.vertices[mesh.faces].mean(axis=1) - [1, 1.5, 2.5])
    assert (outward > 0).all()
    assert np.array_equal(mesh.bounds, [[0, 0, 0], [2, 3, 5]])
    assert set(mesh.face_tag) == {14}


def test_nan_vertices_are_refused_with_file_and_count() -> None:
    bad = CORNERS.copy()
    bad[2, 1], bad[5, 0] = np.nan, np.inf
    with pytest.raises(InputError, match=r"town\.obj: 2 of 8 vertices are NaN or infinite"):
        build_mesh(bad, BOX, Part(file="town.obj"))


def test_empty_mesh_is_refused() -> None:
    with pytest.raises(InputError, match="no triangles"):
        build_mesh(CORNERS, np.zeros((0, 3), dtype=int))


@pytest.mark.parametrize("index", [-1, 8])
def test_faces_out_of_range_are_refused(index: int) -> None:
    with pytest.raises(InputError, match=rf"1 faces name vertices that do not exist \(index {index}, allowed 0 to 7\)"):
        build_mesh(CORNERS, [[0, 1, index], [0, 1, 2]])


def test_faces_without_area_are_dropped_counted_and_logged(caplog) -> None:
    line = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
    faces = np.concatenate([BOX, [[0, 0, 1], [8, 9, 10]]])
    parts = (Part(object="box", file="a.obj"), Part(object="gone"))
    part = np.append(np.zeros(len(BOX) + 1, dtype=int), 1)
    with caplog.at_level(logging.WARNING):
        mesh = build_mesh(np.concatenate([CORNERS, line]), faces, parts, part)
    assert mesh.n_faces == 12
    assert mesh.repaired == {"degenerate_faces": 2}
    assert [p.object for p in mesh.parts] == ["box"]
    assert "a.obj: dropped 2 of 14 triangles" in caplog.text


def test_long_thin_triangles_of_a_guard_rail_are_kept() -> None:
    # 4 m long, 1 um high: thin, but its normal is exact to 1e-10
    mesh = build_mesh([[0, 0, 0], [4, 0, 0], [4, 0, 1e-6]], [[0, 1, 2]])
    assert mesh.n_faces == 1
    assert np.allclose(mesh.face_normal, [[0, -1, 0]], atol=1e-9)


def test_mesh_of_only_degenerate_faces_is_refused() -> None:
    with pytest.raises(InputError, match="all 1 triangles have no area"):
        build_mesh([[0, 0, 0], [1, 1, 1], [2, 2, 2]], [[0, 1, 2]])


def test_mirroring_flips_the_winding_so_that_normals_stay_outward() -> None:
    mirrored = box().transformed(np.diag([1.0, -1.0, 1.0]))
    assert signed_volume(mirrored) == pytest.approx(30, rel=1e-14)
    assert mirrored.bounds[:, 1].tolist() == [-3, 0]


def test_pose_and_matrix_move_alike(rng) -> None:
    pose = Pose((1, 2, 3), (30, 10, -5))
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pose.rotation, pose.translation
    a, b = box().transformed(pose), box().transformed(matrix)
    assert np.allclose(a.vertices, b.vertices, atol=1e-14)
    assert np.allclose(a.face_area, box().face_area, rtol=1e-13)


def test_singular_or_projective_matrices_are_refused() -> None:
    with pytest.raises(InputError, match="singular"):
        box().transformed(np.diag([1.0, 1.0, 0.0]))
    projective = np.eye(4)
    projective[3, 0] = 0.1
    with pytest.raises(InputError, match="last row"):
        box().transformed(projective)


def test_concatenate_keeps_parts_and_counts() -> None:
    a = build_mesh(CORNERS, np.concatenate([BOX, [[0, 0, 0]]]), Part(object="a"))
    b = box().transformed(Pose((10, 0, 0)))
    both = concatenate([a, b])
    assert both.n_faces == 24
    assert [p.object for p in both.parts] == ["a", "box"]
    assert both.repaired == {"degenerate_faces": 1}
    assert np.array_equal(both.part_bounds()[1], b.bounds)
    assert np.allclose(both.part_area, [62, 62], rtol=1e-14)
    assert both.part_faces.tolist() == [12, 12]


def test_select_drops_what_nothing_uses() -> None:
    both = concatenate([box(), box().transformed(Pose((10, 0, 0)))])
    second = both.select(both.part == 1)
    assert len(second.vertices) == 8
    assert len(second.parts) == 1
    assert second.bounds[0, 0] == 10
    with pytest.raises(InputError, match="no triangle is left"):
        both.select(np.zeros(24, dtype=bool))


def test_arrays_cannot_be_changed_behind_the_mesh() -> None:
    mesh = box()
    with pytest.raises(ValueError, match="read-only"):
        mesh.vertices[0, 0] = 1.0


def test_part_rows_must_exist() -> None:
    with pytest.raises(InputError, match="part holds 1, allowed 0 to 0"):
        build_mesh(CORNERS, BOX, Part(), np.ones(12, dtype=int))
    with pytest.raises(InputError, match="must be integers"):
        build_mesh(CORNERS, BOX.astype(float))
