"""Where echoes fall in the cube, and what every detection is: direct, ghost, folded, noise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._typing import BoolArray, FloatArray
from ..constants import SPEED_OF_LIGHT
from ..dsp import Detections, RadarCube
from ..dsp.truth import attribute
from ..returns import Returns
from .cells import Look, look_at_detection
from .contributions import some_returns

__all__ = ["MAIN_LOBE_BINS", "Middle", "detection_labels", "looks_of", "middle_of", "near_cell"]

#: Half width between the first zeros of each window's response [bins]; where it has none, to its side-lobe level.
MAIN_LOBE_BINS = {"rect": 1.0, "hann": 2.0, "hamming": 2.0, "blackmanharris": 4.0, "taylor": 2.0, "chebyshev": 4.0}


class Middle(NamedTuple):
    """The middle of some echoes by power: position (3,) [m], range [m], range rate [m/s]."""

    position: FloatArray
    range_m: float
    velocity_mps: float


def middle_of(returns: Returns) -> Middle:
    """Return where some echoes are, each with the weight of its power."""
    weight = np.abs(returns.amplitude) ** 2
    if not weight.sum() > 0:
        weight = np.ones(len(returns))
    distance = np.linalg.norm(returns.position, axis=1)
    radial = np.einsum("ij,ij->i", returns.position, returns.velocity) / np.maximum(distance, 1e-9)
    direction = np.average(returns.position / np.maximum(distance, 1e-9)[:, None], axis=0, weights=weight)
    away = float(np.average(distance, weights=weight))
    unit = direction / max(float(np.linalg.norm(direction)), 1e-9)
    return Middle(unit * away, away, float(np.average(radial, weights=weight)))


def near_cell(look: Look, returns: Returns) -> tuple[BoolArray, BoolArray]:
    """Tell which echoes lie within the main lobe around a cell, (n,) in range and (n,) in (folded) Doppler."""
    cube, p = look.cube, look.cube.profile
    distance = np.maximum(np.linalg.norm(returns.position, axis=1), 1e-9)
    radial = np.einsum("ij,ij->i", returns.position, returns.velocity) / distance
    doppler_hz = radial * (2 * p.center_hz / SPEED_OF_LIGHT)
    apparent = distance + doppler_hz * (SPEED_OF_LIGHT / (2 * p.slope_hz_per_s))
    near = []
    lengths = (p.waveform.samples, p.waveform.chirps)
    at = (apparent / cube.range_step_m, doppler_hz * cube.n_fft[1] * p.loop_period_s + cube.n_fft[1] // 2)
    for axis, (bins, cell, name) in enumerate(
        zip(at, (look.row, look.column), (cube.range_window, cube.doppler_window), strict=True)
    ):
        size = cube.n_fft[axis]
        off = (bins - cell + size / 2) % size - size / 2
        near.append(np.abs(off) <= MAIN_LOBE_BINS[name] * size / lengths[axis])
    return near[0], near[1]


def looks_of(cube: RadarCube, detections: Detections) -> list[Look]:
    """Return the cell and beam of every detection."""
    t = detections
    return [
        look_at_detection(cube, *(float(v) for v in row))
        for row in zip(t.range, t.velocity, t.azimuth, t.elevation, strict=True)
    ]


def detection_labels(cube: RadarCube, detections: Detections, returns: Returns) -> tuple[str, ...]:
    """Return what each detection is.

    Returns
    -------
    tuple of str
        ``direct``, or ``ghost`` where echoes that show their object elsewhere bring most of the power into its cell;
        with ``folded`` where its velocity is known to be; ``noise`` where no echo accounts for it.
    """
    looks = looks_of(cube, detections)
    row, column = (np.array([getattr(look, name) for look in looks], dtype=np.int64) for name in ("row", "column"))
    sine, elevation = (np.array([getattr(look, name) for look in looks]) for name in ("sine", "sine_elevation"))
    ghost = _elsewhere(returns, cube.profile.range_resolution_m)
    power = [
        attribute(cube, some_returns(returns, part), row, column, sine, elevation).power for part in (~ghost, ghost)
    ]
    labels = []
    for i in range(len(detections)):
        if detections.object_id[i] < 0:
            labels.append("noise")
            continue
        label = "ghost" if power[1][i] > power[0][i] else "direct"
        labels.append(f"{label}, folded" if detections.ambiguous[i] else label)
    return tuple(labels)


def _elsewhere(returns: Returns, cell_m: float) -> BoolArray:
    """Tell which echoes over several surfaces show their object more than a cell from its first surfaces, (n,)."""
    from scipy.spatial import cKDTree

    several = returns.bounces > 1
    ghost = several.copy()  # of an object without first surfaces nothing is where it is
    for number in np.unique(returns.object_id[several]):
        own = returns.object_id == number
        surface = returns.position[own & ~several]
        if len(surface):
            rows = np.flatnonzero(own & several)
            distance, _ = cKDTree(surface).query(returns.position[rows])
            ghost[rows] = np.asarray(distance) > cell_m
    return ghost
