"""Two-dimensional directions of arrays with rows: accuracy at the bound, two heights in one cell, grating lobes."""

from __future__ import annotations

import math

import numpy as np
import pytest

import shenron_rt as srt
from shenron_rt.config.profile import RadarProfile, load_profile

RANGE_M = 30.0


def _profile(rows: list[float], columns: int, pattern: str = "isotropic") -> RadarProfile:
    """Return the awrl1432 with one transmitter a row height [half wavelengths] and a line of receivers."""
    data = load_profile("awrl1432").model_dump()
    data["array"] = {"tx": [[0, 0, r] for r in rows], "rx": [[0, -c, 0] for c in range(columns)]}
    data["antenna"]["pattern"] = pattern
    return RadarProfile.model_validate(data)


def _frame(profile: RadarProfile, *directions_deg: tuple[float, float], rcs_dbsm: float = 20) -> srt.Frame:
    """Return a frame of still point targets at azimuths and elevations, all at one range."""
    points = []
    for k, (azimuth, elevation) in enumerate(np.radians(directions_deg)):
        flat = RANGE_M * math.cos(elevation)
        xyz = (2 + flat * math.cos(azimuth), flat * math.sin(azimuth), 1 + RANGE_M * math.sin(elevation))
        points.append({"id": k + 1, "xyz_m": xyz, "rcs_dbsm": rcs_dbsm})
    return srt.simulate(srt.Scene(seed=4, point_targets=points, radars=[{"profile": profile, "xyz_m": (2, 0, 1)}]))


@pytest.mark.parametrize(("azimuth", "elevation"), [(0, 0), (20, 10), (-35, -8), (50, 12), (10, 25), (-5, -30)])
def test_both_angles_of_a_square_array_reach_the_cramer_rao_bound(azimuth: float, elevation: float) -> None:
    profile = _profile([0, 1, 2, 3], 4)
    row = _frame(profile, (azimuth, elevation)).detections.table[0]
    assert row["elevation_valid"]
    # sigma of a direction cosine: 1 / (2 pi / lambda sqrt(2 SNR) std(z)), std of 0, 1, 2, 3 half wavelengths
    sigma = 1 / (math.pi * math.sqrt(2 * 10 ** (row["snr_db"] / 10)) * np.std([0, 1, 2, 3]))
    sine = math.sin(row["azimuth"]) * math.cos(row["elevation"])
    true = math.sin(math.radians(azimuth)) * math.cos(math.radians(elevation))
    assert sine == pytest.approx(true, abs=5 * sigma)
    assert math.sin(row["elevation"]) == pytest.approx(math.sin(math.radians(elevation)), abs=5 * sigma)
    assert row["z"] == pytest.approx(RANGE_M * math.sin(math.radians(elevation)), abs=5 * sigma * RANGE_M + 0.02)


def test_two_heights_at_one_azimuth_and_range_are_two_detections() -> None:
    frame = _frame(_profile(list(range(6)), 4), (0, -15), (0, 20))
    strong = frame.detections.table[:2]
    assert sorted(strong["object_id"].tolist()) == [1, 2]
    for row in strong:
        # what each leaves in the other's fit is a side lobe of a line of six, a tenth of a beam of 2/6
        true = math.sin(math.radians((-15, 20)[row["object_id"] - 1]))
        assert math.sin(row["elevation"]) == pytest.approx(true, abs=0.1 * 2 / 6)
        assert row["rcs_dbsm"] == pytest.approx(20, abs=1.0)


def test_one_target_of_an_array_with_rows_is_one_detection() -> None:
    found = _frame(_profile(list(range(6)), 4), (15, 12)).detections
    assert int(np.sum(found.object_id == 1)) == 1


def test_three_rows_are_too_few_to_tell_two_heights() -> None:
    found = _frame(_profile([0, 1, 2], 4), (0, -15), (0, 20)).detections
    assert int(np.sum(found.object_id > 0)) == 1


@pytest.mark.parametrize("elevation", [-8.0, 0.0, 10.0])
def test_a_grating_lobe_of_sparse_rows_yields_to_the_beam_with_more_gain(elevation: float) -> None:
    # rows 4 half wavelengths apart repeat in steps of 0.5 of the sine of elevation
    frame = _frame(_profile([0, 4], 4, pattern="gaussian"), (-20, elevation))
    row = frame.detections.table[0]
    assert math.degrees(row["elevation"]) == pytest.approx(elevation, abs=0.5)
    assert math.degrees(row["azimuth"]) == pytest.approx(-20, abs=0.5)


@pytest.mark.parametrize("elevation", [-40.0, -3.3, 1.8, 21.0])
def test_a_tall_array_finds_targets_between_its_beams(elevation: float) -> None:
    # forty rows: a beam is 0.05 wide in sine
    row = _frame(_profile([float(k) for k in range(40)], 4), (5, elevation)).detections.table[0]
    assert math.sin(row["elevation"]) == pytest.approx(math.sin(math.radians(elevation)), abs=1e-3)
