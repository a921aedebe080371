"""Frames of reference: poses, CARLA <-> ROS, spherical <-> Cartesian.

Inside the package every frame is right-handed, x forward, y left, z up (ROS REP-103), in metres and radians. CARLA is
left-handed, y right, in degrees; it is converted here and nowhere else.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ._typing import ArrayLike, FloatArray
from .errors import InputError

__all__ = [
    "Pose",
    "direction",
    "from_carla_points",
    "from_carla_pose",
    "rotation_matrix",
    "spherical",
    "to_carla",
    "to_carla_pose",
]

# Mirror between CARLA (y right) and ROS (y left); its own inverse.
_FLIP_Y = np.array([1.0, -1.0, 1.0])


def rotation_matrix(ypr_deg: ArrayLike) -> FloatArray:
    """Return R = Rz(yaw) Ry(-pitch) Rx(roll) for angles in degrees.

    Parameters
    ----------
    ypr_deg : (3,) array_like
        Yaw (+ left), pitch (+ nose up), roll (+ left side up) [deg].

    Returns
    -------
    (3, 3) ndarray
        Maps child to parent coordinates.
    """
    yaw, pitch, roll = np.radians(np.asarray(ypr_deg, dtype=np.float64))
    cy, sy = np.cos(yaw), np.sin(yaw)
    cp, sp = np.cos(pitch), np.sin(pitch)
    cr, sr = np.cos(roll), np.sin(roll)
    about_z = np.array([[cy, -sy, 0.0], [sy, cy, 0.0], [0.0, 0.0, 1.0]])
    # Ry(-pitch) in the right-hand sense: pitch is nose up, and z is up.
    about_y = np.array([[cp, 0.0, -sp], [0.0, 1.0, 0.0], [sp, 0.0, cp]])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]])
    rotation: FloatArray = about_z @ about_y @ about_x
    return rotation


@dataclass(frozen=True)
class Pose:
    """Child frame in its parent: p_parent = R p_child + xyz.

    Parameters
    ----------
    xyz : (3,) sequence of float
        Origin of the child in the parent [m].
    ypr_deg : (3,) sequence of float
        Yaw (+ left), pitch (+ nose up), roll (+ left side up) [deg]; R = Rz(yaw) Ry(-pitch) Rx(roll).

    Examples
    --------
    >>> Pose((1, 0, 0), (90, 0, 0)).apply([[1.0, 0.0, 0.0]]).round(6)
    array([[1., 1., 0.]])
    """

    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ypr_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("xyz", "ypr_deg"):
            value = tuple(float(v) for v in getattr(self, name))
            if len(value) != 3 or not np.all(np.isfinite(value)):
                raise InputError(f"Pose.{name}: three finite numbers are needed, got {getattr(self, name)!r}")
            object.__setattr__(self, name, value)

    @property
    def rotation(self) -> FloatArray:
        """(3, 3) rotation, child to parent."""
        return rotation_matrix(self.ypr_deg)

    @property
    def translation(self) -> FloatArray:
        """(3,) origin of the child in the parent [m]."""
        return np.asarray(self.xyz, dtype=np.float64)

    def apply(self, points: ArrayLike) -> FloatArray:
        """Map (n, 3) points from the child to the parent frame [m]."""
        return np.asarray(points, dtype=np.float64) @ self.rotation.T + self.translation

    def apply_inverse(self, points: ArrayLike) -> FloatArray:
        """Map (n, 3) points from the parent to the child frame [m]."""
        return (np.asarray(points, dtype=np.float64) - self.translation) @ self.rotation

    def compose(self, child: Pose) -> Pose:
        """Return the pose of ``child`` (given in this frame) in this frame's parent."""
        return Pose.from_matrix(self.rotation @ child.rotation, self.apply(child.translation[None])[0])

    def inverse(self) -> Pose:
        """Return the pose of the parent in the child."""
        return Pose.from_matrix(self.rotation.T, -(self.rotation.T @ self.translation))

    @classmethod
    def from_matrix(cls, rotation: ArrayLike, xyz: ArrayLike) -> Pose:
        """Build a pose from a rotation matrix and a translation.

        Parameters
        ----------
        rotation : (3, 3) array_like
        xyz : (3,) array_like
            Metres.
        """
        R = np.asarray(rotation, dtype=np.float64)
        pitch = np.arctan2(R[2, 0], np.hypot(R[0, 0], R[1, 0]))
        if np.hypot(R[0, 0], R[1, 0]) > 1e-9:
            yaw, roll = np.arctan2(R[1, 0], R[0, 0]), np.arctan2(R[2, 1], R[2, 2])
        else:  # nose straight up or down: only yaw -+ roll is defined, put it all into yaw
            yaw, roll = np.arctan2(-R[0, 1], R[1, 1]), 0.0
        x, y, z = (float(v) for v in np.asarray(xyz, dtype=np.float64))
        yaw_deg, pitch_deg, roll_deg = (float(v) for v in np.degrees([yaw, pitch, roll]))
        return cls((x, y, z), (yaw_deg, pitch_deg, roll_deg))


def from_carla_points(points: ArrayLike) -> FloatArray:
    """Convert (n, 3) points or vectors from CARLA axes (y right) to ours (y left)."""
    flipped: FloatArray = np.asarray(points, dtype=np.float64) * _FLIP_Y
    return flipped


def to_carla(points: ArrayLike) -> FloatArray:
    """Convert (n, 3) points or vectors from our axes (y left) to CARLA's (y right)."""
    flipped: FloatArray = np.asarray(points, dtype=np.float64) * _FLIP_Y
    return flipped


def from_carla_pose(location: Sequence[float], rotation_deg: Sequence[float]) -> Pose:
    """Convert a CARLA transform to a pose.

    Parameters
    ----------
    location : (3,) sequence of float
        ``carla.Location`` x, y, z [m].
    rotation_deg : (3,) sequence of float
        ``carla.Rotation`` in its own order pitch (+ nose up), yaw (+ right), roll (+ right side down) [deg].

    Notes
    -----
    CARLA's matrix (LibCarla ``Transform.h``) conjugated by the y mirror gives yaw' = -yaw and keeps "nose up" and
    "left side up", which is what :class:`Pose` calls pitch and roll.
    """
    pitch, yaw, roll = (float(v) for v in rotation_deg)
    x, y, z = from_carla_points(location)
    return Pose((x, y, z), (-yaw, pitch, roll))


def to_carla_pose(pose: Pose) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Convert a pose to CARLA's location [m] and rotation (pitch, yaw, roll) [deg]."""
    x, y, z = (float(v) for v in to_carla(pose.xyz))
    yaw, pitch, roll = pose.ypr_deg
    return (x, y, z), (pitch, -yaw, roll)


def spherical(points: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return range [m], azimuth (+ left) and elevation (+ up) [rad] of (..., 3) points; at zero range angles are 0."""
    p = np.asarray(points, dtype=np.float64)
    horizontal = np.hypot(p[..., 0], p[..., 1])
    return np.hypot(horizontal, p[..., 2]), np.arctan2(p[..., 1], p[..., 0]), np.arctan2(p[..., 2], horizontal)


def direction(azimuth: ArrayLike, elevation: ArrayLike) -> FloatArray:
    """Return (..., 3) unit vectors for azimuth (+ left) and elevation (+ up) [rad]."""
    az, el = np.broadcast_arrays(np.asarray(azimuth, dtype=np.float64), np.asarray(elevation, dtype=np.float64))
    return np.stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)], axis=-1)
