"""What the tests of the scenes' contracts share: perturbed scenes, twins of a radar, the strongest cell."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from real_input_tools import chrono_sedan

import shenron_rt as srt

#: Cells nearer than this are blanked, as the users of the scenes do.
BLANKING_M = 2.0
#: Enough for levels: the scenes' cars have rays of their own.
FAST = {"rays": 60_000, "accuracy": 1e-3}


def perturbed(scene: srt.Scene, seed: int) -> srt.Scene:
    """Return the scene with its first actor moved by up to 2 m along and across the road and turned by up to 5 deg."""
    along, across, turn = np.random.default_rng(seed).uniform(-1, 1, 3)
    car = scene.actors[0]
    x, y, z = car.xyz_m
    yaw, pitch, roll = car.ypr_deg
    moved = car.model_copy(
        update={"xyz_m": (x + 2 * along, y + 2 * across, z), "ypr_deg": (yaw + 5 * turn, pitch, roll)}
    )
    return scene.model_copy(update={"actors": (moved, *scene.actors[1:])})


def with_chrono(scene: srt.Scene, data: Path) -> srt.Scene:
    """Return the scene with the Chrono sedan as its first actor, its tail where the bundled car has its own."""
    car = scene.actors[0]
    back = np.asarray(car.ypr_deg[0]) * np.pi / 180
    longer = 2.445 - 2.25  # half lengths of the two cars
    x, y, z = car.xyz_m
    place = (x + longer * np.cos(back), y + longer * np.sin(back), z)
    swapped = type(car)(**{**car.model_dump(), "shape": None, "mesh": chrono_sedan(data), "xyz_m": place})
    return scene.model_copy(update={"actors": (swapped, *scene.actors[1:])})


def twin(name: str = "awrl1432", **antenna: object) -> srt.RadarProfile:
    """Return a profile with other antenna keys."""
    return srt.load_profile(name, {f"antenna.{key}": value for key, value in antenna.items()})


@dataclass(frozen=True)
class Cell:
    """A cell of the range-azimuth map."""

    range_m: float
    azimuth_deg: float
    power_w: float


def strongest_cell(frame: srt.Frame, *, near_deg: float = 0.0, far_deg: float = 90.0) -> Cell:
    """Return the strongest cell of the range-azimuth map beyond blanking, with near <= abs(azimuth) <= far."""
    cube = frame.cube
    power = cube.range_azimuth.copy()
    azimuth = np.degrees(cube.azimuth_rad)
    power[cube.range_m < BLANKING_M] = 0.0
    power[:, (np.abs(azimuth) < near_deg) | (np.abs(azimuth) > far_deg)] = 0.0
    row, column = np.unravel_index(power.argmax(), power.shape)
    return Cell(float(cube.range_m[row]), float(azimuth[column]), float(power[row, column]))


def is_the_car(cell: Cell, frame: srt.Frame, object_id: int = 101) -> bool:
    """Say whether a cell is the car's: within a bin (and half a bin of grid) of its nearest surface, and 10 degrees."""
    mine = frame.scatterers.position[frame.scatterers.object_id == object_id]
    distance = np.linalg.norm(mine, axis=1)
    azimuth = np.degrees(np.arctan2(mine[:, 1], mine[:, 0]))
    near = abs(cell.range_m - distance.min()) < 1.5 * frame.cube.range_step_m
    return bool(near and abs(cell.azimuth_deg - azimuth.mean()) < 10.0)


def db(ratio: float | np.ndarray) -> float | np.ndarray:
    """Return 10 log10."""
    return 10 * np.log10(ratio)


def apparent_rcs_dbsm(frame: srt.Frame, object_id: int) -> float:
    """Return the radar equation inverted for the power of an object, at the middle of its visible surface."""
    p = frame.profile
    x, y, z = frame.scatterers.position[frame.scatterers.object_id == object_id].mean(axis=0)
    distance = float(np.sqrt(x * x + y * y + z * z))
    gain = 10 ** ((p.antenna.gain_tx_dbi + p.antenna.gain_rx_dbi - p.antenna.radome_loss_db) / 10)
    gain *= float(p.pattern(np.arctan2(y, x), np.arcsin(z / distance))) ** 2
    power = frame.returns.power_by_object()[object_id]
    return float(db(power * (4 * np.pi) ** 3 * distance**4 / (p.tx_power_w * gain * p.wavelength_m**2)))
