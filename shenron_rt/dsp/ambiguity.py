"""Doppler ambiguity: which multiple of 2 v_max belongs to a folded velocity.

Both methods look for each detection among the detections of a second look at the same targets, and try the velocities
v + q 2 v_max one by one. A velocity says where the target must then stand in the other look, and at which folded
velocity. Another burst of the same frame, at another chirp interval, is told by the velocity (dual PRF, the Chinese
remainder theorem with noise); an earlier frame at the same interval is told by the range it has changed since.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .._typing import BoolArray, FloatArray, IntArray
from ..constants import SPEED_OF_LIGHT
from ..errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..config.profile import RadarProfile
    from .cube import RadarCube
    from .detections import Detections

__all__ = ["AMBIGUITY_METHODS", "Look", "Unfolding", "least_interval_s", "other_looks", "unfold"]

#: What ``detect`` takes for ``ambiguity``.
AMBIGUITY_METHODS = ("staggered", "two_frame", "tdm_phase")
#: No target closes or recedes faster [m/s]: two cars at 180 km/h each.
VELOCITY_LIMIT_MPS = 100.0
#: How far off a target may be from where a velocity puts it: [range and Doppler bins], [m/s^2] of a braking car, [dB].
_GATE_BINS, _ACCELERATION_MPS2, _GATE_POWER_DB = 1.0, 10.0, 10.0
#: The runner-up must be this much worse, in sums of squared gates, or the answer is not unique.
_MARGIN = 0.5


@dataclass(frozen=True)
class Look:
    """Detections of one burst or frame, as their radar reported them.

    Parameters
    ----------
    table : (n,) structured array
        Rows of ``Detections``.
    profile : RadarProfile
        Of the burst.
    mid_frame_s : float
        Time to which the ranges of the table hold [s].
    mid_offset_s : float
        Middle of the chirps that measured them, after that [s].
    """

    table: NDArray[Any]
    profile: RadarProfile
    mid_frame_s: float = 0.0
    mid_offset_s: float = 0.0

    @property
    def time_s(self) -> float:
        """Time of the measurement [s]."""
        return self.mid_frame_s + self.mid_offset_s

    @property
    def span_mps(self) -> FloatArray:
        """(n,) velocity that looks the same, c / (2 T (f_c - k tau)): 2 v_max at each target's delay [m/s]."""
        seen = self.profile.center_hz - self.profile.slope_hz_per_s * 2 * self.table["range"] / SPEED_OF_LIGHT
        return np.asarray(SPEED_OF_LIGHT / (2 * seen * self.profile.loop_period_s), dtype=np.float64)

    @property
    def beat_range_m(self) -> FloatArray:
        """(n,) range of the beat frequency: what was corrected with the reported velocity, put back [m]."""
        corrected = self.mid_offset_s + self.profile.center_hz / self.profile.slope_hz_per_s
        return np.asarray(self.table["range"] + corrected * self.table["velocity"], dtype=np.float64)


@dataclass(frozen=True)
class Unfolding:
    """Multiples of 2 v_max to add, (n,), 0 where ``resolved`` is false, and whether there was one answer."""

    fold: IntArray
    resolved: BoolArray


def other_looks(
    cube: RadarCube,
    method: str,
    previous: Detections | None,
    interval_s: float | None,
    detect: Callable[[RadarCube], Detections],
) -> list[Look]:
    """Return what a method compares the detections of ``cube`` with; nothing where it needs none or there is none.

    Parameters
    ----------
    cube : RadarCube
        Of the whole frame.
    method, previous, interval_s
        As for ``detect``.
    detect : callable
        Finds the detections of another burst.

    Raises
    ------
    InputError
        An unknown method, ``staggered`` with one burst, ``two_frame`` with a previous frame and no interval.
    """
    if method not in AMBIGUITY_METHODS:
        raise InputError(
            f"detect: unknown ambiguity {method!r}; allowed: None, {', '.join(map(repr, AMBIGUITY_METHODS))}"
        )
    if method == "staggered":
        if not cube.bursts:
            raise InputError(
                f"detect: ambiguity 'staggered' needs a profile with stagger: burst and several chirp_period_s; "
                f"{cube.profile.name!r} has one burst a frame"
            )
        return [Look(detect(burst).table, burst.profile, 0.0, burst.mid_offset_s) for burst in cube.bursts[1:]]
    if method == "tdm_phase" or previous is None:
        return []
    if interval_s is None or not interval_s > 0:
        raise InputError(f"detect: ambiguity 'two_frame' needs interval_s > 0 with a previous frame, got {interval_s}")
    burst = cube.bursts[0] if cube.bursts else cube
    return [Look(previous.table, burst.profile, -interval_s, burst.mid_offset_s)]


