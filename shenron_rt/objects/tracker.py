"""Tracks of objects: gating, global nearest neighbour, and the life of a track."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from .._typing import FloatArray
from ..errors import InputError
from .kalman import constant_velocity, predict, update

__all__ = ["Measurement", "Track", "Tracker", "TrackerSettings"]

Status = Literal["tentative", "confirmed"]


@dataclass(frozen=True)
class TrackerSettings:
    """What the tracker believes of its measurements and of what it tracks.

    Parameters
    ----------
    range_std_m, azimuth_std_deg, range_rate_std_mps : float
        Of an object's middle; larger than those of a point, since an extended object's echo wanders over it.
    acceleration_std_mps2 : float
        Of the objects, constant over a frame.
    speed_std_mps : float
        Of a new track across the line of sight, where nothing was measured.
    gate_probability : float
        Share of true measurements that pass the gate.
    confirm_hits, confirm_frames : int
        A track is confirmed when it has so many hits in its first so many frames, else it is dropped.
    max_misses : int
        A confirmed track is dropped after more frames than this without a hit.
    """

    range_std_m: float = 0.5
    azimuth_std_deg: float = 1.5
    range_rate_std_mps: float = 0.3
    acceleration_std_mps2: float = 3.0
    speed_std_mps: float = 10.0
    gate_probability: float = 0.99
    confirm_hits: int = 4
    confirm_frames: int = 5
    max_misses: int = 5

    def __post_init__(self) -> None:
        spreads = (
            self.range_std_m, self.azimuth_std_deg, self.range_rate_std_mps, self.acceleration_std_mps2,
            self.speed_std_mps,
        )  # fmt: skip
        if not min(spreads) > 0 or not 0 < self.gate_probability < 1:
            raise InputError("TrackerSettings: standard deviations must be > 0, gate_probability between 0 and 1")
        if not 1 <= self.confirm_hits <= self.confirm_frames or self.max_misses < 0:
            raise InputError(
                f"TrackerSettings: 1 <= confirm_hits <= confirm_frames and max_misses >= 0 are needed, got "
                f"{self.confirm_hits}, {self.confirm_frames}, {self.max_misses}"
            )


@dataclass(frozen=True, eq=False)
class Measurement:
    """One object as one frame shows it, in a frame of reference that does not move.

    Parameters
    ----------
    position : (2,) float
        [m].
    covariance : (2, 2) float
        [m^2].
    direction : (2,) float
        Unit vector from the radar to it.
    range_rate : float
        Without the radar's own motion: direction . velocity of the object [m/s].
    range_rate_std : float
        [m/s].
    fold_mps : float
        Range rates are known modulo this, 2 v_max; infinite where they do not fold [m/s].
    object_id : int
        Truth: the object behind most of its detections, -1 none.
    size_m : (2,) float
        Extent along both axes [m].
    detections : int
        How many it was made of.
    """

    position: FloatArray
    covariance: FloatArray
    direction: FloatArray
    range_rate: float
    range_rate_std: float
    fold_mps: float = math.inf
    object_id: int = -1
    size_m: tuple[float, float] = (0.0, 0.0)
    detections: int = 1

    @property
    def matrix(self) -> FloatArray:
        """(3, 4) what is measured of the state (x, y, v_x, v_y)."""
        H = np.zeros((3, 4))
        H[0, 0] = H[1, 1] = 1.0
        H[2, 2:] = self.direction
        return H

    @property
    def noise(self) -> FloatArray:
        """(3, 3) covariance of position and range rate."""
        R = np.zeros((3, 3))
        R[:2, :2] = self.covariance
        R[2, 2] = self.range_rate_std**2
        return R

    def innovation(self, state: FloatArray) -> FloatArray:
        """Return measured minus expected (3,), the range rate the short way round."""
        off = np.append(self.position - state[:2], self.range_rate - self.direction @ state[2:])
        if math.isfinite(self.fold_mps):
            off[2] = (off[2] + self.fold_mps / 2) % self.fold_mps - self.fold_mps / 2
        return np.asarray(off, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Track:
    """One object over time.

    Parameters
    ----------
    number : int
        Identity, from 1 up.
    state : (4,) float
        x, y, v_x, v_y in the frame of the measurements [m], [m/s].
    covariance : (4, 4) float
    status : "tentative" or "confirmed"
    age, hits, misses : int
        Frames since it began, frames with a measurement, frames since the last.
    last : Measurement
        The latest.
    """

    number: int
    state: FloatArray
    covariance: FloatArray
    status: Status
    age: int
    hits: int
    misses: int
    last: Measurement


@dataclass
class Tracker:
    """Follows objects from frame to frame.

    Parameters
    ----------
    settings : TrackerSettings
    tracks : list of Track
        All that are alive, tentative ones included.
    """

    settings: TrackerSettings = field(default_factory=TrackerSettings)
    tracks: list[Track] = field(default_factory=list)
    time_s: float | None = None
    _next: int = 1

    def step(self, time_s: float, measurements: Sequence[Measurement]) -> list[Track]:
        """Take in one frame.

        Parameters
        ----------
        time_s : float
            Later than that of the frame before [s].
        measurements : sequence of Measurement

        Returns
        -------
        list of Track
            The confirmed ones; ``misses`` above 0 where they are only predicted.
        """
        if self.time_s is not None and not time_s > self.time_s:
            raise InputError(f"Tracker: times must ascend, got {time_s} s after {self.time_s} s")
        if self.time_s is not None:
            F, Q = constant_velocity(time_s - self.time_s, self.settings.acceleration_std_mps2)
            self.tracks = [self._predicted(t, F, Q) for t in self.tracks]
        self.time_s = time_s
        pairs = self._assign(measurements)
        tracks = [
            self._hit(t, measurements[pairs[i]]) if i in pairs else replace(t, age=t.age + 1, misses=t.misses + 1)
            for i, t in enumerate(self.tracks)
        ]
        self.tracks = [t for t in tracks if self._lives(t)]
        taken = set(pairs.values())
        self.tracks += [self._born(m) for j, m in enumerate(measurements) if j not in taken]
        return [t for t in self.tracks if t.status == "confirmed"]

    @staticmethod
    def _predicted(track: Track, F: FloatArray, Q: FloatArray) -> Track:
        state, covariance = predict(track.state, track.covariance, F, Q)
        return replace(track, state=state, covariance=covariance)

    def _assign(self, measurements: Sequence[Measurement]) -> dict[int, int]:
        """Return the measurement of each track: least total of d^2 + ln det S, within the gates."""
        from scipy.optimize import linear_sum_assignment
        from scipy.special import gammaincinv

        if not (self.tracks and measurements):
            return {}
        gate = 2 * float(gammaincinv(1.5, self.settings.gate_probability))  # chi^2 of three degrees of freedom
        cost = np.full((len(self.tracks), len(measurements)), np.inf)
        for i, track in enumerate(self.tracks):
            for j, m in enumerate(measurements):
                S = m.matrix @ track.covariance @ m.matrix.T + m.noise
                off = m.innovation(track.state)
                squared = float(off @ np.linalg.solve(S, off))
                if squared <= gate:
                    cost[i, j] = squared + float(np.linalg.slogdet(S)[1])
        if not np.isfinite(cost).any():
            return {}
        # confirmed tracks choose first: what is only tried must not take their measurement
        pairs: dict[int, int] = {}
        for status in ("confirmed", "tentative"):
            rows = [i for i, t in enumerate(self.tracks) if t.status == status]
            columns = [j for j in range(len(measurements)) if j not in pairs.values()]
            part = cost[np.ix_(rows, columns)]
            known = np.isfinite(part)
            if not known.any():
                continue
            far = part[known].max() + np.ptp(part[known]) * min(part.shape) + 1e3
            chosen = linear_sum_assignment(np.where(known, part, far))
            pairs |= {rows[i]: columns[j] for i, j in zip(*chosen, strict=True) if known[i, j]}
        return pairs

    def _hit(self, track: Track, m: Measurement) -> Track:
        state, covariance = update(track.state, track.covariance, m.innovation(track.state), m.matrix, m.noise)
        hits = track.hits + 1
        confirmed = track.status == "confirmed" or hits >= self.settings.confirm_hits
        return replace(
            track, state=state, covariance=covariance, hits=hits, age=track.age + 1, misses=0, last=m,
            status="confirmed" if confirmed else "tentative",
        )  # fmt: skip

    def _lives(self, track: Track) -> bool:
        s = self.settings
        if track.status == "confirmed":
            return track.misses <= s.max_misses
        left = s.confirm_frames - track.age
        return track.hits + left >= s.confirm_hits

    def _born(self, m: Measurement) -> Track:
        """Start a track: the velocity along the line of sight was measured, across it nothing is known."""
        s = self.settings
        across = np.array([-m.direction[1], m.direction[0]])
        covariance = np.zeros((4, 4))
        covariance[:2, :2] = m.covariance
        covariance[2:, 2:] = m.range_rate_std**2 * np.outer(m.direction, m.direction)
        covariance[2:, 2:] += s.speed_std_mps**2 * np.outer(across, across)
        state = np.concatenate([m.position, m.range_rate * m.direction])
        number, self._next = self._next, self._next + 1
        status: Status = "confirmed" if s.confirm_hits == 1 else "tentative"
        return Track(number, state, covariance, status, 1, 1, 0, m)
