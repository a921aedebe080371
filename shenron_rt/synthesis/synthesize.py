"""Returns -> AdcCube."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence

import numpy as np

from .._typing import ComplexArray
from ..config.profile import RadarProfile
from ..errors import InputError
from ..randomness import frame_generator
from ..returns import Returns
from .adc import AdcCube
from .direct import direct_field
from .interference import HeardRadar, add_interference
from .nufft import nufft_field
from .phase_noise import add_phase_noise, margin_samples
from .receiver import add_noise, cube_noise_power, quantise, to_adc
from .signal import Points, decode, hadamard, transmitted

__all__ = ["synthesize", "synthesize_segments"]

ACCURACY_MIN, ACCURACY_MAX = 1e-9, 1e-1
#: Finest accuracy double precision allows at 1e5 cycles of carrier phase.
ACCURACY_LIMIT = 1e-11
#: Cube RMS over the root sum of powers below which the margin of the NUFFT (measured error <= 0.6 of what was asked)
#: is used up.
CANCELLATION = 0.6

logger = logging.getLogger(__name__)


def synthesize(
    returns: Returns,
    profile: RadarProfile,
    *,
    noise: str | None = "thermal",
    seed: int | None = None,
    frame: int = 0,
    accuracy: float = 1e-5,
    method: str = "nufft",
    radar: str = "",
    interference: Sequence[HeardRadar] = (),
) -> AdcCube:
    """Synthesise the ADC samples of one frame.

    Parameters
    ----------
    returns : Returns
        Echoes in the radar frame, mid-frame. None at all gives noise alone.
    profile : RadarProfile
    noise : "thermal" or None
        Thermal noise k T0 F f_s per complex sample, and the profile's phase noise; or neither.
    seed : int, optional
        Seed of the noise; None is 0.
    frame : int
        Frame index; every frame has its own noise.
    accuracy : float
        Largest RMS error relative to the RMS of the noise-free cube, 1e-9 to 1e-1. ``method="direct"`` is exact.
    method : "nufft" or "direct"
        ``"direct"`` is the reference sum, about 50 ns for every echo and sample.
    radar : str
        Name of the radar, so that several radars of one frame get noise of their own.
    interference : sequence of HeardRadar
        Other radars that send meanwhile, as ``heard_radars`` finds them in a scene.

    Returns
    -------
    AdcCube

    Raises
    ------
    InputError
        An unknown option, an accuracy out of bounds, NaN in the returns, BPM with a number of transmitters that is
        not a power of two.

    Notes
    -----
    Channel (tx, rx) of a loop holds sum_i a_i exp(+j 2 pi (f0 tau + k tau t - k tau^2 / 2)) with
    tau = (abs(p - tx) + abs(p - rx)) / c at the instant of the sample, p = position + velocity (T - mid-frame).
    """
    _check(profile, noise, accuracy, method)
    clean = _clean(profile, returns, accuracy, method, _margin(profile, noise))
    return _received(
        profile, clean, returns, noise=noise, seed=seed, frame=frame, radar=radar, interference=interference
    )


def synthesize_segments(
    segments: Iterable[tuple[RadarProfile, Returns]],
    profile: RadarProfile,
    returns: Returns,
    *,
    noise: str | None = "thermal",
    seed: int | None = None,
    frame: int = 0,
    accuracy: float = 1e-5,
    method: str = "nufft",
    radar: str = "",
    interference: Sequence[HeardRadar] = (),
) -> AdcCube:
    """Synthesise the ADC samples of a frame whose echoes are known at several instants.

    Parameters
    ----------
    segments : iterable of (RadarProfile, Returns)
        Consecutive loops of the frame as frames of their own, and the echoes at the middle of each.
    profile : RadarProfile
        Of the whole frame.
    returns : Returns
        At mid-frame, for the truth that the cube carries.
    noise, seed, frame, accuracy, method, radar, interference
        As for :func:`synthesize`; noise and receiver are those of the whole frame.

    Raises
    ------
    InputError
        As :func:`synthesize`, or segments that are not the frame's loops.
    """
    _check(profile, noise, accuracy, method)
    margin = _margin(profile, noise)
    clean = np.concatenate([_clean(part, echoes, accuracy, method, margin) for part, echoes in segments])
    if len(clean) != profile.waveform.chirps:
        raise InputError(
            f"segments of {len(clean)} loops in all; the frame of {profile.name!r} has {profile.waveform.chirps}"
        )
    return _received(
        profile, clean, returns, noise=noise, seed=seed, frame=frame, radar=radar, interference=interference
    )


def _clean(profile: RadarProfile, returns: Returns, accuracy: float, method: str, margin: int) -> ComplexArray:
    points = Points.from_returns(returns)
    if method == "direct":
        return transmitted(profile, points, direct_field, margin)
    return _fast(profile, points, accuracy, margin)


def _margin(profile: RadarProfile, noise: str | None) -> int:
    """Return the samples that phase noise needs beside those of a chirp."""
    shaky = noise is not None and profile.receiver.phase_noise_dbc_hz is not None
    return margin_samples(profile) if shaky else 0


def _received(
    profile: RadarProfile,
    clean: ComplexArray,
    returns: Returns,
    *,
    noise: str | None,
    seed: int | None,
    frame: int,
    radar: str,
    interference: Sequence[HeardRadar],
) -> AdcCube:
    """Return what the receiver makes of the noise-free chirps."""
    seed = 0 if seed is None else int(seed)
    if noise is not None and profile.receiver.phase_noise_dbc_hz is not None:
        points, margin = Points.from_returns(returns), _margin(profile, noise)
        clean = add_phase_noise(profile, points, clean, margin, frame_generator(seed, frame, radar, "phase noise"))
    add_interference(profile, clean, interference)
    raw = to_adc(profile, clean)
    if noise is not None:
        add_noise(profile, raw, frame_generator(seed, frame, radar, "noise"))
    cube = decode(profile, quantise(profile, raw))
    power = cube_noise_power(profile) if noise is not None else 0.0
    return AdcCube(cube, profile, noise_power_w=power, seed=seed, frame=frame, weather=returns.weather, returns=returns)


def _fast(profile: RadarProfile, points: Points, accuracy: float, margin: int) -> ComplexArray:
    """Sum by NUFFT; once more, finer, where the echoes cancel to a cube well below the sum of their powers.

    The error goes with the root of that sum. Echoes of unrelated phase give a cube of the same RMS; those of a smooth
    surface may leave far less.
    """
    clean = transmitted(profile, points, nufft_field(accuracy), margin)
    # every raw chirp under BPM and DDM carries all transmitters
    n_sent = profile.n_tx if profile.array.multiplex in ("bpm", "ddm") else 1
    incoherent = np.sqrt(n_sent * np.sum(np.abs(points.amplitude) ** 2))
    rms = np.sqrt(np.mean(clean.real**2 + clean.imag**2))
    if rms >= CANCELLATION * incoherent:
        return clean
    finer = max(accuracy * float(rms / incoherent), ACCURACY_LIMIT)
    logger.debug("echoes cancel to %.3g of the root sum of their powers; accuracy %.3g", rms / incoherent, finer)
    return transmitted(profile, points, nufft_field(finer), margin)


def _check(profile: RadarProfile, noise: str | None, accuracy: float, method: str) -> None:
    if noise not in (None, "thermal"):
        raise InputError(f"noise {noise!r} is unknown; allowed: 'thermal', None")
    if method not in ("nufft", "direct"):
        raise InputError(f"method {method!r} is unknown; allowed: 'nufft', 'direct'")
    if not (np.isfinite(accuracy) and ACCURACY_MIN <= accuracy <= ACCURACY_MAX):
        raise InputError(f"accuracy {accuracy!r} is out of bounds; allowed: {ACCURACY_MIN:g} to {ACCURACY_MAX:g}")
    if profile.array.multiplex == "bpm":
        hadamard(profile.n_tx)
