"""A LiDAR of our own arithmetic: rays over level ground, a wall and a box, in CARLA's records."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shenron_rt._typing import FloatArray, NDArray
from shenron_rt.lidar.readers import RECORD

#: The sensor of the synthetic frames: 64 channels, 0.5 degrees, 2.4 m above the road.
CHANNELS, UPPER_DEG, LOWER_DEG, STEP_DEG, HEIGHT_M = 64, 10.0, -30.0, 0.5, 2.4
GRID = (CHANNELS, UPPER_DEG, LOWER_DEG, STEP_DEG)
ROADS, BUILDINGS, CAR = 1, 3, 14
#: The car: a box whose rear is at x = 12, 3 m to the right of the middle (CARLA y), with an id.
CAR_ID, CAR_LOW, CAR_HIGH = 101, (12.0, 2.0, -2.4), (16.0, 4.0, -0.9)
WALL_X = 30.0


def directions(channels: int = CHANNELS, step_deg: float = STEP_DEG) -> FloatArray:
    """Return (n, 3) unit vectors in CARLA axes and order: channel 0 on top, clockwise from behind."""
    elevation = np.radians(np.linspace(UPPER_DEG, LOWER_DEG, channels))
    azimuth = np.radians(np.arange(-180.0, 180.0, step_deg))
    el, az = np.meshgrid(elevation, azimuth, indexing="ij")
    d: FloatArray = np.stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)], axis=-1).reshape(-1, 3)
    return d


def street(channels: int = CHANNELS, step_deg: float = STEP_DEG, reach_m: float = 80.0) -> NDArray[np.void]:
    """Return the records of one revolution over road, wall and car; CARLA axes, tags of 0.9.14."""
    d = directions(channels, step_deg)
    with np.errstate(divide="ignore", invalid="ignore"):
        ground = np.where(d[:, 2] < 0, -HEIGHT_M / d[:, 2], np.inf)
        wall = np.where(d[:, 0] > 0, WALL_X / d[:, 0], np.inf)
        wall = np.where(np.abs(wall * d[:, 1]) < 15.0, wall, np.inf)
        near, far = np.asarray(CAR_LOW) / d, np.asarray(CAR_HIGH) / d
    enter, leave = np.minimum(near, far), np.maximum(near, far)
    face = np.argmax(enter, axis=1)
    car = enter.max(axis=1)
    car = np.where((car < leave.min(axis=1)) & (car > 0), car, np.inf)
    distance = np.stack([ground, wall, car])
    which = np.argmin(distance, axis=0)
    r = distance.min(axis=0)
    keep = r < reach_m
    cos = np.choose(which, [-d[:, 2], d[:, 0], np.abs(d[np.arange(len(d)), face])])
    out = np.zeros(int(keep.sum()), RECORD)
    for k, axis in enumerate("xyz"):
        out[axis] = (d[:, k] * r)[keep]
    out["CosAngle"] = cos[keep]
    out["ObjTag"] = np.choose(which, [ROADS, BUILDINGS, CAR])[keep]
    out["ObjIdx"] = np.where(which == 2, CAR_ID, 0)[keep]
    return out


def ply_text(
    records: NDArray[np.void], *, newline: str = "\n", kinds: tuple[str, str] = ("float32", "uint32")
) -> bytes:
    """Return what save_to_disk writes: ASCII, four decimals."""
    f, u = kinds
    head = ["ply", "format ascii 1.0", f"element vertex {len(records)}"]
    head += [f"property {f} {n}" for n in ("x", "y", "z", "CosAngle")] + [
        f"property {u} {n}" for n in ("ObjIdx", "ObjTag")
    ]
    rows = [f"{x:.4f} {y:.4f} {z:.4f} {c:.4f} {i} {t}" for x, y, z, c, i, t in records.tolist()]
    return (newline.join([*head, "end_header", *rows]) + newline).encode()


def write_bin(path: Path, records: NDArray[np.void]) -> Path:
    """Write raw records."""
    path.write_bytes(records.tobytes())
    return path
