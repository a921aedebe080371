"""Profiles, echoes and an independent evaluation of the signal, for the synthesis tests."""

from __future__ import annotations

import numpy as np

from shenron_rt.config.profile import RadarProfile
from shenron_rt.returns import Returns

C = 299_792_458.0
LINE = [[0, -c, 0] for c in range(3)]


def make_profile(array=None, receiver=None, **waveform) -> RadarProfile:
    """A profile from its few relevant numbers; the AWRL1432's 77 GHz, 400 MHz waveform by default."""
    numbers = {
        "carrier_hz": 77e9,
        "bandwidth_hz": 400e6,
        "samples": 256,
        "sample_rate_hz": 12.5e6,
        "chirps": 64,
        "chirp_period_s": 36.4e-6,
    }
    return RadarProfile(
        name="test",
        waveform=numbers | waveform,
        array=array or {"line": 6},
        antenna={"pattern": "isotropic"},
        receiver={"tx_power_dbm": 10, "noise_figure_db": 14} | (receiver or {}),
    )


def make_returns(position, velocity=(0.0, 0.0, 0.0), amplitude=1.0) -> Returns:
    position = np.atleast_2d(np.asarray(position, dtype=float))
    n = len(position)
    velocity = np.broadcast_to(np.asarray(velocity, dtype=float), (n, 3)).copy()
    zeros = np.zeros(n, dtype=np.int64)
    return Returns(
        amplitude=np.broadcast_to(np.asarray(amplitude, dtype=complex), n).copy(),
        position=position,
        velocity=velocity,
        object_id=zeros.astype(np.uint32),
        tag=zeros.astype(np.uint8),
        coherent=np.ones(n, dtype=bool),
        bounces=zeros.astype(np.uint8),
        scatterer=zeros,
        center_hz=77e9,
    )


def draw_returns(rng: np.random.Generator, n: int, profile: RadarProfile, near: bool = True) -> Returns:
    """Echoes from 0.5 m (or 5 m) to 250 m at up to 60 m/s, a third of them tangential, paths beyond 0.5 m."""
    least = 0.55 + float(np.abs(profile.positions_m).max())
    r = np.exp(rng.uniform(np.log(least if near else 5.0), np.log(250.0), n))
    r[:2] = (least, 250.0) if near else (5.0, 250.0)
    u = rng.normal(size=(n, 3)) * [1, 1, 0.4]
    u[:, 0] = np.abs(u[:, 0])
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = rng.normal(size=(n, 3))
    v *= rng.uniform(0, 60, (n, 1)) / np.linalg.norm(v, axis=1, keepdims=True)
    v[0] = 60 * np.cross(u[0], [0, 0, 1]) / np.linalg.norm(np.cross(u[0], [0, 0, 1]))
    v[1] = -60 * u[1]
    last = profile.frame_mid_s
    time = np.clip(-(r[:, None] * u * v).sum(axis=1) / (v * v).sum(axis=1), -last, last)
    tangential = (np.arange(n) % 3 == 0) | (np.linalg.norm(r[:, None] * u + v * time[:, None], axis=1) < least)
    v[tangential] -= (v * u).sum(axis=1, keepdims=True)[tangential] * u[tangential]
    amplitude = (rng.normal(size=n) + 1j * rng.normal(size=n)) / np.sqrt(2)
    return make_returns(r[:, None] * u, v, amplitude)


def tones(profile: RadarProfile, returns: Returns, tx: int, starts) -> np.ndarray:
    """(n_starts, n_rx, n_samples): the signal's formula, one echo at a time, written out anew."""
    w = profile.waveform
    t = w.adc_start_s + np.arange(w.samples) / w.sample_rate_hz
    k = w.bandwidth_hz * w.sample_rate_hz / w.samples
    total = np.zeros((len(starts), profile.n_rx, w.samples), dtype=complex)
    for a, p, v in zip(returns.amplitude, returns.position, returns.velocity, strict=True):
        time = np.asarray(starts)[:, None, None] + t - profile.frame_mid_s
        at = p + v * time[..., None]
        there = np.linalg.norm(at - profile.tx_m[tx], axis=-1)
        back = np.linalg.norm(at - profile.rx_m[None, :, None], axis=-1)
        tau = (there + back) / C
        total += a * np.exp(2j * np.pi * (w.carrier_hz * tau + k * tau * t - k * tau**2 / 2))
    return total


def relative_error(found: np.ndarray, exact: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.abs(found - exact) ** 2) / np.mean(np.abs(exact) ** 2)))
