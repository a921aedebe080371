"""Every verb over runs at the edge: nothing seen, a radar in a car, thousands of actors, damaged files, a full disk."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from export_tools import files_up_to

from shenron_rt.cli import main
from shenron_rt.runs import verify_manifest

FAST = ("--backend", "scalar", "--no-pictures", "--set", "profile.waveform.chirps=16")
EMPTY = "name: empty\n"
BEHIND = """
static:
  - {name: wall, shape: 'plate:2x2', xyz_m: [-20, 0, 1], tag: Walls, material: concrete, id: 4}
"""
#: The radar stands inside a metal box; a strong target beyond it.
INSIDE = """
actors:
  - {id: 7, name: shell, shape: "box:4x2x2", xyz_m: [2, 0, 1], tag: Car, material: metal, aim: 500}
point_targets:
  - {id: 9, name: hidden, xyz_m: [30, 0, 1], rcs_dbsm: 30}
"""
#: ``pedestrian`` and ``car`` without sizes, in parts that move.
PARTS = """
actors:
  - {id: 7, shape: car, articulation: auto, xyz_m: [22, 3, 0], velocity_mps: [5, 0, 0], aim: 500}
  - {id: 8, shape: pedestrian, articulation: auto, xyz_m: [14, 0, 0], velocity_mps: [1, 0, 0], aim: 500}
