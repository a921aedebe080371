"""First bounces over facets: which bodies they can do, what is seen of them, and that they agree with tubes of rays."""

from __future__ import annotations

import math

import numpy as np
import pytest

import shenron_rt as srt
from shenron_rt.frames import Pose
from shenron_rt.sbr import sight
from shenron_rt.sbr.sight import HIDDEN, LIMB, PARTLY, WHOLE, Sight
from shenron_rt.sbr.subdivide import clipped, shortened
from shenron_rt.sbr.surface import Reflector, Surface
from shenron_rt.sbr.views import Views
from shenron_rt.scene.mesh import TaggedMesh, concatenate
from shenron_rt.scene.shapes import make_shape
from shenron_rt.tracing.backend import choose_backend

LAM = srt.constants.SPEED_OF_LIGHT / 77e9


def surface(mesh: TaggedMesh) -> Surface:
    return Surface(mesh, (Reflector(),), np.zeros(mesh.n_faces, dtype=np.int64), choose_backend("auto"))


def views(*azimuth_deg: float, distance: float | None = None) -> Views:
    return Views(np.radians(azimuth_deg), np.zeros(len(azimuth_deg)), distance)


def area(triangles: np.ndarray) -> np.ndarray:
    a, b, c = (triangles[:, k] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def pair(distance: float) -> TaggedMesh:
    """Return a plate of 40 mm in front of the middle of one of 100 mm, both facing +x."""
    front = make_shape("plate:0.04x0.04").transformed(Pose((distance, 0.0, 0.0)))
    return concatenate([make_shape("plate:0.1x0.1"), front])


@pytest.mark.parametrize(
    "shape", ["sphere:r=0.02", "cylinder:r=0.05,l=0.3", "box:0.3x0.2x0.1", "plate:0.1x0.1", "disc:r=0.05"]
)
def test_bodies_that_hide_nothing_of_themselves_are_known(shape: str) -> None:
    assert surface(make_shape(shape)).convex


@pytest.mark.parametrize("shape", ["dihedral:a=0.1,b=0.1,h=0.1", "trihedral:square,a=0.1", "pedestrian"])
def test_bodies_that_may_hide_themselves_are_not_taken_for_convex(shape: str) -> None:
    assert not surface(make_shape(shape)).convex


def test_two_convex_bodies_are_not_one() -> None:
    ball = make_shape("sphere:r=0.02")
    assert not surface(concatenate([ball, ball.transformed(Pose((0.1, 0.0, 0.0)))])).convex


def test_a_body_turned_inside_out_is_still_convex() -> None:
    box = make_shape("box:0.3x0.2x0.1")
    mirrored = TaggedMesh(box.vertices, box.faces[:, ::-1], box.part, box.parts)
    assert surface(box).outward == -surface(mirrored).outward != 0


def test_parts_of_triangles_add_up_to_them(rng: np.random.Generator) -> None:
    triangles, longest = rng.normal(size=(20, 3, 3)), 0.4
    cut = shortened(triangles, lambda place: np.full(len(place), longest), 100_000)
    assert cut is not None
    parts, row = cut
    np.testing.assert_allclose(np.bincount(row, area(parts)), area(triangles), rtol=1e-9)
    sides = np.linalg.norm(np.roll(parts, -1, axis=1) - parts, axis=2)
    assert sides.max() <= longest
    turn = np.einsum("ni,ni->n", *(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]) for t in (parts, triangles[row])))
    assert (turn > 0).all()
    assert shortened(triangles, lambda place: np.full(len(place), longest), len(parts) - 1) is None


