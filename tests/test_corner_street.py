"""Scene ``corner_reflector``: three corners in a street, the bounces that it asks for, and who may say otherwise."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from corner_tools import corner_scene, four_path_corner

import shenron_rt as srt
from shenron_rt.cli import main
from shenron_rt.errors import ConfigError

CORNERS = {10: (10.0, -14.0), 20: (20.0, 9.0), 30: (40.0, 0.0)}
FAST = {"rays": 60_000, "accuracy": 1e-3}


@pytest.fixture(scope="module")
def street() -> srt.Frame:
    return srt.simulate(srt.load_scene("corner_reflector"), **FAST)


@pytest.mark.parametrize("number", CORNERS)
def test_each_corner_is_detected_in_its_place(street: srt.Frame, number: int) -> None:
    mine = street.detections.table[street.detections.object_id == number][0]
    distance, azimuth_deg = CORNERS[number]
    # the mixed ways over the road are longer by 2 / R, 0.2 m at 10 m, where the pattern takes 4 dB from them
    assert mine["range"] == pytest.approx(distance, abs=0.1 * street.profile.range_resolution_m)
    assert np.degrees(mine["azimuth"]) == pytest.approx(azimuth_deg, abs=0.2)
    assert mine["velocity"] == pytest.approx(0.0, abs=0.01)
    assert mine["snr_db"] > 60


def test_corners_are_the_strongest_of_the_street(street: srt.Frame) -> None:
    assert list(street.detections.object_id[:3]) == [10, 20, 30]


@pytest.mark.parametrize("number", CORNERS)
def test_each_corner_reads_the_sum_of_its_paths_over_the_road(street: srt.Frame, number: int) -> None:
    mine = street.detections.table[street.detections.object_id == number][0]
    wanted = 20 * np.log10(abs(four_path_corner(street.profile, CORNERS[number][0])))
    # 1 dB RMS is the bar of this law; houses and the other corners stand 20 dB below
    assert mine["rcs_dbsm"] == pytest.approx(wanted, abs=1.5)


def test_the_scene_says_how_many_bounces_it_needs(street: srt.Frame) -> None:
    scene = srt.load_scene("corner_reflector")
    assert scene.max_bounces == 5
    assert street.scatterers.paths is not None
    assert street.scatterers.paths.count.max() == 5
    first = srt.simulate(scene, max_bounces=1, **FAST)
    assert first.scatterers.paths is None
    ours, theirs = street.returns.power_by_object(), first.returns.power_by_object()
    # an open corner sends its first surfaces' mirror echo elsewhere
    assert all(ours[n] > 100 * theirs.get(n, 0.0) for n in CORNERS)


def test_the_command_line_takes_the_bounces_of_the_scene_unless_told(tmp_path: Path) -> None:
    scene = corner_scene(10.0, road=True).model_dump(mode="json", exclude_none=True, exclude_defaults=True)
    scene["actors"][0]["aim"] = 200
    file = tmp_path / "corner.yaml"
    file.write_text(yaml.safe_dump(scene | {"version": 1, "max_bounces": 5}))
    for argv, wanted in (((), 5), (("--max-bounces", "1"), 1)):
        folder = tmp_path / str(wanted)
        options = ("-o", str(folder), "--rays", "3000", "--accuracy", "1e-3", "--no-pictures")
        assert main(["run", str(file), *options, *argv]) == 0
        assert json.loads((folder / "summary.json").read_text())["max_bounces"] == wanted
    # what an earlier run was told is kept by its configuration, over the scene's own
    again = tmp_path / "again"
    assert main(["run", str(tmp_path / "1" / "config.yaml"), "-o", str(again), "--no-pictures"]) == 0
    assert json.loads((again / "summary.json").read_text())["max_bounces"] == 1


@pytest.mark.parametrize("bounces", [0, 6])
def test_bounces_of_a_scene_out_of_bounds_are_refused_with_their_place(tmp_path: Path, bounces: int) -> None:
    file = tmp_path / "street.yaml"
    file.write_text(f"version: 1\nmax_bounces: {bounces}\n")
    with pytest.raises(ConfigError, match=r"street\.yaml:2: max_bounces"):
        srt.load_scene(file)
