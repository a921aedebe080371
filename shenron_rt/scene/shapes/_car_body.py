"""The painted shell of the car: a plan outline with a barrel-shaped flank, wheel arches, bonnet and boot lid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._typing import FloatArray, IntArray
from ._outline import Outline, half_outline
from ._piece import grid, join

__all__ = ["AXLES", "LENGTH", "WHEEL_RADIUS", "WIDTH", "Shell", "shell"]

#: Size without mirrors [m].
LENGTH, WIDTH = 4.5, 1.8
#: x of front and rear axle and radius of the tyres [m].
AXLES = (1.33, -1.33)
WHEEL_RADIUS = 0.33

# What fixes the echo (docs/car-rcs.md): radius at the corners in plan [m], half widths of the flatter stretches [deg],
# and the vertical radius of the band that a level radar sees at right angles [m].
_CORNER = 0.55
_SPREAD_DEG = (6.0, 14.0, 7.0)
_BAND_RADIUS = 6.5
_BAND_HALF_HEIGHT = 0.17
# Beyond the band the flank leans in with these radii, and rounds over into bonnet or shoulder with the last one [m].
_LEAN_RADIUS = 1.2
_TUCK_RADIUS = 0.4
_SHOULDER_RADIUS = 0.07
_SHOULDER_HEIGHT = 0.05

_CLEARANCE = 0.18
_ARCH_TOP = 0.69
_ARCH_HALF_LENGTH = 0.40

# Facets of length s on a radius R leave a two-way phase error k s^2 / (4 R); s = 0.02 sqrt(R) keeps it at 0.16 rad.
_FACET = 0.02
_ARCH_FACET = 0.03
_ROWS = 24
_SHOULDER_ROWS = 4
_LID_COLUMNS = 6


@dataclass(frozen=True, eq=False)
class Shell:
    """The closed shell with what each facet is.

    Parameters
    ----------
    vertices : (v, 3) float64
        Metres.
    faces : (f, 3) int32
    azimuth : (f,) float
        Azimuth of the outline's normal at flank facets [rad], -pi to pi; NaN on the lids.
    height, below_top : (f,) float
        Height of the centroid, and how far it lies below the upper edge there [m].
    """

    vertices: FloatArray
    faces: IntArray
    azimuth: FloatArray
    height: FloatArray
    below_top: FloatArray


def band_height(x: FloatArray) -> FloatArray:
    """Height at which the flank is widest [m]: low on the bumpers, higher along the doors."""
    return np.interp(x, [-2.25, -1.6, -0.6, 0.6, 1.6, 2.25], [0.64, 0.66, 0.68, 0.67, 0.64, 0.62])


def upper_edge(x: FloatArray) -> FloatArray:
    """Height of the edge to bonnet, shoulder and boot lid [m]."""
    return np.interp(x, [-2.25, -1.8, -1.0, 0.6, 1.2, 1.9, 2.25], [0.93, 0.99, 0.97, 0.93, 0.91, 0.86, 0.81])


def lower_edge(x: FloatArray) -> FloatArray:
    """Height of the sill and of the wheel arches [m]."""
    reach = np.min([np.abs(x - axle) for axle in AXLES], axis=0) / _ARCH_HALF_LENGTH
    height: FloatArray = _CLEARANCE + (_ARCH_TOP - _CLEARANCE) * np.sqrt(np.clip(1.0 - reach**3, 0.0, None))
    return height


def tuck(height: FloatArray, x: FloatArray) -> FloatArray:
    """How far the flank lies inside the outline [m], for heights (m, n) over outline points x (n,)."""
    off = height - band_height(x)
    above, below = (np.clip(side - _BAND_HALF_HEIGHT, 0.0, None) for side in (off, -off))
    shoulder = np.clip(height - (upper_edge(x) - _SHOULDER_HEIGHT), 0.0, None)
    inward: FloatArray = off**2 / (2.0 * _BAND_RADIUS) + above**2 / (2.0 * _LEAN_RADIUS)
    inward += below**2 / (2.0 * _TUCK_RADIUS) + shoulder**2 / (2.0 * _SHOULDER_RADIUS)
    return inward


def columns() -> Outline:
    """Return the outline sampled so that facets follow its curvature and the arches."""
    fine = half_outline(LENGTH, WIDTH, _CORNER, _SPREAD_DEG)
    step = _FACET * np.sqrt(fine.radius)
    near_arch = np.min([np.abs(fine.x - axle) for axle in AXLES], axis=0) < _ARCH_HALF_LENGTH + _ARCH_FACET
    step = np.where(near_arch, np.minimum(step, _ARCH_FACET), step)
    density = np.concatenate([[0.0], np.cumsum(np.diff(fine.arc) / (0.5 * (step[1:] + step[:-1])))])
    count = int(np.ceil(density[-1]))
    return fine.resampled(np.interp(np.linspace(0.0, density[-1], count + 1), density, fine.azimuth))


def shell() -> Shell:
    """Build the shell: flank all round, a lid above, a floor below."""
    half = columns()
    x = np.concatenate([half.x, half.x[-2:0:-1]])
    y = np.concatenate([half.y, -half.y[-2:0:-1]])
    azimuth = np.concatenate([half.azimuth, -half.azimuth[-2:0:-1]])
    low, top = lower_edge(x), upper_edge(x)
    split = (top - _SHOULDER_HEIGHT - low) / (top - low)
    rows = np.concatenate(
        [
            np.linspace(0.0, 1.0, _ROWS, endpoint=False)[:, None] * split,
            split + np.linspace(0.0, 1.0, _SHOULDER_ROWS + 1)[:, None] * (1.0 - split),
        ]
    )
    height = low + (top - low) * rows
    inward = tuck(height, x)
    flank = np.stack([x - inward * np.cos(azimuth), y - inward * np.sin(azimuth), height], axis=2)
    vertices, faces = grid(flank, wrap=True)
    n, m = len(half.x), len(x)
    lid = _lid(flank[-1], n, bulge=0.035)
    floor = _lid(flank[0], n, bulge=0.0)
    points, triangles = join((vertices, faces), lid, (floor[0], floor[1][:, ::-1]))
    column = faces[:, 0] % m
    pad = len(triangles) - len(faces)
    centre = points[triangles].mean(axis=1)
    edge = upper_edge(centre[:, 0])
    return Shell(
        points,
        triangles,
        np.concatenate([azimuth[column], np.full(pad, np.nan)]),
        centre[:, 2],
        edge - centre[:, 2],
    )


def _lid(rim: FloatArray, n: int, bulge: float) -> tuple[FloatArray, IntArray]:
    """Span a rim (m, 3) from its left half to its right half; ``bulge`` [m] raises the middle. Faces up."""
    left = rim[:n]
    right = rim[np.concatenate([[0], np.arange(len(rim) - 1, n - 1, -1), [n - 1]])]
    t = np.linspace(0.0, 1.0, _LID_COLUMNS + 1)[None, :, None]
    across = left[:, None] + t * (right - left)[:, None]
    wide = np.abs(left[:, 1]) / (WIDTH / 2.0)
    across[..., 2] += bulge * wide[:, None] * np.sin(np.pi * t[..., 0])
    return grid(across.transpose(0, 1, 2)[:, ::-1])
