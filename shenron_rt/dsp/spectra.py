"""From ADC samples to the range-Doppler spectrum of every channel. Arrays in, arrays out."""

from __future__ import annotations

import numpy as np
from scipy import fft as sp_fft

from .._typing import ComplexArray, FloatArray
from .windows import window

__all__ = ["doppler_spectrum", "is_uniform", "range_spectrum", "slow_time_offsets"]


def range_spectrum(samples: ComplexArray, *, name: str, n_fft: int, real: bool) -> ComplexArray:
    """Transform fast time to range.

    Parameters
    ----------
    samples : (..., n) complex
        ADC samples [sqrt(W)].
    name : str
        Window.
    n_fft : int
        Length of the transform, >= n.
    real : bool
        The samples are those of a real converter, turned by a phase for each chirp at most: keep the positive half and
        scale by sqrt(2), so that the tone sqrt(2) Re(x) reads like x.

    Returns
    -------
    (..., n_range) complex
        A bin-centred tone of power P reads abs()**2 = P; n_range is n_fft, or n_fft // 2 of a real ADC.
    """
    w = window(name, samples.shape[-1])
    taper = w / w.sum()
    if real and np.any(samples.imag):
        whole = sp_fft.fft(samples * (np.sqrt(2.0) * taper), n_fft, axis=-1, overwrite_x=True)
        return np.asarray(whole[..., : n_fft // 2], dtype=np.complex128)
    if real:
        half = sp_fft.rfft(samples.real * (np.sqrt(2.0) * taper), n_fft, axis=-1)
        return np.asarray(half[..., : n_fft // 2], dtype=np.complex128)
    return np.asarray(sp_fft.fft(samples * taper, n_fft, axis=-1, overwrite_x=True), dtype=np.complex128)


def slow_time_offsets(chirp_start_s: FloatArray) -> FloatArray:
    """Return how much later than the mean channel each channel's chirps start [s], shape (n_virtual,)."""
    mean = chirp_start_s.mean(axis=0)
    return np.asarray(mean - mean.mean(), dtype=np.float64)


def is_uniform(chirp_start_s: FloatArray) -> bool:
    """Tell whether the loops follow each other at one interval.

    An interval that is off by 1e-7 of itself turns the phase of the last Doppler bin by 3e-7 rad per chirp.
    """
    if len(chirp_start_s) < 3:
        return True
    steps = np.diff(chirp_start_s, axis=0)
    return bool(np.ptp(steps) <= 1e-7 * steps.mean())


def doppler_spectrum(
    profiles: ComplexArray, *, name: str, n_fft: int, chirp_start_s: FloatArray, loop_period_s: float
) -> ComplexArray:
    """Transform slow time to Doppler and refer all channels to one time.

    Parameters
    ----------
    profiles : (n_loops, n_virtual, n_range) complex
        Range profiles.
    name : str
        Window.
    n_fft : int
        Number of Doppler bins, >= n_loops.
    chirp_start_s : (n_loops, n_virtual) float
        Starts of the chirps [s].
    loop_period_s : float
        Mean interval of the loops; bin q of the result is the Doppler frequency (q - n_fft // 2) / (n_fft T). [s]

    Returns
    -------
    (n_range, n_fft, n_virtual) complex
        Doppler ascending. Channels that start later are turned back by the phase that the bin's own (folded) velocity
        makes in the meantime (TDM phase compensation).

    Notes
    -----
    Loops at unequal intervals are non-uniform samples: they get the Fourier sum at their exact starts.
    """
    n_loops = len(profiles)
    w = window(name, n_loops)
    taper = w / w.sum()
    frequency = (np.arange(n_fft) - n_fft // 2) / (n_fft * loop_period_s)
    cube = np.ascontiguousarray(profiles.transpose(1, 2, 0))
    offsets = slow_time_offsets(chirp_start_s)
    if is_uniform(chirp_start_s):
        # a tone of -n_fft // 2 bins on the window brings the spectrum out in ascending order
        shift = np.exp(2j * np.pi * (n_fft // 2) / n_fft * np.arange(n_loops))
        spectrum = sp_fft.fft(cube * (taper * shift), n_fft, axis=-1, overwrite_x=True)
        if np.any(offsets):
            spectrum *= np.exp(-2j * np.pi * offsets[:, None, None] * frequency)
    else:
        mean_start = chirp_start_s.mean(axis=1)
        times = chirp_start_s - mean_start[0]
        kernel = taper[None, :, None] * np.exp(-2j * np.pi * times.T[:, :, None] * frequency)
        spectrum = cube @ kernel
    return np.ascontiguousarray(spectrum.transpose(1, 2, 0), dtype=np.complex128)
