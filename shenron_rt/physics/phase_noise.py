"""Phase noise of an oscillator, and what de-chirping with the same oscillator leaves of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["dechirped_phase_noise", "single_sideband_level"]

FloatArray = NDArray[np.float64]


def single_sideband_level(offset_hz: ArrayLike, table: Sequence[tuple[float, float]]) -> FloatArray:
    """Return the single-sideband phase noise L(f), noise power in 1 Hz over carrier power.

    Parameters
    ----------
    offset_hz : array_like
        Distance from the carrier, > 0. [Hz]
    table : sequence of (float, float)
        Offset [Hz], ascending, and level [dBc/Hz]; straight lines in dB over the logarithm of the offset between them,
        the level of the nearest end outside.

    Returns
    -------
    array of the same shape [1/Hz]
    """
    offsets, levels = np.asarray(table, dtype=np.float64).T
    level = np.interp(np.log10(np.asarray(offset_hz, dtype=np.float64)), np.log10(offsets), levels)
    return np.asarray(10 ** (level / 10), dtype=np.float64)


def dechirped_phase_noise(offset_hz: ArrayLike, delay_s: ArrayLike, table: Sequence[tuple[float, float]]) -> FloatArray:
    """Return the single-sideband phase noise of a beat signal over its power, L(f) 4 sin^2(pi f tau).

    Parameters
    ----------
    offset_hz : array_like
        Distance from the beat frequency, > 0. [Hz]
    delay_s : array_like
        Two-way delay of the echo. [s]
    table : sequence of (float, float)
        As for :func:`single_sideband_level`.

    Returns
    -------
    array of the broadcast shape [1/Hz]

    Notes
    -----
    Echo and local oscillator share phi(t): phi(t) - phi(t - tau) has the power transfer abs(1 - e^{-j 2 pi f tau})^2.

    References
    ----------
    M. P. Burt, M. C. Budge, "Range correlation effects on phase noise spectra", 25th Southeastern Symposium on System
    Theory (1993), doi:10.1109/SSST.1993.522829.
    """
    f = np.asarray(offset_hz, dtype=np.float64)
    correlation = 4 * np.sin(np.pi * f * np.asarray(delay_s, dtype=np.float64)) ** 2
    return np.asarray(single_sideband_level(f, table) * correlation, dtype=np.float64)
