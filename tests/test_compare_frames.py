"""Comparisons of several frames: linear means, and what is made of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from compare_tools import ROWS, frame_of, patch, scatterers_of
from test_compare_cli import write_runs

import shenron_rt as srt
from shenron_rt.cli import main
from shenron_rt.comparison.frame_pair import palette_of
from shenron_rt.comparison.levels import Levels
from shenron_rt.comparison.sides import side_of

AT = (20.0, 0.0, 0.0)
#: Frames of either side: a wall that comes nearer, of another area; the car is in one frame of each, not in the same.
RANGES = (20.0, 18.0, 16.0)


def _frames(area: float, car: int, seed: int, **fields: Any) -> list[Any]:
    frames = []
    for k, x in enumerate(RANGES):
        patches = [patch(7, (x, 0.0, 0.0), area=area, material="concrete", seed=k)]
        if k == car:
            patches.append(patch(9, (12.0, 4.0, 0.0), area=1.0, material="asphalt", rows=100))
        frames.append(frame_of(scatterers_of(*patches, seed=seed + k, **fields), index=k))
    return frames


@pytest.fixture(scope="module")
def sides() -> tuple[list[Any], list[Any]]:
    return _frames(2.0, 1, 10), _frames(8.0, 2, 50)


@pytest.fixture(scope="module")
def runs(sides: tuple[list[Any], list[Any]], tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("frames")
    return write_runs(folder / "a", sides[0], {"seed": 1}), write_runs(folder / "b", sides[1][:3], {"seed": 2})


@pytest.fixture(scope="module")
def pooled(runs: tuple[Path, Path]) -> srt.Comparison:
    return srt.compare(*runs)


def test_powers_are_linear_means_over_all_common_frames(
    pooled: srt.Comparison, sides: tuple[list[Any], list[Any]]
) -> None:
    assert pooled.frames == [0, 1, 2]
    wall, car = ({o.id: o for o in pooled.objects}[i] for i in (7, 9))
    for side, frames in zip("ab", sides, strict=True):
        for record in (wall, car):
            powers = [f.returns.power_by_object().get(record.id, 0.0) for f in frames]
            assert record[f"power_db_{side}"] == pytest.approx(10 * np.log10(np.mean(powers)), abs=1e-9)
    assert (wall.rows_a, wall.rows_b, car.rows_a, car.rows_b) == (3 * ROWS, 3 * ROWS, 100, 100)
    assert (car.detected_frames_a is not None, car.detected_frames_a <= 1) == (True, True)


def test_the_terms_of_the_mean_add_up_and_name_the_cause(pooled: srt.Comparison) -> None:
    for record in [*pooled.objects, *pooled.tags]:
        assert sum(record.terms_db.values()) == pytest.approx(record.delta_db, abs=1e-9)
    wall = next(o for o in pooled.objects if o.id == 7)
    assert wall.cause == "different_surfaces"
    assert wall.terms_db["coverage"] == pytest.approx(10 * np.log10(4.0), abs=1e-9)
    # the mean range is that of each frame's scattered power
    assert wall.mean_range_m_a == pytest.approx(np.mean(RANGES), abs=0.05)


def test_independent_frames_steady_a_level_and_equal_ones_change_nothing_else() -> None:
    side = side_of(frame_of(scatterers_of(patch(7, AT))), "A", radar=None, frame=None, lidar_origin=None)
    one = Levels.of(side, side, "object_id", palette_of(side, side, several=True), {})
    four = Levels.pool([one] * 4)
    assert four.powers[0][0] == pytest.approx(one.powers[0][0], rel=1e-12)
    assert one.budgets is not None
    assert four.budgets is not None
    for name in ("area", "backscatter", "expected", "mean_range", "nearest", "cosine"):
        assert getattr(four.budgets[0], name) == pytest.approx(getattr(one.budgets[0], name), rel=1e-12)
    # frames draw speckle of their own: four of them have four times the looks
    assert four.budgets[0].looks == pytest.approx(4 * one.budgets[0].looks, rel=1e-12)
    assert four.fluctuation_db(0) == pytest.approx(one.fluctuation_db(0) / 2, rel=0.01)


def test_an_object_in_one_frame_only_keeps_its_share_of_the_mean(
    sides: tuple[list[Any], list[Any]], pooled: srt.Comparison
) -> None:
    car = next(o for o in pooled.objects if o.id == 9)
    alone = sides[0][1].returns.power_by_object()[9]
    assert car.power_db_a == pytest.approx(10 * np.log10(alone / 3), abs=1e-9)
    assert car.materials_a == pytest.approx({"asphalt": 1.0})


def test_maps_detections_and_counts_are_of_all_frames(
    pooled: srt.Comparison, sides: tuple[list[Any], list[Any]]
) -> None:
    for pair in pooled.map_pairs:
        for value, frames in ((pair.a, sides[0]), (pair.b, sides[1])):
            np.testing.assert_allclose(value, np.mean([getattr(f.cube, pair.name) for f in frames], axis=0), rtol=1e-12)
    found = pooled.detections
    for side, kind, frames in (("a", "missed", sides[0]), ("b", "extra", sides[1])):
        total = sum(len(f.detections) for f in frames)
        assert len(found.matched) + len(found[kind]) == total == pooled.results[side].detections
    # a detection of one frame has no partner in another
    assert {m.frame for m in found.matched} == {0, 1, 2}
    single = [srt.compare(a, b).detections for a, b in zip(*sides, strict=True)]
    assert len(found.matched) == sum(len(s.matched) for s in single)
    assert pooled.scatterers is not None
    assert pooled.scatterers.rows_a == sum(len(f.scatterers) for f in sides[0])


def test_frames_can_be_chosen_and_those_of_one_side_are_left_out_and_named(
    sides: tuple[list[Any], list[Any]], runs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    short = write_runs(tmp_path / "short", sides[1][1:], {"seed": 2})
    result = srt.compare(runs[0], short)
    assert result.frames == [1, 2]
    assert any("A has 1 frames that the other side lacks" in note for note in result.notes)
    assert srt.compare(runs[0], short, frame=2).frames == [2]
    assert srt.compare(*runs, frame=range(2)).frames == [0, 1]
    with pytest.raises(srt.InputError, match=r"frames \[0\] are not in a run, which has \[1, 2\]"):
        srt.compare(runs[0], short, frame=[0, 1])
    assert main(["compare", *map(str, runs), "--frames", "0:2", "-o", str(tmp_path / "out")]) == 0
    text = capsys.readouterr().out
    assert "2 frames: powers and maps are linear means" in text
    assert (tmp_path / "out" / "compare.png").stat().st_size > 10_000
    assert main(["compare", *map(str, runs), "--frames", "0:2", "--frame", "1"]) == 2
    assert "not both" in capsys.readouterr().err