def _range_gate_m(profile: RadarProfile, interval_s: float) -> float:
    """Return how far a target may be from its prediction [m]."""
    return _GATE_BINS * profile.range_resolution_m + _ACCELERATION_MPS2 * interval_s**2 / 2


def least_interval_s(profile: RadarProfile) -> float:
    """Return the shortest interval of two frames whose range change tells velocities 2 v_max apart [s].

    Notes
    -----
    Velocities one fold apart move a target by 2 v_max t more or less. Gates of +-g about the two predictions are
    apart if v_max t > g, g = one range bin + a t^2 / 2 with a = 10 m/s^2.
    """
    v, a, g = profile.max_velocity_mps, _ACCELERATION_MPS2, _GATE_BINS * profile.range_resolution_m
    root = v**2 - 2 * a * g
    if root < 0:
        return float("inf")
    return float((v - np.sqrt(root)) / a)


def unfold(own: Look, others: Sequence[Look]) -> Unfolding:
    """Find the velocity of every detection among those of other looks.

    Parameters
    ----------
    own : Look
    others : sequence of Look
        Bursts at other chirp intervals, or an earlier frame. A target must show in all of them.

    Returns
    -------
    Unfolding

    Raises
    ------
    InputError
        A look neither differs in its chirp interval nor lies far enough away in time.

    Notes
    -----
    Cost of a velocity in one look: the least sum of squares of (range off its prediction / gate), (folded velocity off
    / gate), (direction cosine off / beam) and (power off / 10 dB) over the detections inside all gates. The velocity of
    the least total cost is taken if the next one costs 0.5 more.
    """
    reach = int(np.ceil(VELOCITY_LIMIT_MPS / (2 * own.profile.max_velocity_mps) + 0.5))
    folds = np.arange(-reach, reach + 1)
    velocity = own.table["velocity"][:, None] + folds * own.span_mps[:, None]
    cost = np.where(np.abs(velocity) <= VELOCITY_LIMIT_MPS, 0.0, np.inf)
    for other in others:
        _check(own, other)
        cost = cost + _cost(own, other, velocity)
    if not cost.size or not others:
        return Unfolding(np.zeros(len(cost), dtype=np.int64), np.zeros(len(cost), dtype=bool))
    best = np.argmin(cost, axis=1)
    ordered = np.sort(cost, axis=1)
    resolved = np.isfinite(ordered[:, 0]) & (ordered[:, 1] > ordered[:, 0] + _MARGIN)
    return Unfolding(np.where(resolved, folds[best], 0), resolved)


def _check(own: Look, other: Look) -> None:
    """Refuse a look that cannot tell one fold from none."""
    same = abs(own.profile.loop_period_s - other.profile.loop_period_s) < 1e-3 * own.profile.loop_period_s
    interval = abs(own.time_s - other.time_s)
    least = least_interval_s(own.profile)
    if same and not interval >= least:
        raise InputError(
            f"two_frame: the frames lie {interval:.4g} s apart; velocities {2 * own.profile.max_velocity_mps:.4g} m/s "
            f"apart need at least {least:.3g} s with range bins of {own.profile.range_resolution_m:.3g} m"
        )


def _cost(own: Look, other: Look, velocity: FloatArray) -> FloatArray:
    """Return (n, n_fold) costs; infinite where no detection of the other look fits."""
    step = other.time_s - own.time_s
    bin_mps = max(own.profile.velocity_resolution_mps, other.profile.velocity_resolution_mps)
    gate_v = _GATE_BINS * bin_mps + _ACCELERATION_MPS2 * abs(step)
    gate_r = _range_gate_m(own.profile, abs(step))
    sine = [np.sin(look.table["azimuth"]) for look in (own, other)]
    y = own.profile.positions_m[:, 1]
    beam = own.profile.wavelength_m / (float(np.ptp(y)) + own.profile.wavelength_m / 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        level = [10 * np.log10(look.table["power"]) for look in (own, other)]
    # while chirps of a loop take turns a fold also turns the direction, differently in every burst
    known = own.profile.n_chirps_per_loop == 1
    alike = _gated((sine[0][:, None] - sine[1]) / beam * known)
    alike = alike + _gated((level[0][:, None] - level[1]) / _GATE_POWER_DB)
    cost = np.full(velocity.shape, np.inf)
    for q in range(velocity.shape[1]):
        v = velocity[:, q, None]
        off_r = own.beat_range_m[:, None] + v * step - other.beat_range_m
        off_v = v - other.table["velocity"]
        off_v = off_v - np.rint(off_v / other.span_mps) * other.span_mps
        total = alike + _gated(off_r / gate_r) + _gated(off_v / gate_v)
        cost[:, q] = total.min(axis=1, initial=np.inf)
    return cost


def _gated(off: FloatArray) -> FloatArray:
    """Return the square, infinite outside [-1, 1]."""
    return np.asarray(np.where(np.abs(off) <= 1, off**2, np.inf), dtype=np.float64)