"""
SCENES = {"empty": EMPTY, "behind": BEHIND, "inside": INSIDE, "parts": PARTS}


def render(folder: Path, text: str, *options: str, rays: int = 2000) -> Path:
    (folder / "scene.yaml").write_text(text)
    words = ["run", str(folder / "scene.yaml"), "-o", str(folder / "run"), "--rays", str(rays), *FAST, *options]
    assert main(words) == 0
    return folder / "run"


@pytest.fixture(scope="module", params=SCENES)
def edge(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    folder = tmp_path_factory.mktemp(request.param)
    return request.param, render(folder, SCENES[request.param], "--frames", "0:3")


def verbs(run: Path, to: Path) -> dict[str, list[str]]:
    """Return a call of every verb that reads a run."""
    exports = {form: ["export", str(run), "--to", form, "-o", str(to / form)] for form in ("csv", "pcd", "ply")}
    for form, library in (("mcap", "foxglove"), ("ros2", "rosbags"), ("zarr", "zarr")):
        try:
            __import__(library)
        except ImportError:
            continue
        exports[form] = ["export", str(run), "--to", form, "-o", str(to / form)]
    return exports | {
        "explain": ["explain", str(run), "-o", str(to / "explained")],
        "track": ["track", str(run), "-o", str(to / "tracks")],
        "report": ["report", str(run), "-o", str(to / "page.html")],
    }


def test_every_verb_takes_a_run_at_the_edge(
    edge: tuple[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, run = edge
    capsys.readouterr()
    for name, words in verbs(run, tmp_path).items():
        assert main(words) == 0, name
        said = capsys.readouterr()
        assert "Traceback" not in said.out + said.err, name
    assert verify_manifest(run) == []
    assert not [p for p in tmp_path.iterdir() if ".partial" in p.name]


def test_verdicts_at_the_edge_are_the_right_ones(edge: tuple[str, Path], capsys: pytest.CaptureFixture[str]) -> None:
    name, run = edge
    capsys.readouterr()
    assert main(["explain", str(run), "--frame", "0", "--json"]) == 0
    (frame,) = json.loads(capsys.readouterr().out)["frames"]
    found = {o["object_id"]: (o["verdict"]["name"], o["verdict"]["by"]) for o in frame["objects"]}
    assert (
        found
        == {
            "empty": {},
            "behind": {4: ("outside the beam", "")},
            "inside": {7: ("detected", ""), 9: ("occluded", "shell")},
            "parts": {7: ("detected", ""), 8: ("detected", "")},
        }[name]
    )


@pytest.mark.parametrize(
    ("file", "text", "refusing"),
    [
        ("config.yaml", "actors: {", {"explain", "track", "report", "csv", "mcap", "zarr"}),
        ("config.yaml", "actors: [{id: -1, shape: car}]\n", {"explain", "track", "report", "csv", "mcap", "zarr"}),
        ("summary.json", "[]", {"explain", "track", "report", "csv", "mcap", "zarr"}),
        ("radars/radar/frame_000001/returns.npz", "PK", {"explain", "track", "report", "mcap", "zarr"}),
        ("radars/radar/frame_000001/detections.csv", "x,y\n", {"explain", "track", "report", "csv", "mcap", "zarr"}),
        ("radars/radar/frame_000001/adc.npz", "PK", {"zarr"}),
    ],
)
def test_a_damaged_file_is_named_in_one_line_by_all_that_read_it(
    file: str,
    text: str,
    refusing: set[str],
    tmp_path: Path,
    tmp_path_factory: pytest.TempPathFactory,
    capsys: pytest.CaptureFixture[str],
) -> None:
    run, to = tmp_path / "run", tmp_path / "to"
    shutil.copytree(_sound(tmp_path_factory), run)
    (run / file).write_text(text)
    capsys.readouterr()
    for name, words in verbs(run, to).items():
        expected = 2 if name in refusing or (name in ("pcd", "ply", "ros2") and "csv" in refusing) else 0
        assert main(words) == expected, name
        err = capsys.readouterr().err
        if expected == 2:
            assert file in err, (name, err)
            assert err.count("\n") == 1, (name, err)
    left = {p.name for p in to.iterdir()} if to.exists() else set()
    assert not {n for n in left if ".partial" in n or n in refusing}


_kept: dict[str, Path] = {}


def _sound(factory: pytest.TempPathFactory) -> Path:
    """Return a run of two frames, made once."""
    if "run" not in _kept:
        _kept["run"] = render(factory.mktemp("sound"), PARTS, "--frames", "0:2")
    return _kept["run"]


@pytest.mark.parametrize("name", ["explain", "track", "report", "run"])
def test_a_full_disk_is_one_line_and_leaves_nothing(
    name: str, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, capsys: pytest.CaptureFixture[str]
) -> None:
    run, to = _sound(tmp_path_factory), tmp_path / "to"
    to.mkdir()
    again = ["run", str(run / "config.yaml"), "-o", str(to / "again"), *FAST]
    words = again if name == "run" else verbs(run, to)[name]
    capsys.readouterr()
    with files_up_to(400):
        assert main(words) == 2
    err = capsys.readouterr().err
    assert "File too large; what was being written has been removed" in err
    assert err.count("\n") == 1
    assert list(to.iterdir()) == []


@pytest.mark.parametrize("count", [200, pytest.param(10_000, marks=pytest.mark.slow)])
def test_thousands_of_actors_go_through_every_verb(
    count: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Plates on a dome about the radar: none hides another."""
    rows = int(np.sqrt(count / 2))
    azimuth, elevation = np.meshgrid(np.linspace(-50, 50, count // rows), np.linspace(-15, 15, rows))
    lines = ["actors:"]
    for k, (a, e) in enumerate(zip(azimuth.ravel(), elevation.ravel(), strict=True)):
        ra, re = np.radians((a, e))
        x, y, z = 2 + 40 * np.cos(re) * np.cos(ra), 40 * np.cos(re) * np.sin(ra), 1 + 40 * np.sin(re)
        lines.append(
            f"  - {{id: {k + 1}, shape: 'plate:0.5x0.3', tag: Car, material: metal, xyz_m: [{x:.3f}, {y:.3f}, {z:.3f}],"
            f" ypr_deg: [{180 + a:.3f}, {e:.3f}, 0], velocity_mps: [-1, 0, 0]}}"
        )
    run = render(tmp_path, "\n".join(lines) + "\n", "--accuracy", "1e-4", rays=20 * count)
    (frame,) = json.loads((run / "summary.json").read_text())["radars"][0]["frames"]
    assert len(frame["objects"]) == len(lines) - 1
    calls = verbs(run, tmp_path / "to") | {"explain": ["explain", str(run), "--object", "5"]}
    for name, words in calls.items():
        assert main(words) == 0, name
    assert "Verdict:" in capsys.readouterr().out


@pytest.mark.parametrize("side", [100, pytest.param(1600, marks=pytest.mark.slow)])
def test_millions_of_triangles_go_through_every_verb(
    side: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A ground of side x side squares in a file, two triangles each: 5.1 million with ``-m slow``."""
    _ground(tmp_path / "ground.ply", side)
    scene = """
static:
  - {name: ground, mesh: ground.ply, mesh_frame: ros_z_up, tag: Roads, material: asphalt}
  - {name: wall, shape: 'plate:2x2', xyz_m: [32, 0, 2], ypr_deg: [180, 0, 0], tag: Walls, material: metal, id: 5}
"""
    run = render(tmp_path, scene, rays=20_000)
    (frame,) = json.loads((run / "summary.json").read_text())["radars"][0]["frames"]
    assert {o["id"]: o["power_dbw"] is not None for o in frame["objects"]} == {0: True, 5: True}
    capsys.readouterr()
    for name, words in verbs(run, tmp_path / "to").items():
        assert main(words) == 0, name
    # a page holds 120 000 faces, whatever the scene has
    assert (tmp_path / "to/page.html").stat().st_size < 8e6
    left_out = "the viewer gets no mesh of ground" in capsys.readouterr().err
    assert left_out == (2 * side**2 > 1_000_000 and (tmp_path / "to/mcap").exists())


def _ground(file: Path, side: int) -> None:
    y, x = np.meshgrid(np.linspace(-40, 40, side + 1), np.linspace(4, 84, side + 1))
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    a, b, c, d = corner, corner + side + 1, corner + side + 2, corner + 1
    faces = np.zeros(2 * side**2, dtype=[("n", "u1"), ("rows", "<i4", (3,))])
    faces["n"] = 3
    faces["rows"] = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)]).astype("<f4")
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    file.write_bytes(header.encode() + vertices.tobytes() + faces.tobytes())
