"""Bars: a reference, limits on the difference from it, and what halving the ray spacing may change."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

import shenron_rt as srt
from shenron_rt._typing import BoolArray, FloatArray
from shenron_rt.rcs import DEFAULT_RAYS_PER_WAVELENGTH

#: mean, max: of |error|; at: |error| of one sample, the peak or boresight; median: error of the median level; highest:
#: the largest value itself, where a level is the result.
Statistic = Literal["mean", "max", "at", "median", "highest"]


@functools.lru_cache(maxsize=64)
def _shared(target: Any, options: tuple[tuple[str, Any], ...]) -> srt.RcsSweep:
    return srt.sweep_rcs(target, **dict(options))


@dataclass(frozen=True)
class Run:
    """How to measure.

    Parameters
    ----------
    shared : Path
        Folder of the reference tables and meshes.
    quick : bool
        A subset of the samples.
    finer : bool
        Half the default ray spacing.
    """

    shared: Path
    quick: bool = False
    finer: bool = False

    def thin(self, step: int) -> slice:
        """Return every ``step``-th sample of a quick run, all of a full one."""
        return slice(None, None, step if self.quick else 1)

    def sweep(self, target: Any, **options: Any) -> srt.RcsSweep:
        """Call ``sweep_rcs`` at the run's ray spacing; quick runs, which nobody times, share sweeps among bars."""
        if self.finer:
            options["rays_per_wavelength"] = 2.0 * DEFAULT_RAYS_PER_WAVELENGTH
        if not self.quick:
            return srt.sweep_rcs(target, **options)
        plain = ((k, tuple(v.tolist()) if isinstance(v, np.ndarray) else v) for k, v in options.items())
        return _shared(target, tuple(plain))


@dataclass(frozen=True, eq=False)
class Cut:
    """Levels computed and wanted, (n,) each, in the bar's unit; ``at`` is the sample of that statistic."""

    got: FloatArray
    want: FloatArray
    at: int = 0

    def kept(self, within_db: float | None) -> BoolArray:
        """Return which samples count: those whose reference lies within so much of its peak."""
        if within_db is None:
            return np.ones(len(self.want), dtype=bool)
        return np.asarray(self.want >= self.want.max() - within_db)


@dataclass(frozen=True)
class Limit:
    """The most a statistic may be, over samples within so many dB of the reference's peak; None: reported only.

    ``steady`` is whether halving the spacing must change it by less than half the limit.
    """

    statistic: Statistic
    most: float | None
    within_db: float | None = None
    steady: bool = True

    def __str__(self) -> str:
        name = {"at": "at the peak", "median": "median", "highest": "highest"}.get(self.statistic, self.statistic)
        return name if self.within_db is None else f"{name} within {self.within_db:g} dB"

    def value(self, cuts: Sequence[Cut]) -> float:
        """Return the statistic of the errors."""
        if self.statistic == "highest":
            return float(max(c.got.max() for c in cuts))
        if self.statistic == "median":
            return float(max(abs(np.median(c.got) - np.median(c.want)) for c in cuts))
        if self.statistic == "at":
            return float(max(abs(c.got[c.at] - c.want[c.at]) for c in cuts))
        errors = np.concatenate([np.abs(c.got - c.want)[c.kept(self.within_db)] for c in cuts])
        return float(errors.mean() if self.statistic == "mean" else errors.max())

    def change(self, cuts: Sequence[Cut], finer: Sequence[Cut]) -> float:
        """Return the same statistic of what halving the spacing changes."""
        if self.statistic == "highest":
            return abs(self.value(finer) - self.value(cuts))
        moved = [Cut(f.got, c.got, c.at) for c, f in zip(cuts, finer, strict=True)]
        if self.statistic in ("median", "at"):
            return self.value(moved)
        kept = [c.kept(self.within_db) for c in cuts]
        change = np.concatenate([np.abs(m.got - m.want)[k] for k, m in zip(kept, moved, strict=True)])
        return float(change.mean() if self.statistic == "mean" else change.max())


@dataclass(frozen=True)
class Figure:
    """One limit, measured; ``change`` is None where the ray spacing does not enter."""

    limit: Limit
    value: float
    change: float | None

    @property
    def holds(self) -> bool:
        """Whether the value keeps the limit, and would with finer rays."""
        most = self.limit.most
        if most is None:
            return True
        return self.value <= most and (self.change is None or not self.limit.steady or self.change < 0.5 * abs(most))


@dataclass(frozen=True)
class Bar:
    """One claim.

    Parameters
    ----------
    key, what, reference : str
        For tests and for the table.
    measure : callable
        From a run to its cuts.
    limits : sequence of Limit, or a callable that reads them from the shared folder
    unit : str
    rays : bool
        Whether rays are cast, so that their spacing matters.
    slow : bool
        Too long for the default tests even as a quick run.
    needs : str or None
        Subfolder of the shared material without which it cannot be measured.
    """

    key: str
    what: str
    reference: str
    measure: Callable[[Run], list[Cut]] = field(repr=False)
    limits: Sequence[Limit] | Callable[[Path], Sequence[Limit]] = field(repr=False)
    unit: str = "dB"
    rays: bool = True
    slow: bool = False
    needs: str | None = "reference"

    def figures(self, shared: Path, *, quick: bool) -> tuple[list[Figure], float]:
        """Measure all limits; return them and the wall time at the default spacing [s].

        Quick runs cast finer rays only where a limit asks what these change.
        """
        started = time.perf_counter()
        cuts = self.measure(Run(shared, quick))
        seconds = time.perf_counter() - started
        limits = self.limits(shared) if callable(self.limits) else self.limits
        asked = not quick or any(x.steady and x.most is not None for x in limits)
        finer = self.measure(Run(shared, quick, finer=True)) if self.rays and asked else None
        figures = [Figure(x, x.value(cuts), None if finer is None else x.change(cuts, finer)) for x in limits]
        return figures, seconds


def dbsm(amplitude: Any) -> FloatArray:
    """Return 20 log10 |amplitude|, not below the solver's floor of -120 dBsm."""
    return np.asarray(20.0 * np.log10(np.maximum(np.abs(amplitude), 1e-6)), dtype=np.float64)
