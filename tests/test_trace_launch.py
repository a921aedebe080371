"""Ray cells: they tile, cover the pattern, and hold what they aim at."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shenron_rt.frames import direction, spherical
from shenron_rt.physics.antenna import CosinePattern, GaussianPattern, IsotropicPattern
from shenron_rt.tracing.launch import aimed_cells, pattern_cells, turned


def directions(cells):
    return cells.directions_of(slice(None))


def corners(cells):
    """Return (n, 4, 3) corner directions, counter-clockwise from (-,-)."""
    edges = cells.edges_of(np.arange(len(cells)))
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return directions(cells)[:, None] + np.einsum("ks,nsj->nkj", signs, edges)


def solid_angle_of_corners(w):
    """Return (n,) solid angle of spherical quadrilaterals, as two triangles (van Oosterom and Strackee 1983)."""
    w = w / np.linalg.norm(w, axis=-1, keepdims=True)

    def triangle(a, b, c):
        triple = np.einsum("ij,ij->i", a, np.cross(b, c))
        dots = [np.einsum("ij,ij->i", p, q) for p, q in ((a, b), (b, c), (c, a))]
        return 2 * np.arctan2(triple, 1 + sum(dots))

    return triangle(w[:, 0], w[:, 1], w[:, 2]) + triangle(w[:, 0], w[:, 2], w[:, 3])


def inside(cells, directions):
    """Return (m,) how many cells hold each direction: left of all four edge planes."""
    w = corners(cells)
    count = np.zeros(len(directions), dtype=int)
    planes = np.cross(w, np.roll(w, -1, axis=1))
    for block in np.array_split(np.arange(len(directions)), 20):
        left = np.einsum("nkj,mj->mnk", planes, directions[block]) >= 0
        count[block] = left.all(axis=2).sum(axis=1)
    return count


def test_isotropic_cells_add_up_to_the_sphere():
    cells = pattern_cells(IsotropicPattern(), 20_000)
    assert cells.solid_angle.sum() == pytest.approx(4 * math.pi, rel=1e-12)


def test_solid_angle_is_that_of_the_corners():
    """Differences of corner functions of size 1 leave 1e-16 / 1e-4 of a cell's 6e-4 sr."""
    cells = pattern_cells(IsotropicPattern(), 20_000)
    np.testing.assert_allclose(cells.solid_angle, solid_angle_of_corners(corners(cells)), rtol=1e-9)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.31, -0.44), (-0.5, 0.5)])
def test_turned_cells_tile_without_overlap_or_gap(shift, rng):
    cells = turned(pattern_cells(IsotropicPattern(), 3_000), np.array(shift))
    d = rng.normal(size=(2_000, 3))
    np.testing.assert_array_equal(inside(cells, d / np.linalg.norm(d, axis=1, keepdims=True)), 1)
    assert solid_angle_of_corners(corners(cells)).sum() == pytest.approx(4 * math.pi, rel=1e-9)


def test_directions_are_unit_vectors_within_their_cell():
    cells = turned(pattern_cells(IsotropicPattern(), 3_000), np.array([0.2, 0.3]))
    np.testing.assert_allclose(np.linalg.norm(directions(cells), axis=1), 1, atol=1e-12)
    w = corners(cells)
    planes = np.cross(w, np.roll(w, -1, axis=1))
    assert np.all(np.einsum("nkj,nj->nk", planes, directions(cells)) > 0)


@pytest.mark.parametrize("rays", [100, 2_000, 50_000])
@pytest.mark.parametrize("pattern", [IsotropicPattern(), GaussianPattern(math.radians(120), math.radians(40))])
def test_number_of_cells_is_about_the_number_asked_for(pattern, rays):
    """A whole number of cells along a cube's edge and the rim of the lit region leave 25 %, at 100 rays more."""
    assert 0.7 < len(pattern_cells(pattern, rays)) / rays < (1.3 if rays > 1_000 else 2.5)


@pytest.mark.parametrize(
    "pattern",
    [
        GaussianPattern(math.radians(120), math.radians(40)),
        GaussianPattern(math.radians(30), math.radians(10)),
        CosinePattern(math.radians(80), math.radians(60)),
    ],
)
@pytest.mark.parametrize("rays", [2_000, 10_000])
def test_cells_cover_the_pattern_down_to_40_db_two_way(pattern, rays, rng):
    """Whatever the turn: directions at -39.9 dB two-way and above are held by exactly one cell."""
    cells = turned(pattern_cells(pattern, rays), rng.uniform(-0.5, 0.5, 2))
    d = rng.normal(size=(20_000, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    _, az, el = spherical(d)
    loud = d[20 * np.log10(np.maximum(pattern(az, el), 1e-30)) > -39.9][:1_500]
    assert len(loud) > 50
    np.testing.assert_array_equal(inside(cells, loud), 1)


def test_nothing_is_launched_far_below_the_floor():
    """One way -30 dB is 10 dB below the floor, further than any cell of 2e4 is wide on this slope."""
    pattern = GaussianPattern(math.radians(30), math.radians(10))
    _, az, el = spherical(pattern_cells(pattern, 20_000).direction)
    assert np.all(10 * np.log10(pattern(az, el)) > -30)


@pytest.mark.parametrize("where", [(10, 0, 0), (-3, 4, 1), (0, 0, 20), (0.1, 0.1, -8), (50, -49, 2)])
def test_aimed_cells_hold_every_point_of_the_target(where, rng):
    points = np.array(where) + rng.uniform(-0.5, 0.5, (40, 3))
    for rays in (10, 500, 5_000):
        cells = aimed_cells(points, rays, rng.uniform(-0.5, 0.5, 2))
        assert cells is not None
        np.testing.assert_array_equal(inside(cells, points / np.linalg.norm(points, axis=1, keepdims=True)), 1)
        # a rim of one cell on each side: (sqrt(n) + 3)^2 for a square target, more for one seen edge-on
        assert len(cells) <= 2 * (np.sqrt(rays) + 4) ** 2


def test_aimed_cells_tile_their_patch(rng):
    cells = aimed_cells(np.array([5.0, 1, 0]) + rng.uniform(-1, 1, (30, 3)), 400, np.array([0.1, -0.3]))
    assert cells is not None
    np.testing.assert_allclose(cells.solid_angle, solid_angle_of_corners(corners(cells)), rtol=1e-9)
    picked = directions(cells)[rng.integers(len(cells), size=200)]
    np.testing.assert_array_equal(inside(cells, picked), 1)


def test_no_patch_holds_a_target_around_the_radar():
    assert aimed_cells(np.array([[-1.0, -1, -1], [1, 1, 1], [1, -1, 0]]), 100, np.zeros(2)) is None


def test_an_edge_on_target_gets_no_runaway_number_of_cells():
    points = direction(np.linspace(-0.1, 0.1, 20), np.zeros(20)) * 30.0
    cells = aimed_cells(points, 1_000, np.zeros(2))
    assert cells is not None
    assert len(cells) < 5_000
