"""Di- and trihedrals of every kind, off axis: the exact sum over bounces against tables, closed forms, symmetries."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from canonical_tools import FLOOR, PRINTED, TO_TABLE, angles, columns, dbsm, in_table_frame, wavelength

from shenron_rt.errors import InputError
from shenron_rt.physics import (
    dihedral_rcs,
    dihedral_scattering_matrix,
    trihedral_rcs,
    trihedral_scattering_matrix,
)
from shenron_rt.physics.canonical.polygon import clip_convex, polygon_area, polygon_transform

WAVELENGTH = wavelength(77)
ENTRY = {"VV": (0, 0), "HH": (1, 1), "HV": (1, 0)}


def octant(count: int, rng: np.random.Generator) -> np.ndarray:
    """Return unit vectors (count, 3) of the octant, in the plates' frame, none within 0.6 deg of a plate."""
    u = np.abs(rng.normal(size=(4 * count, 3)))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u[np.min(u, axis=1) > 0.01][:count]


@pytest.mark.parametrize("ghz", [24, 77])
def test_dihedral_matches_the_table_in_both_polarisations(ghz: int, shared_reference: Path) -> None:
    t = columns(shared_reference / f"rcs/dihedral_100x100x100mm_{ghz}GHz.csv")
    azimuth = np.radians(t["phi_deg"] - 45.0)
    matrix = dihedral_scattering_matrix(0.1, 0.1, 0.1, wavelength(ghz), azimuth)
    for p in ("VV", "HH"):
        assert np.max(np.abs(dbsm(matrix[(..., *ENTRY[p])]) - t[f"gopo_{p}_dbsm"])) < PRINTED
    double = dihedral_scattering_matrix(0.1, 0.1, 0.1, wavelength(ghz), azimuth, bounces=(2,))
    assert np.max(np.abs(dbsm(double[..., 0, 0]) - t["double_only_dbsm"])) < PRINTED
    assert np.max(np.abs(matrix[..., 0, 1])) < 1e-12  # no cross-polar echo across the seam


def test_the_double_bounce_of_a_dihedral_has_opposite_signs_and_the_closed_form() -> None:
    phi = np.radians(np.linspace(1.0, 89.0, 50))
    matrix = dihedral_scattering_matrix(0.1, 0.1, 0.2, WAVELENGTH, phi - math.pi / 4, bounces=(2,))
    assert np.allclose(matrix[..., 0, 0], -matrix[..., 1, 1], rtol=1e-12)
    assert np.allclose(np.abs(matrix[..., 1, 1]) ** 2, dihedral_rcs(0.1, 0.2, WAVELENGTH, phi), rtol=1e-12)
    # E along the seam is reversed twice: what a plate sends back reversed comes back upright
    assert np.all(matrix[..., 0, 0].real < 0.0)


def test_unequal_plates_of_a_dihedral_lie_where_they_are_said_to() -> None:
    # the radar that faces plate a (along azimuth -45) stands at +45, and sees plate b edge on
    for azimuth, width in ((math.pi / 4, 0.1), (-math.pi / 4, 0.2)):
        matrix = dihedral_scattering_matrix(0.1, 0.2, 0.3, WAVELENGTH, azimuth)
        assert matrix[0, 0] == pytest.approx(2.0 * math.sqrt(math.pi) * width * 0.3 / WAVELENGTH, rel=1e-9)


def test_dihedral_turns_the_seam_s_pattern_with_elevation() -> None:
    # k h sin(el) = pi at the first null of the sinc; the plates' overlap shrinks by at most el * w * tan there
    null = math.asin(WAVELENGTH / (2.0 * 0.1))
    on, off = (abs(dihedral_scattering_matrix(0.1, 0.1, 0.1, WAVELENGTH, 0.0, el)[1, 1]) for el in (0.0, null))
    assert 20.0 * math.log10(off / on) < -25.0


