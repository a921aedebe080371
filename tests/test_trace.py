"""Trace: what is hit, what hides what, columns of a row, repeatability, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from echo_tools import ISO, scene_of

import shenron_rt as srt
from shenron_rt.errors import InputError
from shenron_rt.scene.mesh import TaggedMesh
from shenron_rt.tracing.backend import backend_status

PROFILE = srt.load_profile("awrl1432")
STREET = [
    {"id": 1, "shape": "ground:60x16", "xyz_m": (30, 0, -1)},
    {"id": 2, "shape": "box:4x1.8x1.5", "xyz_m": (20, 1, -0.25), "ypr_deg": (25, 0, 0), "tag": "Car"},
    {"id": 3, "shape": "sphere:r=0.5,edge=0.05", "xyz_m": (12, -3, 0)},
    {"id": 4, "shape": "wall:30x4", "xyz_m": (25, 8, -1), "tag": "Walls"},
]
needs_llvm = pytest.mark.skipif(not backend_status("llvm").usable, reason="no usable LLVM on this machine")


@pytest.fixture(scope="module")
def street():
    return srt.trace(scene_of(*STREET, profile=PROFILE), seed=1, rays=30_000)


def test_rows_lie_on_the_surfaces_they_name(street):
    p, ids = street.position, street.object_id
    assert set(np.unique(ids)) == {1, 2, 3, 4}
    np.testing.assert_allclose(p[ids == 1][:, 2], -1, atol=1e-12)
    from_center = np.linalg.norm(p[ids == 3] - [12, -3, 0], axis=1)
    # vertices and facets of a sphere of 0.05 m edges lie within edge^2/(3 r) of its radius
    assert np.max(np.abs(from_center - 0.5)) < 0.05**2 / 1.5


def test_columns_of_a_row_belong_together(street):
    d = street.position / street.range[:, None]
    np.testing.assert_allclose(np.linalg.norm(street.normal, axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(street.cos_incidence, -np.sum(street.normal * d, axis=1), atol=1e-12)
    assert np.all((street.cos_incidence > 0) & (street.cos_incidence <= 1))
    e_u, e_v = street.footprint[:, 0], street.footprint[:, 1]
    cell = 4 * np.abs(np.sum(np.cross(e_u, e_v) * d, axis=1))
    # the solid angle of a cell 0.02 rad wide differs from its tangent patch by its square
    np.testing.assert_allclose(street.area, street.range**2 * cell / street.cos_incidence, rtol=2e-3)
    np.testing.assert_array_equal(street.bounces, 1)
    assert street.object_id.dtype == np.uint32
    assert street.tag.dtype == np.uint8
    assert street.position.dtype == np.float64
    assert (street.radar, street.seed, street.frame, street.door) == ("r", 1, 0, "mesh")


def test_tag_of_the_scene_overrides_that_of_the_shape(street):
    tags = {int(i): {srt.SemanticTag(int(t)).name for t in street.tag[street.object_id == i]} for i in (1, 2, 4)}
    assert tags[2] == {"Car"}
    assert tags[4] == {"Walls"}
    assert tags[1] == {"Roads"} or tags[1] == {"Ground"}


def test_nearest_surface_hides_what_is_behind(street):
    behind = scene_of({"id": 7, "shape": "plate:1x1", "xyz_m": (30, 0, 0)}, profile=ISO)
    front = scene_of(
        {"id": 7, "shape": "plate:1x1", "xyz_m": (30, 0, 0)},
        {"id": 8, "shape": "plate:2x2", "xyz_m": (10, 0, 0)},
        profile=ISO,
    )
    assert 7 in srt.trace(behind, rays=200_000).object_id
    hidden = srt.trace(front, rays=200_000)
    assert 7 not in hidden.object_id
    assert 8 in hidden.object_id


def test_hidden_object_is_hidden_from_its_aimed_rays_too():
    target = {"id": 7, "shape": "plate:1x1", "xyz_m": (30, 0, 0), "aim": 2_000}
    assert (
        7 not in srt.trace(scene_of(target, {"id": 8, "shape": "plate:2x2", "xyz_m": (10, 0, 0)}), rays=1_000).object_id
    )
    half = srt.trace(scene_of(target, {"id": 8, "shape": "plate:2x2", "xyz_m": (10, 1, 0)}), seed=2, rays=1_000)
    shown = half.position[half.object_id == 7]
    assert len(shown) > 500
    # the shadow of the edge at y = 0 is y = 0
    assert shown[:, 1].max() < 1e-9 + 0.0


def test_point_targets_are_seen_unless_hidden():
    wall = {"id": 8, "shape": "plate:2x2", "xyz_m": (10, 0, 0)}
    points = [
        {"id": 1, "xyz_m": (9.9, 0, 0), "rcs_dbsm": 0},
        {"id": 2, "xyz_m": (10.1, 0, 0), "rcs_dbsm": 0},
        {"id": 3, "xyz_m": (10.1, 3, 0), "rcs_dbsm": 0},
        {"id": 4, "xyz_m": (10.0, 0.1, 0), "rcs_dbsm": 0},
        {"id": 5, "xyz_m": (-4.0, 0, 0), "rcs_dbsm": 0},
    ]
    scat = srt.trace(scene_of(wall, point_targets=points), rays=1_000)
    assert set(scat.object_id[~np.isnan(scat.rcs)]) == {1, 3, 4, 5}


def test_scene_without_anything_gives_no_rows():
    empty = srt.trace(scene_of(), rays=200)
    assert len(empty) == 0
    assert len(srt.illuminate(empty, ISO)) == 0
    assert srt.illuminate(empty, ISO).power_by_object() == {}


def test_radar_inside_a_closed_box_sees_it_all_around():
    """The aimed patch cannot hold it, so the common grid does: the box's whole inner surface, 24 m^2."""
    scat = srt.trace(scene_of({"id": 5, "shape": "box:2x2x2", "xyz_m": (0.3, 0.2, 0.1), "aim": 500}), rays=30_000)
    assert scat.area.sum() == pytest.approx(24.0, rel=0.01)
    assert len(scat) == pytest.approx(30_000, rel=0.3)


