"""ROS 2 messages, made of ours, through a ``rosbags`` type store."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..dsp import Detections
from .points import Points
from .poses import Transform

__all__ = ["RADAR_MSGS", "Messages"]

#: Interface of ros-perception's radar_msgs.
RADAR_MSGS = {
    "radar_msgs/msg/RadarReturn": (
        "float32 range\nfloat32 azimuth\nfloat32 elevation\nfloat32 doppler_velocity\nfloat32 amplitude\n"
    ),
    "radar_msgs/msg/RadarScan": "std_msgs/Header header\nradar_msgs/RadarReturn[] returns\n",
}
#: datatype of sensor_msgs/PointField by NumPy type
_DATATYPES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}


class Messages:
    """Builds messages of a type store that has ROS 2's common interfaces and :data:`RADAR_MSGS`."""

    def __init__(self) -> None:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.store = get_typestore(Stores.ROS2_HUMBLE)
        found: dict[str, Any] = {}
        for name, text in RADAR_MSGS.items():
            found |= get_types_from_msg(text, name)
        self.store.register(found)

    def cloud(self, points: Points, frame: str, stamp: int) -> Any:
        """Return a sensor_msgs/PointCloud2 of packed records."""
        layout: Mapping[str, Any] = points.dtype.fields or {}
        field = self._type("sensor_msgs/msg/PointField")
        fields = [
            field(name=name, offset=int(place[1]), datatype=_DATATYPES[place[0].str[1:]], count=1)
            for name, place in layout.items()
        ]
        step = points.dtype.itemsize
        return self._type("sensor_msgs/msg/PointCloud2")(
            header=self._header(frame, stamp), height=1, width=len(points), fields=fields, is_bigendian=False,
            point_step=step, row_step=step * len(points), data=np.frombuffer(points.tobytes(), dtype=np.uint8),
            is_dense=True,
        )  # fmt: skip

    def scan(self, detections: Detections, frame: str, stamp: int) -> Any:
        """Return a radar_msgs/RadarScan: azimuth counter-clockwise, positive Doppler = receding, amplitude = SNR in dB.

        Elevation is 0 where the radar measures none, as the interface asks for 2-D radars.
        """
        entry = self._type("radar_msgs/msg/RadarReturn")
        elevation = np.where(detections.elevation_valid, detections.elevation, 0.0)
        rows = np.column_stack(
            [detections.range, detections.azimuth, elevation, detections.velocity, detections.snr_db]
        ).tolist()
        returns = [
            entry(range=r, azimuth=az, elevation=el, doppler_velocity=v, amplitude=snr) for r, az, el, v, snr in rows
        ]
        return self._type("radar_msgs/msg/RadarScan")(header=self._header(frame, stamp), returns=returns)

    def transforms(self, items: Sequence[Transform], stamp: int) -> Any:
        """Return a tf2_msgs/TFMessage."""
        stamped, transform, vector, quaternion = (
            self._type(f"geometry_msgs/msg/{n}") for n in ("TransformStamped", "Transform", "Vector3", "Quaternion")
        )
        messages = []
        for t in items:
            x, y, z = (float(v) for v in t.origin)
            qx, qy, qz, qw = (float(v) for v in t.quaternion)
            pose = transform(translation=vector(x=x, y=y, z=z), rotation=quaternion(x=qx, y=qy, z=qz, w=qw))
            header = self._header(t.parent, stamp)
            messages.append(stamped(header=header, child_frame_id=t.child, transform=pose))
        return self._type("tf2_msgs/msg/TFMessage")(transforms=messages)

    def _header(self, frame: str, stamp: int) -> Any:
        time = self._type("builtin_interfaces/msg/Time")(sec=stamp // 1_000_000_000, nanosec=stamp % 1_000_000_000)
        return self._type("std_msgs/msg/Header")(stamp=time, frame_id=frame)

    def _type(self, name: str) -> Any:
        return self.store.types[name]
