"""Contracts about cosines, ids, noise, axes and profiles, held through the whole chain."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from contract_tools import apparent_rcs_dbsm

import shenron_rt as srt
from shenron_rt.cli import main
from shenron_rt.errors import InputError
from shenron_rt.physics import near_range_plate_rcs
from shenron_rt.scatterers import Scatterers

PROFILES = [
    "awrl1432", "awrl1432_137mhz", "awrl1432_staggered", "awrl1432boost", "ddm_4x4", "mmwcas", "radarbook",
    "radarbook2", "radarbook_200mhz", "ti_cascade",
]  # fmt: skip


def plate_scene(side_m: float, range_m: float, **more: object) -> srt.Scene:
    plate = {"id": 3, "shape": f"plate:{side_m}x{side_m}", "xyz_m": (range_m, 0, 0), "ypr_deg": (180, 0, 0)}
    plate |= {"tag": "Other", "material": "metal", "aim": 4000, **more}
    return srt.Scene(actors=[plate], radars=[{"name": "r", "xyz_m": (0, 0, 0)}])


def test_plate_at_normal_incidence_has_cosine_one_and_the_closed_form() -> None:
    rows = srt.trace(plate_scene(0.3, 10.0), rays=2_000)
    mine = rows.cos_incidence[rows.object_id == 3]
    # its corners lie 0.21 m off the normal through the radar: cos >= 10 / sqrt(100 + 0.045)
    assert np.all(mine > 0.9997)
    assert np.all(mine <= 1.0)
    frame = srt.simulate(plate_scene(0.3, 10.0), rays=2_000, noise=None, seed=1)
    exact = 10 * np.log10(near_range_plate_rcs(0.3, 0.3, frame.profile.wavelength_m, 10.0))
    assert apparent_rcs_dbsm(frame, 3) == pytest.approx(exact, abs=0.3)


def test_turning_a_plate_away_takes_its_echo_instead_of_raising_it() -> None:
    level = {}
    for yaw in (180.0, 195.0, 240.0):
        frame = srt.simulate(plate_scene(0.3, 10.0, ypr_deg=(yaw, 0, 0)), rays=2_000, noise=None, seed=1)
        level[yaw] = apparent_rcs_dbsm(frame, 3)
        rows = frame.scatterers
        assert np.median(rows.cos_incidence[rows.object_id == 3]) == pytest.approx(
            abs(np.cos(np.radians(yaw - 180))), abs=0.02
        )
    # side lobes of physical optics at 15 and 60 degrees lie 35 dB and more below the mirror
    assert level[180.0] > max(level[195.0], level[240.0]) + 30


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [(5, 101.5, "bits"), (6, 14 * 1.4e-45, "bits"), (6, 300.0, "0 to 255"), (4, 1.2, "cosine"), (5, -1.0, "whole")],
)
def test_ids_and_tags_that_were_cast_to_float_are_refused(column: int, value: float, words: str) -> None:
    table = np.array([[10.0, 0.0, 0.0, -5.0, 1.0, 101.0, 14.0]] * 3)
    assert Scatterers.from_table(table).object_id.dtype == np.uint32
    table[1, column] = value
    with pytest.raises(InputError, match=words):
        Scatterers.from_table(table)


def test_the_largest_id_survives_the_table() -> None:
    table = np.array([[10.0, 0.0, 0.0, -5.0, 1.0, 2.0**32 - 1, 255.0]])
    rows = Scatterers.from_table(table)
    assert rows.object_id[0] == 2**32 - 1
    assert np.array_equal(rows.table(), table)


def test_noise_is_on_by_default_and_new_on_every_chirp_and_channel() -> None:
    profile = srt.load_profile("awrl1432")
    frame = srt.simulate(srt.Scene(), profile, seed=4)
    data = frame.adc.data
    count = data.size
    power = np.mean(np.abs(data) ** 2)
    assert power == pytest.approx(profile.noise_power_w, rel=5 / np.sqrt(count))
    flat = data.reshape(-1, data.shape[-1])  # (chirp x antenna, sample)
    product = np.abs(flat @ flat.conj().T) / (data.shape[-1] * power)
    np.fill_diagonal(product, 0.0)
    # 74 k pairs of 256 samples: |correlation| is Rayleigh of scale 1/16, the largest about sqrt(ln 73536) / 16 = 0.21
    assert product.max() < 0.3


@pytest.mark.parametrize("name", PROFILES)
def test_axes_and_detections_are_those_of_the_profile_asked_for(name: str) -> None:
    profile = srt.load_profile(name)
    distance = 0.4 * min(profile.max_range_m, 100.0)
    scene = srt.Scene(
        point_targets=[{"id": 9, "xyz_m": (2 + distance, 0, 1.0), "rcs_dbsm": 30.0}],
        radars=[{"name": "front", "profile": "ti_cascade" if name == "awrl1432" else "awrl1432"}],
    )
    frame = srt.simulate(scene, profile, seed=1)
    w = profile.waveform
    assert frame.profile == frame.adc.profile == frame.cube.profile == profile
    assert frame.cube.range_m[1] == pytest.approx(299_792_458.0 / (2 * w.bandwidth_hz))
    # an odd number of chirps has no bin at -v_max
    assert frame.cube.velocity_mps[0] == pytest.approx(-(w.chirps // 2) * profile.velocity_resolution_mps)
    assert w.chirps * profile.velocity_resolution_mps == pytest.approx(2 * profile.max_velocity_mps)
    assert frame.cube.data.shape == (profile.n_range, w.chirps, profile.n_virtual)
    row = frame.detections.table[frame.detections.object_id == 9][0]
    assert row["range"] == pytest.approx(distance, abs=profile.range_resolution_m)
    assert abs(row["velocity"]) < profile.velocity_resolution_mps


@pytest.mark.parametrize("name", ["radarbook", "awrl1432_137mhz"])
def test_the_profile_asked_for_is_used_and_written_into_the_run(name: str, tmp_path: Path) -> None:
    (tmp_path / "point.yaml").write_text(
        "version: 1\npoint_targets: [{id: 9, xyz_m: [30, 0, 1], rcs_dbsm: 20}]\n"
        "radars: [{name: front, profile: awrl1432}]\n"
    )
    out = tmp_path / "run"
    argv = ["run", str(tmp_path / "point.yaml"), "--profile", name, "-o", str(out), "--rays", "500", "--no-pictures"]
    assert main(argv) == 0
    asked = srt.load_profile(name)
    written = np.load(out / "radars" / "front" / "frame_000000" / "cube.npz")
    stored = json.loads(str(written["profile"]))
    assert stored["name"] == name
    assert srt.RadarProfile.model_validate(stored) == asked
    assert written["range_m"][1] == pytest.approx(asked.range_resolution_m)
    config = yaml.safe_load((out / "config.yaml").read_text())
    used = config["radars"][0]["profile"]
    assert name in (used, used.get("name") if isinstance(used, dict) else used)
