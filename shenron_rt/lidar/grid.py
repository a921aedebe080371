"""The angular grid of a LiDAR, given or estimated, and the solid angle that each point stands for."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .._typing import FloatArray, IntArray
from ..errors import InputError
from ..frames import spherical

__all__ = ["MIN_AREA_COS", "LidarGrid", "estimate_grid", "surface_area"]

#: Area R^2 dOmega / cos is taken at this cosine where the recorded one is less: no footprint of a ray is 200 times as
#: long as wide, and a cosine of four decimals has no more than two digits left there.
MIN_AREA_COS = 0.005
#: Elevations nearer than this are one channel [rad]; LAZ coordinates err by 0.5 mm, 0.25 mrad at 2 m.
_SAME_CHANNEL = math.radians(0.02)
#: Points nearer than this say too little of the angles [m].
_NEAR_M = 2.0


@dataclass(frozen=True)
class LidarGrid:
    """Directions of a scanning LiDAR, equally spaced in elevation and in azimuth.

    Parameters
    ----------
    channels : int
        Rows; CARLA's channel k looks at upper - k (upper - lower) / (channels - 1).
    upper_deg, lower_deg : float
        Elevations of the first and the last [deg].
    azimuth_step_deg : float
        Between two points of a channel [deg].
    estimated : bool
        Whether the grid was found in the points.
    """

    channels: int
    upper_deg: float
    lower_deg: float
    azimuth_step_deg: float
    estimated: bool = False

    def __post_init__(self) -> None:
        if self.channels < 1 or not -90 <= self.lower_deg <= self.upper_deg <= 90:
            raise InputError(
                f"grid: channels >= 1 and -90 <= lower <= upper <= 90 degrees are needed, got {self.channels}, "
                f"upper {self.upper_deg:g}, lower {self.lower_deg:g}"
            )
        if self.channels > 1 and self.lower_deg == self.upper_deg:
            raise InputError(
                f"grid: {self.channels} channels between {self.lower_deg:g} and {self.upper_deg:g} degrees"
            )
        if not 0 < self.azimuth_step_deg <= 30:
            raise InputError(f"grid: an azimuth step of 0 to 30 degrees is needed, got {self.azimuth_step_deg:g}")

    @property
    def elevation_step_deg(self) -> float:
        """Between two channels [deg]; a single channel is taken to be as high as its points are wide."""
        if self.channels == 1:
            return self.azimuth_step_deg
        return (self.upper_deg - self.lower_deg) / (self.channels - 1)

    def solid_angle(self, elevation: FloatArray) -> FloatArray:
        """Return the solid angle of a point at each elevation [rad]: d_az d_el cos(el) [sr]."""
        cell = math.radians(self.azimuth_step_deg) * math.radians(self.elevation_step_deg)
        solid: FloatArray = cell * np.cos(elevation)
        return solid

    def __str__(self) -> str:
        return (
            f"{self.channels} channels from {self.upper_deg:+.2f} to {self.lower_deg:+.2f} deg, azimuth step "
            f"{self.azimuth_step_deg:.3f} deg, {'estimated from the points' if self.estimated else 'given'}"
        )


def surface_area(grid: LidarGrid, position: FloatArray, cos_incidence: FloatArray) -> FloatArray:
    """Return the surface each point stands for, R^2 dOmega / cos [m^2].

    Parameters
    ----------
    grid : LidarGrid
    position : (n, 3) float
        At the sensor [m].
    cos_incidence : (n,) float
        As the sensor recorded it.
    """
    distance, _, elevation = spherical(position)
    area: FloatArray = distance**2 * grid.solid_angle(elevation) / np.maximum(cos_incidence, MIN_AREA_COS)
    return area


def estimate_grid(position: FloatArray, path: str = "points") -> LidarGrid:
    """Find the grid in the elevations and azimuths of the points of one sweep.

    Parameters
    ----------
    position : (n, 3) float
        At the sensor [m].
    path : str
        For messages.

    Raises
    ------
    InputError
        The points lie on no grid: a merged or resampled cloud, or one whose origin is not the sensor.

    Notes
    -----
    Channels are the clusters of the elevations; the steps are medians of the differences between neighbours, so that
    missing returns and empty channels do not widen them.
    """
    distance, azimuth, elevation = spherical(position)
    far = distance > min(_NEAR_M, float(np.median(distance)))
    azimuth, elevation = azimuth[far], elevation[far]
    order = np.argsort(elevation, kind="stable")
    breaks = np.diff(elevation[order]) > _SAME_CHANNEL
    channel = np.empty(len(order), dtype=np.int64)
    channel[order] = np.concatenate([[0], np.cumsum(breaks)]) if len(order) else []
    found = int(breaks.sum()) + 1
    centers = np.bincount(channel, elevation) / np.bincount(channel)
    step = _azimuth_step(azimuth, channel)
    spread = np.abs(elevation - centers[channel]).max(initial=0.0)
    if step is None or found * 4 > len(order) or spread > 4 * _SAME_CHANNEL:
        raise InputError(
            f"{path}: no angular grid can be found in {len(position)} points ({found} elevations); give grid="
            "(channels, upper_deg, lower_deg, azimuth_step_deg), and mind that the origin must be the sensor's"
        )
    upper, lower = float(np.degrees(centers[-1])), float(np.degrees(centers[0]))
    if found == 1:
        return LidarGrid(1, upper, lower, step, estimated=True)
    gaps = np.degrees(np.diff(centers))
    channels = round((upper - lower) / float(np.median(gaps))) + 1
    return LidarGrid(channels, upper, lower, step, estimated=True)


def _azimuth_step(azimuth: FloatArray, channel: IntArray) -> float | None:
    """Return the median step between neighbours of a channel [deg]; None with fewer than eight of them."""
    order = np.lexsort((azimuth, channel))
    same = np.diff(channel[order]) == 0
    steps = np.degrees(np.diff(azimuth[order]))[same]
    steps = steps[steps > 1e-3]
    if len(steps) < 8:
        return None
    # the middle of the steps is one cell unless most returns are missing; multiples of it are gaps
    small = float(np.median(steps))
    near = steps[np.abs(steps - small) < 0.25 * small]
    return float(np.clip(np.mean(near), 1e-3, 30.0))
