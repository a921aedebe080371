"""Truth as labels: which object the cells of a map show, and where every object is."""

from __future__ import annotations

import numpy as np

from .._typing import FloatArray, IntArray
from ..dsp import RadarCube
from ..frames import spherical
from ..returns import Returns

__all__ = ["NOTHING", "azimuth_label", "doppler_label", "object_means"]

#: Label of a cell in which no echo lies.
NOTHING = -1


def doppler_label(returns: Returns, cube: RadarCube) -> IntArray:
    """Return (range, velocity) int64: the object whose echoes bring the most power into the cell; -1 where none lies.

    Echoes count for the cell that their beat frequency and their folded Doppler fall into, without side lobes or
    speckle: the label of what is there, not of what the map shows of it.
    """
    p = cube.profile
    distance, rate, _ = _polar(returns)
    # the beat frequency of a moving echo is k tau + Doppler
    beat = distance + rate * (p.center_hz / p.slope_hz_per_s)
    n_range, n_velocity, _ = cube.data.shape
    row = np.rint(beat / cube.range_step_m).astype(np.int64)
    column = (np.rint(rate / cube.velocity_step_mps).astype(np.int64) + n_velocity // 2) % n_velocity
    return _strongest(returns, row, column, (n_range, n_velocity))


def azimuth_label(returns: Returns, cube: RadarCube) -> IntArray:
    """Return (range, azimuth) int64: as :func:`doppler_label`, by the nearest beam of the range-azimuth map."""
    p = cube.profile
    distance, rate, sine = _polar(returns)
    row = np.rint((distance + rate * (p.center_hz / p.slope_hz_per_s)) / cube.range_step_m).astype(np.int64)
    grid = cube.azimuth_sine
    column = np.rint((sine - grid[0]) / (grid[1] - grid[0])).astype(np.int64)
    return _strongest(returns, row, np.clip(column, 0, len(grid) - 1), (cube.data.shape[0], len(grid)))


def _polar(returns: Returns) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return distance [m], range rate [m/s] and the direction cosine along +y of every echo."""
    distance = np.maximum(np.linalg.norm(returns.position, axis=1), 1e-9)
    rate = np.einsum("ij,ij->i", returns.position, returns.velocity) / distance
    return distance, rate, returns.position[:, 1] / distance


def _strongest(returns: Returns, row: IntArray, column: IntArray, shape: tuple[int, int]) -> IntArray:
    """Return the id with the most power in every cell."""
    label = np.full(shape, NOTHING, dtype=np.int64)
    inside = (row >= 0) & (row < shape[0])
    power = np.abs(returns.amplitude[inside]) ** 2
    ids, number = np.unique(returns.object_id[inside], return_inverse=True)
    if len(ids) == 0:
        return label
    cell = row[inside] * shape[1] + column[inside]
    pairs, place = np.unique(cell * len(ids) + number, return_inverse=True)
    total = np.bincount(place, power)
    order = np.argsort(total, kind="stable")  # the strongest of a cell is written last
    label.reshape(-1)[pairs[order] // len(ids)] = ids[pairs[order] % len(ids)]
    return label


def object_means(returns: Returns, ids: IntArray) -> dict[str, FloatArray]:
    """Return where objects are at mid-frame, radar frame; NaN for those without an echo.

    Parameters
    ----------
    returns : Returns
    ids : (n,) int
        The objects wanted.

    Returns
    -------
    dict of str to (n,) float
        ``range_m azimuth_rad elevation_rad velocity_mps``, of the power-weighted mean position, and ``power_w``.
        Ghosts, which show an object where it is not, count for its power alone.
    """
    names = ("range_m", "azimuth_rad", "elevation_rad", "velocity_mps", "power_w")
    out = {name: np.full(len(ids), np.nan) for name in names}
    power, total = np.where(returns.ghost, 0.0, np.abs(returns.amplitude) ** 2), returns.power_by_object()
    _, rate, _ = _polar(returns)
    for k, number in enumerate(ids.tolist()):  # a scene has a few dozen
        rows = returns.object_id == number
        out["power_w"][k] = total.get(number, np.nan)
        weight = power[rows]
        if weight.sum() <= 0:
            continue
        place = spherical(weight @ returns.position[rows] / weight.sum())
        for name, value in zip(names, [*place, weight @ rate[rows] / weight.sum()], strict=False):
            out[name][k] = value
    return out
