"""Coarse meshes in scenes: what ``round_below_deg`` makes of them, and what it costs at most."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh
from echo_tools import ISO, WAVELENGTH, apparent_rcs, db, scene_of

import shenron_rt as srt
from shenron_rt.errors import InputError
from shenron_rt.scene import rounded
from shenron_rt.scene.bodies import Body, load_bodies
from shenron_rt.scene.mesh import Part, TaggedMesh, build_mesh, concatenate
from shenron_rt.tags import SemanticTag

RADIUS, AHEAD = 0.4, 10.0


@pytest.fixture(scope="module")
def ball() -> TaggedMesh:
    """A ball of 1280 facets, 8 deg each: 6 cm wide, they lie up to a third of 77 GHz's wavelength below it."""
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=RADIUS)
    return build_mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), Part(object="ball"))


def target(mesh: TaggedMesh, **more: Any) -> dict[str, Any]:
    common = {"id": 5, "name": "ball", "mesh": mesh, "xyz_m": (AHEAD, 0, 0), "tag": "Other", "material": "metal"}
    return {**common, **more}


def bodies(*actors: dict[str, Any], **more: Any) -> tuple[Body, ...]:
    return load_bodies(scene_of(*actors, **more))[0]


def levels(mesh: TaggedMesh, **more: Any) -> np.ndarray:
    """Return the echo [dB over pi a^2] under eight aspects, first bounce, aimed rays 2 mm apart."""
    # a wave from h before a ball comes back as if the ball were sqrt(h (h + a)) away: geometric optics, spherical wave
    distance = np.sqrt((AHEAD - RADIUS) * AHEAD)
    found = []
    for seed, (yaw, pitch) in enumerate(np.random.default_rng(1).uniform(0, 60, (8, 2))):
        scene = scene_of(target(mesh, aim=160_000, ypr_deg=(yaw, pitch, 0), **more))
        returns = srt.illuminate(srt.trace(scene, ISO, seed=seed, rays=500), ISO)
        found.append(apparent_rcs(returns, 5, distance) / (np.pi * RADIUS**2))
    return np.asarray(db(np.array(found)))


def test_a_coarse_ball_scatters_as_a_ball_only_when_rounded(ball: TaggedMesh) -> None:
    assert np.abs(levels(ball)).max() > 5.0  # each facet flashes by itself
    found = levels(ball, round_below_deg=30)
    # Facets lie up to lambda / 32 below the ball: a parabola of 0.39 rad, of 0.12 rad RMS about its mean.
    # If all of that were of one sign in the first zone, an aspect would be off by 20 log10 1.12 = 1.0 dB; rays add 0.1.
    assert np.abs(found).max() < 1.1
    assert np.abs(found.mean()) < 1.0 / np.sqrt(8) + 0.1  # aspects turn other facets to the radar: signs differ


def test_parts_keep_their_tags_and_materials(ball: TaggedMesh) -> None:
    upper = (ball.vertices[ball.faces].mean(axis=1)[:, 2] > 0).astype(int)
    parts = (
        Part(object="low", tag=SemanticTag.Car, em_material="concrete"),
        Part(object="high", tag=SemanticTag.Poles, em_material="metal"),
    )
    mesh = replace(ball, parts=parts, part=upper)
    entry = target(mesh, aim=20_000, round_below_deg=30) | {"tag": None, "material": None}
    seen = srt.trace(scene_of(entry), ISO, seed=1, rays=500)
    above = seen.position[:, 2] > 0
    names = np.array(seen.material_names)[seen.material]
    # the border goes along facets, up to a side of one above and below the middle
    clear = np.abs(seen.position[:, 2]) > 0.07
    np.testing.assert_array_equal(seen.tag[clear] == int(SemanticTag.Poles), above[clear])
    np.testing.assert_array_equal(seen.tag[clear] == int(SemanticTag.Car), ~above[clear])
    np.testing.assert_array_equal(names[clear] == "metal", above[clear])
    np.testing.assert_array_equal(names[clear] == "concrete", ~above[clear])
    # and lies where the ball does, not where its chords do: 1.1 mm
    radius = np.linalg.norm(seen.position - [AHEAD, 0, 0], axis=1)
    assert np.all(RADIUS - radius < 1.01 * WAVELENGTH / 32)


def test_parts_that_turn_stay_the_parts_that_turn(ball: TaggedMesh) -> None:
    box = srt.make_shape("box:1x1x0.2").with_parts([Part(object="platform")])
    both = concatenate([box, ball])
    spin = {"part": "ball", "center_m": (0, 0, 0), "axis": (0, 0, 1), "rate_deg_s": 90}
    (found,) = bodies(target(both, round_below_deg=30, spinning_parts=[spin]))
    assert found.mesh.n_faces > both.n_faces
    np.testing.assert_array_equal(found.face_link, found.mesh.part)  # platform, then ball
    np.testing.assert_array_equal(found.vertex_link[found.mesh.faces], found.face_link[:, None].repeat(3, axis=1))
    assert np.count_nonzero(found.face_link == 0) == box.n_faces  # what is flat stays


def test_static_parts_and_shapes_are_rounded_too(ball: TaggedMesh) -> None:
    shape = "cylinder:r=0.3,l=1,edge=0.1"
    static = [
        {"name": "ball", "mesh": ball, "tag": "Other", "round_below_deg": 30},
        {"name": "drum", "shape": shape, "round_below_deg": 30},
        {"name": "as_is", "shape": shape},
    ]
    rounded_ball, drum, as_is = bodies(static=static)
    assert rounded_ball.mesh.n_faces > ball.n_faces
    assert drum.mesh.n_faces > as_is.mesh.n_faces == srt.make_shape(shape).n_faces


def test_the_highest_carrier_of_the_scene_decides_how_finely(ball: TaggedMesh) -> None:
    low, high = ({"name": p, "profile": p} for p in ("radarbook2", "awrl1432"))
    entry = target(ball, round_below_deg=30)
    faces = {
        name: load_bodies(srt.Scene(actors=[entry], radars=radars))[0][0].mesh.n_faces
        for name, radars in {"low": [low], "high": [high], "both": [low, high], "none": []}.items()
    }
    assert faces["low"] < faces["high"] == faces["both"] <= faces["none"]


@pytest.mark.parametrize("most", [2_000, 6_000, 30_000])
def test_more_triangles_than_allowed_are_refused(ball: TaggedMesh, monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """One ball takes 20 480: the limit is on all of the scene's together, and is found while a mesh is made."""
    monkeypatch.setattr(rounded, "MOST_ROUNDED_FACES", most)
    entry = target(ball, round_below_deg=30)
    with pytest.raises(InputError, match=rf"ball: round_below_deg 30: .* more than {most} triangles; take a smaller"):
        bodies(entry, {**entry, "id": 6})


def test_bodies_of_one_mesh_share_what_was_rounded(ball: TaggedMesh) -> None:
    entry = target(ball, round_below_deg=30)
    first, second = bodies(entry, {**entry, "id": 6, "xyz_m": (20, 0, 0)})
    assert first.mesh is second.mesh