def test_same_seed_gives_the_same_bytes():
    first, again = (srt.trace(scene_of(*STREET, profile=PROFILE), seed=5, rays=20_000) for _ in range(2))
    other = srt.trace(scene_of(*STREET, profile=PROFILE), seed=6, rays=20_000)
    for name in ("position", "area", "speckle", "jitter", "footprint", "object_id"):
        assert getattr(first, name).tobytes() == getattr(again, name).tobytes()
    assert first.position.tobytes() != other.position.tobytes()
    lit = [srt.illuminate(s, PROFILE).amplitude.tobytes() for s in (first, again)]
    assert lit[0] == lit[1]


@pytest.mark.llvm
@needs_llvm
def test_number_of_threads_does_not_change_a_byte():
    import drjit as dr

    from shenron_rt.tracing.backend import use_backend

    results, before = [], dr.thread_count()
    try:
        for threads in (1, 2):
            with use_backend("llvm"):
                dr.set_thread_count(threads)
            scat = srt.trace(scene_of(*STREET, profile=PROFILE), seed=5, rays=20_000, backend="llvm")
            returns = srt.illuminate(scat, PROFILE)
            results.append((scat.position.tobytes(), scat.speckle.tobytes(), returns.amplitude.tobytes()))
    finally:
        dr.set_thread_count(before)
    assert results[0] == results[1]


@pytest.mark.llvm
@needs_llvm
def test_scalar_and_llvm_give_the_same_hits():
    """The same triangle for 99.99 % of rays, positions to 1e-4 m."""
    from shenron_rt.scene.world import build_world, load_bodies
    from shenron_rt.tracing.caster import RayCaster
    from shenron_rt.tracing.launch import pattern_cells

    scene = scene_of(*STREET, profile=PROFILE)
    bodies, materials = load_bodies(scene)
    world = build_world(scene, scene.radars[0], 0.0, bodies, materials)
    directions = np.ascontiguousarray(pattern_cells(PROFILE.pattern, 20_000).direction.T, dtype=np.float32)
    scalar, llvm = (RayCaster(world.vertices, world.faces, b).cast(directions) for b in ("scalar", "llvm"))
    assert np.mean(scalar == llvm) >= 0.9999
    rows = [srt.trace(scene, seed=2, rays=5_000, backend=b) for b in ("scalar", "llvm")]
    assert [r.backend for r in rows] == ["scalar", "llvm"]
    assert len(rows[0]) == len(rows[1])
    np.testing.assert_allclose(rows[0].position, rows[1].position, atol=1e-4)


def test_hits_agree_with_an_independent_ray_caster():
    """trimesh with Embree, in its own float32: the same face but for rays within 1e-5 of an edge."""
    pytest.importorskip("embreex")
    trimesh = pytest.importorskip("trimesh")
    from shenron_rt.scene.world import build_world, load_bodies
    from shenron_rt.tracing.backend import choose_backend
    from shenron_rt.tracing.caster import RayCaster
    from shenron_rt.tracing.launch import pattern_cells

    scene = scene_of(*STREET, profile=PROFILE)
    bodies, materials = load_bodies(scene)
    world = build_world(scene, scene.radars[0], 0.0, bodies, materials)
    d = pattern_cells(PROFILE.pattern, 8_000).direction
    ours = RayCaster(world.vertices, world.faces, choose_backend()).cast(np.ascontiguousarray(d.T, dtype=np.float32))
    mesh = trimesh.Trimesh(world.vertices, world.faces, process=False)
    theirs = mesh.ray.intersects_first(np.zeros_like(d), d)
    assert np.mean(ours == theirs) > 0.999
    assert np.mean(ours >= 0) > 0.3


