"""Round surfaces back from coarse facets: spheres, cylinders, mixed windings, creases, and what they scatter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import shenron_rt as srt
from shenron_rt.errors import InputError
from shenron_rt.scene import rounding
from shenron_rt.scene.mesh import TaggedMesh, build_mesh

WAVELENGTH = 299_792_458 / 77e9
RADIUS = 0.1


def from_trimesh(mesh: trimesh.Trimesh) -> TaggedMesh:
    return build_mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))


@pytest.fixture(scope="module")
def sphere() -> TaggedMesh:
    """A ball of 1280 facets, 8 deg each."""
    return from_trimesh(trimesh.creation.icosphere(subdivisions=3, radius=RADIUS))


def is_closed(mesh: TaggedMesh) -> bool:
    a, _ = mesh.adjacent
    return 2 * len(a) == 3 * mesh.n_faces


def test_a_sphere_comes_back_from_its_facets(sphere: TaggedMesh) -> None:
    tolerance = 1e-5
    found = srt.round_mesh(sphere, tolerance)
    inside = found.vertices[found.faces].mean(axis=1)
    # patches are off by a t^4 / 128 with t = 0.15 rad between vertices: 0.4 um, and less than twice that between edges
    patch = 2 * RADIUS * 0.15**4 / 128
    np.testing.assert_allclose(np.linalg.norm(found.vertices, axis=1), RADIUS, atol=patch)
    # the middle of a facet lies further in than those of its edges, by 4/3
    assert RADIUS - np.linalg.norm(inside, axis=1).min() < 4 / 3 * tolerance + patch
    assert is_closed(found)
    for vertex in sphere.vertices[::40]:
        assert np.abs(found.vertices - vertex).max(axis=1).min() < 1e-15


def test_facets_may_be_wound_either_way(sphere: TaggedMesh) -> None:
    third = np.arange(sphere.n_faces)[:, None] % 3 == 0
    flipped = replace(sphere, faces=np.where(third, sphere.faces[:, ::-1], sphere.faces))
    found, wanted = (srt.round_mesh(m, 1e-5) for m in (flipped, sphere))
    assert found.n_faces == wanted.n_faces
    np.testing.assert_allclose(found.bounds, wanted.bounds, atol=1e-12)
    np.testing.assert_allclose(found.face_area.sum(), wanted.face_area.sum(), rtol=1e-12)


def test_the_rim_of_a_cylinder_stays_on_its_cap_and_its_side() -> None:
    coarse = from_trimesh(trimesh.creation.cylinder(radius=RADIUS, height=0.5, sections=32))
    found = srt.round_mesh(coarse, 1e-5)
    assert is_closed(found)
    np.testing.assert_allclose(found.bounds[:, 2], [-0.25, 0.25], atol=1e-12)  # the caps stay flat
    side = found.vertices[found.faces[np.abs(found.face_normal[:, 2]) < 0.5]]
    radius = np.hypot(side[..., 0], side[..., 1])
    np.testing.assert_allclose(radius, RADIUS, atol=2 * RADIUS * (2 * np.pi / 32) ** 4 / 128)
    assert found.face_area.sum() == pytest.approx(2 * np.pi * RADIUS * (0.5 + RADIUS), rel=1e-3)  # 32 sides: 0.6 % less


@pytest.mark.parametrize("shape", ["box:1x0.5x0.2", "dihedral:a=0.1,b=0.1,h=0.1", "trihedral:square,a=0.1"])
def test_what_is_flat_stays(shape: str) -> None:
    mesh = srt.make_shape(shape)
    found = srt.round_mesh(mesh, 1e-6)
    assert found.n_faces == mesh.n_faces
    np.testing.assert_array_equal(found.vertices[found.faces], mesh.vertices[mesh.faces])


def test_facets_of_different_fineness_leave_no_crack() -> None:
    """A ball stretched threefold: sharp at its ends, where it is cut six times as often as in the middle."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=RADIUS)
    mesh = build_mesh(np.asarray(ball.vertices) * [3.0, 1.0, 1.0], np.asarray(ball.faces))
    found = srt.round_mesh(mesh, 1e-5)
    assert is_closed(found)
    edges = np.linalg.norm(np.diff(found.vertices[found.faces], axis=1), axis=2)
    assert edges.max() > 4 * edges.min()


def test_parts_keep_their_surface(sphere: TaggedMesh) -> None:
    halves = (sphere.vertices[sphere.faces].mean(axis=1)[:, 2] > 0).astype(int)
    mesh = build_mesh(sphere.vertices, sphere.faces, (replace(sphere.parts[0], group="low"), sphere.parts[0]), halves)
    found = srt.round_mesh(mesh, 1e-5)
    assert found.parts == mesh.parts
    upper = found.vertices[found.faces].mean(axis=1)[found.part == 1]
    assert upper[:, 2].min() > -0.01
    # the border follows the facets; 1280 of them have 0.5 % less area than the ball
    np.testing.assert_allclose(found.part_area / mesh.part_area, 1.005, atol=0.002)


def test_edges_that_bend_more_stay_edges(sphere: TaggedMesh) -> None:
    """Facets that meet at 3.1 to 5.8 deg are flat where less than 3 is asked for."""
    found = srt.round_mesh(sphere, 1e-5, below_deg=3.0)
    assert found.n_faces == sphere.n_faces


def test_a_coarse_sphere_scatters_as_a_sphere(sphere: TaggedMesh) -> None:
    sweep = {"frequency_hz": 77e9, "azimuth_deg": np.arange(0.0, 40.0, 7.0), "elevation_deg": 3.0, "max_bounces": 1}
    wanted = 10 * np.log10(np.pi * RADIUS**2)
    coarse = srt.sweep_rcs(sphere, **sweep).rcs_dbsm.ravel() - wanted
    assert np.abs(coarse).max() > 2.0  # facets of 15 mm, four wavelengths: each flashes by itself
    found = srt.sweep_rcs(srt.round_mesh(sphere, WAVELENGTH / 256), **sweep).rcs_dbsm.ravel() - wanted
    # chords lie 4 pi / 256 rad and less before the surface: 0.05 rad, 0.2 dB where it all is of one sign
    assert np.abs(found).max() < 0.2


@pytest.mark.parametrize(("tolerance", "below"), [(0.0, 30.0), (np.nan, 30.0), (1e-3, 0.0), (1e-3, 91.0)])
def test_bounds(sphere: TaggedMesh, tolerance: float, below: float) -> None:
    with pytest.raises(InputError, match=r"round_mesh: (tolerance_m|below_deg)"):
        srt.round_mesh(sphere, tolerance, below_deg=below)


def test_too_fine_a_tolerance_is_refused(sphere: TaggedMesh, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rounding, "_MOST_FACES", 10_000)
    with pytest.raises(InputError, match="take a larger one"):
        srt.round_mesh(sphere, 1e-7)
