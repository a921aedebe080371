"""Rotations as vectors: axis times angle, and how a turning one moves."""

from __future__ import annotations

import numpy as np

from .._typing import ArrayLike, FloatArray

__all__ = ["left_of_exp", "rotation_exp", "rotation_log"]

#: Below this angle [rad] the series to the fourth order is exact to the last bit of a double.
_SMALL = 1e-2


def cross_matrix(v: ArrayLike) -> FloatArray:
    """Return the (3, 3) matrix of v x."""
    x, y, z = np.asarray(v, dtype=np.float64)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_exp(vector: ArrayLike) -> FloatArray:
    """Return the (3, 3) rotation by ``norm(vector)`` [rad] about ``vector`` (Rodrigues)."""
    v = np.asarray(vector, dtype=np.float64)
    angle = float(np.linalg.norm(v))
    K = cross_matrix(v)
    half = float(np.sinc(angle / (2.0 * np.pi)))  # sin(a/2) / (a/2)
    return np.asarray(np.eye(3) + np.sinc(angle / np.pi) * K + 0.5 * half**2 * (K @ K))


def rotation_log(rotation: ArrayLike) -> FloatArray:
    """Return the (3,) shortest rotation vector [rad] of a (3, 3) rotation; by half a turn, one of the two."""
    R = np.asarray(rotation, dtype=np.float64)
    w = float(np.sqrt(max(0.0, 1.0 + np.trace(R)))) / 2.0  # cos(a/2), and below sin(a/2) times the axis
    skew = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    if w > 0.1:
        half_axis = skew / (2.0 * w)
    else:  # near half a turn: from the symmetric part, by its largest column
        B = 0.25 * (R + R.T + (1.0 - np.trace(R)) * np.eye(3))
        k = int(np.argmax(np.diag(B)))
        half_axis = B[k] / np.sqrt(B[k, k])
        half_axis = half_axis if half_axis @ skew >= 0 else -half_axis
    sine = float(np.linalg.norm(half_axis))
    angle = 2.0 * np.arctan2(sine, w)
    return np.asarray(half_axis * (angle / sine if sine > 0 else 2.0))


def left_of_exp(vector: ArrayLike) -> FloatArray:
    """Return the (3, 3) matrix J with: exp(v(t)) turns at J v'(t), in the axes it turns from.

    Notes
    -----
    The left Jacobian of SO(3), J = I + (1 - cos a)/a^2 K + (a - sin a)/a^3 K^2, a = norm(v), K = v x
    (J. Sola et al., "A micro Lie theory for state estimation in robotics", arXiv:1812.01537, eq. 145). That of the axes
    it turns to is its transpose.
    """
    v = np.asarray(vector, dtype=np.float64)
    angle = float(np.linalg.norm(v))
    K = cross_matrix(v)
    first = 0.5 * float(np.sinc(angle / (2.0 * np.pi))) ** 2
    if angle < _SMALL:
        second = 1.0 / 6.0 - angle**2 / 120.0 + angle**4 / 5040.0
    else:
        second = (angle - np.sin(angle)) / angle**3
    return np.asarray(np.eye(3) + first * K + second * (K @ K))
