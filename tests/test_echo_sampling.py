"""What must not change an object's echo: the number of rays and triangles, other objects, aim."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from echo_tools import ISO, db, isotropic_profile, scene_of

import shenron_rt as srt
from shenron_rt.scene.mesh import TaggedMesh

# a beam that holds the targets: the cells of 300 k rays over the whole pattern of awrl1432, with 30 k
PROFILE = isotropic_profile(pattern="gaussian", beamwidth_az_deg=30.0, beamwidth_el_deg=20.0)
TARGETS = {
    "box": {"shape": "box:4x1.8x1.5", "xyz_m": (20, 1, 0), "ypr_deg": (25, 0, 0), "material": "concrete"},
    "box_facing": {"shape": "box:4x1.8x1.5", "xyz_m": (20, 0.3, 0)},
    "sphere": {"shape": "sphere:r=0.6,edge=0.02", "xyz_m": (12, -1, 0)},
    "wall": {"shape": "wall:10x3", "xyz_m": (15, 4, -1), "ypr_deg": (60, 0, 0), "material": "brick"},
    "car": {"shape": "car", "xyz_m": (20, 0, -1), "ypr_deg": (12, 0, 0)},
    "truck": {"shape": "truck", "xyz_m": (24, 0, -1), "ypr_deg": (12, 0, 0)},
    "pedestrian": {"shape": "pedestrian", "xyz_m": (12, 0.5, -1), "ypr_deg": (20, 0, 0)},
}
#: Rays of its own that a body needs for its mean power to stand: the sides of a truck are 8 m of grazing incidence.
AIM = {"wall": 20_000, "box": 20_000, "box_facing": 20_000, "car": 20_000, "truck": 80_000, "pedestrian": 20_000}
SEEDS = range(20)


def halved(mesh: TaggedMesh) -> TaggedMesh:
    """Return the mesh with every triangle split in four at the middles of its edges."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    corners = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    faces = np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3)
    return TaggedMesh(corners.reshape(-1, 3), faces, np.tile(mesh.part, 4), mesh.parts)


def mean_power(actor, rays, seeds, profile=PROFILE, *, expected=False):
    """Return the linear mean over seeds; each seed moves the object by up to a wavelength, as in the field.

    ``expected``: with speckle, whose mean power is one, replaced by one. What is left is the expected power of the
    incoherent echoes and the coherent sum of the others; the seeds are those of places and grids.
    """
    powers = []
    for seed in seeds:
        x, y, z = actor["xyz_m"]
        moved = {**actor, "id": 5, "xyz_m": (x + 0.0002 * seed, y, z)}
        scat = srt.trace(scene_of(moved, profile=profile), seed=seed, rays=rays)
        if expected:
            scat = replace(scat, speckle=np.ones_like(scat.speckle))
        powers.append(srt.illuminate(scat, profile).power_by_object().get(5, 0.0))
    return np.mean(powers), np.std(powers) / np.mean(powers) / np.sqrt(len(powers))


def split(actor):
    """Return the actor with every triangle of its shape split in four."""
    return {**{k: v for k, v in actor.items() if k != "shape"}, "mesh": halved(srt.make_shape(actor["shape"]))}


@pytest.mark.parametrize("name", ["box", "box_facing", "wall"])
@pytest.mark.parametrize("rays", [6_000, pytest.param(30_000, marks=pytest.mark.slow)])
def test_doubling_rays_keeps_the_mean_power(name, rays):
    few, many = (mean_power(TARGETS[name], n, SEEDS, expected=True)[0] for n in (rays, 2 * rays))
    assert abs(db(many / few)) < 0.5


@pytest.mark.parametrize("name", [n if n == "box" else pytest.param(n, marks=pytest.mark.slow) for n in AIM])
def test_doubling_aimed_rays_keeps_the_mean_power(name):
    few, many = (
        mean_power(TARGETS[name] | {"aim": n}, 500, SEEDS, expected=True)[0] for n in (AIM[name], 2 * AIM[name])
    )
    assert abs(db(many / few)) < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sphere", "car", "truck", "pedestrian"])