def test_positions_keep_float64_at_a_kilometre():
    """A plate 900 m out, turned: on its plane to 1e-9 m, where float32 would be 3e-5 m off."""
    scene = scene_of({"id": 5, "shape": "plate:40x40", "xyz_m": (900, 20, 3), "ypr_deg": (30, 10, 0), "aim": 500})
    scat = srt.trace(scene, rays=200)
    normal = srt.Pose((0, 0, 0), (30, 10, 0)).rotation[:, 0]
    assert np.max(np.abs((scat.position - [900, 20, 3]) @ normal)) < 1e-9


def test_far_from_the_world_origin_nothing_is_lost():
    """The same scene 50 km away from the world's origin: float64 keeps 1e-11 m of it."""
    here = srt.trace(scene_of(STREET[1]), seed=4, rays=100_000)
    x, y, z = STREET[1]["xyz_m"]
    there = srt.trace(
        scene_of({**STREET[1], "xyz_m": (x + 5e4, y - 3e4, z)}, ego={"xyz_m": (5e4, -3e4, 0)}), seed=4, rays=100_000
    )
    assert len(here) > 50
    np.testing.assert_allclose(there.position, here.position, atol=1e-7)


def test_mesh_objects_can_be_given_in_python():
    mesh = TaggedMesh(
        np.array([[5.0, -1, -1], [5, 1, -1], [5, 0, 1]]),
        np.array([[0, 1, 2]]),
        np.array([0]),
        srt.make_shape("plate:1x1").parts,
    )
    scat = srt.trace(scene_of({"id": 5, "mesh": mesh}), rays=50_000)
    assert scat.area.sum() == pytest.approx(2.0, rel=0.05)


def test_tag_sky_reflects_nothing():
    sky = {"id": 5, "shape": "plate:20x20", "xyz_m": (30, 0, 0), "tag": "Sky"}
    wall = {"id": 6, "shape": "plate:20x20", "xyz_m": (40, 0, 0)}
    scat = srt.trace(scene_of(sky, wall), rays=2_000)
    assert set(scat.object_id) == {6}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"rays": 50}, "at least 100"),
        ({"max_bounces": 6}, "max_bounces"),
        ({"max_bounces": 0}, "max_bounces"),
        ({"radar": "rear"}, "no radar 'rear'"),
        ({"backend": "cudda"}, "did you mean 'cuda'"),
    ],
)
def test_bad_arguments_are_refused_in_words(arguments, message):
    with pytest.raises(InputError, match=message):
        srt.trace(scene_of(STREET[1]), **arguments)


def test_several_radars_need_a_name():
    scene = srt.Scene(radars=[{"name": "front"}, {"name": "rear", "ypr_deg": (180, 0, 0)}])
    with pytest.raises(InputError, match=r"2 radars.*front.*rear"):
        srt.trace(scene)
    assert srt.trace(scene, radar="rear", rays=100).radar == "rear"


def test_unknown_material_names_the_part_and_a_suggestion():
    with pytest.raises(InputError, match=r"unknown material 'asfalt'.*did you mean 'asphalt"):
        srt.trace(scene_of({"id": 5, "name": "road", "shape": "plate:1x1", "material": "asfalt"}), rays=100)


def test_unknown_shape_and_missing_mesh_are_refused():
    with pytest.raises(InputError, match=r"did you mean 'sphere'"):
        srt.trace(scene_of({"id": 5, "shape": "spere:r=1"}), rays=100)
    with pytest.raises(srt.NotFoundError, match=r"gone\.obj"):
        srt.trace(scene_of({"id": 5, "mesh": "gone.obj"}), rays=100)


def test_nan_vertices_are_refused(tmp_path):
    with pytest.raises(InputError, match="NaN"):
        TaggedMesh(np.full((3, 3), np.nan), np.array([[0, 1, 2]]), np.array([0]), srt.make_shape("plate:1x1").parts)
    (tmp_path / "bad.obj").write_text("o Car_1\nv 0 0 0\nv nan 1 0\nv 0 0 1\nf 1 2 3\n")
    with pytest.raises(InputError, match=r"bad\.obj"):
        srt.trace(scene_of({"id": 5, "mesh": tmp_path / "bad.obj"}), rays=100)
