"""Recording from CARLA, without CARLA: pairing by tick, layouts, axes.

A sensor's data arrive on another thread, one or more ticks after the world state they belong to. Whoever writes the
newest state beside the newest cloud gets actors that trail their points in turns. Here nothing is paired but what has
the same frame number, and poses are those of the data's own tick: ``measurement.transform`` for the sensor, the
snapshot of that frame for ego and actors.

The functions read attributes of CARLA's objects (``carla.Transform``, ``carla.ActorSnapshot`` ...) and need none of its
modules, so that stand-ins can test them.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from .._typing import FloatArray
from ..errors import InputError
from ..frames import Pose, from_carla_points, from_carla_pose, to_carla
from .npz import atomic_write

__all__ = ["Tick", "TickPairing", "actor_record", "side_record", "transform_record", "write_radar", "write_tick"]

#: Bytes of a point of ``sensor.lidar.ray_cast_semantic``: float32 x y z cos, uint32 index, tag.
_POINT_BYTES = 24
#: Bytes of a detection of ``sensor.other.radar``: float32 velocity azimuth altitude depth.
_RADAR_BYTES = 16

# What arrives is CARLA's own object or a stand-in: only attributes are known.
Carla = Any


@dataclass(frozen=True)
class Tick:
    """One frame that is complete.

    Parameters
    ----------
    frame : int
        CARLA's frame number, that of the state and of every measurement.
    state : Any
        What :meth:`TickPairing.state` was given for it.
    data : dict of str to Any
        What each sensor measured in it.
    """

    frame: int
    state: Any
    data: dict[str, Any]


class TickPairing:
    """Pairs world states with measurements of the same frame, in whatever order and on whatever thread they come.

    Parameters
    ----------
    sensors : sequence of str
        Those without which a frame is not complete.
    patience : int
        A frame that is not complete is given up when the newest is more than this many frames ahead.
    """

    def __init__(self, sensors: Sequence[str], patience: int = 32) -> None:
        if not sensors or len(set(sensors)) != len(sensors):
            raise InputError(f"sensors: different names, at least one, got {list(sensors)}")
        self._sensors = tuple(sensors)
        self._needed = len(sensors)
        self._patience = patience
        self._lock = threading.Lock()
        self._states: dict[int, Any] = {}
        self._data: dict[int, dict[str, Any]] = {}
        self._oldest = 0
        #: Frames given up with data of some sensor, but not of all, or without their state.
        self.incomplete = 0
        #: Measurements whose frame had been given up when they came.
        self.late = 0

    def state(self, frame: int, state: Any) -> None:
        """Take the world state of a frame."""
        with self._lock:
            if frame >= self._oldest:
                self._states[frame] = state

    def measurement(self, sensor: str, frame: int, data: Any) -> None:
        """Take a measurement; to be called with ``measurement.frame``, never with the current frame."""
        if sensor not in self._sensors:
            raise InputError(f"unknown sensor {sensor!r}; known: {', '.join(self._sensors)}")
        with self._lock:
            if frame < self._oldest:
                self.late += 1
                return
            self._data.setdefault(frame, {})[sensor] = data

    def complete(self) -> list[Tick]:
        """Return and forget the frames that are complete, in order.

        A frame without any data is no loss: a sensor with a ``sensor_tick`` is silent between its own ticks.
        """
        with self._lock:
            full = [f for f in sorted(self._states.keys() & self._data.keys()) if len(self._data[f]) == self._needed]
            ticks = [Tick(f, self._states.pop(f), self._data.pop(f)) for f in full]
            newest = max([*self._states, *self._data, *full], default=0)
            self._oldest = max(self._oldest, newest - self._patience)
            self.incomplete += sum(f < self._oldest for f in self._data)
            self._data = {f: v for f, v in self._data.items() if f >= self._oldest}
            self._states = {f: v for f, v in self._states.items() if f >= self._oldest}
        return ticks


# ---- layouts
def _triple(vector: Carla) -> list[float]:
    return [float(vector.x), float(vector.y), float(vector.z)]


def transform_record(transform: Carla) -> dict[str, Any]:
    """Return a ``carla.Transform`` as it stands in a side file: CARLA's axes, metres and degrees."""
    turn = transform.rotation
    return {
        "location": _triple(transform.location),
        "rotation_deg": {"pitch": float(turn.pitch), "yaw": float(turn.yaw), "roll": float(turn.roll)},
    }


def _pose(transform: Carla) -> Pose:
    turn = transform.rotation
    return from_carla_pose(_triple(transform.location), (float(turn.pitch), float(turn.yaw), float(turn.roll)))


def _in_axes_of(pose: Pose, vector: Carla) -> list[float]:
    """Return a world vector of CARLA in the axes of a pose, still y right."""
    turned: FloatArray = to_carla(from_carla_points(_triple(vector)) @ pose.rotation)
    return [float(v) for v in turned]


