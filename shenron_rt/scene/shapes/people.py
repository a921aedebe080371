"""A standing adult, the proportions of the soft pedestrian targets."""

from __future__ import annotations

import numpy as np

from ..._typing import FloatArray, IntArray
from ...tags import SemanticTag
from ._piece import Piece, ellipsoid, grid, join, tube

__all__ = ["ARM", "LEG", "pedestrian", "walker"]

# Body proportions at a height of 1.80 m, after the adult target of ISO 19206-2: shoulders 0.50 m wide, hip at 0.92 m.
_TARGET_HEIGHT = 1.80


def pedestrian(h: float = 1.75, stride: float = 0.6) -> list[Piece]:
    """Return a walking adult of height ``h`` facing +x, feet ``stride`` apart, about 9 k triangles [m].

    Head and hands are skin, the rest clothing, the shoes rubber. Origin on the ground below the hip.
    """
    scale = h / _TARGET_HEIGHT
    half = stride / 2.0 / scale
    leg = 0.92 - 0.10
    # Both feet reach the ground however long the stride: the hip sinks as it does in walking.
    hip = 0.10 + np.sqrt(max(leg**2 - half**2, (0.3 * leg) ** 2))
    rise = hip - 0.92
    cloth = [_torso(rise)]
    skin = [ellipsoid([0.105, 0.08, 0.135], 12, [0.02, 0.0, 1.665 + rise]), _neck(rise)]
    shoes = []
    for side, forward in ((1.0, half), (-1.0, -half)):
        foot = np.array([forward, side * 0.10, 0.10])
        top = np.array([0.0, side * 0.10, hip])
        knee = 0.5 * (foot + top) + [0.04, 0.0, 0.0]
        cloth.append(tube(_bent(top, knee, foot), np.linspace(0.085, 0.045, 9), 20))
        shoes.append(ellipsoid([0.14, 0.05, 0.06], 5, foot + np.array([0.05, 0.0, -0.04])))
        shoulder = np.array([0.0, side * 0.21, 1.43 + rise])
        hand = np.array([-0.7 * forward, side * 0.27, 0.86 + rise])
        elbow = 0.5 * (shoulder + hand) + [-0.05, side * 0.02, 0.0]
        cloth.append(tube(_bent(shoulder, elbow, hand), np.linspace(0.055, 0.035, 9), 16))
        skin.append(ellipsoid([0.04, 0.03, 0.08], 4, hand + np.array([0.0, 0.0, -0.05])))
    parts = (("clothes", "clothing", cloth), ("skin", "skin", skin), ("shoes", "rubber", shoes))
    top_of_head = 1.80 + rise
    return [
        Piece(name, material, SemanticTag.Pedestrians, vertices * [scale, scale, h / top_of_head], faces)
        for name, material, patches in parts
        for vertices, faces in [join(*patches)]
    ]


#: Joints of the walker for a height of 1.80 m: y to either side and heights of hip, knee, shoulder and elbow [m].
LEG = {"y": 0.10, "hip": 0.92, "knee": 0.51}
ARM = {"y": 0.24, "shoulder": 1.43, "elbow": 1.14}


def walker(h: float = 1.75) -> list[Piece]:
    """Return an adult of height ``h`` facing +x, standing straight, in pieces cut at the joints [m].

    Torso, head, and for each side thigh, lower leg, shoe, upper arm, lower arm and hand. The cuts overlap, so that a
    bent limb has no gap.
    """
    cloth = [("torso", _torso(0.0))]
    skin = [("head", join(ellipsoid([0.105, 0.08, 0.135], 12, [0.02, 0.0, 1.665]), _neck(0.0)))]
    shoes = []
    for sign, side in ((1.0, "left"), (-1.0, "right")):
        leg, arm = sign * LEG["y"], sign * ARM["y"]
        limbs = (
            ("thigh", leg, LEG["hip"], LEG["knee"], 0.085, 0.062, 20),
            ("lower leg", leg, LEG["knee"], 0.10, 0.062, 0.045, 20),
            ("upper arm", arm, ARM["shoulder"], ARM["elbow"], 0.055, 0.045, 16),
            ("lower arm", arm, ARM["elbow"], 0.86, 0.045, 0.035, 16),
        )
        for name, y, top, bottom, wide, narrow, n in limbs:
            path = np.column_stack([np.zeros(5), np.full(5, y), np.linspace(top + 0.02, bottom - 0.02, 5)])
            cloth.append((f"{side} {name}", tube(path, np.linspace(wide, narrow, 5), n)))
        shoes.append((f"{side} shoe", ellipsoid([0.14, 0.05, 0.06], 5, [0.05, leg, 0.06])))
        skin.append((f"{side} hand", ellipsoid([0.04, 0.03, 0.08], 4, [0.0, arm, 0.81])))
    scale = h / _TARGET_HEIGHT
    return [
        Piece(name, material, SemanticTag.Pedestrians, vertices * scale, faces)
        for material, patches in (("clothing", cloth), ("skin", skin), ("rubber", shoes))
        for name, (vertices, faces) in patches
    ]


def _torso(rise: float) -> tuple[FloatArray, IntArray]:
    """Stack of ellipses from the hip to the shoulders, closed at both ends."""
    height = np.array([0.82, 0.84, 0.92, 1.05, 1.20, 1.35, 1.44, 1.50, 1.53]) + rise
    deep = np.array([0.0, 0.10, 0.125, 0.11, 0.12, 0.125, 0.10, 0.06, 0.0])
    wide = np.array([0.0, 0.13, 0.18, 0.16, 0.18, 0.215, 0.21, 0.12, 0.0])
    fine = np.linspace(height[0], height[-1], 33)
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    depth, width = np.interp(fine, height, deep), np.interp(fine, height, wide)
    x, y = depth[:, None] * np.cos(angle), width[:, None] * np.sin(angle)
    return grid(np.stack([x, y, np.broadcast_to(fine[:, None], x.shape)], axis=2), wrap=True)


def _neck(rise: float) -> tuple[FloatArray, IntArray]:
    return tube([[0.0, 0.0, 1.48 + rise], [0.01, 0.0, 1.53 + rise], [0.02, 0.0, 1.58 + rise]], 0.055, 16)


def _bent(start: FloatArray, middle: FloatArray, end: FloatArray) -> FloatArray:
    """Return 9 points on the parabola through a joint, (9, 3) [m]."""
    t = np.linspace(0.0, 1.0, 9)[:, None]
    curve: FloatArray = 2.0 * (t - 0.5) * (t - 1.0) * start - 4.0 * t * (t - 1.0) * middle + 2.0 * t * (t - 0.5) * end
    return curve
