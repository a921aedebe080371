"""How far something has driven, turned and walked: what its wheels and legs go by."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .._typing import FloatArray
from ..config.scene import Moving
from .motion import BodyState, body_state
from .motion_of import trajectory_of
from .trajectory import Trajectory

if TYPE_CHECKING:
    from ..config._base import Placed

__all__ = ["Ride", "ride_of"]

#: Gauss-Legendre over the interval between two keyframes: exact for the speed along straight lines.
_NODE, _WEIGHT = np.polynomial.legendre.leggauss(6)


@dataclass(frozen=True)
class Ride:
    """Integrals since time 0, or since the first keyframe, and their rates.

    Parameters
    ----------
    time : float
        [s].
    distance, speed : float
        Along the body's x axis [m, m/s].
    yaw, yaw_rate : float
        About the body's z axis [rad, rad/s].
    root, root_rate : float
        Integral of the root of the absolute speed, which the pace of a walker goes with, and that root
        [m^0.5 s^0.5, (m/s)^0.5].
    """

    time: float
    distance: float
    speed: float
    yaw: float
    yaw_rate: float
    root: float
    root_rate: float


def ride_of(item: Placed, folder: Path, time: float) -> Ride:
    """Return the ride of an actor until ``time`` [s]; nothing but the time where it does not move."""
    if not isinstance(item, Moving) or not item.moves:
        return Ride(time, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    if not item.has_trajectory:
        rate = _rates(body_state(item.pose, item.velocity_mps, item.yaw_rate_deg_s, 0.0))
        return _ride(time, rate * time, rate)
    path = trajectory_of(item, folder)
    return _ride(time, _integrals(path, time), _rates(path.at(time)))


def _ride(time: float, total: FloatArray, rate: FloatArray) -> Ride:
    distance, yaw, root = (float(v) for v in total)
    speed, yaw_rate, root_rate = (float(v) for v in rate)
    return Ride(time, distance, speed, yaw, yaw_rate, root, root_rate)


def _rates(state: BodyState) -> FloatArray:
    """Return forward speed, yaw rate and the root of the absolute speed."""
    forward = float(state.velocity @ state.rotation[:, 0])
    return np.array([forward, float(state.spin @ state.rotation[:, 2]), float(np.sqrt(np.linalg.norm(state.velocity)))])


def _integrals(path: Trajectory, time: float) -> FloatArray:
    t = path.time_s
    whole = _cumulative(path)
    k = int(np.clip(np.searchsorted(t, time, side="right") - 1, 0, len(t) - 1))
    return np.asarray(whole[k] + _integral(path, float(t[k]), time))


def _integral(path: Trajectory, start: float, end: float) -> FloatArray:
    half, middle = (end - start) / 2.0, (end + start) / 2.0
    if half == 0:
        return np.zeros(3)
    rates = np.array([_rates(path.at(middle + half * x)) for x in _NODE])
    return np.asarray(half * _WEIGHT @ rates)


@functools.lru_cache(maxsize=1024)
def _cumulative(path: Trajectory) -> FloatArray:
    """(n, 3) integrals from the first keyframe to each."""
    pairs = zip(path.time_s[:-1], path.time_s[1:], strict=True)
    steps = [_integral(path, float(a), float(b)) for a, b in pairs]
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
