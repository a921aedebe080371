"""A recorded radar point cloud, in our axes and signs whatever the device's were."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from ..._typing import FloatArray
from ...errors import InputError
from ...frames import direction, spherical

__all__ = ["PointCloud"]


@dataclass(frozen=True)
class PointCloud:
    """Points of one frame of a recorded radar, x forward, y left, z up.

    Parameters
    ----------
    position : (n, 3) float
        Sensor frame [m].
    velocity : (n,) float
        Range rate, positive = receding [m/s].
    snr_db, noise_db : (n,) float
        NaN where the device gives none [dB].
    frame : int
        The device's frame number.
    time_s : float
        Device time; NaN where unknown [s].
    source : str
        What wrote it.
    elevation_valid : bool
        The device measured elevation.
    """

    position: FloatArray
    velocity: FloatArray
    snr_db: FloatArray
    noise_db: FloatArray
    frame: int = 0
    time_s: float = float("nan")
    source: str = ""
    elevation_valid: bool = True

    def __post_init__(self) -> None:
        n = len(self.velocity)
        shapes = {"position": (n, 3), "velocity": (n,), "snr_db": (n,), "noise_db": (n,)}
        for name, shape in shapes.items():
            if np.shape(getattr(self, name)) != shape:
                raise InputError(f"PointCloud.{name}: shape {shape} is needed, got {np.shape(getattr(self, name))}")
        if not (np.all(np.isfinite(self.position)) and np.all(np.isfinite(self.velocity))):
            raise InputError("PointCloud: positions and velocities must be finite")

    @classmethod
    def from_spherical(
        cls, range_m: FloatArray, azimuth: FloatArray, elevation: FloatArray, velocity: FloatArray, *, source: str = ""
    ) -> Self:
        """Build a cloud without levels from range [m], azimuth (+ left), elevation (+ up) [rad] and range rate."""
        nothing = np.full(len(range_m), np.nan)
        position = direction(azimuth, elevation) * np.asarray(range_m)[:, None]
        return cls(position, np.asarray(velocity, dtype=np.float64), nothing, nothing, source=source)

    def __len__(self) -> int:
        return len(self.velocity)

    def __repr__(self) -> str:
        return f"PointCloud({len(self)} points, frame {self.frame}, {self.source or 'unknown source'})"

    @property
    def range(self) -> FloatArray:
        """(n,) [m]."""
        return spherical(self.position)[0]

    @property
    def azimuth(self) -> FloatArray:
        """(n,) positive = left [rad]."""
        return spherical(self.position)[1]

    @property
    def elevation(self) -> FloatArray:
        """(n,) positive = up [rad]."""
        return spherical(self.position)[2]
