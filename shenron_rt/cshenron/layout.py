"""Points of the public C-Shenron pipeline: its axes, views, crop and materials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._typing import ArrayLike, FloatArray, IntArray
from ..echo._shenron_tables import UNLABELLED, material_of_class, released_class
from ..errors import InputError

__all__ = ["VIEWS_DEG", "ViewPoints", "check_points", "view_points"]

#: Front, right, rear, left [deg].
VIEWS_DEG = (0, 90, 180, 270)
#: The released crop, strict: q1 above the first, abs(q0) below the second, q1 below the third, q2 below the fourth [m].
NEAR_M, SIDE_M, FAR_M, TOP_M = 0.8, 50.0, 100.0, 2.0


@dataclass(frozen=True)
class ViewPoints:
    """The points one view keeps, in the radar axes of the public code: right, forward, up.

    Parameters
    ----------
    rows : (m,) int
        Their rows in the input.
    position : (m, 3) float
        Right, forward, up [m].
    cosine : (m,) float
        Cosine of incidence as recorded.
    speed : (m,) float
        Radial, positive = receding [m/s]; 0 in the released pipeline.
    material : (m,) int
        0 to 4.
    """

    rows: IntArray
    position: FloatArray
    cosine: FloatArray
    speed: FloatArray
    material: IntArray

    @property
    def rho(self) -> FloatArray:
        """(m,) distance in space [m]."""
        distance: FloatArray = np.linalg.norm(self.position, axis=1)
        return distance

    @property
    def theta(self) -> FloatArray:
        """(m,) pi/2 - atan(right / forward): pi/2 ahead, smaller to the right [rad]."""
        angle: FloatArray = np.pi / 2 - np.arctan(self.position[:, 0] / self.position[:, 1])
        return angle

    @property
    def polar_angle(self) -> FloatArray:
        """(m,) angle from the upward vertical [rad]."""
        angle: FloatArray = np.arccos(self.position[:, 2] / self.rho)
        return angle


def check_points(points: ArrayLike) -> FloatArray:
    """Return C-Shenron's list as (n, 7) float64, a speed of 0 added to six columns.

    Parameters
    ----------
    points : (n, 6) or (n, 7) array_like
        ``[x, y, z, cos, id, tag]``, or with the radial speed last; x forward, y right, z up from the ground under the
        vehicle [m].

    Raises
    ------
    InputError
        Another shape, values that are not finite, a cosine outside [-1, 1], tags that are no whole numbers.
    """
    rows = np.asarray(points, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] not in (6, 7):
        raise InputError(
            f"points have columns x, y, z, cos, id, tag and, optionally, speed; got an array of shape {rows.shape}"
        )
    if not np.all(np.isfinite(rows)):
        raise InputError(f"points need finite numbers; {int(np.sum(~np.isfinite(rows)))} are not")
    if np.any(np.abs(rows[:, 3]) > 1):
        raise InputError(
            f"column 3 is the cosine of incidence, -1 to 1; got {rows[:, 3].min():g} to {rows[:, 3].max():g}"
        )
    if np.any((rows[:, 5] != np.round(rows[:, 5])) | (rows[:, 5] < 0) | (rows[:, 5] > 255)):
        raise InputError("column 5 is the semantic tag, a whole number from 0 to 255; were its bits cast to float?")
    if rows.shape[1] == 7:
        return rows
    return np.column_stack([rows, np.zeros(len(rows))])


def view_points(points: ArrayLike, view_deg: float, material: ArrayLike | None = None) -> ViewPoints:
    """Rotate points into a view and crop them as the released pipeline does.

    Parameters
    ----------
    points : (n, 6) or (n, 7) array_like
        As for :func:`check_points`, tags in CARLA's numbering up to 0.9.13.
    view_deg : float
        0 front, 90 right, 180 rear, 270 left.
    material : (n,) array_like of int, optional
        Replaces the released tag table.

    Returns
    -------
    ViewPoints
        Forward > 0.8 m and < 100 m, right within 50 m, up < 2 m, labelled.

    Raises
    ------
    InputError
        Points of the wrong form, tags the released table does not have.
    """
    rows = check_points(points)
    kind = material_of_class(released_class(rows[:, 5].astype(np.int64))) if material is None else np.asarray(material)
    angle = np.radians(view_deg)
    right, ahead, up = rows[:, 1], rows[:, 0], rows[:, 2]
    q0 = right * np.cos(angle) - ahead * np.sin(angle)
    q1 = right * np.sin(angle) + ahead * np.cos(angle)
    keep = (q1 > NEAR_M) & (kind != UNLABELLED) & (np.abs(q0) < SIDE_M) & (q1 < FAR_M) & (up < TOP_M)
    position = np.column_stack([q0, q1, up])
    return ViewPoints(np.flatnonzero(keep), position[keep], rows[keep, 3], rows[keep, 6], kind[keep])
