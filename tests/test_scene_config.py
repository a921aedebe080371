"""Scenes: the same fields in YAML and Python, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import shenron_rt as srt
from shenron_rt.errors import ConfigError

EXAMPLE = """
version: 1
seed: 7
frame_period_s: 0.1
weather: {rain_mm_h: 4, fog_visibility_m: null, temperature_c: 15}
ego: {xyz_m: [0, 0, 0], ypr_deg: [0, 0, 0], velocity_mps: [15, 0, 0], yaw_rate_deg_s: 0}
static:
  - {name: left_wall, shape: "box:80x0.3x3", xyz_m: [43, 4.15, 1.5], tag: Walls, material: concrete, id: 40}
actors:
  - {id: 101, name: lead, shape: "box:4x2x1.5", xyz_m: [27, 0, 0], velocity_mps: [10, 0, 0], tag: car, aim: 20000}
point_targets:
  - {id: 900, xyz_m: [30, 0, 1], velocity_mps: [0, 0, 0], rcs_dbsm: 10, tag: Other}
radars:
  - {name: front, profile: awrl1432, xyz_m: [2.0, 0, 1.0], ypr_deg: [0, 0, 0]}
"""


@pytest.fixture
def scene_file(tmp_path):
    def write(text):
        file = tmp_path / "own.yaml"
        file.write_text(text)
        return file

    return write


def test_yaml_and_python_give_the_same_scene(scene_file):
    scene = srt.load_scene(scene_file(EXAMPLE))
    assert scene.name == "own"
    assert scene.seed == 7
    assert scene.actors[0].tag == "Car"
    assert scene.weather is not None
    assert scene.weather.plain().rain_mm_h == 4
    assert scene.object_names() == {0: "static", 40: "left_wall", 101: "lead", 900: "object 900"}
    again = srt.Scene(**scene.model_dump())
    assert again.actors == scene.actors
    assert again.radars == scene.radars


def test_overrides_by_dotted_key(scene_file):
    scene = srt.load_scene(scene_file(EXAMPLE), {"weather.rain_mm_h": "25", "actors.0.velocity_mps": [0, 0, 0]})
    assert scene.weather is not None
    assert scene.weather.rain_mm_h == 25
    assert scene.actors[0].velocity_mps == (0, 0, 0)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("tag: Walls", "tag: Wals", ["unknown tag 'Wals'", "did you mean 'Walls'", ":8:"]),
        ("id: 900", "id: 101", ["101", "is given to more than one thing"]),
        ("id: 900", "id: 40", ["40", "is given to more than one thing"]),
        ("id: 900", "id: 0", [":12:", "point_targets.0.id", "greater than 0"]),
        ("rcs_dbsm: 10", "rcs_dbms: 10", ["did you mean 'rcs_dbsm'"]),
        ("seed: 7", "seed: -1", [":3:", "seed"]),
        ("rain_mm_h: 4", "rain_mm_h: -4", [":5:", "weather.rain_mm_h"]),
        ("name: front", "name: ../front", ["becomes a folder"]),
        ("version: 1", "version: 2", [":2:", "version"]),
        ('shape: "box:80x0.3x3"', 'shape: "box:80x0.3x3", mesh: a.obj', ["exactly one of mesh"]),
        ("aim: 20000", "aim: 0", ["actors.0.aim"]),
        ("aim: 20000", "round_below_deg: 0", ["actors.0.round_below_deg", "greater than 0"]),
        ("aim: 20000", "round_below_deg: 91", ["actors.0.round_below_deg", "less than or equal to 90"]),
        ("aim: 20000", "round_below_deg: yes please", ["actors.0.round_below_deg", "number"]),
        ("id: 40", "round_below: 30", ["did you mean 'round_below_deg'"]),
        ("xyz_m: [27, 0, 0]", "xyz_m: [27, 0]", ["three numbers are needed"]),
        ("xyz_m: [27, 0, 0]", "xyz_m: [27, 0, .inf]", ["finite"]),
    ],
)
def test_bad_scenes_are_refused_with_the_place(scene_file, old, new, words):
    assert old in EXAMPLE
    file = scene_file(EXAMPLE.replace(old, new, 1))
    with pytest.raises(ConfigError) as caught:
        srt.load_scene(file)
    for word in [str(file), *words]:
        assert word in str(caught.value)


def test_two_radars_of_one_name_are_refused():
    with pytest.raises(ValueError, match=r"radar name .?a.? is given to more than one thing"):
        srt.Scene(radars=[{"name": "a"}, {"name": "a"}])


def test_mesh_that_escapes_its_folder_is_refused(scene_file, tmp_path):
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "secret.obj").write_text("v 0 0 0\n")
    file = inner / "own.yaml"
    file.write_text("static:\n  - {name: x, mesh: ../secret.obj}\n")
    with pytest.raises(ConfigError, match="leaves the folder"):
        srt.trace(srt.load_scene(file), rays=100)


def test_relative_mesh_is_looked_for_beside_the_scene(scene_file, tmp_path, monkeypatch):
    (tmp_path / "wall.obj").write_text("o Wall_1\nv 5 -1 0\nv 5 1 0\nv 5 0 3\nf 1 2 3\n")
    file = scene_file("static:\n  - {name: x, mesh: wall.obj, tag: Walls, id: 4}\n")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    scat = srt.trace(srt.load_scene(file), rays=2_000)
    assert set(scat.object_id) == {4}
    np.testing.assert_allclose(scat.position[:, 0], 3.0, atol=1e-12)  # default mount at x = 2


def test_profile_beside_the_scene_comes_first(scene_file, tmp_path):
    profile = srt.load_profile("awrl1432")
    import yaml

    own = {**profile.model_dump(mode="json", exclude_none=True), "name": "mine"}
    (tmp_path / "mine.yaml").write_text(yaml.safe_dump(own))
    scene = srt.load_scene(scene_file("radars:\n  - {name: r, profile: mine.yaml}\n"))
    assert scene.profile_of(scene.radar()).name == "mine"


def test_unknown_scene_and_profile_list_what_exists():
    with pytest.raises(srt.NotFoundError, match=r"unknown scene 'brakin'; did you mean 'braking'"):
        srt.load_scene("brakin")
    with pytest.raises(srt.NotFoundError, match=r"did you mean 'awrl1432'"):
        srt.trace(srt.Scene(radars=[{"profile": "awrl143"}]), rays=100)


def test_scene_is_frozen():
    scene = srt.Scene()
    with pytest.raises(ValueError, match="frozen"):
        scene.seed = 3
