"""Scenes at the edge: nothing in sight, a radar in a car, thousands of actors, millions of triangles, a full disk."""

from __future__ import annotations

import errno
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shenron_rt as srt
from shenron_rt.cli import main
from shenron_rt.io import npz
from shenron_rt.runs import verify_manifest
from shenron_rt.scene.mesh import Part, build_mesh
from shenron_rt.tracing.launch import pattern_cells

FAST = ("--rays", "2000", "--backend", "scalar", "--no-pictures")
SEED = 3


def test_a_scene_with_nothing_in_sight_is_noise_and_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "behind.yaml").write_text(
        "static:\n  - {name: wall, shape: 'plate:2x2', xyz_m: [-20, 0, 1], tag: Walls, material: concrete, id: 4}\n"
    )
    out = tmp_path / "out"
    assert main(["run", str(tmp_path / "behind.yaml"), *FAST, "-o", str(out)]) == 0
    said = capsys.readouterr()
    assert "Traceback" not in said.out + said.err
    (frame,) = json.loads((out / "summary.json").read_text())["radars"][0]["frames"]
    (wall,) = frame["objects"]
    assert (wall["name"], wall["power_dbw"], wall["detected"]) == ("wall", None, False)
    assert verify_manifest(out) == []
    assert len(srt.Returns.load(out / "radars/radar/frame_000000/returns.npz")) == 0


def test_an_empty_scene_can_be_drawn(tmp_path: Path) -> None:
    (tmp_path / "empty.yaml").write_text("name: empty\n")
    assert main(["run", str(tmp_path / "empty.yaml"), *FAST[:-1], "-o", str(tmp_path / "out")]) == 0
    assert (tmp_path / "out/radars/radar/frame_000000/range_doppler.png").stat().st_size > 1000


def test_a_radar_inside_an_actor_sees_that_actor_from_within() -> None:
    shell = {"id": 7, "shape": "box:4x2x2", "xyz_m": (2, 0, 1), "tag": "Car", "material": "metal", "aim": 500}
    target = {"id": 9, "xyz_m": (30, 0, 1), "rcs_dbsm": 30}
    scene = srt.Scene(actors=[shell], point_targets=[target])
    frame = srt.simulate(scene, rays=2000, backend="scalar", seed=SEED)
    assert set(np.unique(frame.scatterers.object_id)) <= {7}  # its walls hide the target; own rays cannot hold it
    assert np.all(np.isfinite(frame.adc.data))
    assert np.all(np.isfinite(frame.returns.amplitude))
    # a radar on the very wall of the box is a degenerate view, and no error either
    edge = srt.Scene(actors=[shell | {"xyz_m": (4, 0, 1)}])
    assert np.all(np.isfinite(srt.simulate(edge, rays=2000, backend="scalar", seed=SEED).adc.data))


def test_a_thousand_actors_are_told_apart() -> None:
    """A field of plates; ``-m slow`` has ten thousand."""
    _field(1000, rays=20_000)


@pytest.mark.slow
def test_ten_thousand_actors_are_told_apart() -> None:
    _field(10_000, rays=200_000)


def _field(count: int, rays: int) -> None:
    """Plates on a dome about the radar, so that none hides another; each is a cell of its own."""
    rows = max(int(np.sqrt(count / 2)), 1)
    columns = count // rows
    azimuth, elevation = np.meshgrid(np.linspace(-50, 50, columns), np.linspace(-15, 15, rows))
    actors: list[dict[str, Any]] = []
    for k, (a, e) in enumerate(zip(np.radians(azimuth.ravel()), np.radians(elevation.ravel()), strict=True)):
        place = 40.0 * np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        actors.append(
            {
                "id": k + 1, "shape": "plate:0.5x0.3", "tag": "Car", "material": "metal",
                "xyz_m": (2 + place[0], place[1], 1 + place[2]),
                "ypr_deg": (180 + np.degrees(a), np.degrees(e), 0), "velocity_mps": (-1, 0, 0),
            }
        )  # fmt: skip
    frame = srt.simulate(srt.Scene(actors=actors), rays=rays, seed=SEED, accuracy=1e-4)
    seen = np.unique(frame.scatterers.object_id)
    assert set(seen.tolist()) <= set(range(1, len(actors) + 1))
    # a plate of 0.5 x 0.3 m at 40 m takes 9.4e-5 sr; the chance that a cell's middle falls on it is that over the
    # cell's solid angle where it is less than one; 0.8 leaves three standard deviations of 1000 such plates
    cell = pattern_cells(srt.load_profile("awrl1432").pattern, rays).solid_angle.mean()
    assert len(seen) >= 0.8 * min(0.5 * 0.3 / 40.0**2 / cell, 1.0) * len(actors)
    assert np.all(np.isfinite(frame.adc.data))


@pytest.mark.slow
def test_five_million_triangles_are_traced() -> None:
    _many_triangles(1600)


def test_half_a_million_triangles_are_traced() -> None:
    """``-m slow`` has five million; docs/limits.md what they take."""
    _many_triangles(500)


def _many_triangles(side: int) -> None:
    """A ground of side x side squares, two triangles each, before a wall: the wall's level does not depend on them."""
    y, x = np.meshgrid(np.linspace(-40, 40, side + 1), np.linspace(4, 84, side + 1))
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    a, b, c, d = corner, corner + side + 1, corner + side + 2, corner + 1
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    ground = build_mesh(vertices, faces, Part(object="ground", tag=srt.SemanticTag.Roads))
    wall = {
        "id": 5,
        "shape": "plate:2x2",
        "xyz_m": (32, 0, 2),
        "ypr_deg": (180, 0, 0),
        "tag": "Walls",
        "material": "metal",
    }
    scene = srt.Scene(static=[{"mesh": ground, "material": "asphalt"}, wall])
    bare = srt.Scene(static=[wall])
    powers = [srt.simulate(s, rays=20_000, seed=SEED).returns.power_by_object() for s in (scene, bare)]
    assert powers[0][5] == pytest.approx(powers[1][5], rel=1e-9)
    assert powers[0][0] > 0  # the ground's echo


@pytest.mark.parametrize("at", [0, 2])
def test_a_full_disk_ends_a_run_with_one_line_and_no_folder(
    at: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    count, real = 0, npz.np.savez

    def savez(file: Any, **arrays: Any) -> None:
        nonlocal count
        count += 1
        if count > at:
            raise OSError(errno.ENOSPC, "No space left on device")
        real(file, **arrays)

    (tmp_path / "empty.yaml").write_text("name: empty\n")
    monkeypatch.setattr(npz.np, "savez", savez)
    (tmp_path / "runs").mkdir()
    assert main(["run", str(tmp_path / "empty.yaml"), *FAST, "-o", str(tmp_path / "runs/out")]) == 2
    error = capsys.readouterr().err
    assert "no space left on the disk" in error
    assert error.count("\n") == 1
    assert list((tmp_path / "runs").iterdir()) == []
