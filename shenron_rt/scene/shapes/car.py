"""A car, 4.5 x 1.8 x 1.45 m, whose echo at 77 GHz has the level and the flashes measured on real ones.

It is a shape of its own, no model of a product. Radii of curvature decide its echo; docs/car-rcs.md shows how.
"""

from __future__ import annotations

import numpy as np

from ..._typing import BoolArray, FloatArray, IntArray
from ...tags import SemanticTag
from ._car_body import AXLES, WHEEL_RADIUS, Shell, columns, shell, tuck
from ._piece import Piece, Wheel, ellipsoid, grid, revolve

__all__ = ["car", "car_wheels"]

_HEIGHT = 1.45
_TRACK = 0.76
_TYRE_WIDTH = 0.215
_RIM_RADIUS = 0.205


def car() -> list[Piece]:
    """Return the car: nose +x, on z = 0, centred in x and y, about 29 k triangles.

    Body and pillars are painted metal, as is the band of the bumpers behind which real cars have their metal beam (no
    wave passes through plastic here); sills, lower bumpers and mirrors' feet are plastic, windows glass, lamps acrylic.
    """
    pieces = [*_body(), *_cabin(), *_wheels()]
    for side in (1.0, -1.0):
        housing = ellipsoid([0.07, 0.10, 0.065], 5, [0.62, side * 0.95, 0.985])
        name = "left mirror" if side > 0 else "right mirror"
        pieces.append(Piece(name, "car_paint", SemanticTag.Car, *housing))
    pieces.append(Piece("front plate", "metal", SemanticTag.Car, *_number_plate(0.0, 0.42)))
    pieces.append(Piece("rear plate", "metal", SemanticTag.Car, *_number_plate(np.pi, 0.80)))
    return pieces


def car_wheels() -> tuple[Wheel, ...]:
    """Return its four wheels."""
    return tuple(
        Wheel(f"{where} {side} [tr]*", (axle, sign * _TRACK, WHEEL_RADIUS), WHEEL_RADIUS)
        for axle, where in zip(AXLES, ("front", "rear"), strict=True)
        for sign, side in ((1.0, "left"), (-1.0, "right"))
    )


def _body() -> list[Piece]:
    whole = shell()
    turned = np.degrees(np.abs(whole.azimuth))
    with np.errstate(invalid="ignore"):
        low = whole.height < 0.34
        bumper = low & ((turned < 62.0) | (turned > 118.0))
        sill = (whole.height < 0.27) & ~bumper & np.isfinite(turned)
        headlamp = (turned > 24.0) & (turned < 60.0) & (whole.below_top > 0.03) & (whole.below_top < 0.09)
        taillamp = (turned > 125.0) & (turned < 162.0) & (whole.below_top > 0.06) & (whole.below_top < 0.17)
    rules = (
        ("bumpers", "plastic", bumper),
        ("sills", "plastic", sill),
        ("headlamps", "acrylic", headlamp),
        ("tail lamps", "acrylic", taillamp),
    )
    return _split(whole, rules, rest=("body", "car_paint"))


def _split(whole: Shell, rules: tuple[tuple[str, str, BoolArray], ...], rest: tuple[str, str]) -> list[Piece]:
    """Cut a closed shell into pieces; the faces no rule takes are the first piece."""
    taken = np.zeros(len(whole.faces), dtype=bool)
    pieces = []
    for name, material, mask in rules:
        pieces.append(_cut(name, material, whole.vertices, whole.faces[mask & ~taken]))
        taken |= mask
    return [_cut(*rest, whole.vertices, whole.faces[~taken]), *pieces]


def _cut(name: str, material: str, vertices: FloatArray, faces: IntArray) -> Piece:
    used, local = np.unique(faces, return_inverse=True)
    return Piece(name, material, SemanticTag.Car, vertices[used], local.reshape(-1, 3).astype(np.int32))


