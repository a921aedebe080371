"""From where a target is lit and seen: directions, polarisation bases, plane or spherical waves, lattices of rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._typing import FloatArray, IntArray

__all__ = ["Rays", "Views"]


@dataclass(frozen=True, eq=False)
class Rays:
    """Rays about to be cast, with the derivatives of their fronts over the lattice.

    Parameters
    ----------
    view : (n,) int
        Row of the views each belongs to.
    x, y : (n,) float
        Where it crosses the lattice, along H and V from the centre of the target [m].
    origin, direction : (n, 3) float
        [m].
    across_u, across_v : (n, 3) float
        Change of the position on the front over the lattice coordinates, for a unit of ``spread``.
    path : (n,) float
        Length so far less that to the target's origin [m].
    """

    view: IntArray
    x: FloatArray
    y: FloatArray
    origin: FloatArray
    direction: FloatArray
    across_u: FloatArray
    across_v: FloatArray
    path: FloatArray

    def __len__(self) -> int:
        return len(self.view)


@dataclass(frozen=True, eq=False)
class Views:
    """Directions from which a target is lit or seen.

    Parameters
    ----------
    azimuth, elevation : (a,) float
        Of the radar, seen from the target's origin [rad].
    distance : float or None
        From the radar to the target's origin [m]; None is a plane wave.
    """

    azimuth: FloatArray
    elevation: FloatArray
    distance: float | None = None

    def __len__(self) -> int:
        return len(self.azimuth)

    @property
    def toward(self) -> FloatArray:
        """(a, 3) unit vectors from the target's origin to the radar."""
        cos = np.cos(self.elevation)
        return np.stack([cos * np.cos(self.azimuth), cos * np.sin(self.azimuth), np.sin(self.elevation)], axis=1)

    @property
    def horizontal(self) -> FloatArray:
        """(a, 3) H, the unit vectors of increasing azimuth."""
        return np.stack([-np.sin(self.azimuth), np.cos(self.azimuth), np.zeros_like(self.azimuth)], axis=1)

    @property
    def vertical(self) -> FloatArray:
        """(a, 3) V, the unit vectors of increasing elevation."""
        sin = np.sin(self.elevation)
        return np.stack([-sin * np.cos(self.azimuth), -sin * np.sin(self.azimuth), np.cos(self.elevation)], axis=1)

    def select(self, rows: slice | IntArray) -> Views:
        """Return some of the views."""
        return Views(self.azimuth[rows], self.elevation[rows], self.distance)

    def launch(self, view: IntArray, x: FloatArray, y: FloatArray, centre: FloatArray, radius: float) -> Rays:
        """Return rays through points of the lattice planes.

        Parameters
        ----------
        view : (n,) int
        x, y : (n,) float
            Along H and V from the centre of the target [m].
        centre : (3,) float
        radius : float
            Of the sphere about the centre that holds the target; rays start outside of it [m].
        """
        toward, u, v = self.toward[view], self.horizontal[view], self.vertical[view]
        point = centre + x[:, None] * u + y[:, None] * v
        if self.distance is None:
            origin = point + 2.0 * radius * toward
            return Rays(view, x, y, origin, -toward, u, v, -np.einsum("ij,ij->i", toward, origin))
        radar = self.distance * toward
        reach = point - radar
        length = np.linalg.norm(reach, axis=1)
        d = reach / length[:, None]
        across_u, across_v = ((a - np.einsum("ij,ij->i", a, d)[:, None] * d) / length[:, None] for a in (u, v))
        start = np.maximum(np.linalg.norm(radar - centre, axis=1) - 1.01 * radius, 0.0)
        return Rays(view, x, y, radar + start[:, None] * d, d, across_u, across_v, start - self.distance)

    def decay(self, path: FloatArray) -> FloatArray:
        """Return the field over that at the target's origin, for a wave that only widens [1]."""
        return np.ones_like(path) if self.distance is None else self.distance / (path + self.distance)

    def spread(self, path: FloatArray) -> FloatArray:
        """Return by how much fronts have widened since a unit [m or 1]."""
        return np.ones_like(path) if self.distance is None else path + self.distance

    def seen_from(self, position: FloatArray, view: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return how points are seen: unit vectors towards the radar, path back less the distance, and decay.

        Parameters
        ----------
        position : (n, 3) float
        view : (n,) int

        Returns
        -------
        toward : (n, 3) float
        path : (n,) float
            [m].
        decay : (n,) float
            Distance of the target's origin over that of the point; 1 for plane waves.
        """
        toward = self.toward[view]
        if self.distance is None:
            return toward, -np.einsum("ij,ij->i", toward, position), np.ones(len(position))
        way = self.distance * toward - position
        length = np.linalg.norm(way, axis=1)
        return way / length[:, None], length - self.distance, self.distance / length
