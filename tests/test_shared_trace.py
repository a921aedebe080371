"""Several radars at one place: one cast of rays, and what each of them gets from it."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shenron_rt as srt
from shenron_rt.cli import main
from shenron_rt.rendering import rendered
from shenron_rt.run_setup import RunOptions, with_profiles
from shenron_rt.tracing.caster import RayCaster
from shenron_rt.tracing.launch import UnionPattern, lit_part, pattern_cells
from shenron_rt.tracing.shared import trace_shared

NAMES = ["awrl1432", "radarbook", "ti_cascade"]
RAYS = 6000


@pytest.fixture(scope="module")
def braking() -> srt.Scene:
    return with_profiles(srt.load_scene("braking"), NAMES, {})


def test_three_radars_at_one_place_cast_rays_once_a_frame(braking: srt.Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    cast: list[int] = []
    real = RayCaster.cast

    def counting(self: RayCaster, directions: Any, origins: Any = None, **options: Any) -> Any:
        if directions.shape[1]:  # point targets are looked for, too; there are none
            cast.append(directions.shape[1])
        return real(self, directions, origins, **options)

    monkeypatch.setattr(RayCaster, "cast", counting)
    found = trace_shared(braking, [r.name for r in braking.radars], rays=RAYS, backend="scalar")
    together = list(cast)
    cast.clear()
    alone = srt.trace(braking, radar="front_awrl1432", rays=RAYS, backend="scalar")
    assert together == cast  # as many rays as the widest pattern takes alone
    assert list(found) == [f"front_{n}" for n in NAMES]
    # the widest pattern holds the others: its radar sees the same bytes as alone
    for field in dataclasses.fields(alone):
        one, other = getattr(alone, field.name), getattr(found["front_awrl1432"], field.name)
        assert (
            np.array_equal(one, other, equal_nan=one.dtype.kind == "f") if isinstance(one, np.ndarray) else one == other
        )


def test_a_narrower_radar_has_its_own_instant_and_random_numbers() -> None:
    plate = {
        "id": 7, "shape": "plate:2x1", "xyz_m": (20, 0, 1), "ypr_deg": (180, 0, 0), "velocity_mps": (-5, 0, 0),
        "tag": "Walls", "material": "concrete", "aim": 500,
    }  # fmt: skip
    scene = with_profiles(srt.Scene(actors=[plate]), NAMES, {})
    found = trace_shared(scene, [r.name for r in scene.radars], rays=RAYS, backend="scalar")
    wide, late = found["radar_awrl1432"], found["radar_radarbook"]
    assert len(wide) == len(late) > 400  # the same rays of its own
    gap = srt.load_profile("radarbook").frame_mid_s - srt.load_profile("awrl1432").frame_mid_s
    # a plane across the line of sight is 5 m/s x 47 ms nearer at the middle of the later frame
    assert wide.position[:, 0] - late.position[:, 0] == pytest.approx(5.0 * gap, abs=1e-9)
    assert not np.any(wide.speckle == late.speckle)


def test_echoes_of_radars_that_share_rays_are_those_of_radars_alone(braking: srt.Scene) -> None:
    """Power of each object, shared against alone with as many rays in the narrower pattern.

    The car has rays of its own, 20 000 in both cases, on grids placed by the numbers of another radar: sampling.
    Outlines of the later radar are those of 47 ms before: the car, 23 m away and 5 m/s slower, is 0.23 m nearer at its
    own instant, so its rays, which keep their directions, light (1 - 0.23/23)^2 = 2 % less of it, 0.09 dB, and at most
    twice that where it adds up in phase. 1 dB stands for sampling. Walls are rough and graze: speckle of some thousand
    cells that count as few hundred.
    """
    options = RunOptions(rays=30_000, accuracy=1e-3)
    shared = {m.profile.name: f for m, f in rendered(braking, options, range(1))}
    for name in NAMES:
        alone = srt.simulate(braking, radar=f"front_{name}", rays=30_000, accuracy=1e-3)
        one, other = (f.returns.power_by_object()[101] for f in (alone, shared[name]))
        assert 10 * np.log10(other / one) == pytest.approx(0.0, abs=1.2), name
        rows = [f.detections.table[f.detections.object_id == 101][0] for f in (alone, shared[name])]
        # the same cell, to a tenth of its size for the noise of the estimate
        profile = srt.load_profile(name)
        assert rows[0]["range"] == pytest.approx(rows[1]["range"], abs=0.1 * profile.range_resolution_m)
        assert rows[0]["velocity"] == pytest.approx(rows[1]["velocity"], abs=0.1 * profile.velocity_resolution_mps)


def test_cells_of_a_part_are_cells_of_the_whole(braking: srt.Scene) -> None:
    wide, narrow = (srt.load_profile(n).pattern for n in ("awrl1432", "ti_cascade"))
    base = pattern_cells(UnionPattern((narrow, wide)), RAYS)
    assert np.array_equal(base.direction, pattern_cells(wide, RAYS).direction)
    part, rows = lit_part(base, narrow)
    assert np.array_equal(base.direction[rows], part.direction)
    assert 0.1 < len(part) / len(base) < 0.4  # half as wide both ways: a quarter
    inside = part.neighbour >= 0
    assert np.array_equal(rows[part.neighbour[inside]], base.neighbour[rows][inside])


def test_radars_at_several_places_are_refused() -> None:
    mounts = [{"name": "left", "xyz_m": (2, 1, 1)}, {"name": "right", "xyz_m": (2, -1, 1)}]
    scene = srt.Scene(point_targets=[{"id": 1, "xyz_m": (30, 0, 1), "rcs_dbsm": 10}], radars=mounts)
    with pytest.raises(srt.InputError, match="left, right stand at several places"):
        trace_shared(scene, ["left", "right"])
    found = list(rendered(scene, RunOptions(rays=500, backend="scalar"), range(1)))
    assert [m.name for m, _ in found] == ["left", "right"]
    assert [f.radar for _, f in found] == ["left", "right"]


def test_run_with_three_profiles_writes_all_three(tmp_path: Path) -> None:
    out = tmp_path / "out"
    profiles = [word for name in NAMES for word in ("--profile", name)]
    given = ["--rays", "3000", "--backend", "scalar", "--no-pictures", "--frames", "0:2", "-o", str(out)]
    assert main(["run", "clear_road", *profiles, *given]) == 0
    told = json.loads((out / "summary.json").read_text())
    assert [r["profile"] for r in told["radars"]] == NAMES
    assert [[f["frame"] for f in r["frames"]] for r in told["radars"]] == [[0, 1]] * 3
