"""Record a semantic LiDAR from a running CARLA 0.9.14 to 0.9.16, so that this package can read it back.

Beside a client that ticks the world in synchronous mode::

    python examples/carla_recorder.py --role hero --out recording --frames 200

With ``--tick`` this script ticks the world itself (and sets synchronous mode while it runs). Every frame becomes
``roof_00001234.bin`` (CARLA's bytes) and ``roof_00001234.meta.yaml`` (sensor, ego and actors at the tick of those
bytes); with ``--radar`` CARLA's own radar detections too. Read a frame back with::

    srt.read_semantic_lidar("roof_00001234.bin", tag_table="0.9.14", frame="carla", side_file="roof_00001234.meta.yaml")

Needs ``pip install carla==<version of the server>``.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

from shenron_rt.io.carla_record import TickPairing, side_record, write_radar, write_tick

LIDAR, RADAR = "roof", "native_radar"
#: Actors that move, or may be moved.
MOVING = ("vehicle.", "walker.", "static.prop.")


class Recorder:
    """Writes every frame whose data and state have the same number.

    Parameters
    ----------
    world : carla.World
    ego : carla.Actor
    sensors : dict of str to carla.Sensor
        ``roof`` is the semantic LiDAR.
    folder : path
    attributes : dict
        Written into every side file.
    """

    def __init__(self, world: Any, ego: Any, sensors: dict[str, Any], folder: Path, attributes: dict[str, Any]) -> None:
        self.world, self.ego, self.folder, self.attributes = world, ego, folder, attributes
        self.pairing = TickPairing(list(sensors))
        self.actors: dict[int, Any] = {}
        self.written = 0
        for name, sensor in sensors.items():
            # the frame is the measurement's own; by the time it arrives the world may be further on
            sensor.listen(lambda data, name=name: self.pairing.measurement(name, data.frame, data))

    def on_tick(self, snapshot: Any) -> None:
        """Take the state of a frame; for ``world.on_tick``."""
        self.pairing.state(snapshot.frame, snapshot)

    def write(self) -> int:
        """Write the frames that are complete; return how many."""
        ticks = self.pairing.complete()
        if ticks:
            self._refresh_actors()
        for tick in ticks:
            cloud = tick.data[LIDAR]
            side = side_record(cloud, tick.state, self.ego.id, self.actors.values(), self.attributes)
            write_tick(self.folder, LIDAR, cloud, side)
            if RADAR in tick.data:
                write_radar(self.folder, RADAR, tick.data[RADAR])
        self.written += len(ticks)
        return len(ticks)

    def _refresh_actors(self) -> None:
        """Remember every actor there ever was: one that is gone by now may be in the frame that is written."""
        for actor in self.world.get_actors():
            if actor.type_id.startswith(MOVING):
                self.actors.setdefault(actor.id, actor)


def spawn(carla: Any, world: Any, ego: Any, options: argparse.Namespace) -> dict[str, Any]:
    """Return the sensors, spawned and attached to the ego vehicle."""
    library = world.get_blueprint_library()
    lidar = library.find("sensor.lidar.ray_cast_semantic")
    settings = {
        "channels": options.channels, "range": options.range, "upper_fov": options.upper, "lower_fov": options.lower,
        "points_per_second": options.points_per_second, "rotation_frequency": options.rotation_hz,
    }  # fmt: skip
    for key, value in settings.items():
        lidar.set_attribute(key, str(value))
    place = carla.Transform(carla.Location(*options.lidar_at))
    sensors = {LIDAR: world.spawn_actor(lidar, place, attach_to=ego)}
    if options.radar:
        place = carla.Transform(carla.Location(*options.radar_at))
        sensors[RADAR] = world.spawn_actor(library.find("sensor.other.radar"), place, attach_to=ego)
    return sensors


def find_ego(world: Any, role: str) -> Any:
    """Return the vehicle of that role name, the first if the role is empty."""
    vehicles = list(world.get_actors().filter("vehicle.*"))
    named = [v for v in vehicles if not role or v.attributes.get("role_name") == role]
    if not named:
        roles = sorted({v.attributes.get("role_name", "") for v in vehicles})
        raise SystemExit(f"no vehicle with role_name {role!r} in the world; there are {len(vehicles)}, roles {roles}")
    return named[0]


def parse(arguments: list[str]) -> argparse.Namespace:
    """Return the options."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--host", default="localhost")
    parser.add_argument("--port", type=int, default=2000)
    parser.add_argument("--role", default="hero", help="role_name of the ego vehicle; empty: the first vehicle")
    parser.add_argument("--out", type=Path, default=Path("recording"))
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--tick", action="store_true", help="tick the world from here")
    parser.add_argument("--step-s", type=float, default=0.1, help="seconds a tick, with --tick")
    parser.add_argument("--channels", type=int, default=64)
    parser.add_argument("--upper", type=float, default=10.0)
    parser.add_argument("--lower", type=float, default=-30.0)
    parser.add_argument("--range", type=float, default=80.0)
    parser.add_argument("--points-per-second", type=int, default=600_000)
    parser.add_argument("--rotation-hz", type=float, default=10.0, help="1 / tick for whole turns")
    parser.add_argument("--lidar-at", type=float, nargs=3, default=(0.0, 0.0, 2.5), metavar=("X", "Y", "Z"))
    parser.add_argument("--radar", action="store_true", help="record CARLA's own radar too")
    parser.add_argument("--radar-at", type=float, nargs=3, default=(2.0, 0.0, 1.0), metavar=("X", "Y", "Z"))
    return parser.parse_args(arguments)


def main(arguments: list[str]) -> int:
    """Record; return the exit code."""
    import carla

    options = parse(arguments)
    client = carla.Client(options.host, options.port)
    client.set_timeout(20.0)
    world = client.get_world()
    before = world.get_settings()
    ego = find_ego(world, options.role)
    sensors = spawn(carla, world, ego, options)
    attributes = {
        "carla_version": client.get_server_version(), "town": world.get_map().name, "tag_table": "0.9.14",
        "channels": options.channels, "upper_fov": options.upper, "lower_fov": options.lower, "range": options.range,
        "points_per_second": options.points_per_second, "rotation_frequency": options.rotation_hz,
    }  # fmt: skip
    recorder = Recorder(world, ego, sensors, options.out, attributes)
    listener = world.on_tick(recorder.on_tick)
    try:
        if options.tick:
            settings = world.get_settings()
            settings.synchronous_mode, settings.fixed_delta_seconds = True, options.step_s
            world.apply_settings(settings)
        elif not before.synchronous_mode:
            print("warning: the world is not in synchronous mode; frames will be lost", file=sys.stderr)
        while recorder.written < options.frames:
            if options.tick:
                world.tick()
            else:
                time.sleep(0.02)
            recorder.write()
    except KeyboardInterrupt:
        pass
    finally:
        world.remove_on_tick(listener)
        for sensor in sensors.values():
            sensor.stop()
            sensor.destroy()
        if options.tick:
            world.apply_settings(before)
    lost = recorder.pairing
    print(f"{recorder.written} frames in {options.out}; {lost.incomplete} incomplete, {lost.late} late")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
