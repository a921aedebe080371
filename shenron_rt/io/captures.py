"""ADC data that this package did not make: plain ``.npy`` arrays and raw captures of a DCA1000 card.

Byte layouts after TI SWRA581B, "Mmwave Radar Device ADC Raw Data Capture": little-endian int16 words, chirp after
chirp.

``"two_lane"``
    xWR16xx, xWR18xx, xWR68xx. Within a chirp the receivers follow each other. Complex data come as groups of two
    samples, the two I words before the two Q words: I0 I1 Q0 Q1. Real data are the samples in order.
``"four_lane"``
    xWR12xx, xWR14xx, xWR22xx. Within a chirp the samples follow each other, each with all receivers side by side:
    I of every receiver, then Q of every receiver; lanes of receivers that are off are absent.

The application report predates the xWRL devices. Their demo keeps the receivers of a real-only chirp one after the
other, which is the real form of ``"two_lane"``; that a DCA1000 file of theirs is laid out so is an assumption.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any, Literal, get_args

import numpy as np

from .._typing import ComplexArray, FloatArray, NDArray
from ..config.profile import RadarProfile
from ..errors import InputError, NotFoundError, did_you_mean
from ..synthesis.adc import AdcCube
from ..synthesis.receiver import cube_noise_power
from ..synthesis.signal import decode, hadamard
from .npz import atomic_write

__all__ = ["Layout", "count_scale", "noise_floor_scale", "read_dca1000", "read_npy", "write_dca1000"]

Layout = Literal["two_lane", "four_lane"]
_WORD = np.dtype("<i2")
#: Counts of a full-scale sample.
_FULL_SCALE = 2**15


def count_scale(profile: RadarProfile) -> float:
    """Return sqrt(W) per count of a 16-bit sample from ``receiver.full_scale_dbm``, the power of a full-scale tone.

    Raises
    ------
    InputError
        The profile does not say its full scale.
    """
    level = profile.receiver.full_scale_dbm
    if level is None:
        raise InputError(
            f"profile {profile.name!r} has no receiver.full_scale_dbm, needed to turn counts into watts; "
            "set it, together with receiver.adc_bits"
        )
    # A complex tone of power P has the modulus sqrt(P); the real ADC's sqrt(2) Re(x) peaks at sqrt(2 P).
    peak = math.sqrt(10 ** ((level - 30) / 10) * (2 if profile.waveform.adc == "real" else 1))
    return peak / _FULL_SCALE


def noise_floor_scale(data: ComplexArray, profile: RadarProfile) -> float:
    """Return the factor that brings the noise floor of uncalibrated data to the nominal k T0 F f_s.

    Parameters
    ----------
    data : (n_loops, n_virtual, n_samples) complex
        Samples in any unit.
    profile : RadarProfile

    Returns
    -------
    float
        1 where the data hold no noise at all.

    Notes
    -----
    The floor is the median power of the range-Doppler cells of all channels over ln 2, the median of an exponential
    distribution of unit mean; targets fill few cells and do not move a median. Levels are then as good as the
    profile's noise figure.
    """
    spectrum = np.fft.fft2(data, axes=(0, 2), norm="ortho")
    floor = float(np.median(np.abs(spectrum) ** 2)) / math.log(2)
    return math.sqrt(cube_noise_power(profile) / floor) if floor > 0 else 1.0


def read_npy(path: str | os.PathLike[str], profile: RadarProfile, *, scale: float = 1.0) -> list[AdcCube]:
    """Read a plain ``.npy`` array of ADC samples.

    Parameters
    ----------
    path : path
        Array (chirp, antenna, sample), or (frame, chirp, antenna, sample), of a virtual array: chirps per transmitter
        and tx * n_rx + rx.
    profile : RadarProfile
        The radar that made it; nothing in the file says.
    scale : float
        sqrt(W) per unit of the file.

    Returns
    -------
    list of AdcCube
        One a frame.

    Raises
    ------
    NotFoundError, InputError
        No such file; not numbers; a shape that is not the profile's.
    """
    file = Path(path)
    try:
        data = np.load(file, allow_pickle=False)
    except FileNotFoundError:
        raise NotFoundError(f"{file}: no such file") from None
    except (ValueError, OSError, EOFError) as error:
        raise InputError(f"{file}: not a .npy array that can be read ({error})") from None
    w = profile.waveform
    shape = (w.chirps, profile.n_virtual, w.samples)
    if not isinstance(data, np.ndarray) or data.dtype.kind not in "iufc":
        raise InputError(f"{file}: an array of real or complex numbers is needed")
    if data.ndim not in (3, 4) or data.shape[-3:] != shape:
        raise InputError(
            f"{file}: profile {profile.name!r} needs shape {shape} (chirp, antenna, sample), "
            f"or frames of it; got {data.shape}"
        )
    _finite(data, file)
    frames = data.reshape(-1, *shape).astype(np.complex128) * scale
    if w.adc == "real" and np.any(frames.imag):
        raise InputError(f"{file}: complex samples, but profile {profile.name!r} has adc: real")
    return [_cube(frame, profile, i) for i, frame in enumerate(frames)]


def _finite(data: NDArray[Any], file: Path) -> None:
    bad = int(np.sum(~np.isfinite(data)))
    if bad:
        raise InputError(f"{file}: {bad} samples are not finite numbers")


def read_dca1000(
    path: str | os.PathLike[str],
    profile: RadarProfile,
    *,
    layout: Layout = "two_lane",
    scale: float | None = None,
    swap_iq: bool = False,
) -> list[AdcCube]:
    """Read a raw capture of a DCA1000 card (``adc_data.bin``, headers of the UDP packets removed).

    Parameters
    ----------
    path : path
        Whole frames; a rest at the end that is no whole frame is refused.
    profile : RadarProfile
        Samples, loops, transmitters, receivers, multiplexing and whether samples are complex.
    layout : {"two_lane", "four_lane"}
        See the module.
    scale : float, optional
        sqrt(W) per count; from ``receiver.full_scale_dbm`` where ``None``.
    swap_iq : bool
        The Q words come before the I words, as with the device's sample swap set to Q first. A capture read the wrong
        way round has its ranges mirrored: near targets appear at the far end.

    Returns
    -------
    list of AdcCube
        One a frame; TDM chirps sorted to virtual channels, BPM blocks decoded.

    Raises
    ------
    NotFoundError, InputError
    """
    file = Path(path)
    _check_layout(layout, profile)
    factor = count_scale(profile) if scale is None else scale
    chirps, rx, samples = _chirp_shape(profile)
    parts = 2 if profile.waveform.adc == "complex" else 1
    try:
        size = file.stat().st_size
    except FileNotFoundError:
        raise NotFoundError(f"{file}: no such file") from None
    frame_bytes = chirps * rx * samples * parts * _WORD.itemsize
    if size == 0 or size % frame_bytes:
        raise InputError(
            f"{file}: {size} bytes are no whole number of frames of profile {profile.name!r} "
            f"({chirps} chirps x {rx} receivers x {samples} {profile.waveform.adc} samples = {frame_bytes} bytes)"
        )
    words = np.fromfile(file, dtype=_WORD).reshape(size // frame_bytes, chirps, -1)
    data = _unpack(words, rx, samples, parts, layout) * factor
    if swap_iq and parts == 2:
        data = data.imag + 1j * data.real
    return [_cube(_to_virtual(f, profile), profile, i) for i, f in enumerate(data)]


def write_dca1000(
    path: str | os.PathLike[str],
    frames: Sequence[AdcCube],
    *,
    layout: Layout = "two_lane",
    scale: float | None = None,
) -> Path:
    """Write cubes as a DCA1000 capture, rounded and clipped to int16; what :func:`read_dca1000` reads.

    Parameters
    ----------
    path : path
    frames : sequence of AdcCube
        Of one profile.
    layout : {"two_lane", "four_lane"}
    scale : float, optional
        sqrt(W) per count; from ``receiver.full_scale_dbm`` where ``None``.

    Raises
    ------
    InputError
        No frames, or of several profiles, or a layout the profile cannot have.
    """
    if not frames or any(f.profile != frames[0].profile for f in frames):
        raise InputError("a capture needs at least one frame, all of one profile")
    profile = frames[0].profile
    _check_layout(layout, profile)
    factor = count_scale(profile) if scale is None else scale
    parts = 2 if profile.waveform.adc == "complex" else 1
    chirps = np.stack([_to_chirps(f.data, profile) for f in frames]) / factor
    words = _pack(chirps, parts, layout)
    counts = np.clip(np.rint(words), -_FULL_SCALE, _FULL_SCALE - 1).astype(_WORD)

    def write(out: IO[bytes]) -> None:
        out.write(counts.tobytes())

    return atomic_write(path, write)


def _cube(data: ComplexArray, profile: RadarProfile, frame: int) -> AdcCube:
    # the noise is in the data; what is recorded is its nominal power, which SNR refers to
    return AdcCube(data=data, profile=profile, noise_power_w=cube_noise_power(profile), frame=frame)


def _check_layout(layout: str, profile: RadarProfile) -> None:
    if layout not in get_args(Layout):
        raise InputError(f"unknown capture layout {layout!r}; {did_you_mean(layout, get_args(Layout))}")
    if layout == "two_lane" and profile.waveform.adc == "complex" and profile.waveform.samples % 2:
        raise InputError(f"layout two_lane groups two samples; profile {profile.name!r} has an odd number of them")


def _chirp_shape(profile: RadarProfile) -> tuple[int, int, int]:
    """Return (chirps in a frame, receivers behind each, samples) as a card sees them."""
    w = profile.waveform
    if profile.array.multiplex == "simultaneous":
        return w.chirps, profile.n_virtual, w.samples
    return w.chirps * profile.n_chirps_per_loop, profile.n_rx, w.samples


def _unpack(words: NDArray[np.int16], rx: int, samples: int, parts: int, layout: Layout) -> ComplexArray:
    """Return (frame, chirp, rx, sample) counts from the (frame, chirp, word) words of a file."""
    lead = words.shape[:2]
    if layout == "four_lane":
        lanes = words.reshape(*lead, samples, parts, rx).astype(np.float64)
        split = np.moveaxis(lanes, (3, 4, 2), (0, 3, 4))
    elif parts == 2:
        pairs = words.reshape(*lead, rx, samples // 2, 2, 2).astype(np.float64)
        split = np.moveaxis(pairs, 4, 0).reshape(2, *lead, rx, samples)
    else:
        split = words.reshape(1, *lead, rx, samples).astype(np.float64)
    return np.asarray(split[0] + 1j * (split[1] if parts == 2 else 0.0), dtype=np.complex128)


def _pack(chirps: ComplexArray, parts: int, layout: Layout) -> FloatArray:
    """Return the words of a file, still unrounded, from (frame, chirp, rx, sample) counts."""
    split = np.stack([chirps.real, chirps.imag][:parts])
    if layout == "four_lane":
        return np.ascontiguousarray(np.moveaxis(split, (0, 3, 4), (3, 4, 2))).reshape(-1)
    if parts == 2:
        pairs = split.reshape(*split.shape[:-1], -1, 2)
        return np.ascontiguousarray(np.moveaxis(pairs, 0, 4)).reshape(-1)
    return split.reshape(-1)


def _to_virtual(chirps: ComplexArray, profile: RadarProfile) -> ComplexArray:
    """Return (loop, virtual, sample) from the (chirp, rx, sample) of one frame."""
    shape = (profile.waveform.chirps, profile.n_virtual, profile.waveform.samples)
    if profile.array.multiplex == "ddm":
        return decode(profile, chirps[:, None])
    if profile.array.multiplex != "bpm":
        return chirps.reshape(shape)
    block = chirps.reshape(shape[0], profile.n_tx, -1)
    decoded: ComplexArray = np.einsum("ct,lcx->ltx", hadamard(profile.n_tx), block) / profile.n_tx
    return decoded.reshape(shape)


def _to_chirps(data: ComplexArray, profile: RadarProfile) -> ComplexArray:
    """Return (chirp, rx, sample) of one frame from (loop, virtual, sample): the inverse of :func:`_to_virtual`."""
    shape = _chirp_shape(profile)
    if profile.array.multiplex == "ddm":  # the first transmitter has no ramp: its channels are the receivers
        return data[:, : profile.n_rx]
    if profile.array.multiplex != "bpm":
        return data.reshape(shape)
    block = data.reshape(shape[0] // profile.n_tx, profile.n_tx, -1)
    coded: ComplexArray = np.einsum("ct,ltx->lcx", hadamard(profile.n_tx), block)
    return coded.reshape(shape)
