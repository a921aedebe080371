"""ROS 2 bags, decoded by ``rosbags`` with the message definitions inside them."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from export_tools import EPOCH_NS, columns_of

import shenron_rt as srt
from shenron_rt.cli import main

pytest.importorskip("rosbags", reason="rosbags is not installed (extra ros)")

#: datatype of sensor_msgs/PointField
KINDS = {2: "u1", 5: "<i4", 7: "<f4"}


@pytest.fixture(scope="module")
def bag(street_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ros2") / "bag"
    assert main(["export", str(street_run), "--to", "ros2", "-o", str(folder), "--lidar"]) == 0
    return folder


@pytest.fixture(scope="module")
def read(bag: Path) -> dict[str, list[Any]]:
    from rosbags.highlevel import AnyReader

    found: dict[str, list[Any]] = defaultdict(list)
    # no type store of ours: types come from the definitions in the bag
    with AnyReader([bag]) as reader:
        for connection, time, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            found[connection.topic].append((time, connection.msgtype, message))
    return dict(found)


def _table(cloud: Any) -> np.ndarray:
    layout = np.dtype(
        {
            "names": [f.name for f in cloud.fields],
            "formats": [KINDS[f.datatype] for f in cloud.fields],
            "offsets": [f.offset for f in cloud.fields],
            "itemsize": cloud.point_step,
        }
    )
    return np.frombuffer(cloud.data.tobytes(), dtype=layout)


def test_topics_types_and_counts(read: dict[str, list[Any]], bag: Path) -> None:
    assert {topic: (len(m), m[0][1]) for topic, m in read.items()} == {
        "/tf_static": (1, "tf2_msgs/msg/TFMessage"),
        "/tf": (3, "tf2_msgs/msg/TFMessage"),
        "/radar/front/points": (3, "sensor_msgs/msg/PointCloud2"),
        "/radar/front/scan": (3, "radar_msgs/msg/RadarScan"),
        "/lidar/roof/points": (3, "sensor_msgs/msg/PointCloud2"),
    }
    assert sorted(p.name for p in bag.iterdir()) == ["bag.mcap", "metadata.yaml"]
    info = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert (info["storage_identifier"], info["message_count"]) == ("mcap", 13)
    (static,) = [t for t in info["topics_with_message_count"] if t["topic_metadata"]["name"] == "/tf_static"]
    # durability 1 is transient local: kept for those who subscribe later
    assert yaml.safe_load(static["topic_metadata"]["offered_qos_profiles"])[0]["durability"] == 1


def test_clouds_and_scans_hold_the_detections_of_the_run(street_run: Path, read: dict[str, list[Any]]) -> None:
    for k, (time, _, cloud) in enumerate(read["/radar/front/points"]):
        table = columns_of(street_run / f"radars/front/frame_{k:06d}/detections.csv")
        assert cloud.header.frame_id == "radar/front"
        assert (cloud.height, cloud.width, cloud.row_step) == (1, len(table["x"]), cloud.point_step * len(table["x"]))
        assert cloud.header.stamp.sec * 10**9 + cloud.header.stamp.nanosec == time
        points = _table(cloud)
        assert points.dtype.names == ("x", "y", "z", "velocity", "snr_db", "rcs_dbsm", "object_id", "tag", "ghost")
        for name in points.dtype.names:
            np.testing.assert_array_equal(points[name], table[name].astype(points[name].dtype), err_msg=name)
        scan = read["/radar/front/scan"][k][2]
        names = {"range": "range", "azimuth": "azimuth", "doppler_velocity": "velocity", "amplitude": "snr_db"}
        for field, column in names.items():
            values = np.array([getattr(r, field) for r in scan.returns], dtype=np.float32)
            np.testing.assert_array_equal(values, table[column].astype(np.float32), err_msg=field)
        assert {r.elevation for r in scan.returns} == {0.0}  # awrl1432's line array measures none


def test_transforms_and_stamps(read: dict[str, list[Any]]) -> None:
    mid = srt.load_profile("awrl1432").frame_mid_s
    for k, (time, _, message) in enumerate(read["/tf"]):
        assert time == EPOCH_NS + round((0.1 * k + mid) * 1e9)
        placed = {t.child_frame_id: t for t in message.transforms}
        assert {c: t.header.frame_id for c, t in placed.items()} == {"ego": "world", "body/lead": "world"}
        assert placed["ego"].transform.translation.x == pytest.approx(15 * (0.1 * k + mid), abs=1e-9)
    static = {t.child_frame_id: t for t in read["/tf_static"][0][2].transforms}
    for frame, xyz in {"radar/front": (2, 0, 1), "lidar/roof": (0, 0, 2.5)}.items():
        v, q = static[frame].transform.translation, static[frame].transform.rotation
        assert static[frame].header.frame_id == "ego"
        assert ((v.x, v.y, v.z), (q.x, q.y, q.z, q.w)) == (xyz, (0, 0, 0, 1))


def test_radar_names_that_ros_does_not_allow_are_replaced_and_may_not_collide(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    from shenron_rt.errors import InputError
    from shenron_rt.export.ros2 import radar_topics

    assert radar_topics(["front-left", "rear"]) == {"front-left": "/radar/front_left", "rear": "/radar/rear"}
    assert "front_left" in caplog.text
    with pytest.raises(InputError, match=r"a-b and a\.b would share /radar/a_b"):
        radar_topics(["a-b", "a.b"])
