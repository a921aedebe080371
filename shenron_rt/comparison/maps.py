"""How alike two power maps are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._typing import FloatArray
from ..dsp import RadarCube
from .record import Record

__all__ = ["MapPair", "compare_maps", "map_record", "pool_maps"]

_MAPS = ("range_doppler", "range_azimuth")
#: Above the noise, a cell holds an echo: 13 dB, exceeded by noise in one cell of 5e8 (exponential power).
_SIGNAL = 20.0


@dataclass(frozen=True)
class MapPair:
    """Two maps of one radar on the same cells.

    Parameters
    ----------
    name : str
    a, b : (n, m) float
        Power [W].
    floor : float
        Expected noise of a cell; what lies below it says nothing and counts as it [W].
    """

    name: str
    a: FloatArray
    b: FloatArray
    floor: float


def compare_maps(a: RadarCube, b: RadarCube) -> list[MapPair]:
    """Return the map pairs of two cubes of the same axes."""
    largest = max(1.0, float(np.log(a.data.shape[1])))
    # range_azimuth is a maximum over Doppler of beamformed cells, which noise fills to ln(n_velocity) times its mean
    floors = {"range_doppler": 1.0, "range_azimuth": largest / len(a.azimuth_channels)}
    level = max(a.noise_power_w, b.noise_power_w)
    return [MapPair(name, getattr(a, name), getattr(b, name), level * floors[name]) for name in _MAPS]


def pool_maps(frames: Sequence[Sequence[MapPair]]) -> list[MapPair]:
    """Return the mean power over frames of each kind of map; nothing where a frame has none."""
    if not all(frames):
        return []
    return [
        MapPair(
            pairs[0].name,
            np.mean([p.a for p in pairs], axis=0),
            np.mean([p.b for p in pairs], axis=0),
            max(p.floor for p in pairs),
        )
        for pairs in zip(*frames, strict=True)
    ]


def map_record(pair: MapPair) -> Record:
    """Return the figures of one pair.

    Notes
    -----
    Levels are 10 log10(max(P, floor)). ``correlation`` is Pearson's over the cells, of those levels in dB; in linear
    power (``correlation_linear``) a single strong cell decides. ``log_spectral_distance_db`` is the root mean square
    difference of the levels over all cells, ``_signal_db`` over the cells 13 dB above the floor on either side.
    """
    level_a, level_b = (10 * np.log10(np.maximum(p, pair.floor)) for p in (pair.a, pair.b))
    difference = level_b - level_a
    signal = (pair.a > _SIGNAL * pair.floor) | (pair.b > _SIGNAL * pair.floor)
    inside = difference[signal]
    return Record(
        correlation=_pearson(level_a, level_b),
        correlation_linear=_pearson(pair.a, pair.b),
        log_spectral_distance_db=float(np.sqrt(np.mean(difference**2))),
        log_spectral_distance_signal_db=float(np.sqrt(np.mean(inside**2))) if inside.size else None,
        mean_difference_signal_db=float(inside.mean()) if inside.size else None,
        signal_cells=int(signal.sum()),
        cells=int(signal.size),
        floor_dbw=float(10 * np.log10(pair.floor)),
    )


def _pearson(a: FloatArray, b: FloatArray) -> float | None:
    """Return the correlation; None where a map is constant."""
    x, y = a - a.mean(), b - b.mean()
    scale = float(np.sqrt(np.sum(x**2) * np.sum(y**2)))
    return float(np.sum(x * y) / scale) if scale > 0 else None