def _cabin() -> list[Piece]:
    """Lofted superellipses from inside the body to the roof, split into windows and painted pillars."""
    z = np.array([0.85, 0.93, 0.97, *np.linspace(1.01, 1.37, 9)])
    roof = np.cos(np.linspace(0.0, np.pi / 2.0, 10))[1:]
    around = np.linspace(-np.pi, np.pi, 96, endpoint=False)
    front = np.interp(z, [0.85, 1.37], [1.20, 0.28])
    back = np.interp(z, [0.85, 1.37], [-2.00, -1.22])
    wide = np.interp(z, [0.85, 1.37], [0.80, 0.60])
    shrink = np.concatenate([[0.0], np.ones(len(z)), roof])
    front, back, wide = (np.concatenate([v[:1], v, np.full(len(roof), v[-1])]) for v in (front, back, wide))
    height = np.concatenate([z[:1], z, 1.37 + (_HEIGHT - 1.37) * np.sqrt(1.0 - roof**2)])
    ring = np.stack([_root(np.cos(around)), _root(np.sin(around))], axis=1)
    x = 0.5 * (front + back)[:, None] + 0.5 * (front - back)[:, None] * shrink[:, None] * ring[:, 0]
    y = wide[:, None] * shrink[:, None] * ring[:, 1]
    vertices, faces = grid(np.stack([x, y, np.broadcast_to(height[:, None], x.shape)], axis=2), wrap=True)
    centre = vertices[faces].mean(axis=1)
    glazed = (centre[:, 2] > 0.97) & (centre[:, 2] < 1.36)
    turned = np.degrees(np.abs(np.arctan2(centre[:, 1] / 0.7, (centre[:, 0] + 0.43) / 1.2)))
    pillar_b = np.abs(centre[:, 0] + 0.25) < 0.05
    windscreen = glazed & (turned < 38.0)
    rear = glazed & (turned > 142.0)
    sides = glazed & (turned > 47.0) & (turned < 133.0) & ~pillar_b
    panes = (("windscreen", windscreen), ("rear window", rear), ("side windows", sides))
    pieces = [_cut(name, "glass", vertices, faces[mask]) for name, mask in panes]
    return [*pieces, _cut("roof and pillars", "car_paint", vertices, faces[~(windscreen | rear | sides)])]


def _root(values: FloatArray) -> FloatArray:
    """Superellipse of exponent 4: sharper corners than an ellipse, no flat side."""
    rooted: FloatArray = np.sign(values) * np.sqrt(np.abs(values))
    return rooted


def _wheels() -> list[Piece]:
    """Tyres with rounded shoulders and rims bulging outward, so that no flat disc flashes at the side."""
    half, deep = _TYRE_WIDTH / 2.0, 0.035
    bend = np.linspace(0.0, np.pi / 2.0, 4)
    shoulder = np.stack([WHEEL_RADIUS - deep + deep * np.sin(bend), half - deep + deep * np.cos(bend)], axis=1)
    wall = np.stack([np.linspace(_RIM_RADIUS, WHEEL_RADIUS - deep, 3)[:-1], np.zeros(2)], axis=1)
    wall[:, 1] = half - 0.012 + 0.012 * np.sin(np.linspace(0.0, np.pi / 2.0, 3)[:-1])
    outer = np.concatenate([wall, shoulder])
    loop = np.concatenate([outer * [1.0, -1.0], outer[::-1]])
    tyre = revolve(np.concatenate([[[0.0, -0.07]], loop, [[0.0, 0.07]]]), 48)
    r = np.linspace(_RIM_RADIUS, 0.0, 10)
    dish = revolve(np.stack([r, 0.066 + 0.035 * (1.0 - (r / _RIM_RADIUS) ** 2)], axis=1), 48)
    lying = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    pieces = []
    for axle, where in zip(AXLES, ("front", "rear"), strict=True):
        for name, material, surface in (("tyre", "rubber", tyre), ("rim", "metal", dish)):
            left = Piece(f"{where} left {name}", material, SemanticTag.Car, *surface)
            left = left.moved([axle, _TRACK, WHEEL_RADIUS], lying)
            right = left.mirrored()
            pieces += [left, Piece(f"{where} right {name}", material, SemanticTag.Car, right.vertices, right.faces)]
    return pieces


def _number_plate(azimuth: float, centre_height: float) -> tuple[FloatArray, IntArray]:
    """Return a 0.52 x 0.11 m plate bent along the bumper, 1 cm in front of it, as an open sheet."""
    half = columns()
    forward = 1.0 if azimuth == 0.0 else -1.0
    order = slice(None) if forward > 0 else slice(None, None, -1)
    across = np.linspace(-0.26, 0.26, 14)
    x = np.interp(np.abs(across), half.y[order][: len(half.y) // 3], half.x[order][: len(half.y) // 3])
    z = np.linspace(centre_height - 0.055, centre_height + 0.055, 6)
    inward = tuck(z[:, None], np.broadcast_to(x, (1, len(x)))[0])
    out = x + forward * (0.01 - inward)
    y = np.broadcast_to(across * forward, out.shape)
    return grid(np.stack([out, y, np.broadcast_to(z[:, None], out.shape)], axis=2))
