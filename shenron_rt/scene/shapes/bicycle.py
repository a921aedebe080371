"""A bicycle without rider, 1.8 m long."""

from __future__ import annotations

import numpy as np

from ..._typing import ArrayLike, FloatArray, IntArray
from ...tags import SemanticTag
from ._piece import Piece, Wheel, ellipsoid, grid, join, tube, weld

__all__ = ["bicycle", "bicycle_wheels", "ridden"]

# 622 mm rims with 37 mm tyres, wheelbase 1.06 m: a common city bicycle.
_WHEEL_RADIUS, _TYRE = 0.33, 0.0185
_AXLES = (0.53, -0.53)
_TUBE = 0.016
_SEAT = np.array([-0.25, 0.0, 0.80])
_SIDES = 16


def bicycle() -> list[Piece]:
    """Return the bicycle: front +x, standing upright on z = 0, about 8 k triangles."""
    frame, saddle = _frame(), _saddle()
    rims, tyres = ([_wheel(name, x) for x in _AXLES] for name in ("rim", "tyre"))
    return [
        Piece("frame", "metal", SemanticTag.Bicycle, *join(frame, *rims)),
        Piece("tyres", "rubber", SemanticTag.Bicycle, *join(*tyres)),
        Piece("saddle", "plastic", SemanticTag.Bicycle, *saddle),
    ]


def ridden() -> list[Piece]:
    """Return the same bicycle with a piece for each rim and tyre, so that its wheels can turn."""
    wheels = [
        Piece(f"{where} {name}", material, SemanticTag.Bicycle, *_wheel(name, x))
        for where, x in zip(("front", "rear"), _AXLES, strict=True)
        for name, material in (("rim", "metal"), ("tyre", "rubber"))
    ]
    return [
        Piece("frame", "metal", SemanticTag.Bicycle, *_frame()),
        *wheels,
        Piece("saddle", "plastic", SemanticTag.Bicycle, *_saddle()),
    ]


def bicycle_wheels() -> tuple[Wheel, ...]:
    """Return the two wheels of :func:`ridden`."""
    return tuple(
        Wheel(f"{where} [rt]*", (x, 0.0, _WHEEL_RADIUS), _WHEEL_RADIUS)
        for where, x in zip(("front", "rear"), _AXLES, strict=True)
    )


def _wheel(name: str, x: float) -> tuple[FloatArray, IntArray]:
    """Return the rim or the tyre of the wheel at ``x`` [m]."""
    radius, thick = (_WHEEL_RADIUS - 0.03, 0.010) if name == "rim" else (_WHEEL_RADIUS - _TYRE, _TYRE)
    return _ring(radius, thick, np.array([x, 0.0, _WHEEL_RADIUS]))


def _saddle() -> tuple[FloatArray, IntArray]:
    perch = _SEAT + np.array([0.0, 0.0, 0.10])
    return join(ellipsoid([0.13, 0.07, 0.035], 5, perch), _bar(_SEAT, perch, 0.013))


def _frame() -> tuple[FloatArray, IntArray]:
    """Return tubes, forks, cranks and handlebar."""
    front, rear = (np.array([x, 0.0, _WHEEL_RADIUS]) for x in _AXLES)
    bottom, seat = np.array([-0.08, 0.0, 0.29]), _SEAT
    head_low, head_top = np.array([0.38, 0.0, 0.62]), np.array([0.34, 0.0, 0.92])
    bars = [(bottom, seat), (bottom, head_low), (seat, np.array([0.36, 0.0, 0.78])), (head_low, head_top)]
    metal = [_bar(a, b, _TUBE) for a, b in bars]
    for side in (0.06, -0.06):
        shift = np.array([0.0, side, 0.0])
        forks = ((head_low, front, 0.011), (seat, rear, 0.008), (bottom, rear, 0.009))
        metal += [_bar(start, end + shift, radius) for start, end, radius in forks]
        crank = bottom + 2.0 * shift
        metal.append(_bar(crank, crank + np.array([np.copysign(0.17, side), 0.0, 0.0]), 0.01))
    metal.append(_bar([0.30, -0.30, 1.02], [0.30, 0.30, 1.02], 0.012))
    metal.append(_bar(head_top, [0.30, 0.0, 1.02], 0.012))
    metal.append(_bar([-0.08, -0.12, 0.29], [-0.08, 0.12, 0.29], 0.02))
    return join(*metal)


def _bar(start: ArrayLike, end: ArrayLike, radius: float) -> tuple[FloatArray, IntArray]:
    a, b = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    return tube(np.stack([a, b]), radius, _SIDES)


def _ring(radius: float, thick: float, centre: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return a closed torus about an axis along y, standing on its rim; winding outward."""
    around = np.linspace(0.0, 2.0 * np.pi, 73)
    section = np.linspace(0.0, 2.0 * np.pi, 13)
    out = radius + thick * np.cos(section)[None]
    points = np.stack(
        [
            out * np.cos(around)[:, None],
            np.broadcast_to(thick * np.sin(section), (len(around), len(section))),
            out * np.sin(around)[:, None],
        ],
        axis=2,
    )
    vertices, faces = weld(*grid(points))
    return vertices + centre, faces