@pytest.mark.parametrize("cut", ["az", "el"])
@pytest.mark.parametrize(
    "name", ["triangular_100mm_77GHz", "triangular_150mm_24GHz", "square_50mm_77GHz", "circular_80mm_77GHz"]
)
def test_trihedral_cuts_match_the_tables_cross_polar_echo_included(name: str, cut: str, shared_reference: Path) -> None:
    t = columns(shared_reference / f"rcs/trihedral_{name}_{cut}.csv")
    kind, leg, ghz = name.split("_")
    step = 6 if kind == "circular" else 1  # many corners: slow
    t = {key: column[::step] for key, column in t.items()}

    def matrix(bounces: tuple[int, ...]) -> np.ndarray:
        corner = partial(trihedral_scattering_matrix, kind, float(leg[:-2]) * 1e-3, wavelength(ghz[:-3]))
        return in_table_frame(partial(corner, bounces=bounces), t["az_deg"], t["el_deg"])

    total = matrix((1, 2, 3))
    # Elevations print four decimals: 35.2644 is 2e-5 deg off boresight, 1e-4 of an amplitude of a thousandth.
    for column, p, bar in (("VV", "VV", 2e-4), ("HH", "HH", 2e-4), ("cross_HV", "HV", 5e-3)):
        want = t[f"gopo_{column}_dbsm"]
        assert np.max(np.abs(dbsm(total[(..., *ENTRY[p])]) - want)) < bar
    triple, want = matrix((3,)), t["triple_only_dbsm"]
    assert np.max(np.abs(dbsm(triple[..., 0, 0]) - want)) < 2e-4
    assert np.count_nonzero(want > FLOOR) > 25


@pytest.mark.parametrize("name", ["triangular_5lambda", "triangular_10lambda", "square_4lambda"])
def test_trihedrals_in_wavelengths_match_beside_the_full_wave_solution(name: str, shared_reference: Path) -> None:
    t = columns(shared_reference / f"rcs/trihedral_{name}_fullwave.csv")
    kind, size = name.split("_")
    leg = float(size.removesuffix("lambda"))
    matrix = in_table_frame(
        lambda az, el: trihedral_scattering_matrix(kind, leg, 1.0, az, el), t["az_deg"], t["el_deg"]
    )
    for p in ("VV", "HH"):
        got = dbsm(matrix[(..., *ENTRY[p])])
        assert np.max(np.abs(got - t[f"gopo_{p}_db"])) < 1e-3  # three decimals printed
        near = np.hypot(t["az_deg"] - 45.0, t["el_deg"] - 35.2644) < 20.0
        # what the theory itself is worth near boresight, as stated for each size in the reference's report
        bar = {"triangular_5lambda": 0.4, "triangular_10lambda": 0.25, "square_4lambda": 1.5}[name]
        assert np.mean(np.abs(got - t[f"mom_{p}_db"])[near]) < bar


def triple_area(kind: str, u: np.ndarray) -> np.ndarray:
    """Return the classical triple-bounce area of a unit leg (SAND2014-0882) for unit vectors in the plates' frame."""
    p, q, r = np.sort(u, axis=1).T
    if kind == "square":
        return np.where(q >= r / 2.0, p * (4.0 - r / q), 4.0 * p * q / r)
    t = p + q + r
    return np.where(p + q <= r, 4.0 * p * q / t, t - 2.0 / t)


