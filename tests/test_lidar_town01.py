"""The Town01 frame in every layout people store: one set of scatterers, from Python and from the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from real_input_tools import street_scene

import shenron_rt as srt
from shenron_rt.cli import main
from shenron_rt.lidar import lidar_scatterers, suggest_tag_table

BUMPER = srt.Pose((2.0, 0.0, 1.0))
#: Layout, axes, and the largest distance of a point from where the raw record has it [m]: four decimals in PLY, half of
#: 1 mm in LAZ; a coordinate each, so that the PLY's is measured along each axis.
LAYOUTS = {
    ".ply": ("carla", 0.05e-3),
    ".bin": ("carla", 0.0),
    "_struct.npy": ("carla", 0.0),
    "_f4view.npy": ("carla", 0.0),
    "_simbev.npz": ("ros", 0.0),
    ".laz": ("carla", 0.6e-3),
}
ACTORS = {101: ("Car", 88), 102: ("Bus", 93), 201: ("Pedestrians", 26), 202: ("Pedestrians", 3)}


def _path(data: Path, layout: str) -> Path:
    if layout == ".laz":
        pytest.importorskip("laspy", reason="pip install 'shenron-rt[io]'")
        pytest.importorskip("lazrs", reason="pip install 'shenron-rt[io]'")
    return data / "semlidar_synth_town01" / f"frame_town01_0916{layout}"


def _meta(data: Path) -> Path:
    return data / "semlidar_synth_town01" / "frame_town01_0916.meta.yaml"


def _read(data: Path, layout: str, **options: Any) -> srt.LidarFrame:
    frame = LAYOUTS[layout][0]
    return srt.read_semantic_lidar(
        _path(data, layout), tag_table="0.9.14", frame=frame, side_file=_meta(data), **options
    )  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def raw(shared_data: Path) -> srt.Scatterers:
    """Scatterers of the raw records, in the radar frame of a bumper mount."""
    return lidar_scatterers(_read(shared_data, ".bin"), mount=BUMPER)


@pytest.mark.parametrize("layout", sorted(LAYOUTS))
def test_all_layouts_give_the_same_scatterers_actor_by_actor(
    layout: str, shared_data: Path, raw: srt.Scatterers
) -> None:
    rows = lidar_scatterers(_read(shared_data, layout), mount=BUMPER)
    tolerance = LAYOUTS[layout][1] * (1 + 1e-9)
    assert len(rows) == 35_110
    assert np.array_equal(rows.object_id, raw.object_id)
    assert np.array_equal(rows.tag, raw.tag)
    for number, (tag, count) in ACTORS.items():
        mine, theirs = rows.select(rows.object_id == number), raw.select(raw.object_id == number)
        assert len(mine) == count
        assert set(mine.tag) == {srt.SemanticTag[tag]}
        assert np.abs(mine.position - theirs.position).max() <= tolerance
        assert np.abs(mine.range_rate - theirs.range_rate).max() <= 11.0 * tolerance / 3.0  # speed x turn of the sight
    assert np.abs(rows.position - raw.position).max() <= tolerance
    assert np.abs(rows.cos_incidence - raw.cos_incidence).max() <= (0.05e-3 if layout == ".ply" else 0.0) + 1e-12
    assert rows.area is not None
    assert raw.area is not None
    # four decimals of a cosine of 0.025 and more: 0.2 %
    assert rows.area == pytest.approx(raw.area, rel=2.5e-3)


def test_points_lie_in_the_boxes_of_their_actors_in_the_radar_frame(shared_data: Path, raw: srt.Scatterers) -> None:
    meta = yaml.safe_load(_meta(shared_data).read_text())
    ego = meta["ego_transform"]["location"]
    for actor in meta["actors"]:
        # the ego's yaw is 0.0061 deg, 4 mm at 36 m: the world's axes are the ego's to a centimetre
        x, y = actor["location"][0] - ego[0] - 2.0, -(actor["location"][1] - ego[1])
        points = raw.position[raw.object_id == actor["id"]]
        reach = np.hypot(*actor["bbox"]["extent"][:2]) + 0.12
        assert np.all(np.hypot(points[:, 0] - x, points[:, 1] - y) < reach), actor["id"]


def test_velocities_of_the_side_file_reach_the_scatterers(raw: srt.Scatterers) -> None:
    u = raw.position / raw.range[:, None]
    for number, velocity in ((101, (8, 0, 0)), (102, (-11, 0, 0)), (201, (0, 1.4, 0)), (202, (0, 0, 0))):
        mine = raw.object_id == number
        assert raw.range_rate[mine] == pytest.approx(u[mine] @ np.array(velocity, dtype=float), abs=1e-9)
    assert not np.any(raw.range_rate[raw.object_id == 0])


def test_histogram_and_grid_are_those_of_the_description(shared_data: Path) -> None:
    meta = yaml.safe_load(_meta(shared_data).read_text())
    frame = _read(shared_data, "_struct.npy")
    summary = frame.summary()
    assert summary["tags"] == {v["name"]: v["count"] for v in meta["tag_histogram"].values()}
    assert summary["points_per_actor"] == {number: count for number, (_, count) in ACTORS.items()}
    assert frame.grid.channels == meta["channels"]
    assert (frame.grid.upper_deg, frame.grid.lower_deg) == pytest.approx(
        (meta["upper_fov"], meta["lower_fov"]), abs=1e-3
    )
    assert frame.grid.azimuth_step_deg == pytest.approx(360 / 720, abs=1e-3)
    assert frame.sensor_pose is not None
    assert frame.sensor_pose.xyz == pytest.approx((0, 0, 2.4))
    assert suggest_tag_table(_path(shared_data, ".bin")).table == "0.9.14"


def test_the_old_table_is_refused(shared_data: Path) -> None:
    with pytest.raises(srt.InputError, match=r"does not list 28 \(19 times\)"):
        srt.read_semantic_lidar(_path(shared_data, ".ply"), tag_table="0.9.13", frame="carla")


@pytest.mark.parametrize(("layout", "frame"), [(".ply", "ros"), ("_simbev.npz", "carla")])
def test_y_flipped_once_too_often_is_refused(layout: str, frame: str, shared_data: Path) -> None:
    with pytest.raises(srt.InputError, match="y is mirrored"):
        srt.read_semantic_lidar(
            _path(shared_data, layout), tag_table="0.9.14", frame=frame, side_file=_meta(shared_data)
        )  # type: ignore[arg-type]


def test_the_sedan_is_detected_where_and_as_fast_as_it_is(shared_data: Path) -> None:
    profile = srt.load_profile("awrl1432")
    lidar = _read(shared_data, ".bin", ego_velocity=(10.0, 0.0, 0.0)).with_normals()
    hits = 0
    for seed in range(3):
        done = srt.simulate(lidar, profile, mount=BUMPER, seed=seed, accuracy=1e-3)
        table = done.detections.table[done.detections.object_id == 101]
        # its rear is 18 - 2.445 - 2 = 13.56 m ahead; it drives 2 m/s slower than the ego
        on = (np.abs(table["range"] - 13.56) < 0.4) & (np.abs(table["velocity"] + 2.0) < 0.5)
        hits += bool(on.any())
    # a few random phasors in one cell: 29 dB in the mean over a threshold of 12 dB fade away in 2 % of the frames
    assert hits >= 2


def test_both_doors_see_common_objects_at_the_same_range(shared_data: Path, raw: srt.Scatterers) -> None:
    profile = srt.load_profile("awrl1432")
    mesh = srt.trace(street_scene(shared_data), profile, rays=60_000)
    for number in (101, 102, 201):
        nearest = [rows.range[rows.object_id == number].min() for rows in (raw, mesh)]
        assert abs(nearest[0] - nearest[1]) < profile.range_resolution_m, number


def test_both_doors_receive_the_same_power_from_what_the_points_resolve(shared_data: Path) -> None:
    profile, scene = srt.load_profile("awrl1432"), street_scene(shared_data)
    lidar = _read(shared_data, ".bin").with_normals()
    seeds = range(4)
    means: list[dict[int, float]] = []
    for door in ("lidar", "mesh"):
        power: dict[int, list[float]] = {}
        for seed in seeds:
            if door == "lidar":
                rows = lidar_scatterers(lidar, mount=BUMPER, radar="front", seed=seed)
            else:
                rows = srt.trace(scene, profile, rays=60_000, seed=seed)
            for number, watts in srt.illuminate(rows, profile).power_by_object().items():
                power.setdefault(number, []).append(watts)
        means.append({number: float(np.mean(watts)) for number, watts in power.items()})
    off = {n: 10 * np.log10(means[0][n] / means[1][n]) for n in (0, 101, 201, 202)}
    # walkers are rough: their area decides, and 3 points of 26 err by 1.5 dB
    assert abs(off[201]) < 1.0
    assert abs(off[202]) < 2.5
    assert abs(off[0]) < 3.0
    # Points have no phases: what they hold of a metal body is its mean over attitudes a lobe, 2 degrees, apart. In that
    # of this frame the sedan's mirrors cancel, 10 dB below it. 12 attitudes leave 2 dB; the sedan's normals err by 3
    # degrees of a lobe of 7.
    turned = _mean_over_attitudes(scene, 101, profile)
    assert abs(10 * np.log10(means[0][101] / turned)) < 4.0


def _mean_over_attitudes(scene: srt.Scene, number: int, profile: srt.RadarProfile) -> float:
    """Return the mean power of an actor alone by the mesh door, yaw and pitch 2 degrees (RMS) about its own [W]."""
    (actor,) = (a for a in scene.actors if a.id == number)
    yaw, pitch, roll = actor.ypr_deg
    powers = []
    for seed, (y, p) in enumerate(np.random.default_rng(3).normal(0.0, 2.0, (12, 2))):
        turned = actor.model_copy(update={"ypr_deg": (yaw + y, pitch + p, roll)})
        alone = scene.model_copy(update={"actors": (turned,), "static": ()})
        powers.append(srt.illuminate(srt.trace(alone, profile, seed=seed, rays=20_000), profile).power_by_object())
    return float(np.mean([power[number] for power in powers]))


@pytest.mark.parametrize("layout", sorted(LAYOUTS))
def test_the_command_line_takes_every_layout(
    layout: str, shared_data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    argv = ["lidar", str(_path(shared_data, layout)), "--tag-table", "0.9.14", "--frame", LAYOUTS[layout][0]]
    argv += ["--side-file", str(_meta(shared_data)), "--mount", "2,0,1", "--ego-velocity", "10,0,0"]
    argv += [
        "-o",
        str(tmp_path / "run"),
        "--json",
        "--no-pictures",
        "--seed",
        "2",
    ]  # no fade of the sedan's few mirrors
    assert main(argv) == 0
    summary = json.loads(capsys.readouterr().out)
    frame = summary["radars"][0]["frames"][0]
    if layout != ".laz":  # 0.5 mm is a tenth of a wavelength: which phasors add up is another draw
        strongest = frame["strongest"]
        assert strongest["object_id"] == 101
        assert strongest["range_m"] == pytest.approx(13.56, abs=0.4)
        assert strongest["velocity_mps"] == pytest.approx(-2.0, abs=0.5)
    lidar = _read(shared_data, ".bin").with_normals()
    rows = lidar_scatterers(lidar, mount=BUMPER, radar="awrl1432", seed=2)
    power = srt.illuminate(rows, srt.load_profile("awrl1432")).power_by_object()
    for item in frame["objects"]:
        # cosines of four decimals near 1 and normals of mm coordinates: a percent of the lobe
        assert item["power_dbw"] == pytest.approx(10 * np.log10(power[item["id"]]), abs=0.1), item["name"]
    assert summary["lidar"][0]["points"] == 35_110
    rows = srt.Scatterers.load(tmp_path / "run" / "radars" / "awrl1432" / "frame_000000" / "scatterers.npz")
    assert rows.door == "lidar"
