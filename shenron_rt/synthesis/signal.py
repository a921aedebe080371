"""What every method needs to know: the clock of the samples, the chirps behind a channel, the multiplexing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .._typing import ComplexArray, FloatArray, IntArray
from ..config.profile import RadarProfile
from ..errors import InputError
from ..returns import Returns

__all__ = ["Clock", "Field", "Points", "decode", "doppler_ramps", "dot", "hadamard", "transmitted"]


@dataclass(frozen=True)
class Points:
    """The echoes as synthesis sees them: amplitude [sqrt(W)], position [m] and velocity [m/s], radar frame.

    Parameters
    ----------
    amplitude : (n,) complex
    position, velocity : (n, 3) float
        As receivers see them.
    sent : Points or None
        As transmitters see them; ``None``: the same.
    """

    amplitude: ComplexArray
    position: FloatArray
    velocity: FloatArray
    sent: Points | None = None

    @classmethod
    def from_returns(cls, returns: Returns) -> Points:
        """Take the columns that matter and leave out echoes of zero amplitude.

        Raises
        ------
        InputError
            A value is NaN or infinite.
        """
        amplitude = np.asarray(returns.amplitude, dtype=np.complex128)
        position = np.asarray(returns.position, dtype=np.float64)
        velocity = np.asarray(returns.velocity, dtype=np.float64)
        away, leaving = (
            None if v is None else np.asarray(v, dtype=np.float64)
            for v in (returns.departure, returns.departure_velocity)
        )
        columns = {"position": position, "velocity": velocity, "departure": away, "departure_velocity": leaving}
        for name, values in ({"amplitude": amplitude} | columns).items():
            if values is None or np.isfinite(values).all():
                continue
            bad = np.flatnonzero(~np.isfinite(np.atleast_2d(values.T)).all(axis=0))
            raise InputError(
                f"Returns.{name}: {len(bad)} of {len(values)} rows are NaN or infinite, the first is row {bad[0]} "
                f"({values[bad[0]]}); finite numbers are needed"
            )
        points = cls(amplitude, position, velocity)
        if away is not None:
            points = _two_legs(points, away, leaving)
        heard = np.flatnonzero(amplitude)
        return points if len(heard) == len(amplitude) else points[heard]

    def __len__(self) -> int:
        return len(self.amplitude)

    def __getitem__(self, rows: slice | IntArray) -> Points:
        sent = None if self.sent is None else self.sent[rows]
        return Points(self.amplitude[rows], self.position[rows], self.velocity[rows], sent)

    @property
    def outward(self) -> Points:
        """The echoes as transmitters see them."""
        return self if self.sent is None else self.sent

    def by_legs(self) -> list[Points]:
        """Return the echoes whose legs are the same, then, where there are any, those whose legs differ."""
        if self.sent is None:
            return [self]
        same = np.all((self.sent.position == self.position) & (self.sent.velocity == self.velocity), axis=1)
        return [replace(self[np.flatnonzero(same)], sent=None), self[np.flatnonzero(~same)]]


def _two_legs(points: Points, departure: FloatArray, departure_velocity: FloatArray | None) -> Points:
    """Tell the legs of echoes apart whose wave did not leave where it arrives; see :class:`Returns`."""
    position, velocity = points.position, points.velocity
    if departure_velocity is None:
        rate = np.einsum("ij,ij->i", velocity, _unit(position))
        same = np.all(departure == position, axis=1)[:, None]
        departure_velocity = np.where(same, velocity, rate[:, None] * _unit(departure))
    rows = np.flatnonzero(np.any((departure != position) | (departure_velocity != velocity), axis=1))
    if not len(rows):
        return points
    here, moving, away, leaving = (a[rows] for a in (position, velocity, departure, departure_velocity))
    toward, rate = _unit(here), np.einsum("ij,ij->i", moving, _unit(here))
    half, there = np.linalg.norm(here, axis=1), np.linalg.norm(away, axis=1)
    back = 2.0 * half - there
    if np.any(back <= 0):
        row = rows[int(np.argmax(back <= 0))]
        raise InputError(
            f"Returns.departure: row {row} is {np.linalg.norm(departure[row]):g} m away, which leaves nothing of the "
            f"way 2 * {np.linalg.norm(position[row]):g} m; the way there must be shorter"
        )
    across = moving - rate[:, None] * toward
    rest = 2.0 * rate - np.einsum("ij,ij->i", leaving, _unit(away))
    position, velocity = position.copy(), velocity.copy()
    position[rows] = back[:, None] * toward
    velocity[rows] = rest[:, None] * toward + (back / half)[:, None] * across
    return Points(points.amplitude, position, velocity, Points(points.amplitude, departure, departure_velocity))


def dot(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the scalar products of vectors (3, n) and (3, n); einsum takes several times as long."""
    found: FloatArray = a[0] * b[0]
    found += a[1] * b[1]
    found += a[2] * b[2]
    return found


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), 1e-12))


