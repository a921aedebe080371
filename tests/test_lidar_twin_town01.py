"""Our LiDAR over the exported street against the stored frame of that street, which another caster made: ray by ray."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from real_input_tools import frame_meta, street_scene

import shenron_rt as srt
from shenron_rt.config.scene import LidarMount
from shenron_rt.lidar import LidarFrame
from shenron_rt.lidar.side_writer import scene_side_file

CHANNELS, AZIMUTHS = 64, 720


def _ray(frame: LidarFrame) -> np.ndarray:
    """Return which ray of the pattern each point lies on."""
    unit = frame.position / np.linalg.norm(frame.position, axis=1)[:, None]
    row = np.rint((10 - np.degrees(np.arcsin(unit[:, 2]))) * (CHANNELS - 1) / 40).astype(int)
    column = np.rint((180 - np.degrees(np.arctan2(unit[:, 1], unit[:, 0]))) * AZIMUTHS / 360).astype(int) % AZIMUTHS
    return row * AZIMUTHS + column


@pytest.fixture(scope="module")
def frames(shared_data: Path) -> tuple[LidarFrame, LidarFrame]:
    """Return the cast and the stored frame."""
    mount = LidarMount(
        xyz_m=(0, 0, 2.4), channels=CHANNELS, upper_deg=10, lower_deg=-30, range_m=80,
        points_per_second=CHANNELS * AZIMUTHS * 10,
    )  # fmt: skip
    folder = shared_data / "semlidar_synth_town01"
    stored = srt.read_semantic_lidar(
        folder / "frame_town01_0916.bin", tag_table="0.9.14", frame="carla",
        side_file=folder / "frame_town01_0916.meta.yaml",
    )  # fmt: skip
    return srt.cast_lidar(street_scene(shared_data), mount), stored


def test_every_ray_that_meets_the_exported_mesh_meets_what_the_stored_frame_has(
    frames: tuple[LidarFrame, LidarFrame],
) -> None:
    ours, stored = frames
    _, i, j = np.intersect1d(_ray(ours), _ray(stored), return_indices=True)
    assert len(i) == len(ours)  # nothing is hit that is not there
    np.testing.assert_array_equal(ours.tag[i], stored.tag[j])
    np.testing.assert_array_equal(ours.object_id[i], stored.object_id[j])
    missing = np.setdiff1d(np.arange(len(stored)), j)
    tags = {srt.SemanticTag(int(t)).name for t in stored.tag[missing]}
    # the lawns are not among the exported parts, and its road strips end a little earlier
    assert tags == {"Terrain", "Roads", "Sidewalks"}
    assert np.sum(stored.tag[missing] != srt.SemanticTag.Terrain) < 0.01 * len(stored)
    for name in ("Buildings", "Poles", "Vegetation", "Car", "Bus", "Pedestrians", "Dynamic", "GuardRail"):
        assert np.sum(ours.tag == srt.SemanticTag[name]) == np.sum(stored.tag == srt.SemanticTag[name]), name


def test_points_and_cosines_are_those_of_the_stored_frame(frames: tuple[LidarFrame, LidarFrame]) -> None:
    ours, stored = frames
    _, i, j = np.intersect1d(_ray(ours), _ray(stored), return_indices=True)
    apart = np.linalg.norm(ours.position[i] - stored.position[j], axis=1)
    static = stored.object_id[j] == 0
    # poses are stored to 0.1 mm and 1e-4 degrees; vehicles stand within 1 cm in their boxes
    still = static & (stored.tag[j] != srt.SemanticTag.Car)
    assert apart[still].max() < 1e-3
    assert apart.max() < 0.02
    off = np.abs(ours.cos_incidence[i] - stored.cos_incidence[j])
    assert np.mean(off < 1e-3) > 0.999


def test_our_side_file_of_the_street_says_what_its_description_says(
    shared_data: Path, frames: tuple[LidarFrame, LidarFrame]
) -> None:
    ours, stored = frames
    side = scene_side_file(street_scene(shared_data), LidarMount(xyz_m=(0, 0, 2.4)))
    for actor in frame_meta(shared_data)["actors"]:
        center, half = side.actors[actor["id"]].box  # type: ignore[misc]
        np.testing.assert_allclose(half, actor["bbox"]["extent"], atol=0.01)
        inside = center.apply_inverse(ours.sensor_pose.apply(ours.position[ours.object_id == actor["id"]]))  # type: ignore[union-attr]
        assert len(inside) == actor["n_points"]
        assert np.all(np.abs(inside) < half + 1e-3)
    assert stored.velocity is not None
    assert ours.velocity is not None
    for number in (101, 102, 201, 202):
        mine, theirs = (f.velocity[f.object_id == number][0] for f in (ours, stored))  # type: ignore[index]
        np.testing.assert_allclose(mine, theirs, atol=1e-6)
