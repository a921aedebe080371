"""What stands between a radar and any scatterer: both antenna patterns, powers, radome and weather."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .._typing import FloatArray
from ..frames import spherical
from ..scatterers import Weather

if TYPE_CHECKING:
    from ..config.profile import RadarProfile

__all__ = ["link_amplitude"]


def link_amplitude(
    profile: RadarProfile, position: FloatArray, weather: Weather | None, *, departure: FloatArray | None = None
) -> FloatArray:
    """Return sqrt(Pt Gt Gr / L): all of the radar equation but lambda^2 sigma / ((4 pi)^3 R^4).

    Parameters
    ----------
    profile : RadarProfile
    position : (n, 3) float
        Where the echo comes from, at half the length of its way; radar frame [m].
    weather : Weather or None
        ``None`` is no attenuation at all.
    departure : (n, 3) float, optional
        Directions in which the wave left, where they are others.

    Returns
    -------
    (n,) float
        [sqrt(W)].
    """
    antenna = profile.antenna
    distance, azimuth, elevation = spherical(position)
    one_way = profile.pattern(azimuth, elevation)
    if departure is not None:
        _, azimuth, elevation = spherical(departure)
        one_way = np.sqrt(one_way * profile.pattern(azimuth, elevation))
    gain_db = antenna.gain_tx_dbi + antenna.gain_rx_dbi - antenna.radome_loss_db
    power = profile.tx_power_w * 10 ** (gain_db / 10)
    amplitude: FloatArray = np.sqrt(power) * one_way
    if weather is not None:
        amplitude = amplitude / np.sqrt(weather.two_way_loss(distance, profile.center_hz, antenna.polarization))
    return amplitude
