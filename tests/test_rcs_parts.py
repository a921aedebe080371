"""The solver's parts: polygon integral, smooth surfaces, tubes, vector fields along bounces."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shenron_rt.physics import fresnel, fresnel_cos
from shenron_rt.sbr.chain import Bounce, Chain, trace_chain
from shenron_rt.sbr.fields import Fields, fields_along
from shenron_rt.sbr.polygon import polygon_integral
from shenron_rt.sbr.surface import Reflector, Surface
from shenron_rt.sbr.tubes import in_line
from shenron_rt.sbr.views import Views
from shenron_rt.scene.mesh import TaggedMesh, build_mesh, concatenate
from shenron_rt.scene.shapes import make_shape
from shenron_rt.scene.smooth import smooth_groups
from shenron_rt.tracing.backend import choose_backend

CONCRETE = 5.24 - 0.3225j


def surface(mesh: TaggedMesh, permittivity: complex | None = None) -> Surface:
    """Return a surface of one reflector."""
    kind = Reflector() if permittivity is None else Reflector(lambda _f, cos: fresnel_cos(permittivity, cos))
    return Surface(mesh, (kind,), np.zeros(mesh.n_faces, dtype=np.int64), choose_backend("auto"))


def cast(of: Surface, views: Views, points: np.ndarray, bounces: int) -> Chain:
    """Return the paths of the rays of one view that head for points (n, 3)."""
    offset = points - of.centre
    x, y = offset @ views.horizontal[0], offset @ views.vertical[0]
    rays = views.launch(np.zeros(len(points), dtype=np.int64), x, y, of.centre, of.radius)
    return trace_chain(of, views, rays, bounces)


def one_view(azimuth_deg: float, elevation_deg: float = 0.0) -> Views:
    return Views(np.radians([azimuth_deg]), np.radians([elevation_deg]))


def by_quadrature(corners: np.ndarray, gradient: np.ndarray) -> complex:
    """Integrate exp(-j g . x) over a star-shaped polygon by Gauss-Legendre on the triangles from its first corner."""
    x, weight = np.polynomial.legendre.leggauss(60)
    s, w = 0.5 * (x + 1.0), 0.5 * weight
    total = 0.0j
    for a, b in zip(corners[1:-1] - corners[0], corners[2:] - corners[0], strict=True):
        points = corners[0] + s[:, None, None] * (a + s[:, None] * (b - a))
        total += np.sum((s * w)[:, None] * w * (a[0] * b[1] - a[1] * b[0]) * np.exp(-1j * points @ gradient))
    return complex(total)


def test_polygon_integral_is_the_quadrature_s_from_no_phase_to_many_cycles(rng: np.random.Generator) -> None:
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, (30, 5)), axis=1)
    corners = np.stack([np.cos(angle), 0.7 * np.sin(angle)], axis=-1)
    for size in (0.0, 1e-9, 1e-4, 5e-3, 0.1, 3.0, 40.0):
        turn = rng.uniform(0.0, 2.0 * np.pi, 30)
        gradient = size * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        want = np.array([by_quadrature(c, g) for c, g in zip(corners, gradient, strict=True)])
        # the solver's own statement: 1e-6 of the area of about 2
        assert np.abs(polygon_integral(corners, gradient) - want).max() < 2e-6
        assert np.abs(polygon_integral(corners[:, ::-1], gradient) + want).max() < 2e-6


def test_sharp_edges_and_materials_part_smooth_surfaces() -> None:
    def count(mesh: TaggedMesh, kind: np.ndarray | None = None) -> int:
        return len(np.unique(smooth_groups(mesh, np.zeros(mesh.n_faces, dtype=np.int64) if kind is None else kind)))

    assert count(make_shape("box:1x2x3")) == 6
    assert count(make_shape("sphere:r=0.1,edge=0.02")) == 1
    assert count(make_shape("cylinder:r=0.1,l=0.3,edge=0.02")) == 3
    assert count(make_shape("trihedral:triangular,a=0.1")) == 3
    plate = make_shape("plate:1x1")
    assert count(plate) == 1
    assert count(plate, np.array([0, 1])) == 2
    # a file that repeats vertices for every triangle describes the same surface
    sphere = make_shape("sphere:r=0.1,edge=0.02")
    loose = build_mesh(sphere.vertices[sphere.faces].reshape(-1, 3), np.arange(3 * sphere.n_faces).reshape(-1, 3))
    assert count(loose) == 1


def test_hits_are_in_line_on_a_plane_and_not_across_a_step() -> None:
    wavelength = 0.0125
    step = 0.01 * wavelength
    for height, together in ((step, True), (4.0 * step, False)):  # the limit is 1/64 of the wavelength
        low, high = make_shape("plate:0.1x0.1"), make_shape("plate:0.1x0.1")
        high = high.transformed(np.array([[1, 0, 0, height], [0, 1, 0, 0.1], [0, 0, 1, 0], [0, 0, 0, 1.0]]))
        of = surface(concatenate([low, high]))
        chain = cast(of, one_view(0.0), np.array([[0.0, -0.03, 0.0], [0.0, 0.03, 0.01], [0.0, 0.09, 0.0]]), 1)
        (bounce,) = chain.bounces
        first, second, third = (np.array([row]) for row in bounce.row_of)
        assert in_line(bounce, first, second, wavelength, True)[0]
        assert in_line(bounce, second, third, wavelength, True)[0] == together


def mirrored(fields: Fields, bounce: Bounce) -> np.ndarray:
    """Return the fields (n, 2, 3) that leave a conductor."""
    n = bounce.normal[:, None, :]
    return 2.0 * np.sum(fields.arriving * n, axis=2, keepdims=True) * n - fields.arriving


@pytest.mark.parametrize("distance", [None, 0.7])
def test_a_conductor_keeps_the_fields_orthonormal_and_transverse(distance: float | None) -> None:
    of = surface(make_shape("trihedral:square,a=0.1"))
    view = Views(np.radians([7.0]), np.radians([4.0]), distance)
    points = np.array([0.05, 0.0, 0.0]) + np.random.default_rng(1).uniform(-0.02, 0.02, (50, 3))
    chain = cast(of, view, points, 3)
    assert len(chain.bounces) == 3
    for bounce, fields in zip(chain.bounces, fields_along(of, view, chain, 24e9), strict=True):
        gram = np.einsum("npi,nqi->npq", fields.arriving, fields.arriving)
        # a spherical wave's V and H lie across each ray, at right angles but for the square of the ray's slope
        assert np.allclose(gram, np.eye(2), atol=1e-12 if distance is None else 0.03)
        assert np.abs(np.einsum("npi,ni->np", fields.arriving, bounce.direction)).max() < 1e-12
        tangent = np.cross(bounce.normal[:, None, :], mirrored(fields, bounce) + fields.arriving)
        assert np.abs(tangent).max() < 1e-12  # no tangential field on a conductor


@pytest.mark.parametrize("azimuth", [0.0, 30.0, 66.0, 80.0])
def test_a_dielectric_reflects_te_and_tm_by_fresnel(azimuth: float) -> None:
    of = surface(make_shape("plate:1x1"), CONCRETE)
    view = one_view(azimuth)
    chain = cast(of, view, np.array([[0.0, 0.1, -0.2]]), 1)
    (fields,) = fields_along(of, view, chain, 77e9)
    te, tm = fresnel(CONCRETE, math.radians(azimuth))
    v, h = view.vertical[0], view.horizontal[0]
    assert fields.leaving is not None
    assert np.allclose(fields.leaving[0, 0], te * v, atol=1e-12)
    # H lies in the plane of incidence; with it goes the H of the mirrored direction, and TM counts E along e x d
    reflected = h * np.array([1.0, -1.0, 1.0])
    assert np.allclose(fields.leaving[0, 1], tm * reflected, atol=1e-12)


def test_coefficients_of_a_conductor_make_a_conductor() -> None:
    mesh = make_shape("dihedral:a=0.1,b=0.1,h=0.1")
    by_table = Reflector(lambda _f, cos: (-np.ones(len(cos), dtype=complex), np.ones(len(cos), dtype=complex)))
    metal, table = surface(mesh), Surface(mesh, (by_table,), np.zeros(4, dtype=np.int64), choose_backend("auto"))
    view = one_view(12.0, 25.0)
    points = np.array([[0.03, 0.02, 0.0], [0.03, -0.02, 0.01]])
    one, other = (fields_along(s, view, cast(s, view, points, 2), 24e9) for s in (metal, table))
    assert np.allclose(one[1].arriving, other[1].arriving, atol=1e-12)


def test_a_chain_of_dielectrics_is_reciprocal() -> None:
    of = surface(make_shape("dihedral:a=0.1,b=0.1,h=0.3"), CONCRETE)
    there = one_view(10.0, 20.0)
    chain = cast(of, there, np.array([[0.03, 0.01, 0.0]]), 2)
    assert len(chain.bounces) == 2
    last = chain.bounces[1]
    out = last.direction[0] - 2.0 * (last.direction[0] @ last.normal[0]) * last.normal[0]
    back = Views(np.arctan2(out[1:2], out[:1]), np.arcsin(out[2:]))
    returning = cast(of, back, last.position, 2)
    assert np.allclose(returning.bounces[1].position, chain.bounces[0].position, atol=1e-9)

    def jones(view: Views, along: Chain, receiver: Views) -> np.ndarray:
        basis = np.stack([receiver.vertical[0], receiver.horizontal[0]])
        fields = fields_along(of, view, along, 77e9)[1]
        assert fields.leaving is not None
        return np.asarray(basis @ fields.leaving[0].T)

    forth, hither = jones(there, chain, back), jones(back, returning, there)
    assert np.abs(forth - hither.T).max() < 1e-6  # the bar; 1e-9 are the hit's float32 coordinates
    assert abs(forth[0, 1]) > 1e-3
