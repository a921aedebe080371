"""Range-Doppler and range-azimuth maps of a page: decibels in 256 steps, pooled where they would not fit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .._typing import FloatArray
from ..config.profile import RadarProfile
from ..dsp import RadarCube
from ..plot._style import dbm
from .arrays import Arrays, encoded_levels

__all__ = ["MAPS", "MapPools", "add_maps", "pooled"]

#: Maps of a page by the short names its arrays have.
MAPS = {"rd": "range_doppler", "ra": "range_azimuth"}
#: Kept below the noise [dB]: what lies lower says nothing.
_BELOW_NOISE_DB = 12.0
#: Levels that a map spans at least and at most [dB]: 255 steps of 120 dB are 0.47 dB each.
_LEAST_DB, _MOST_DB = 30.0, 120.0


class MapPools:
    """Reduces the maps of the frames of one radar to levels that fit into a page, all by the same factors.

    Parameters
    ----------
    most_cells : float
        Of a map.
    """

    def __init__(self, most_cells: float) -> None:
        self._most = most_cells
        self.axes: Mapping[str, FloatArray] = {}
        self.pools: dict[str, tuple[int, int]] = {}

    def levels(self, maps: Mapping[str, FloatArray] | None) -> dict[str, FloatArray]:
        """Return both maps pooled [dBm] by short name; empty without maps."""
        if maps is None:
            return {}
        self.axes = self.axes or {name: maps[name] for name in ("range_m", "velocity_mps", "azimuth_rad")}
        found: dict[str, FloatArray] = {}
        for short, name in MAPS.items():
            pool = self.pools.setdefault(short, _pool(maps[name].shape, self._most))
            found[short] = dbm(pooled(maps[name], pool))
        return found


def add_maps(
    arrays: Arrays, prefix: str, profile: RadarProfile, pools: MapPools, levels: Sequence[Mapping[str, FloatArray]]
) -> dict[str, Any] | None:
    """Add both maps of every frame of a radar, and return how to read them.

    Parameters
    ----------
    arrays : Arrays
        Gets ``<prefix>.rd.<k>`` and ``<prefix>.ra.<k>``, (rows, columns) uint8, k counting the frames from 0.
    prefix : str
    profile : RadarProfile
    pools : MapPools
        That made the levels.
    levels : sequence of mapping
        Of every frame, by short name [dBm].

    Returns
    -------
    dict or None
        ``range_step_m``, ``n_range``, ``velocity_mps``, ``azimuth_sine``: the axes before pooling; ``has``: whether a
        frame has maps; ``rd`` and ``ra``: ``low_dbm``, ``step_db``, ``top_dbm``, ``noise_dbm``, ``pool`` (rows,
        columns of a cell). None where no frame has any.

    Notes
    -----
    Code c means ``low_dbm + c step_db``; rounding is at most half a step. Pooled cells keep their strongest.
    """
    if not pools.axes:
        return None
    noise = _noise_dbm(profile)
    result: dict[str, Any] = {
        "range_step_m": float(pools.axes["range_m"][1]),
        "n_range": len(pools.axes["range_m"]),
        "velocity_mps": pools.axes["velocity_mps"].tolist(),
        "azimuth_sine": np.sin(pools.axes["azimuth_rad"]).tolist(),
        "has": [bool(frame) for frame in levels],
    }
    for short in MAPS:
        low, step, top = _coding(max(float(frame[short].max()) for frame in levels if frame), noise[short])
        coding = {"low_dbm": low, "step_db": step, "top_dbm": top, "noise_dbm": noise[short]}
        result[short] = coding | {"pool": pools.pools[short]}
        for k, frame in enumerate(levels):
            if frame:
                arrays.add(f"{prefix}.{short}.{k}", encoded_levels(frame[short], low, step), "u1", later=k > 0)
    return result


def _coding(strongest: float, noise: float) -> tuple[float, float, float]:
    """Return the level of code 0 [dBm], the step [dB] and the top [dBm] of the maps of a radar."""
    top = math.ceil(strongest)
    low = min(max(math.floor(noise - _BELOW_NOISE_DB), top - _MOST_DB), top - _LEAST_DB)
    return float(low), (top - low) / 255, float(top)


def _pool(shape: tuple[int, ...], most: float) -> tuple[int, int]:
    """Return by how much rows and columns are pooled so that a map has at most that many cells."""
    pool = [1, 1]
    while math.ceil(shape[0] / pool[0]) * math.ceil(shape[1] / pool[1]) > max(most, 64):
        # halve the axis with more cells left: both keep about the same share of their resolution
        pool[0 if shape[0] / pool[0] >= shape[1] / pool[1] else 1] *= 2
    return pool[0], pool[1]


def pooled(power: FloatArray, pool: tuple[int, int]) -> FloatArray:
    """Return the strongest of every ``pool`` block of cells; blocks at the end may be smaller."""
    rows = np.maximum.reduceat(power, np.arange(0, power.shape[0], pool[0]), axis=0)
    return np.asarray(np.maximum.reduceat(rows, np.arange(0, power.shape[1], pool[1]), axis=1))


def _noise_dbm(profile: RadarProfile) -> dict[str, float]:
    """Return what noise reads on average in each map [dBm].

    The range-azimuth map shows the largest of n_velocity cells that are exponential: about ln(n_velocity) means.
    """
    shape = (profile.n_range, profile.waveform.chirps, profile.n_virtual)
    settings = profile.processing
    nothing = np.broadcast_to(np.complex128(0), shape)
    cube = RadarCube(nothing, profile, settings.range_window, settings.doppler_window)
    largest = max(1.0, math.log(shape[1]))
    beam = cube.noise_power_w / len(cube.azimuth_channels) * largest
    return {"rd": float(dbm(cube.noise_power_w)), "ra": float(dbm(beam))}
