"""Classical CFAR constants: independent cells of exponential power (square-law detector, one channel)."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

import numpy as np

from ..errors import InputError, did_you_mean

__all__ = ["CfarKind", "cfar_alpha", "cfar_pfa", "os_rank"]

CfarKind = Literal["ca", "go", "so", "os"]
#: Rank of the ordered statistic as a part of the training cells (Rohling's choice).
OS_RANK_PART = 0.75


def os_rank(n: int) -> int:
    """Return the rank k (1 = smallest) of the ordered-statistic detector with n training cells."""
    return max(1, round(OS_RANK_PART * n))


def _pfa_ca(alpha: float, n: int, rank: int) -> float:
    return float((1 + alpha / n) ** -n)


def _pfa_os(alpha: float, n: int, rank: int) -> float:
    i = np.arange(rank)
    return float(np.exp(-np.sum(np.log1p(alpha / (n - i)))))


def _pfa_smaller(alpha: float, n: int, rank: int) -> float:
    half = n // 2
    t, k = alpha / half, np.arange(half)
    # log of the binomial (half - 1 + k over k): the sum has only positive terms
    binomial = np.array([math.lgamma(half + j) - math.lgamma(half) - math.lgamma(j + 1) for j in range(half)])
    return float(2 * np.sum(np.exp(binomial - (half + k) * np.log(2 + t))))


def _pfa_greater(alpha: float, n: int, rank: int) -> float:
    # the larger and the smaller half together are both halves: Pfa_GO + Pfa_SO = 2 Pfa of one half
    return 2 * float((1 + alpha / (n // 2)) ** -(n // 2)) - _pfa_smaller(alpha, n, rank)


_PFA: dict[str, Callable[[float, int, int], float]] = {
    "ca": _pfa_ca,
    "go": _pfa_greater,
    "so": _pfa_smaller,
    "os": _pfa_os,
}


def check_kind(kind: str) -> None:
    """Raise InputError for an unknown detector."""
    if kind not in _PFA:
        raise InputError(f"unknown cfar {kind!r}; {did_you_mean(kind, _PFA)}")


def cfar_pfa(n: int, alpha: float, cfar: str = "ca", *, rank: int | None = None) -> float:
    """Return the false-alarm probability of threshold = alpha * statistic; arguments as in :func:`cfar_alpha`."""
    check_kind(cfar)
    if n < 1 or (cfar in ("go", "so") and n % 2):
        raise InputError(f"cfar {cfar!r}: n must be >= 1, and even for go and so; got {n}")
    k = os_rank(n) if rank is None else rank
    if not 1 <= k <= n:
        raise InputError(f"cfar: rank must be 1 to n = {n}, got {k}")
    return _PFA[cfar](alpha, n, k)


def cfar_alpha(n: int, pfa: float, cfar: str = "ca", *, rank: int | None = None) -> float:
    """Return the classical threshold multiplier.

    Parameters
    ----------
    n : int
        Training cells; for ``go`` and ``so`` in two equal halves.
    pfa : float
        False-alarm probability of a cell, 0 to 1.
    cfar : {"ca", "go", "so", "os"}
        Threshold = alpha * mean of the cells, of the larger half, of the smaller half, or alpha * the ``rank``-th
        smallest cell.
    rank : int, optional
        Of ``os``; 0.75 n by default.

    Returns
    -------
    float

    Notes
    -----
    Independent training cells of exponential power, one channel:
    CA (1 + alpha/n)^-n; OS prod_{i<k} (n - i)/(n - i + alpha); SO 2 sum_{k<m} C(m-1+k, k) (2 + alpha/m)^-(m+k) with
    m = n/2; GO 2 (1 + alpha/m)^-m - SO.

    References
    ----------
    .. [1] P. P. Gandhi, S. A. Kassam, IEEE Trans. Aerosp. Electron. Syst. 24, 427-445 (1988), doi:10.1109/7.7185.

    Examples
    --------
    >>> round(cfar_alpha(16, 1e-3), 4)
    8.6388
    """
    if not 0 < pfa < 1:
        raise InputError(f"cfar: pfa must be between 0 and 1, got {pfa}")
    return solve_alpha(lambda alpha: cfar_pfa(n, alpha, cfar, rank=rank), pfa)


def solve_alpha(pfa_of: Callable[[float], float], pfa: float) -> float:
    """Return the multiplier at which a falling false-alarm curve takes the value ``pfa``."""
    from scipy.optimize import brentq

    def miss(log_alpha: float) -> float:
        return math.log(max(pfa_of(math.exp(log_alpha)), 1e-300)) - math.log(pfa)

    high = 1.0
    while miss(high) > 0 and high < 300:
        high += 2.0
    low = -1.0
    while miss(low) < 0 and low > -300:
        low -= 2.0
    return math.exp(float(brentq(miss, low, high, xtol=1e-13, rtol=1e-13)))
