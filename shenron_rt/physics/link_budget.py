"""The radar equation, forwards and backwards, and the signal-to-noise ratio it gives."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..constants import BOLTZMANN, FOUR_PI_CUBED, T0

__all__ = ["noise_power", "one_way_power", "rcs_from_power", "received_power", "snr"]

FloatArray = NDArray[np.float64]


def received_power(
    rcs_m2: ArrayLike,
    range_m: ArrayLike,
    wavelength_m: ArrayLike,
    tx_power_w: ArrayLike,
    gain_tx: ArrayLike,
    gain_rx: ArrayLike,
    loss: ArrayLike = 1.0,
) -> FloatArray:
    """Return P = Pt Gt Gr lambda^2 sigma/((4 pi)^3 R^4 L).

    Parameters
    ----------
    rcs_m2 : array_like
        Radar cross section. [m^2]
    range_m : array_like
        Range, > 0. [m]
    wavelength_m : array_like
        Wavelength. [m]
    tx_power_w : array_like
        Transmit power. [W]
    gain_tx, gain_rx : array_like
        Linear gains in the target's direction. [-]
    loss : array_like
        Linear loss of the whole path (radome both ways, weather both ways), >= 1. [-]

    Returns
    -------
    array of the broadcast shape [W]
    """
    r = np.asarray(range_m, dtype=np.float64)
    scale = (
        np.asarray(tx_power_w)
        * np.asarray(gain_tx)
        * np.asarray(gain_rx)
        * np.asarray(wavelength_m) ** 2
        / (FOUR_PI_CUBED * np.asarray(loss))
    )
    return np.asarray(scale * np.asarray(rcs_m2) / r**4)


def one_way_power(
    range_m: ArrayLike,
    wavelength_m: ArrayLike,
    tx_power_w: ArrayLike,
    gain_tx: ArrayLike,
    gain_rx: ArrayLike,
    loss: ArrayLike = 1.0,
) -> FloatArray:
    """Return Friis' P = Pt Gt Gr (lambda/(4 pi R))^2/L, what one antenna gets from another.

    Parameters
    ----------
    range_m, wavelength_m : array_like
        Distance, > 0, and wavelength. [m]
    tx_power_w : array_like
        Transmit power. [W]
    gain_tx, gain_rx : array_like
        Linear gains towards each other. [-]
    loss : array_like
        Linear loss of the one way, >= 1. [-]

    Returns
    -------
    array of the broadcast shape [W]
    """
    spread = np.asarray(wavelength_m) / (4 * np.pi * np.asarray(range_m, dtype=np.float64))
    gain = np.asarray(gain_tx) * np.asarray(gain_rx) / np.asarray(loss)
    return np.asarray(np.asarray(tx_power_w) * gain * spread**2, dtype=np.float64)


def rcs_from_power(
    power_w: ArrayLike,
    range_m: ArrayLike,
    wavelength_m: ArrayLike,
    tx_power_w: ArrayLike,
    gain_tx: ArrayLike,
    gain_rx: ArrayLike,
    loss: ArrayLike = 1.0,
) -> FloatArray:
    """Return the radar cross section [m^2] that gives a received power [W]: :func:`received_power` inverted."""
    per_unit = received_power(1.0, range_m, wavelength_m, tx_power_w, gain_tx, gain_rx, loss)
    return np.asarray(np.asarray(power_w) / per_unit)


def noise_power(bandwidth_hz: ArrayLike, noise_figure: ArrayLike, temperature_k: ArrayLike = T0) -> FloatArray:
    """Return k T F B.

    Parameters
    ----------
    bandwidth_hz : array_like
        Noise bandwidth, or 1/(coherent integration time). [Hz]
    noise_figure : array_like
        Linear noise factor. [-]
    temperature_k : array_like
        Reference temperature. [K]

    Returns
    -------
    array of the broadcast shape [W]
    """
    return np.asarray(
        BOLTZMANN * np.asarray(temperature_k) * np.asarray(noise_figure) * np.asarray(bandwidth_hz), dtype=np.float64
    )


def snr(power_w: ArrayLike, integration_s: ArrayLike, noise_figure: ArrayLike, channels: ArrayLike = 1) -> FloatArray:
    """Return the power signal-to-noise ratio after coherent integration.

    Parameters
    ----------
    power_w : array_like
        Received signal power per channel. [W]
    integration_s : array_like
        Sampled time added coherently: sample time x chirps. [s]
    noise_figure : array_like
        Linear noise factor. [-]
    channels : array_like
        Channels added coherently. [-]

    Returns
    -------
    array, linear: Pr T channels/(k T0 F)
    """
    return np.asarray(
        np.asarray(power_w) * np.asarray(channels) / noise_power(1.0 / np.asarray(integration_s), noise_figure)
    )