def test_curved_bodies_without_aim_keep_their_mean_power_as_far_as_seeds_can_tell(name):
    """0.5 dB and 2 sigma of both means: cells wider than what curvature allows scatter by some decibels a frame."""
    few, spread = mean_power(TARGETS[name], 30_000, SEEDS, expected=True)
    many, spread_many = mean_power(TARGETS[name], 60_000, SEEDS, expected=True)
    assert abs(db(many / few)) < 0.5 + 2 * 4.34 * np.hypot(spread, spread_many)


@pytest.mark.parametrize("name", ["box", "box_facing", "wall", pytest.param("sphere", marks=pytest.mark.slow)])
def test_splitting_every_triangle_keeps_the_mean_power(name):
    """The same rays and speckle: only what the splitting does is left. 0.5 dB over 20 seeds."""
    whole, parts = (mean_power(a, 6_000, SEEDS)[0] for a in (TARGETS[name], split(TARGETS[name])))
    assert abs(db(parts / whole)) < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("name", ["car", "truck", "pedestrian"])
def test_splitting_every_triangle_keeps_the_mean_power_under_aimed_rays(name):
    actor = TARGETS[name] | {"aim": 20_000}
    whole, parts = (mean_power(a, 500, SEEDS)[0] for a in (actor, split(actor)))
    assert abs(db(parts / whole)) < 0.5


def rows_of(scat, object_id):
    own = scat.object_id == object_id
    columns = ("position", "range_rate", "cos_incidence", "tag", "area", "velocity", "normal", "speckle", "jitter")
    return {name: getattr(scat, name)[own] for name in columns}


BACKGROUND = [
    {"id": 60, "shape": "wall:20x4", "xyz_m": (40, 0, -1), "ypr_deg": (90, 0, 0)},
    {"id": 61, "shape": "box:2x2x2", "xyz_m": (15, 8, 0)},
    {"id": 62, "shape": "sphere:r=0.3,edge=0.05", "xyz_m": (12, -6, 0), "aim": 2_000},
]


@pytest.mark.parametrize("aim", [None, 3_000])
def test_background_never_changes_a_target(aim):
    """Objects that hide nothing leave rows and power as they were, to 1e-9 (they are equal to the last bit)."""
    target = {"id": 5, "shape": "box:3x1.5x1.5", "xyz_m": (20, 0.2, 0), "ypr_deg": (5, 0, 0), "aim": aim}
    alone = srt.trace(scene_of(target, profile=PROFILE), seed=3, rays=10_000)
    point = {"id": 90, "xyz_m": (30, 5, 0), "rcs_dbsm": 20.0}
    crowd = srt.trace(scene_of(*BACKGROUND, target, profile=PROFILE, point_targets=[point]), seed=3, rays=10_000)
    before, after = rows_of(alone, 5), rows_of(crowd, 5)
    assert len(before["position"]) > 20
    for name, column in before.items():
        np.testing.assert_allclose(after[name], column, rtol=1e-9, atol=1e-12, err_msg=name)
    powers = [srt.illuminate(s, PROFILE).power_by_object()[5] for s in (alone, crowd)]
    assert powers[1] == pytest.approx(powers[0], rel=1e-9)


def test_aim_does_not_change_the_expected_power():
    common, _ = mean_power(TARGETS["box"], 12_000, SEEDS, expected=True)
    aimed, _ = mean_power({**TARGETS["box"], "aim": 3_000}, 500, SEEDS, expected=True)
    assert abs(db(aimed / common)) < 0.5


def test_area_of_an_object_is_its_visible_surface():
    """Mean over 20 grids of the sum of R^2 dOmega/cos: 3 m^2 of plate, whatever the rays, to 2 % (spread 1 %)."""
    for rays, aim in ((30_000, None), (60_000, None), (500, 2_000)):
        areas = []
        for seed in range(20):
            target = {"id": 5, "shape": "plate:2x1.5", "xyz_m": (9, 1, 0.5), "ypr_deg": (40, 15, 5), "aim": aim}
            areas.append(srt.trace(scene_of(target, profile=ISO), seed=seed, rays=rays).area.sum())
        assert np.mean(areas) == pytest.approx(3.0, rel=0.02)
