"""Point targets with chosen power, and noise, for the tests of the processing chain."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from shenron_rt.config.profile import RadarProfile
from shenron_rt.frames import direction
from shenron_rt.returns import Returns
from shenron_rt.synthesis.adc import AdcCube
from shenron_rt.synthesis.synthesize import synthesize


def point_returns(profile, distance, azimuth=0.0, velocity=0.0, power=1e-9, elevation=0.0, object_id=None) -> Returns:
    """Return point targets of received power [W] at range [m], angles [rad], range rate [m/s]."""
    columns = np.broadcast_arrays(
        *(np.atleast_1d(np.asarray(v, float)) for v in (distance, azimuth, velocity, power, elevation))
    )
    distance, azimuth, velocity, power, elevation = columns
    n = len(distance)
    u = direction(azimuth, elevation)
    return Returns(
        amplitude=np.sqrt(power).astype(complex),
        position=u * distance[:, None],
        velocity=u * velocity[:, None],
        object_id=np.asarray(np.arange(1, n + 1) if object_id is None else object_id, dtype=np.uint32),
        tag=np.full(n, 14, dtype=np.uint8),
        coherent=np.ones(n, dtype=bool),
        bounces=np.ones(n, dtype=np.uint8),
        scatterer=np.arange(n),
        center_hz=profile.center_hz,
    )


def point_adc(profile: RadarProfile, *args, noise=None, seed=0, **kwargs) -> AdcCube:
    """Return the exact ADC cube of point targets."""
    return synthesize(point_returns(profile, *args, **kwargs), profile, noise=noise, seed=seed, method="direct")


def noise_adc(profile: RadarProfile, rng: np.random.Generator) -> AdcCube:
    """Return thermal noise alone, of a complex ADC."""
    w = profile.waveform
    white = rng.standard_normal((w.chirps, profile.n_virtual, w.samples, 2)).view(np.complex128)[..., 0]
    return AdcCube(white * np.sqrt(profile.noise_power_w / 2), profile, profile.noise_power_w)


def rcs_power(profile: RadarProfile, rcs_dbsm: float, distance, azimuth, elevation=0.0):
    """Return the power that the radar equation gives [W]."""
    a = profile.antenna
    gain = 10 ** ((a.gain_tx_dbi + a.gain_rx_dbi - a.radome_loss_db) / 10) * profile.pattern(azimuth, elevation) ** 2
    area = 10 ** (rcs_dbsm / 10)
    return profile.tx_power_w * gain * profile.wavelength_m**2 * area / ((4 * np.pi) ** 3 * np.asarray(distance) ** 4)


def table_rows(file: Path) -> Iterator[dict[str, str]]:
    """Return the rows of a reference table; lines with # are comments."""
    return csv.DictReader(line for line in file.read_text().splitlines() if not line.startswith("#"))
