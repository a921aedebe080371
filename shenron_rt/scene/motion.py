"""Rigid motion of actors, of their parts and of the ego vehicle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._typing import ArrayLike, FloatArray
from ..frames import Pose, rotation_matrix

__all__ = ["BodyState", "body_state"]

_UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class BodyState:
    """A rigid body at one instant, in its parent's frame: the world unless said otherwise.

    Parameters
    ----------
    rotation : (3, 3) float
        Body to parent.
    origin : (3,) float
        Of the body frame [m].
    velocity : (3,) float
        Of the origin [m/s].
    spin : (3,) float
        Angular velocity, axes of the parent [rad/s].
    """

    rotation: FloatArray
    origin: FloatArray
    velocity: FloatArray
    spin: FloatArray

    @property
    def yaw_rate(self) -> float:
        """About the parent's z axis, + left [rad/s]."""
        return float(self.spin[2])

    def mounted(self, mount: Pose) -> BodyState:
        """Return the state of something fixed to this body at the pose ``mount``."""
        return self.carrying(BodyState(mount.rotation, mount.translation, np.zeros(3), np.zeros(3)))

    def carrying(self, child: BodyState) -> BodyState:
        """Return the state, in this body's parent, of a child that moves in this body's frame."""
        arm = self.rotation @ child.origin
        return BodyState(
            self.rotation @ child.rotation,
            self.origin + arm,
            self.velocity + np.cross(self.spin, arm) + self.rotation @ child.velocity,
            self.spin + self.rotation @ child.spin,
        )


def body_state(pose: Pose, velocity_mps: ArrayLike, yaw_rate_deg_s: float, time: float) -> BodyState:
    """Return a body's state after ``time`` seconds of constant turn rate and velocity.

    Parameters
    ----------
    pose : Pose
        At time 0, in the world.
    velocity_mps : (3,) array_like
        At time 0, world axes; it turns with the body, as that of a vehicle does.
    yaw_rate_deg_s : float
        + left.
    time : float
        Seconds.

    Notes
    -----
    p(t) = p0 + sin(w t)/w v + (1 - cos(w t))/w z x v, the circle of a vehicle in a steady turn.
    """
    rate = float(np.radians(yaw_rate_deg_s))
    angle = rate * time
    v = np.asarray(velocity_mps, dtype=np.float64)
    # sin(w t)/w and (1 - cos(w t))/w without the division that fails at w = 0
    along = time * np.sinc(angle / np.pi)
    across = time * np.sin(angle / 2) * np.sinc(angle / (2 * np.pi))
    turned = rotation_matrix((np.degrees(angle), 0.0, 0.0))
    left_of_v = np.array([-v[1], v[0], 0.0])
    shift = along * v + across * left_of_v
    shift[2] = time * v[2]
    return BodyState(turned @ pose.rotation, pose.translation + shift, turned @ v, rate * _UP)
