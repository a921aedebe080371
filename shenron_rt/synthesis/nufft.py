"""Fast synthesis: one nonuniform FFT per element pair, with the corrections that make it as exact as asked."""

from __future__ import annotations

import numpy as np

from .._typing import ComplexArray, FloatArray
from ..constants import SPEED_OF_LIGHT
from .signal import Clock, Field, Points

__all__ = ["nufft_field"]


def nufft_field(accuracy: float) -> Field:
    """Return a :data:`~shenron_rt.synthesis.signal.Field` that reaches ``accuracy`` relative to the RMS."""

    def field(
        clock: Clock, points: Points, tx_m: FloatArray, rx_m: FloatArray, chirp_start_s: FloatArray
    ) -> ComplexArray:
        import finufft

        t_mid = clock.sample_s.mean()
        s = clock.sample_s - t_mid
        fc = clock.carrier_hz + clock.slope_hz_per_s * t_mid
        k = clock.slope_hz_per_s
        time = chirp_start_s[:, None] + clock.sample_s - clock.frame_mid_s
        eta = ((1 + k * s / fc) * time).ravel()
        s_grid = np.broadcast_to(s, time.shape).ravel().copy()
        out = np.zeros((len(chirp_start_s), len(rx_m), len(s)), dtype=np.complex128)
        for j, rx in enumerate(rx_m):
            tau = rate = 0.0
            for element in (tx_m, rx):
                offset = points.position - element
                r = np.linalg.norm(offset, axis=1)
                tau = tau + r / SPEED_OF_LIGHT
                rate = rate + np.einsum("qi,qi->q", offset, points.velocity) / r / SPEED_OF_LIGHT
            cycles = (fc - k * tau / 2) * tau
            strength = points.amplitude * np.exp(2j * np.pi * (cycles - np.rint(cycles)))
            x, y = 2 * np.pi * k * tau, 2 * np.pi * (fc - k * tau) * rate
            out[:, j] = finufft.nufft2d3(x, y, strength, s_grid, eta, eps=accuracy / 4, isign=1, nthreads=1).reshape(
                time.shape
            )
        return out

    return field
