"""Where echoes fall in the cube, and what every detection is: direct, ghost, folded, noise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .._typing import BoolArray, FloatArray
from ..constants import SPEED_OF_LIGHT
from ..dsp import Detections, RadarCube
from ..returns import Returns
from .cells import Look, look_at_detection

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


def detection_labels(detections: Detections) -> tuple[str, ...]:
    """Return what each detection is.

    Returns
    -------
    tuple of str
        ``direct``, or ``ghost`` with its chain of objects where the echoes show their object elsewhere; with ``folded``
        where its velocity is known to be; ``noise`` where no echo accounts for it.
    """
    labels = []
    for i in range(len(detections)):
        if detections.object_id[i] < 0:
            labels.append("noise")
            continue
        label = f"ghost {detections.chain[i]}" if detections.ghost[i] else "direct"
        labels.append(f"{label}, folded" if detections.ambiguous[i] else label)
    return tuple(labels)
