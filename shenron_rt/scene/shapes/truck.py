"""A two-axle box truck, 8 x 2.5 x 3.6 m."""

from __future__ import annotations

import numpy as np

from ..._typing import FloatArray, IntArray
from ...tags import SemanticTag
from ._outline import half_outline
from ._piece import Piece, Wheel, box, grid, join, revolve

__all__ = ["truck", "truck_wheels"]

_LENGTH, _WIDTH, _HEIGHT = 8.0, 2.5, 3.6
_FLOOR = 1.05
_CAB_LENGTH, _CAB_TOP = 2.0, 2.85
_GAP = 0.12
# Panels of real boxes bulge and dent by centimetres; a plane one would flash like a mirror of its Fresnel zone.
_BULGE = 0.03
_PANEL_FACET = 0.2
_WHEEL_RADIUS, _WHEEL_WIDTH = 0.48, 0.30
_AXLES = (2.75, -2.1)
_HUB = _WIDTH / 2.0 - _WHEEL_WIDTH / 2.0 - 0.03


def truck() -> list[Piece]:
    """Return the truck: front +x, on z = 0, centred in x and y, about 10 k triangles.

    Cab painted metal with a windscreen and side windows, cargo box metal with slightly bulging sides, frame and rear
    underrun bar metal, tyres rubber.
    """
    cargo_length = _LENGTH - _CAB_LENGTH - _GAP
    cargo = _bulging_box(cargo_length, _WIDTH, _HEIGHT - _FLOOR)
    middle = [-_LENGTH / 2.0 + cargo_length / 2.0, 0.0, (_HEIGHT + _FLOOR) / 2.0]
    rails = [_placed(box(_LENGTH - 1.2, 0.08, 0.25), [-0.2, side * 0.42, 0.88]) for side in (1.0, -1.0)]
    rails += [_placed(box(0.12, 2.3, 0.12), [-_LENGTH / 2.0 + 0.12, 0.0, 0.55])]
    rails += [_placed(box(0.06, 0.08, 0.40), [-_LENGTH / 2.0 + 0.15, side * 0.42, 0.78]) for side in (1.0, -1.0)]
    pieces = [
        Piece("cargo box", "metal", SemanticTag.Truck, cargo[0] + np.array(middle), cargo[1]),
        Piece("frame", "metal", SemanticTag.Truck, *join(*rails)),
        *_cab(),
    ]
    half = _WHEEL_WIDTH / 2.0
    r, w = _WHEEL_RADIUS, half - 0.04
    profile = [[0.0, -w], [0.28, -w], [0.30, -half], [r - 0.04, -half], [r, -w]]
    tyre = revolve([*profile, *([a, -b] for a, b in reversed(profile))], 48)
    lying = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    for axle, where in zip(_AXLES, ("front", "rear"), strict=True):
        for side, name in ((1.0, "left"), (-1.0, "right")):
            wheel = Piece(f"{where} {name} wheel", "rubber", SemanticTag.Truck, *tyre)
            pieces.append(wheel.moved([axle, side * _HUB, _WHEEL_RADIUS], lying))
    return pieces


def truck_wheels() -> tuple[Wheel, ...]:
    """Return its four wheels."""
    return tuple(
        Wheel(f"{where} {side} wheel", (axle, sign * _HUB, _WHEEL_RADIUS), _WHEEL_RADIUS)
        for axle, where in zip(_AXLES, ("front", "rear"), strict=True)
        for sign, side in ((1.0, "left"), (-1.0, "right"))
    )


def _placed(surface: tuple[FloatArray, IntArray], xyz: list[float]) -> tuple[FloatArray, IntArray]:
    return surface[0] + np.array(xyz), surface[1]


def _bulging_box(length: float, width: float, height: float) -> tuple[FloatArray, IntArray]:
    """Return a closed box about the origin whose side faces and rear bulge like cushions, inside the given size."""
    inner = np.array([length, width, height]) - 2.0 * _BULGE
    patches = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for sign in (1.0, -1.0):
            a, b = (np.linspace(-1.0, 1.0, int(np.ceil(inner[k] / _PANEL_FACET)) + 1) for k in (u, v))
            b, a = np.meshgrid(b, a * sign, indexing="ij")
            lattice = np.zeros((*a.shape, 3))
            lattice[..., u], lattice[..., v] = a * inner[u] / 2.0, b * inner[v] / 2.0
            lattice[..., axis] = sign * (inner[axis] / 2.0 + _BULGE * (1.0 - a**2) * (1.0 - b**2))
            patches.append(grid(lattice))
    return join(*patches)


def _cab() -> list[Piece]:
    """Return the cab: a rounded prism that leans back above the waist, split at its windows."""
    outline = half_outline(_CAB_LENGTH, _WIDTH - 0.05, 0.22, (20.0, 25.0, 20.0))
    half = outline.resampled(np.interp(np.linspace(0.0, outline.arc[-1], 60), outline.arc, outline.azimuth))
    x, y = np.concatenate([half.x, half.x[-2:0:-1]]), np.concatenate([half.y, -half.y[-2:0:-1]])
    z = np.linspace(0.45, _CAB_TOP, 31)
    lean = np.where(z > 1.5, (z - 1.5) ** 2 / 8.0, (z - 1.5) ** 2 / 16.0)
    x = x[None] - lean[:, None] * np.clip(x / _CAB_LENGTH + 0.5, 0.0, 1.0)
    y = y[None] * (1.0 - 0.4 * lean[:, None] / _WIDTH)
    side = np.stack([x, y, np.broadcast_to(z[:, None], x.shape)], axis=2)
    bottom, top = (np.broadcast_to(ring.mean(axis=0), ring.shape) for ring in (side[0], side[-1]))
    vertices, faces = grid(np.concatenate([bottom[None], side, top[None]]), wrap=True)
    centre = vertices[faces].mean(axis=1)
    vertices = vertices + np.array([_LENGTH / 2.0 - _CAB_LENGTH / 2.0, 0.0, 0.0])
    glazed = (centre[:, 2] > 1.65) & (centre[:, 2] < 2.55)
    screen = glazed & (centre[:, 0] > 0.6) & (np.abs(centre[:, 1]) < 1.05)
    doors = glazed & (np.abs(centre[:, 0] - 0.15) < 0.4)
    parts = (("windscreen", "glass", screen), ("door windows", "glass", doors), ("cab", "car_paint", ~(screen | doors)))
    pieces = []
    for name, material, mask in parts:
        used, local = np.unique(faces[mask], return_inverse=True)
        triangles = local.reshape(-1, 3).astype(np.int32)
        pieces.append(Piece(name, material, SemanticTag.Truck, vertices[used], triangles))
    return pieces
