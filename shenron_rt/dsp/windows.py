"""Tapers of the range and Doppler transforms, and their figures of merit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .._typing import FloatArray
from ..errors import InputError, did_you_mean

__all__ = ["WINDOWS", "WindowFigures", "window", "window_figures"]

#: Side-lobe level of the Taylor window [dB] and its number of nearly constant side lobes.
TAYLOR_SLL_DB, TAYLOR_NBAR = 35, 4
#: Side-lobe level of the Dolph-Chebyshev window [dB].
CHEBYSHEV_SLL_DB = 80
#: Zero padding behind the figures of merit; widths and peaks are read off this grid.
_PADDING = 512

# Cosine sums w = sum_k (-1)^k a_k cos(2 pi k n / N). Hamming and Blackman-Harris as in F. J. Harris, Proc. IEEE 66,
# 51-83 (1978), doi:10.1109/PROC.1978.10837.
_COSINE_SUMS = {
    "rect": (1.0,),
    "hann": (0.5, 0.5),
    "hamming": (0.54, 0.46),
    "blackmanharris": (0.35875, 0.48829, 0.14128, 0.01168),
}


def _cosine_sum(coefficients: tuple[float, ...]) -> Callable[[int], FloatArray]:
    def periodic(n: int) -> FloatArray:
        angle = 2 * np.pi * np.arange(n) / n
        signed = np.array([(-1) ** k * a for k, a in enumerate(coefficients)])
        return np.asarray(signed @ np.cos(np.arange(len(signed))[:, None] * angle), dtype=np.float64)

    return periodic


def _taylor(n: int) -> FloatArray:
    """Symmetric Taylor taper, peak 1: T. T. Taylor, IRE Trans. AP-3, 16-28 (1955), doi:10.1109/TPGAP.1955.5720407."""
    a2 = (np.arccosh(10 ** (TAYLOR_SLL_DB / 20)) / np.pi) ** 2
    stretch = TAYLOR_NBAR**2 / (a2 + (TAYLOR_NBAR - 0.5) ** 2)
    order = np.arange(1, TAYLOR_NBAR)
    m = order[:, None]
    zeros = np.prod(1 - m**2 / (stretch * (a2 + (order - 0.5) ** 2)), axis=1)
    others = np.prod(np.where(m == order, 1.0, 1 - (m / order) ** 2), axis=1)
    weight = (-1.0) ** (order + 1) * zeros / others
    taper = 1 + weight @ np.cos(2 * np.pi * m * (np.arange(n) - (n - 1) / 2) / n)
    return np.asarray(taper / (1 + weight.sum()), dtype=np.float64)


def _chebyshev(n: int) -> FloatArray:
    """Symmetric Dolph-Chebyshev taper, peak 1: C. L. Dolph, Proc. IRE 34, 335-348 (1946)."""
    order = n - 1
    x = np.cosh(np.arccosh(10 ** (CHEBYSHEV_SLL_DB / 20)) / order) * np.cos(np.pi * np.arange(n) / n)
    inside = np.cos(order * np.arccos(np.clip(x, -1, 1)))
    outside = np.sign(x) ** order * np.cosh(order * np.arccosh(np.maximum(np.abs(x), 1)))
    spectrum = np.where(np.abs(x) <= 1, inside, outside)
    taper = np.cos(2 * np.pi / n * np.outer(np.arange(n) - order / 2, np.arange(n))) @ spectrum
    return np.asarray(taper / taper.max(), dtype=np.float64)


_PERIODIC = {name: _cosine_sum(a) for name, a in _COSINE_SUMS.items()}
_SYMMETRIC = {"taylor": _taylor, "chebyshev": _chebyshev}
#: Names of the windows.
WINDOWS = (*_PERIODIC, *_SYMMETRIC)


@lru_cache(maxsize=128)
def window(name: str, n: int, periodic: bool | None = None) -> FloatArray:
    """Return the samples of a window.

    Parameters
    ----------
    name : str
        ``rect``, ``hann``, ``hamming``, ``blackmanharris``, ``taylor`` (nbar 4, -35 dB) or ``chebyshev`` (-80 dB).
    n : int
        Samples, >= 1.
    periodic : bool, optional
        Periodic (DFT-even: the first n of a symmetric window of n + 1) or symmetric. By default what the processing
        chain uses: periodic for the cosine sums, whose spectral zeros then fall on bins, symmetric for Taylor and
        Chebyshev, whose side lobes the periodic form spoils.

    Returns
    -------
    (n,) ndarray
        Read-only, peak near 1.

    Raises
    ------
    InputError
        Unknown name or n < 1.
    """
    if name not in WINDOWS:
        raise InputError(f"unknown window {name!r}; {did_you_mean(name, WINDOWS)}")
    if n < 1:
        raise InputError(f"window {name!r}: n must be >= 1, got {n}")
    as_periodic = name in _PERIODIC if periodic is None else periodic
    if n == 1:
        samples = np.ones(1)
    elif name in _PERIODIC:
        # the symmetric form has its two ends equal: one period of n - 1 samples and its first sample again
        samples = _PERIODIC[name](n) if as_periodic else np.resize(_PERIODIC[name](n - 1), n)
    else:
        samples = _SYMMETRIC[name](n + 1)[:-1] if as_periodic else _SYMMETRIC[name](n)
    samples = np.ascontiguousarray(samples)
    samples.setflags(write=False)
    return samples


@dataclass(frozen=True)
class WindowFigures:
    """Figures of merit of a window; bins are DFT bins of its own length.

    ``coherent_gain`` is the mean sample, ``enbw_bins`` the equivalent noise bandwidth n sum(w^2) / sum(w)^2,
    ``scalloping_db`` the loss of a tone half a bin off, ``peak_sidelobe_db`` the highest side lobe relative to the
    peak, ``width3db_bins`` and ``width6db_bins`` full widths at half power and half amplitude.
    """

    coherent_gain: float
    enbw_bins: float
    scalloping_db: float
    peak_sidelobe_db: float
    width3db_bins: float
    width6db_bins: float


def window_figures(samples: FloatArray) -> WindowFigures:
    """Return the figures of merit of window samples.

    Parameters
    ----------
    samples : (n,) array_like
        n >= 4.

    Notes
    -----
    Levels and widths are read from a spectrum padded 512 times, crossings by linear interpolation between its points.
    """
    w = np.asarray(samples, dtype=np.float64)
    if w.ndim != 1 or len(w) < 4:
        raise InputError(f"window_figures: a line of at least 4 samples is needed, got shape {w.shape}")
    spectrum = np.abs(np.fft.rfft(w, len(w) * _PADDING)) / w.sum()
    first_null = int(np.argmax(np.diff(spectrum) > 0))
    return WindowFigures(
        coherent_gain=float(w.mean()),
        enbw_bins=float(len(w) * np.sum(w**2) / w.sum() ** 2),
        scalloping_db=-20 * float(np.log10(spectrum[_PADDING // 2])),
        peak_sidelobe_db=20 * float(np.log10(spectrum[first_null:].max())),
        width3db_bins=_full_width(spectrum, np.sqrt(0.5)),
        width6db_bins=_full_width(spectrum, 0.5),
    )


def _full_width(spectrum: FloatArray, level: float) -> float:
    """Return twice the offset [bins] at which the main lobe first falls to ``level``."""
    after = int(np.argmax(spectrum < level))
    above, below = spectrum[after - 1], spectrum[after]
    return 2 * float(after - 1 + (above - level) / (above - below)) / _PADDING