def test_a_thin_triangle_is_cut_along_its_length_only() -> None:
    thin = np.array([[[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [0.0, 0.01, 0.0]]])
    cut = shortened(thin, lambda place: np.full(len(place), 0.02), 10_000)
    assert cut is not None
    assert len(cut[1]) < 4 * 6.0 / 0.02  # not that squared


def test_what_is_cut_off_and_what_is_left_add_up(rng: np.random.Generator) -> None:
    triangles, height = rng.normal(size=(200, 3, 3)), rng.normal(size=(200, 3))
    (above, up), (below, down) = clipped(triangles, height), clipped(triangles, -height)
    both = np.bincount(up, area(above), 200) + np.bincount(down, area(below), 200)
    np.testing.assert_allclose(both, area(triangles), rtol=1e-9)
    # one corner up: the part above is the product of the shares of its two sides
    row = int(np.flatnonzero((height > 0).sum(axis=1) == 1)[0])
    top = int(height[row].argmax())
    share = math.prod(height[row, top] / (height[row, top] - height[row, k]) for k in range(3) if k != top)
    assert area(above)[up == row].sum() == pytest.approx(share * area(triangles)[row], rel=1e-9)


def test_a_plate_in_front_hides_the_one_behind_in_part_or_whole() -> None:
    sees = Sight(surface(pair(0.05)), LAM)
    state = sees.of(views(0.0, 180.0))
    assert state[0].tolist() == [PARTLY, PARTLY, WHOLE, WHOLE]
    assert state[1].tolist() == [WHOLE, WHOLE, HIDDEN, HIDDEN]


def test_a_hole_of_light_smaller_than_a_facet_is_noticed() -> None:
    small = make_shape("plate:0.006x0.006").transformed(Pose((0.05, 0.013, 0.021)))  # a wavelength and a half wide
    state = Sight(surface(concatenate([make_shape("plate:0.1x0.1"), small])), LAM).of(views(0.0))
    assert PARTLY in state[0, :2]


def test_half_of_a_sphere_is_seen_and_less_from_near() -> None:
    ball = surface(make_shape("sphere:r=0.02"))
    for distance, share in ((None, 0.5), (0.04, 0.25)):  # a cap seen from 2 r has the height r / 2 of 2 r
        state = Sight(ball, LAM).of(views(20.0, distance=distance))[0]
        face = ball.mesh.face_area
        whole, limb = (face[state == s].sum() / face.sum() for s in (WHOLE, LIMB))
        assert whole < share < whole + limb
        assert limb < 0.1


def test_what_is_hidden_does_not_echo_and_the_rest_does() -> None:
    # at normal incidence every visible bit of a plate adds its area with the phase of its depth
    depth = 0.05 + LAM / 8
    got = srt.sweep_rcs(pair(depth), frequency_hz=77e9, azimuth_deg=0.0, max_bounces=1).amplitude[0, 0, 0, 0]
    k = 2 * math.pi / LAM
    want = 2 * math.sqrt(math.pi) / LAM * (0.1**2 - 0.04**2 + 0.04**2 * np.exp(2j * k * depth))
    # cells cut along the edges: to 1/2048 of their side, of the 26 cells across
    assert abs(got - want) < 2e-3 * abs(want)


@pytest.mark.parametrize("shape", ["dihedral:a=0.05,b=0.05,h=0.05", "trihedral:triangular,a=0.05"])
def test_tubes_of_rays_and_facets_agree(shape: str, monkeypatch: pytest.MonkeyPatch) -> None:
    options = {
        "frequency_hz": 77e9,
        "azimuth_deg": [0.0, 7.0, 20.0],
        "elevation_deg": 5.0,
        "polarization": ("VV", "HH"),
    }
    facets = srt.sweep_rcs(shape, **options)
    monkeypatch.setattr(sight, "_MOST_FACES", 0)
    tubes = srt.sweep_rcs(shape, **options)
    assert not np.array_equal(facets.amplitude, tubes.amplitude)
    peak = np.abs(facets.amplitude).max()
    # tubes were within 0.02 dB of exact integrals at the peak: 0.3 % of the amplitude
    np.testing.assert_allclose(tubes.amplitude, facets.amplitude, rtol=0.0, atol=3e-3 * peak)
