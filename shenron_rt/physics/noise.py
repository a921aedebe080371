"""Thermal noise power of a receiver channel."""

from __future__ import annotations

from ..constants import BOLTZMANN, T0
from ..errors import InputError

__all__ = ["noise_power_per_sample"]


def noise_power_per_sample(
    sample_rate_hz: float, noise_figure_db: float, *, temperature_k: float = T0, real_adc: bool = False
) -> float:
    """Return the variance of one noise sample, referred to the receiver input.

    Parameters
    ----------
    sample_rate_hz : float
        ADC rate of complex, or of real, samples. [Hz]
    noise_figure_db : float
        Single-sideband noise figure, >= 0. [dB]
    temperature_k : float
        Source temperature; the noise figure is defined at T0 = 290 K. [K]
    real_adc : bool
        A real-only ADC keeps half the bandwidth.

    Returns
    -------
    float
        k (T + T0 (F - 1)) f_s, which is k T0 F f_s at T0; half of it for a real-only ADC. [W]
    """
    if not (sample_rate_hz > 0.0 and temperature_k >= 0.0 and noise_figure_db >= 0.0):
        raise InputError(
            f"sample rate {sample_rate_hz} Hz, noise figure {noise_figure_db} dB, temperature {temperature_k} K; "
            "allowed: > 0, >= 0, >= 0"
        )
    system_k = temperature_k + T0 * (10.0 ** (0.1 * noise_figure_db) - 1.0)
    return float(BOLTZMANN * system_k * sample_rate_hz * (0.5 if real_adc else 1.0))