@dataclass(frozen=True)
class Clock:
    """Times and frequencies of the samples of one chirp.

    Parameters
    ----------
    carrier_hz, slope_hz_per_s : float
        f0, the frequency at the chirp's start, and k.
    sample_s : (n_samples,) float
        t = adc_start_s + n / f_s, from the chirp's start [s].
    frame_mid_s : float
        Middle of the frame, the instant the positions hold [s].
    """

    carrier_hz: float
    slope_hz_per_s: float
    sample_s: FloatArray
    frame_mid_s: float

    @classmethod
    def of(cls, profile: RadarProfile, margin: int = 0) -> Clock:
        """Read the clock of a profile; ``margin`` more samples on both sides."""
        w = profile.waveform
        times = w.adc_start_s + np.arange(-margin, w.samples + margin) / w.sample_rate_hz
        return cls(w.carrier_hz, w.slope_hz_per_s, times, profile.frame_mid_s)

    @property
    def window_mid_s(self) -> float:
        """Mean of the sample times [s]."""
        return float(self.sample_s[0] + self.sample_s[-1]) / 2

    @property
    def window_mid_hz(self) -> float:
        """Frequency at that time [Hz]."""
        return self.carrier_hz + self.slope_hz_per_s * self.window_mid_s


#: (clock, points, transmitter (3,), receivers (n_rx, 3), chirp starts (n,)) -> (n, n_rx, n_samples), sqrt(W)
Field = Callable[[Clock, Points, FloatArray, FloatArray, FloatArray], ComplexArray]


def hadamard(n: int) -> FloatArray:
    """Return the (n, n) Hadamard matrix of Sylvester's construction, rows = chirps of a block, columns = transmitters.

    Raises
    ------
    InputError
        n is not a power of two.
    """
    if n < 1 or n & (n - 1):
        raise InputError(
            f"multiplex bpm with {n} transmitters: the number of transmitters must be a power of two (1, 2, 4, 8, 16 "
            "...); use tdm, or add or drop transmitters"
        )
    matrix = np.ones((1, 1))
    while len(matrix) < n:
        matrix = np.kron(np.array([[1.0, 1.0], [1.0, -1.0]]), matrix)
    return matrix


def doppler_ramps(profile: RadarProfile) -> ComplexArray:
    """Return (n_loops, n_tx) phasors e^{j 2 pi i m / n_subbands} of transmitter i in chirp m under DDM, de-chirped."""
    turns = np.outer(np.arange(profile.waveform.chirps), np.arange(profile.n_tx)) % profile.n_subbands
    return np.asarray(np.exp(2j * np.pi / profile.n_subbands * turns), dtype=np.complex128)


def transmitted(profile: RadarProfile, points: Points, field: Field, margin: int = 0) -> ComplexArray:
    """Return what the ADC sees before noise, chirp by chirp.

    Parameters
    ----------
    profile : RadarProfile
    points : Points
    field : callable
        Sums the echoes of one transmitter; see :data:`Field`.
    margin : int
        Samples to add before and after the sampled window.

    Returns
    -------
    (n_loops, n_blocks, n_rx, n_samples + 2 margin) complex
        Blocks are transmitters (simultaneous and TDM), the chirps of a loop, in which all transmit (BPM), or the one
        chirp in which all transmit (DDM). sqrt(W).
    """
    clock, starts = Clock.of(profile, margin), profile.raw_chirp_start_s
    kind = profile.array.multiplex
    shape = (len(starts), 1 if kind == "ddm" else profile.n_tx, profile.n_rx, len(clock.sample_s))
    raw = np.zeros(shape, dtype=np.complex128)
    code = hadamard(profile.n_tx) if kind == "bpm" else np.eye(profile.n_tx)
    ramp = doppler_ramps(profile) if kind == "ddm" else None
    for i, tx in enumerate(profile.tx_m):
        if ramp is not None:
            raw[:, 0] += ramp[:, i, None, None] * field(clock, points, tx, profile.rx_m, starts[:, 0])
        elif kind == "bpm":
            echo = field(clock, points, tx, profile.rx_m, starts.ravel()).reshape(shape)
            raw += code[None, :, i, None, None] * echo
        else:
            raw[:, i] = field(clock, points, tx, profile.rx_m, starts[:, i if kind == "tdm" else 0])
    return raw


def decode(profile: RadarProfile, raw: ComplexArray) -> ComplexArray:
    """Turn raw chirps into virtual channels.

    (1/n_tx) sum_b H[b, i] raw_b under BPM; under DDM every receiver once for each transmitter, turned back by its ramp,
    so that this transmitter's echo stands at its Doppler frequency and the others whole sub-bands away; else a reshape.

    Parameters
    ----------
    profile : RadarProfile
    raw : (n_loops, n_blocks, n_rx, n_samples) complex

    Returns
    -------
    (n_loops, n_virtual, n_samples) complex
    """
    if profile.array.multiplex == "bpm":
        raw = np.einsum("bi,mbjn->mijn", hadamard(profile.n_tx) / profile.n_tx, raw)
    elif profile.array.multiplex == "ddm":
        raw = raw * doppler_ramps(profile).conj()[:, :, None, None]
    return np.ascontiguousarray(raw.reshape(raw.shape[0], -1, raw.shape[-1]))
