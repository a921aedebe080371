"""The exact sum in double precision: the reference every faster method is held against."""

from __future__ import annotations

import numpy as np

from .._typing import ComplexArray, FloatArray
from ..constants import SPEED_OF_LIGHT
from .signal import Clock, Points

__all__ = ["direct_field"]

#: Terms held at once; with its temporaries a block takes about 64 bytes a term.
BLOCK_TERMS = 1 << 18


def direct_field(
    clock: Clock, points: Points, tx_m: FloatArray, rx_m: FloatArray, chirp_start_s: FloatArray
) -> ComplexArray:
    """Sum a exp(+j 2 pi (f0 tau + k tau t - k tau^2 / 2)) over the echoes, tau at the instant of every sample.

    Parameters
    ----------
    clock : Clock
    points : Points
        n echoes.
    tx_m : (3,) float
        The transmitter [m].
    rx_m : (n_rx, 3) float
        The receivers [m].
    chirp_start_s : (n_chirps,) float
        From the frame's start [s].

    Returns
    -------
    (n_chirps, n_rx, n_samples) complex, sqrt(W)

    Notes
    -----
    tau = (abs(p(T) - tx) + abs(p(T) - rx)) / c with p(T) = position + velocity T and T = chirp start + t - mid-frame;
    where an echo has legs of its own, transmitters see ``points.sent``.
    Cost: about 50 ns a term on one core.
    """
    t = clock.sample_s
    out = np.zeros((len(chirp_start_s), len(rx_m), len(t)), dtype=np.complex128)
    n_chirps = max(1, min(len(chirp_start_s), BLOCK_TERMS // len(t)))
    for first in range(0, len(chirp_start_s), n_chirps):
        chirps = slice(first, first + n_chirps)
        time = chirp_start_s[chirps, None] + t - clock.frame_mid_s
        n_points = max(1, BLOCK_TERMS // time.size)
        for begin in range(0, len(points), n_points):
            part = points[begin : begin + n_points]
            to_tx = _distance(part.outward, tx_m, time)
            for j, rx in enumerate(rx_m):
                tau = (to_tx + _distance(part, rx, time)) / SPEED_OF_LIGHT
                cycles = (clock.carrier_hz + clock.slope_hz_per_s * (t - tau / 2)) * tau
                out[chirps, j] += np.einsum("q,qmn->mn", part.amplitude, np.exp(2j * np.pi * cycles))
    return out


def _distance(points: Points, element_m: FloatArray, time: FloatArray) -> FloatArray:
    """Return abs(position + velocity time - element), (n, *time.shape) [m]."""
    offset = points.position - element_m
    at_mid = np.einsum("qi,qi->q", offset, offset)[:, None, None]
    rate = 2 * np.einsum("qi,qi->q", offset, points.velocity)[:, None, None]
    speed = np.einsum("qi,qi->q", points.velocity, points.velocity)[:, None, None]
    # cancellation can leave a path through the element itself a rounding error below zero
    distance: FloatArray = np.sqrt(np.maximum(at_mid + (rate + speed * time) * time, 0.0))
    return distance
