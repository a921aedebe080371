"""Poses by time between keyframes: one cubic a coordinate, one cubic rotation vector, both with their derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from .._typing import FloatArray
from ..errors import InputError
from ..frames import Pose
from .motion import BodyState
from .rotations import left_of_exp, rotation_exp, rotation_log

__all__ = ["Trajectory"]

#: A body that moves or turns by less than this between two keyframes stands still between them [m, rad].
_REST = 1e-9


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Keyframes and what lies between them.

    Parameters
    ----------
    time_s : (n,) float
        Ascending, n >= 2 [s].
    position : (n, 3) float
        [m].
    rotation : (n, 3, 3) float
        Body to world.
    first_velocity : (3,) float, optional
        Velocity at the first keyframe [m/s]; default: that of the parabola through the first three.
    outside : {"error", "hold"}
        What is returned more than a keyframe's interval before the first or after the last one.
    name : str
        For messages.

    Notes
    -----
    Between keyframes the position is the cubic Hermite polynomial of the two positions and velocities. The velocity at
    a keyframe is that of the parabola through it and its two neighbours, so that constant acceleration is exact and a
    circle errs by h^2 / 6 of its third derivative; beside an interval in which the body stands still it is zero, so
    that a car that stops does not roll back. The rotation from one keyframe to the next is exp(q(t)), q the cubic
    Hermite polynomial from 0 to the shortest rotation vector, its ends matched to angular velocities found in the same
    way; so pose, velocity and angular velocity are continuous. ``velocity`` and ``spin`` of a state are the exact
    derivatives of its pose.

    Up to one keyframe interval beyond either end, velocity and angular velocity of that end go on: mid-frame of the
    last frame of a recording lies there.
    """

    time_s: FloatArray
    position: FloatArray
    rotation: FloatArray
    first_velocity: FloatArray | None = None
    outside: Literal["error", "hold"] = "error"
    name: str = "trajectory"

    def __post_init__(self) -> None:
        time = self.time_s
        if len(time) < 2:
            raise InputError(
                f"{self.name}: at least two keyframes are needed, got {len(time)}; without any, give xyz_m"
            )
        late = np.flatnonzero(np.diff(time) <= 0)
        if late.size:
            k = int(late[0])
            raise InputError(
                f"{self.name}: keyframe {k + 1} at {time[k + 1]:g} s does not follow {time[k]:g} s; sort them by time"
            )
        if not (np.isfinite(time).all() and np.isfinite(self.position).all() and np.isfinite(self.rotation).all()):
            raise InputError(f"{self.name}: times and poses must be finite numbers")

    @classmethod
    def from_poses(
        cls,
        time_s: list[float],
        poses: list[Pose],
        *,
        first_velocity: FloatArray | None = None,
        outside: Literal["error", "hold"] = "error",
        name: str = "trajectory",
    ) -> Trajectory:
        """Build one from poses in the world."""
        position = np.array([p.xyz for p in poses], dtype=np.float64).reshape(-1, 3)
        rotation = np.array([p.rotation for p in poses], dtype=np.float64).reshape(-1, 3, 3)
        return cls(np.array(time_s, dtype=np.float64), position, rotation, first_velocity, outside, name)

    @cached_property
    def _steps(self) -> FloatArray:
        """(n - 1, 3) rotation vector from each keyframe to the next, in the axes of either [rad]."""
        pairs = zip(self.rotation[:-1], self.rotation[1:], strict=True)
        return np.array([rotation_log(a.T @ b) for a, b in pairs])

    @cached_property
    def _velocity(self) -> FloatArray:
        """(n, 3) velocity at each keyframe [m/s]."""
        slope = _slopes(np.diff(self.position, axis=0), np.diff(self.time_s))
        if self.first_velocity is not None:
            slope[0] = self.first_velocity
        return slope

    @cached_property
    def _body_rate(self) -> FloatArray:
        """(n, 3) angular velocity at each keyframe, body axes [rad/s]."""
        return _slopes(self._steps, np.diff(self.time_s))

    def at(self, time: float) -> BodyState:
        """Return the state at ``time`` [s].

        Raises
        ------
        InputError
            ``outside`` is ``"error"`` and the time is more than a keyframe's interval away from all keyframes.
        """
        t = self.time_s
        if time < t[0]:
            return self._beyond(0, time, float(t[1] - t[0]))
        if time > t[-1]:
            return self._beyond(len(t) - 1, time, float(t[-1] - t[-2]))
        return self._between(min(int(np.searchsorted(t, time, side="right")) - 1, len(t) - 2), time)

    def _between(self, k: int, time: float) -> BodyState:
        h = float(self.time_s[k + 1] - self.time_s[k])
        s = (time - float(self.time_s[k])) / h
        v, w, step = self._velocity, self._body_rate, self._steps[k]
        position, velocity = _hermite(self.position[k], self.position[k + 1], v[k], v[k + 1], h, s)
        # exp(q) turns at left(q) q' in the axes of keyframe k; at its end that shall be w[k + 1], which is in those of
        # keyframe k + 1, where the Jacobian is the transpose
        end = np.linalg.solve(left_of_exp(step).T, w[k + 1])
        q, q_rate = _hermite(np.zeros(3), step, w[k], end, h, s)
        start = self.rotation[k]
        return BodyState(start @ rotation_exp(q), position, velocity, start @ (left_of_exp(q) @ q_rate))

    def _beyond(self, k: int, time: float, interval: float) -> BodyState:
        ahead = time - float(self.time_s[k])
        here, still = self.rotation[k], np.zeros(3)
        if abs(ahead) > interval * (1.0 + 1e-9):
            if self.outside == "hold":
                return BodyState(here, self.position[k], still, still)
            first, last = self.time_s[0], self.time_s[-1]
            raise InputError(
                f"{self.name}: {time:g} s is outside its keyframes, {first:g} to {last:g} s; give it more keyframes, "
                "fewer frames, or trajectory_outside: hold"
            )
        velocity, rate = self._velocity[k], self._body_rate[k]
        turned = here @ rotation_exp(rate * ahead)
        return BodyState(turned, self.position[k] + velocity * ahead, velocity, here @ rate)


def _slopes(step: FloatArray, h: FloatArray) -> FloatArray:
    """Return (n, 3) derivatives at n points from the (n - 1, 3) steps between them and their lengths ``h``."""
    d = step / h[:, None]
    if len(h) == 1:
        return np.concatenate([d, d])
    left, right = h[:-1, None], h[1:, None]
    inner = (right * d[:-1] + left * d[1:]) / (left + right)
    bend = (d[1:] - d[:-1]) / (left + right)
    slope = np.concatenate([d[:1] - bend[:1] * left[:1], inner, d[-1:] + bend[-1:] * right[-1:]])
    rest = np.linalg.norm(step, axis=1) < _REST
    slope[np.concatenate([rest, [False]]) | np.concatenate([[False], rest])] = 0.0
    return slope


def _hermite(
    a: FloatArray, b: FloatArray, slope_a: FloatArray, slope_b: FloatArray, h: float, s: float
) -> tuple[FloatArray, FloatArray]:
    """Return the cubic with ends a, b and slopes at them, at the fraction s of the length h, and its derivative."""
    r = 1.0 - s
    value = (1 + 2 * s) * r**2 * a + s**2 * (3 - 2 * s) * b + h * s * r * (r * slope_a - s * slope_b)
    rate = 6 * s * r / h * (b - a) + r * (1 - 3 * s) * slope_a + s * (3 * s - 2) * slope_b
    return np.asarray(value), np.asarray(rate)