def actor_record(actor: Carla, state: Carla, ego: Carla) -> dict[str, Any]:
    """Return what a side file says of an actor.

    Parameters
    ----------
    actor : carla.Actor
        Its ``id``, ``type_id`` and ``bounding_box``, which do not change.
    state : carla.ActorSnapshot
        Transform, velocity [m/s] and angular velocity [deg/s] in world axes, of the frame.
    ego : carla.ActorSnapshot
        Of the same frame.
    """
    ego_pose = _pose(ego.get_transform())
    spin = state.get_angular_velocity()
    record = {"id": int(actor.id), "type_id": str(actor.type_id), **transform_record(state.get_transform())}
    box = getattr(actor, "bounding_box", None)
    if box is not None:
        record["bbox"] = {"center_local": _triple(box.location), "extent": _triple(box.extent)}
    record["velocity_m_s"] = _triple(state.get_velocity())
    record["velocity_in_ego_axes_m_s"] = _in_axes_of(ego_pose, state.get_velocity())
    record["angular_velocity_deg_s"] = _triple(spin)
    record["yaw_rate_deg_s"] = float(spin.z)
    return record


def side_record(
    measurement: Carla, snapshot: Carla, ego_id: int, actors: Iterable[Carla], attributes: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the side file of one measurement, in the layout that ``read_side_file`` reads.

    Parameters
    ----------
    measurement : carla.SemanticLidarMeasurement
        Its ``frame``, ``timestamp`` and ``transform``: where the sensor was at the tick of the data.
    snapshot : carla.WorldSnapshot
        Of the same frame.
    ego_id : int
    actors : iterable of carla.Actor
        Those not in the snapshot are left out: born or gone in another frame.
    attributes : mapping
        Written as they are: the sensor's attributes, CARLA's version, the town.

    Raises
    ------
    InputError
        Another frame, or an ego that is not in the snapshot.
    """
    if measurement.frame != snapshot.frame:
        raise InputError(
            f"measurement of frame {measurement.frame} with the state of frame {snapshot.frame}: actors would trail "
            "their points; pair by frame"
        )
    ego = snapshot.find(ego_id)
    if ego is None:
        raise InputError(f"ego actor {ego_id} is not in the snapshot of frame {snapshot.frame}")
    states = [(actor, snapshot.find(actor.id)) for actor in actors]
    return {
        "frame": "CARLA left-handed: x forward, y right, z up, metres, degrees; yaw clockwise seen from above",
        "carla_frame": int(measurement.frame),
        "timestamp_s": float(measurement.timestamp),
        **{k: v for k, v in attributes.items() if v is not None},
        "n_points": len(measurement.raw_data) // _POINT_BYTES,
        "sensor_transform": transform_record(measurement.transform),
        "ego_id": int(ego_id),
        "ego_transform": transform_record(ego.get_transform()),
        "ego_velocity_in_ego_axes_m_s": _in_axes_of(_pose(ego.get_transform()), ego.get_velocity()),
        "ego_yaw_rate_deg_s": float(ego.get_angular_velocity().z),
        "actors": [actor_record(actor, state, ego) for actor, state in states if state is not None],
    }


def write_tick(folder: Path, sensor: str, measurement: Carla, side: Mapping[str, Any]) -> Path:
    """Write ``<sensor>_<frame>.bin``, the points as they came, and ``<sensor>_<frame>.meta.yaml``.

    Raises
    ------
    InputError
        Bytes that are not whole points.
    """
    import yaml

    raw = bytes(measurement.raw_data)
    if len(raw) % _POINT_BYTES:
        raise InputError(f"{sensor}, frame {measurement.frame}: {len(raw)} bytes are not whole points of 24 bytes")
    stem = f"{sensor}_{measurement.frame:08d}"
    text = yaml.safe_dump(dict(side), sort_keys=False, allow_unicode=True, width=120).encode()
    _write(folder / f"{stem}.meta.yaml", text)
    return _write(folder / f"{stem}.bin", raw)


def _write(path: Path, content: bytes) -> Path:
    def write(file: IO[bytes]) -> None:
        file.write(content)

    return atomic_write(path, write)


def write_radar(folder: Path, sensor: str, measurement: Carla) -> Path:
    """Write CARLA's own radar detections as ``<sensor>_<frame>.npy``, (n, 4) float32 as ``read_carla_radar`` reads."""
    raw = bytes(measurement.raw_data)
    if len(raw) % _RADAR_BYTES:
        raise InputError(f"{sensor}, frame {measurement.frame}: {len(raw)} bytes are not whole detections of 16 bytes")
    rows = np.frombuffer(raw, dtype="<f4").reshape(-1, 4)
    path = folder / f"{sensor}_{measurement.frame:08d}.npy"
    return atomic_write(path, lambda file: np.save(file, rows))
