"""A ROS 2 bag with MCAP storage, written without a ROS installation."""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..frames import Pose
from ..run_source import RunSource, open_run
from ..runs import Run
from .others import LidarClouds, lidar_clouds
from .points import detection_points
from .poses import mount_transforms, radar_frame
from .ros2_messages import Messages
from .target import require, whole_folder
from .timeline import EPOCH_S, stamp_ns, timeline

__all__ = ["export_ros2", "radar_topics"]

_log = logging.getLogger(__name__)

#: Every bag has it.
_MARKER = "metadata.yaml"
#: Metadata of ROS 2 Iron, which Humble's tools read as well.
_VERSION = 8


def export_ros2(
    run: RunSource | Run | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    radars: Sequence[str] | None = None,
    frames: Collection[int] | None = None,
    overwrite: bool = False,
    epoch_s: int = EPOCH_S,
    lidar: bool | None = None,
    backend: str = "auto",
    step: Callable[[str], None] | None = None,
) -> Path:
    """Write a bag: PointCloud2 and RadarScan of every radar, PointCloud2 of the LiDARs, /tf and /tf_static.

    Parameters
    ----------
    run : RunSource, Run or path
        A run folder, or one that :func:`~shenron_rt.export.open_run` has opened.
    path : path
        The folder to make: ``metadata.yaml`` and one ``.mcap``.
    radars, frames, overwrite, epoch_s, lidar, backend, step
        As for :func:`~shenron_rt.export.export_mcap`.

    Returns
    -------
    Path

    Raises
    ------
    NotFoundError, InputError
        No such run, radar or frame; rosbags is not installed; the place is taken; the disk refuses.
    """
    require("export to ros2", "rosbags", "ros", "rosbags")
    from rosbags.rosbag2 import StoragePlugin, Writer

    source, target = open_run(run, radars=radars, frames=frames), Path(path)
    lidars = lidar_clouds(source, lidar, backend)
    with (
        whole_folder(target, overwrite=overwrite, marker=_MARKER) as folder,
        Writer(folder, version=_VERSION, storage_plugin=StoragePlugin.MCAP) as writer,
    ):
        _write(_Bag(writer, epoch_s), source, lidars, step)
    return target


class _Bag:
    """A bag being written, with a connection for every topic that came up."""

    def __init__(self, writer: Any, epoch_s: int) -> None:
        self.messages = Messages()
        self.epoch_s = epoch_s
        self._writer = writer
        self._connections: dict[str, Any] = {}

    def log(self, topic: str, message: Any, stamp: int, *, latched: bool = False) -> None:
        """Write a message; a latched one is for those who come later too."""
        name, store = message.__msgtype__, self.messages.store
        if topic not in self._connections:
            profiles = [_latched()] if latched else ()
            self._connections[topic] = self._writer.add_connection(
                topic, name, typestore=store, offered_qos_profiles=profiles
            )
        self._writer.write(self._connections[topic], stamp, store.serialize_cdr(message, name))


def _latched() -> Any:
    """Return the quality of service of /tf_static: reliable, kept for late subscribers."""
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    forever = QosTime(2147483647, 4294967295)
    return Qos(
        history=QosHistory.KEEP_LAST, depth=1, reliability=QosReliability.RELIABLE,
        durability=QosDurability.TRANSIENT_LOCAL, deadline=forever, lifespan=forever,
        liveliness=QosLiveliness.AUTOMATIC, liveliness_lease_duration=forever,
        avoid_ros_namespace_conventions=False,
    )  # fmt: skip


def _ros_name(name: str) -> str:
    """Return a name with what ROS allows in one: letters, digits and underscores."""
    return re.sub(r"[^A-Za-z0-9_]", "_", name)


def radar_topics(names: Sequence[str]) -> dict[str, str]:
    """Return the beginning of every radar's topics.

    Raises
    ------
    InputError
        Two radars whose names differ only in what ROS allows in none.
    """
    topics = {name: f"/radar/{_ros_name(name)}" for name in names}
    for name, topic in topics.items():
        same = [n for n in names if topics[n] == topic]
        if len(same) > 1:
            raise InputError(f"export to ros2: radars {' and '.join(same)} would share {topic}; rename one of them")
        if _ros_name(name) != name:
            _log.warning("radar %s: its topics start with %s, ROS allows no other characters", name, topic)
    return topics


def _write(bag: _Bag, source: RunSource, lidars: Sequence[LidarClouds], step: Callable[[str], None] | None) -> None:
    extra: list[tuple[str, Pose]] = [(other.frame, other.mount) for other in lidars if other.mount is not None]
    topics = radar_topics([r.name for r in source.radars])
    for moment in timeline(source, step):
        radar, frame = moment.radar, moment.frame
        stamp = stamp_ns(frame.mid_s, bag.epoch_s)
        if moment.first:
            bag.log("/tf_static", bag.messages.transforms(mount_transforms(source, extra), stamp), stamp, latched=True)
        moving = [b.pose for b in moment.bodies(moving=True)]
        bag.log("/tf", bag.messages.transforms([moment.ego(), *moving], stamp), stamp)
        found, sensor = frame.detections(), radar_frame(radar.name)
        topic = topics[radar.name]
        bag.log(f"{topic}/points", bag.messages.cloud(detection_points(found), sensor, stamp), stamp)
        bag.log(f"{topic}/scan", bag.messages.scan(found, sensor, stamp), stamp)
        if moment.leading:
            for other in lidars:
                if (points := other.points(frame)) is not None:
                    bag.log(
                        f"/lidar/{_ros_name(other.name)}/points", bag.messages.cloud(points, other.frame, stamp), stamp
                    )
