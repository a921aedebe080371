"""How a person walks: angles of hips, knees, shoulders and elbows over the cycle of two steps.

R. Boulic, N. Magnenat Thalmann, D. Thalmann, "A global human walking model with real-time kinematic personification",
The Visual Computer 6 (1990) 344-358; V. C. Chen, "The Micro-Doppler Effect in Radar" (Artech House, 2011), takes it for
walking people. Its parameter is the speed over the length of the leg, RV [1/s].

Taken over: length and duration of the cycle, flexing at hip, knee, shoulder and elbow. Left out: the centimetres by
which pelvis and thorax rise, sway and twist, and the ankle. Assumption: control points are joined by cubics that are
level at each of them, which is the monotone cubic of the paper's figures but at the elbow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._typing import FloatArray
from .motion import BodyState
from .odometer import Ride
from .rotations import rotation_exp
from .shapes.people import ARM, LEG

__all__ = ["Limb", "leg_length", "pace", "walker_limbs"]

#: Legs (thigh and lower leg) as a share of the height, after the same program: 0.245 + 0.246.
_LEG_SHARE = 0.491
#: Height that the joints in shapes.people belong to [m].
_DRAWN_HEIGHT = 1.80
#: The model ends here; faster people run [1/s].
_FASTEST = 3.0

# Control points: where RV = 0, 0.5, 1.3 and 3, and between them linearly, each is at a share of the cycle and a flexion
# in degrees.
_RV = (0.0, 0.5, 1.3, 3.0)
_HIP = (((0.9, 0.9, 0.9, 0.9), (0.0, 25.0, 25.0, 31.0)), ((0.5,) * 4, (0.0, -15.0, -15.0, -15.0)))
_KNEE = (
    ((0.17, 0.17, 0.17, 0.12), (3.0, 3.0, 3.0, 25.0)),
    ((0.4,) * 4, (3.0, 3.0, 3.0, 3.0)),
    ((0.75, 0.75, 0.75, 0.70), (3.0, 70.0, 70.0, 65.0)),
    ((1.0, 1.0, 1.0, 0.97), (3.0, 3.0, 3.0, 6.0)),
)
_ELBOW = (
    ((0.05,) * 4, (3.0, 6.0, 14.0, 8.0)),
    ((0.5, 0.5, 0.51, 0.55), (3.0, 20.0, 44.0, 70.0)),
    ((0.9, 0.9, 0.9, 0.8), (3.0, 8.0, 17.0, 11.0)),
)
#: Swing of the shoulder [deg] a unit of RV, and its mean forward lean [deg].
_SHOULDER_PER_RV, _SHOULDER_LEAN = 9.88, 3.0


def leg_length(height: float) -> float:
    """Return the length of the leg of a person of ``height`` [m]."""
    return _LEG_SHARE * height


def pace(ride: Ride, height: float) -> tuple[float, float, float]:
    """Return cycles walked, cycles a second and RV [1/s] of a person of ``height`` [m].

    A cycle is 1.346 sqrt(RV) leg lengths long, so that sqrt(RV) / 1.346 cycles pass in a second.
    """
    per_root = 1.0 / (1.346 * np.sqrt(leg_length(height)))
    relative = ride.root_rate**2 / leg_length(height)
    return float(ride.root * per_root), float(ride.root_rate * per_root), float(min(relative, _FASTEST))


def _flexion(points: tuple[tuple[tuple[float, ...], tuple[float, ...]], ...], cycle: float, rv: float) -> FloatArray:
    """Return the angle [rad] and its derivative by the cycle [rad]."""
    at = np.array([np.interp(rv, _RV, x) for x, _ in points])
    angle = np.array([np.interp(rv, _RV, y) for _, y in points])
    order = np.argsort(at)
    at, angle = at[order], angle[order]
    at, angle = np.concatenate([at[-1:] - 1, at, at[:1] + 1]), np.concatenate([angle[-1:], angle, angle[:1]])
    share = cycle % 1.0
    k = int(np.clip(np.searchsorted(at, share, side="right") - 1, 0, len(at) - 2))
    length, rise = at[k + 1] - at[k], angle[k + 1] - angle[k]
    s = (share - at[k]) / length
    return np.radians([angle[k] + rise * s * s * (3 - 2 * s), rise * 6 * s * (1 - s) / length])


def _shoulder(cycle: float, rv: float) -> FloatArray:
    swing, phase = _SHOULDER_PER_RV * rv, 2.0 * np.pi * cycle
    return np.radians([_SHOULDER_LEAN - swing / 2.0 - swing * np.cos(phase), 2.0 * np.pi * swing * np.sin(phase)])


@dataclass(frozen=True)
class Limb:
    """The upper or the lower part of a leg or an arm.

    Parameters
    ----------
    height : float
        Of the person [m].
    arm : bool
        Else a leg.
    lower : bool
        Beyond the knee or the elbow.
    shift : float
        Share of the cycle by which this side is ahead.
    """

    height: float
    arm: bool
    lower: bool
    shift: float

    def at(self, ride: Ride) -> BodyState:
        """Return where the part is in the frame of its body, from where it stands straight.

        The dependence of the angles on a changing speed is left out of the velocities.
        """
        cycle, rate, rv = pace(ride, self.height)
        cycle += self.shift
        joints, bent = (ARM, "elbow") if self.arm else (LEG, "knee")
        upper = _shoulder(cycle, rv) if self.arm else _flexion(_HIP, cycle, rv)
        scale = self.height / _DRAWN_HEIGHT
        # forward is a turn about -y for hip, shoulder and elbow; a knee bends back
        first = _hinge(joints["shoulder" if self.arm else "hip"] * scale, -upper[0], -upper[1] * rate)
        if not self.lower:
            return first
        bend = -_flexion(_ELBOW, cycle, rv) if self.arm else _flexion(_KNEE, cycle, rv)
        return first.carrying(_hinge(joints[bent] * scale, bend[0], bend[1] * rate))


def _hinge(height: float, angle: float, rate: float) -> BodyState:
    """Return a turn by ``angle`` [rad] about an axis along y at a height [m]."""
    axis, center = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, height])
    turned = rotation_exp(angle * axis)
    origin = center - turned @ center
    return BodyState(turned, origin, np.cross(rate * axis, origin - center), rate * axis)


def walker_limbs(height: float) -> dict[str, Limb]:
    """Return the limbs of the walker by the pattern of their part names."""
    limbs = {}
    for side, shift in (("right", 0.0), ("left", 0.5)):
        limbs[f"{side} thigh"] = Limb(height, arm=False, lower=False, shift=shift)
        limbs[f"{side} lower leg"] = limbs[f"{side} shoe"] = Limb(height, arm=False, lower=True, shift=shift)
        limbs[f"{side} upper arm"] = Limb(height, arm=True, lower=False, shift=shift)
        limbs[f"{side} lower arm"] = limbs[f"{side} hand"] = Limb(height, arm=True, lower=True, shift=shift)
    return limbs
