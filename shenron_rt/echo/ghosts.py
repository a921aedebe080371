"""Ghosts: echoes over several surfaces that show an object at a place where it is not."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .._typing import BoolArray, FloatArray, IntArray
from ..paths import Paths
from ..scatterers import Scatterers

if TYPE_CHECKING:
    from ..config.profile import RadarProfile

__all__ = ["apparent_cosines", "appear_elsewhere"]

#: Places are told apart to this part of a cell.
_PARTS = 8
#: An array with less aperture than this part of a wavelength tells no directions.
_SAME_POSITION = 1e-3


def apparent_cosines(arrival: FloatArray, departure: FloatArray, profile: RadarProfile) -> FloatArray:
    """Return (n, 2) direction cosines along y and z at which an array shows echoes that left in another direction.

    Parameters
    ----------
    arrival, departure : (n, 3) float
        Unit vectors, radar frame.
    profile : RadarProfile

    Notes
    -----
    The plane wave u nearest, in least squares over all element pairs, to the phases of departure d at transmitters and
    arrival a at receivers: u = (V_tx d + V_rx a) / (V_tx + V_rx), V the variances of the elements' positions. One
    transmitter leaves the direction of arrival.
    """
    sent, heard = np.var(profile.tx_m, axis=0)[1:], np.var(profile.rx_m, axis=0)[1:]
    share = sent / np.maximum(sent + heard, 1e-30)
    return np.asarray(arrival[:, 1:] + share * (departure - arrival)[:, 1:])


def appear_elsewhere(
    scatterers: Scatterers, paths: Paths, place_m: FloatArray, cosines: FloatArray, profile: RadarProfile
) -> BoolArray:
    """Tell which paths appear more than a cell away from all that is known of their objects.

    Parameters
    ----------
    scatterers : Scatterers
        First surfaces.
    paths : Paths
        n ways over several surfaces, whose hits count as places of the objects, too.
    place_m : (n,) float
        Half the way [m].
    cosines : (n, 2) float
        Where they appear, see :func:`apparent_cosines`.
    profile : RadarProfile
        Its resolution in range, azimuth and elevation is the cell.

    Returns
    -------
    (n,) bool

    Notes
    -----
    Places are rounded to an eighth of a cell. Objects of id 0 are told apart by their tag: a wall is not where a road
    is.
    """
    from scipy.spatial import KDTree

    if not len(paths):
        return np.zeros(0, dtype=bool)
    cell, told = _cell(profile)
    at = np.concatenate([scatterers.position, paths.point[paths.hit]])
    object_id = np.concatenate([scatterers.object_id, paths.object_id[paths.hit]])
    of = _key(object_id, np.concatenate([scatterers.tag, paths.tag[paths.hit]]))
    own = _key(*paths.owner)
    number = np.unique(own)
    known = np.flatnonzero(np.isin(of, number))
    distance = np.linalg.norm(at[known], axis=1)
    seen = np.column_stack([distance, at[known][:, 1:] / np.maximum(distance, 1e-9)[:, None]]) / cell * told
    shown = np.column_stack([place_m, cosines]) / cell * told
    # objects stand four cells apart on an axis of their own, so that one tree holds them all
    places, _ = _distinct(seen, 4 * np.searchsorted(number, of[known]))
    asked, row = _distinct(shown, 4 * np.searchsorted(number, own))
    away, _ = KDTree(places).query(asked, p=np.inf, distance_upper_bound=1.0)
    return np.asarray(~np.isfinite(away))[row]


def _distinct(place: FloatArray, number: IntArray) -> tuple[FloatArray, IntArray]:
    """Return the distinct places and numbers (m, 4), to a part of a cell, and the row of each of n in them."""
    part = np.rint(place * _PARTS).astype(np.int64)
    low = part.min(axis=0)
    span = np.ptp(part, axis=0) + 1
    packed = np.asarray(number, dtype=np.int64)
    for column in range(3):
        packed = packed * span[column] + (part[:, column] - low[column])
    _, first, row = np.unique(packed, return_index=True, return_inverse=True)
    return np.column_stack([part[first] / _PARTS, number[first]]), row.ravel()


def _key(object_id: IntArray, tag: IntArray) -> IntArray:
    named = object_id.astype(np.int64)
    return np.asarray(np.where(named > 0, named + 256, tag.astype(np.int64)))


def _cell(profile: RadarProfile) -> tuple[FloatArray, FloatArray]:
    """Return the resolution in range [m] and in the cosines along y and z, and which of them the radar has (0 or 1).

    A half-wavelength line of M elements resolves 2/M.
    """
    aperture = np.ptp(profile.positions_m, axis=0)[1:] / profile.wavelength_m
    told = aperture > _SAME_POSITION
    return np.array([profile.range_resolution_m, *(2.0 / (2.0 * aperture + 1.0))]), np.array([1.0, *told])
