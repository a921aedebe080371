"""Whole cubes of every bundled profile against the exact sum, at a sample of their entries."""

from __future__ import annotations

import numpy as np
import pytest
from synthesis_cases import C, draw_returns

import shenron_rt as srt
from shenron_rt.config.profile import RadarProfile
from shenron_rt.resources import available
from shenron_rt.returns import Returns

PROFILES = sorted(available("profiles"))
#: A few seconds in all; one or two minutes for the largest of the others.
QUICK = {"awrl1432", "awrl1432_137mhz", "awrl1432boost", "ti_cascade"}
ACCURACY = 1e-6
#: So many that a NUFFT is worth its while; of a few, or of near ones, the program takes the exact sum itself.
ECHOES, MORE = 300, {"mmwcas": 600}


def tone_at(profile: RadarProfile, returns: Returns, tx: int, starts: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Return (n_starts, n_rx, n_samples): what a transmitter's chirps give at some samples, the formula written out."""
    w = profile.waveform
    t = w.adc_start_s + samples / w.sample_rate_hz
    time = np.asarray(starts)[:, None] + t - profile.frame_mid_s
    at = returns.position[:, None, None] + returns.velocity[:, None, None] * time[..., None]
    there = np.linalg.norm(at - profile.tx_m[tx], axis=-1)
    out = np.empty((len(starts), profile.n_rx, len(samples)), dtype=complex)
    for j, rx in enumerate(profile.rx_m):
        tau = (there + np.linalg.norm(at - rx, axis=-1)) / C
        turns = (w.carrier_hz + w.slope_hz_per_s * (t - tau / 2)) * tau
        out[:, j] = np.einsum("q,qmn->mn", returns.amplitude, np.exp(2j * np.pi * (turns - np.round(turns))))
    return out


def exact_at(profile: RadarProfile, returns: Returns, loops: np.ndarray, samples: np.ndarray) -> np.ndarray:
    """Return (n_loops, n_virtual, n_samples) of the noise-free cube by the exact sum, at some loops and samples."""
    starts, kind, n = profile.raw_chirp_start_s[loops], profile.array.multiplex, profile.n_tx
    if kind in ("simultaneous", "tdm"):
        parts = [tone_at(profile, returns, i, starts[:, i if kind == "tdm" else 0], samples) for i in range(n)]
    elif kind == "bpm":  # two transmitters, the signs of (1, 1), (1, -1) in turn
        assert n == 2
        (a0, a1), (b0, b1) = (
            (tone_at(profile, returns, i, starts[:, 0], samples), tone_at(profile, returns, i, starts[:, 1], samples))
            for i in range(n)
        )
        plus, minus = a0 + b0, a1 - b1
        parts = [(plus + minus) / 2, (plus - minus) / 2]
    else:  # ddm: transmitter i turns by i / n_subbands from chirp to chirp
        turn = [np.exp(2j * np.pi * i * loops / profile.n_subbands)[:, None, None] for i in range(n)]
        heard = sum(turn[i] * tone_at(profile, returns, i, starts[:, 0], samples) for i in range(n))
        parts = [turn[i].conj() * heard for i in range(n)]
    exact = np.concatenate(parts, axis=1)
    return exact if profile.waveform.adc == "complex" else np.sqrt(2) * exact.real


def some(rng: np.random.Generator, size: int, count: int) -> np.ndarray:
    """Return first, last and some places in between."""
    inner = rng.choice(np.arange(1, size - 1), min(count, size - 2), replace=False)
    return np.sort(np.concatenate([[0, size - 1], inner]))


@pytest.mark.parametrize("name", [pytest.param(n, marks=[] if n in QUICK else pytest.mark.slow) for n in PROFILES])
def test_full_cube_is_the_exact_sum_for_every_element_pair(name: str) -> None:
    """To ``accuracy``, relative to the root of the sum of powers, 0.5 to 250 m and up to 60 m/s."""
    profile = srt.load_profile(name)
    rng = np.random.default_rng(sum(name.encode()))
    returns = draw_returns(rng, MORE.get(name, ECHOES), profile)
    cube = srt.synthesize(returns, profile, noise=None, accuracy=ACCURACY).data
    loops, samples = some(rng, profile.waveform.chirps, 2), some(rng, profile.waveform.samples, 6)
    exact = exact_at(profile, returns, loops, samples)
    assert cube.shape == (profile.waveform.chirps, profile.n_virtual, profile.waveform.samples)
    senders = profile.n_tx if profile.array.multiplex == "ddm" else 1  # all are in every channel
    level = np.sqrt(senders * np.sum(np.abs(returns.amplitude) ** 2))
    error = np.abs(cube[np.ix_(loops, range(profile.n_virtual), samples)] - exact) / level
    assert np.sqrt(np.mean(error**2, axis=(0, 2))).max() <= ACCURACY
    # of a complex normal error one entry in 8000 lies beyond 3 times its RMS, one in 1e7 beyond 4
    assert error.max() <= 4 * ACCURACY
