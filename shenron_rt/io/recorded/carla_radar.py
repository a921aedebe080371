"""CARLA's native radar (``sensor.other.radar``): rows of velocity, azimuth, altitude, depth.

The order and the signs are those of the server (``RadarData.h`` struct RadarDetection and ``Radar.cpp``
CalculateRelativeVelocity): velocity positive = receding, azimuth positive = right, angles in radians. Tutorials that
name the columns velocity, altitude, azimuth, depth are wrong. The device gives neither a level nor an SNR.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from ..._typing import ArrayLike
from ...errors import InputError, NotFoundError
from .point_cloud import PointCloud

__all__ = ["read_carla_radar"]

_ROW_BYTES = 16


def read_carla_radar(source: str | os.PathLike[str] | ArrayLike) -> PointCloud:
    """Read the detections of one measurement.

    Parameters
    ----------
    source : path or (n, 4) array_like
        A ``.npy`` of shape (n, 4), the measurement's ``raw_data`` in a ``.bin`` file, or the rows themselves.

    Returns
    -------
    PointCloud
        In the radar's frame, y left: azimuth changes its sign.

    Raises
    ------
    NotFoundError
    InputError
        Another shape; values that are not finite; angles outside [-pi, pi] or negative depth, which are signs of
        another column order or of degrees.
    """
    label, rows = "radar rows", source
    if isinstance(source, str | os.PathLike):
        label, rows = str(source), _load(Path(source))
    table = np.asarray(rows, dtype=np.float64)
    if table.ndim != 2 or table.shape[1] != 4:
        raise InputError(f"{label}: (n, 4) velocity, azimuth, altitude, depth is needed, got shape {table.shape}")
    if not np.all(np.isfinite(table)):
        raise InputError(f"{label}: {int(np.sum(~np.isfinite(table)))} values are not finite")
    velocity, azimuth, altitude, depth = table.T
    if np.any(np.abs(azimuth) > np.pi) or np.any(np.abs(altitude) > np.pi / 2) or np.any(depth < 0):
        raise InputError(
            f"{label}: columns must be velocity, azimuth, altitude [rad], depth >= 0; got azimuth up to "
            f"{np.abs(azimuth).max():g}, altitude up to {np.abs(altitude).max():g}, depth from {depth.min():g}"
        )
    return PointCloud.from_spherical(depth, -azimuth, altitude, velocity, source="CARLA radar")


def _load(path: Path) -> ArrayLike:
    try:
        if path.suffix == ".npy":
            array = np.load(path, allow_pickle=False)
            if array.dtype.names:
                raise InputError(f"{path}: a structured array {array.dtype.names}; plain (n, 4) float32 is needed")
            return np.asarray(array)
        raw = path.read_bytes()
    except FileNotFoundError:
        raise NotFoundError(f"{path}: no such file") from None
    except (ValueError, EOFError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: not a .npy file that can be read ({error})") from None
    if len(raw) % _ROW_BYTES:
        raise InputError(f"{path}: {len(raw)} bytes are not whole rows of four float32 ({_ROW_BYTES} bytes)")
    return np.frombuffer(raw, dtype="<f4").reshape(-1, 4)
