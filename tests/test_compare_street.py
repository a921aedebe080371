"""The street of the synthetic LiDAR frame by both doors: every difference has its cause."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from real_input_tools import street_scene

import shenron_rt as srt

ACTORS = {101, 102, 201, 202}


@pytest.fixture(scope="module")
def street(shared_data: Path) -> srt.Comparison:
    scene = street_scene(shared_data)
    folder = shared_data / "semlidar_synth_town01"
    lidar = srt.read_semantic_lidar(
        folder / "frame_town01_0916.bin",
        tag_table="0.9.14",
        frame="carla",
        side_file=folder / "frame_town01_0916.meta.yaml",
    )
    profile = srt.load_profile("awrl1432")
    return srt.compare(
        srt.simulate(scene, rays=60_000, accuracy=1e-3),
        srt.simulate(lidar, profile, mount=srt.Pose((2.0, 0.0, 1.0)), accuracy=1e-3),
    )


def test_ranges_of_common_objects_agree_within_a_bin(street: srt.Comparison) -> None:
    profile = srt.load_profile("awrl1432")
    objects = {o.id: o for o in street.objects}
    assert set(objects) >= ACTORS
    for number in ACTORS:
        assert objects[number].seen_by == "both"
        assert abs(objects[number].nearest_m_b - objects[number].nearest_m_a) < profile.range_resolution_m


def test_every_difference_of_objects_and_tags_is_explained_and_its_terms_add_up(street: srt.Comparison) -> None:
    for record in [*street.objects, *street.tags]:
        assert record.cause != "unexplained", record
        if record.delta_db is not None:
            assert sum(record.terms_db.values()) == pytest.approx(record.delta_db, abs=1e-6)


def test_walkers_of_the_two_doors_agree_as_their_echo_is_diffuse(street: srt.Comparison) -> None:
    for record in (o for o in street.objects if o.id in (201, 202)):
        assert record.cause == "agrees"
        # area by LiDAR points of a known grid: 26 and 3 points, sampling error 1/sqrt(n), 3 sigma
        points = record.rows_b
        assert abs(record.area_m2_b / record.area_m2_a - 1) < 3 / np.sqrt(points)


def test_the_lidars_place_in_the_radar_frame_is_known(street: srt.Comparison) -> None:
    assert street.notes == []
    assert street.sides[1].origin == pytest.approx([-2.0, 0.0, 1.4], abs=1e-3)  # 2.4 m up, the radar at 1 m
