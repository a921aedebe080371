"""The Kalman filter of a point that moves at constant velocity, pushed by random accelerations."""

from __future__ import annotations

import numpy as np

from .._typing import FloatArray

__all__ = ["constant_velocity", "predict", "update"]


def constant_velocity(step_s: float, acceleration_std: float, dimensions: int = 2) -> tuple[FloatArray, FloatArray]:
    """Return transition and process noise of the state (positions, velocities).

    Parameters
    ----------
    step_s : float
        Time step T [s].
    acceleration_std : float
        Standard deviation of an acceleration that is constant during a step and new in the next [m/s^2].
    dimensions : int
        Coordinates d.

    Returns
    -------
    F, Q : (2 d, 2 d) float

    Notes
    -----
    Q = G G^T sigma^2 with G = (T^2/2, T): the discrete white noise acceleration model, Bar-Shalom, Li, Kirubarajan,
    Estimation with Applications to Tracking and Navigation (2001), section 6.3.2.
    """
    one = np.eye(dimensions)
    F = np.block([[one, step_s * one], [np.zeros_like(one), one]])
    push = np.vstack([step_s**2 / 2 * one, step_s * one])
    return np.asarray(F, dtype=np.float64), np.asarray(acceleration_std**2 * push @ push.T, dtype=np.float64)


def predict(x: FloatArray, P: FloatArray, F: FloatArray, Q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return state (n,) and covariance (n, n) one step later: F x, F P F^T + Q."""
    return F @ x, F @ P @ F.T + Q


def update(
    x: FloatArray, P: FloatArray, innovation: FloatArray, H: FloatArray, R: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Correct a state with a measurement.

    Parameters
    ----------
    x, P : (n,), (n, n) float
        Predicted state and covariance.
    innovation : (m,) float
        Measurement minus H x.
    H, R : (m, n), (m, m) float
        What is measured, and its covariance.

    Returns
    -------
    x, P : (n,), (n, n) float
        Joseph's form, which stays symmetric and positive.
    """
    S = H @ P @ H.T + R
    K = np.linalg.solve(S, H @ P).T
    left = np.eye(len(x)) - K @ H
    return x + K @ innovation, left @ P @ left.T + K @ R @ K.T