@pytest.mark.parametrize("kind", ["triangular", "square"])
def test_triple_bounce_area_is_the_classical_one_in_every_direction(kind: str, rng: np.random.Generator) -> None:
    u = octant(300, rng)
    azimuth, elevation = angles(u @ TO_TABLE)
    matrix = trihedral_scattering_matrix(kind, 0.1, WAVELENGTH, azimuth, elevation, bounces=(3,))
    want = 2.0 * math.sqrt(math.pi) / WAVELENGTH * 0.01 * triple_area(kind, u)
    # E comes back upright from three plates, reversed from one: negative, in phase with the apex, no cross-polar part
    assert np.allclose(matrix, -want[:, None, None] * np.eye(2), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("kind", ["triangular", "square", "circular"])
def test_boresight_is_the_classical_value_plus_the_ripple_of_one_and_two_bounces(kind: str) -> None:
    triple = trihedral_scattering_matrix(kind, 0.1, WAVELENGTH, 0.0, bounces=(3,))
    # the circular coefficient, 15.611, is known to five digits; its arcs are chords of 2e-4 of the radius' square
    assert abs(triple[0, 0]) ** 2 == pytest.approx(float(trihedral_rcs(kind, 0.1, WAVELENGTH)), rel=5e-5)
    total = trihedral_scattering_matrix(kind, 0.1, WAVELENGTH, 0.0)
    ripple = 3.2 / (0.1 / WAVELENGTH) if kind == "triangular" else 0.06  # dB, from the reference's report
    assert abs(dbsm(total[0, 0]) - dbsm(triple[0, 0])) < ripple


def test_a_trihedral_looks_alike_from_its_three_edges(rng: np.random.Generator) -> None:
    # a turn by 120 deg about the boresight maps the corner onto itself; singular values do not see the basis
    turn = np.roll(np.eye(3), 1, axis=0)
    u = octant(40, rng)
    values = [
        np.linalg.svd(trihedral_scattering_matrix("square", 0.05, WAVELENGTH, *angles(d @ TO_TABLE)), compute_uv=False)
        for d in (u, u @ turn)
    ]
    assert np.allclose(*values, rtol=1e-9, atol=1e-9)


def test_mirror_directions_give_mirror_matrices() -> None:
    # y -> -y keeps V and reverses H
    azimuth, elevation = np.radians([3.0, 11.0, 25.0]), np.radians([2.0, -8.0, 4.0])
    one = trihedral_scattering_matrix("triangular", 0.05, WAVELENGTH, azimuth, elevation)
    other = trihedral_scattering_matrix("triangular", 0.05, WAVELENGTH, -azimuth, elevation)
    flip = np.diag([1.0, -1.0])
    assert np.allclose(one, flip @ other @ flip, rtol=1e-9, atol=1e-10)


def test_monostatic_cross_polar_echoes_are_alike_far_below_the_peak(rng: np.random.Generator) -> None:
    azimuth, elevation = angles(octant(400, rng) @ TO_TABLE)
    for kind in ("triangular", "square"):
        matrix = trihedral_scattering_matrix(kind, 0.1, WAVELENGTH, azimuth, elevation)
        gap = np.max(np.abs(matrix[..., 0, 1] - matrix[..., 1, 0])) / np.max(np.abs(matrix))
        assert 20.0 * math.log10(gap) < -40.0
        assert gap > 1e-6  # physical optics is not reciprocal beyond one bounce, and this is exact physical optics


def test_directions_behind_a_plate_have_no_value_and_the_rest_keep_theirs() -> None:
    dihedral = dihedral_scattering_matrix(0.1, 0.1, 0.1, WAVELENGTH, np.radians([-46.0, -44.0, 44.0, 46.0]))
    assert np.array_equal(np.isnan(dihedral[:, 0, 0]), [True, False, False, True])
    # an edge of the trihedral lies in the x-z plane, 54.7 deg over boresight; opposite to it a plate 35.3 deg below
    elevation = np.radians([-35.5, -35.0, 54.5, 55.0])
    trihedral = trihedral_scattering_matrix("square", 0.1, WAVELENGTH, 0.0, elevation)
    assert np.array_equal(np.isnan(trihedral[:, 1, 1]), [True, False, False, True])
    assert trihedral_scattering_matrix("square", 0.1, WAVELENGTH, np.zeros((2, 3))).shape == (2, 3, 2, 2)


def test_impossible_corners_are_refused() -> None:
    with pytest.raises(InputError, match="circular, square, triangular"):
        trihedral_scattering_matrix("round", 0.1, WAVELENGTH, 0.0)
    with pytest.raises(InputError, match=r"leg is -0\.1 m"):
        trihedral_scattering_matrix("square", -0.1, WAVELENGTH, 0.0)
    with pytest.raises(InputError, match="dihedral's h is nan m"):
        dihedral_scattering_matrix(0.1, 0.1, math.nan, WAVELENGTH, 0.0)


def test_polygon_transform_is_exact_from_no_phase_to_many_cycles() -> None:
    # a triangle, against nested Gauss-Legendre: 40 nodes resolve 8 cycles to rounding
    corners = np.array([[0.3, -0.2], [1.1, 0.1], [0.2, 0.9]])
    x, weight = np.polynomial.legendre.leggauss(40)
    s, w = 0.5 * (x + 1.0), 0.5 * weight
    a, b = corners[1] - corners[0], corners[2] - corners[0]
    points = corners[0] + s[:, None, None] * (a + s[:, None] * (b - a))
    weights = (s * w)[:, None] * w * (a[0] * b[1] - a[1] * b[0])
    for size in (0.0, 1e-12, 1e-8, 1e-4, 1.0, 40.0):
        for angle in (0.0, 0.4, 2.0):
            q = size * np.array([math.cos(angle), math.sin(angle)])
            want = np.sum(weights * np.exp(1j * points @ q))
            assert polygon_transform(corners, q) == pytest.approx(want, rel=1e-11)
            assert polygon_transform(corners[::-1], q) == pytest.approx(-want, rel=1e-11)


def test_clipping_keeps_what_two_polygons_share(rng: np.random.Generator) -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    shift = rng.uniform(-1.3, 1.3, size=(200, 2))
    shared = np.prod(np.maximum(1.0 - np.abs(shift), 0.0), axis=1)
    assert np.allclose(polygon_area(clip_convex(square + shift[:, None], square)), shared, atol=1e-14)
    # either sense of the clipped polygon will do
    assert np.allclose(polygon_area(clip_convex(square[::-1] + shift[:, None], square)), -shared, atol=1e-14)
