"""The Kalman filter of a point that moves at constant velocity, pushed by random accelerations."""

from __future__ import annotations

import numpy as np

from .._typing import FloatArray

__all__ = ["constant_velocity", "predict", "steady_state_gain", "update"]


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


def steady_state_gain(tracking_index: float) -> tuple[float, float]:
    """Return (alpha, beta): the gains of position and (over T) velocity that the filter settles at.

    Parameters
    ----------
    tracking_index : float
        Lambda = acceleration_std T^2 / measurement_std, > 0.

    References
    ----------
    .. [1] P. R. Kalata, IEEE Trans. Aerosp. Electron. Syst. AES-20, 174-182 (1984), doi:10.1109/TAES.1984.310438.
    """
    r = (4 + tracking_index - np.sqrt(8 * tracking_index + tracking_index**2)) / 4
    alpha = 1 - r**2
    return float(alpha), float(2 * (2 - alpha) - 4 * np.sqrt(1 - alpha))
