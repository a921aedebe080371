"""The same sweep with rays ever closer, and what the difference says."""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from .._typing import FloatArray
from ..errors import InputError
from ..rcs import DEFAULT_RAYS_PER_WAVELENGTH, RcsSweep, sweep_rcs
from ..scene.mesh import TaggedMesh

__all__ = ["Convergence", "ConvergenceStep", "compare_densities", "converge"]

#: Samples further below the peak of their frequency than this do not count [dB].
WITHIN_DB = 20.0
#: How often the density may be doubled in search of a target error.
MOST_DOUBLINGS = 4
#: A sweep of twice the density has four times the cells.
_DEARER = 4.0


@dataclass(frozen=True)
class ConvergenceStep:
    """What doubling the density of rays changed.

    Parameters
    ----------
    rays_per_wavelength : (coarse, fine)
    median_db, p90_db, max_db : float
        Of the absolute change, over samples within 20 dB of the peak of their frequency in the finer sweep.
    median_shift_db : float
        Largest change of the median over aspects, over frequencies and co-polarisations (or all, if there are no
        co-polarised ones).
    samples : int
        How many samples count.
    """

    rays_per_wavelength: tuple[float, float]
    median_db: float
    p90_db: float
    max_db: float
    median_shift_db: float
    samples: int

    def __str__(self) -> str:
        coarse, fine = self.rays_per_wavelength
        return (
            f"{coarse:g} to {fine:g} rays per wavelength changes {self.samples} samples within {WITHIN_DB:g} dB of the "
            f"peak by {self.median_db:.3f} dB (median), {self.p90_db:.3f} dB (90 %), {self.max_db:.2f} dB (at most); "
            f"the median over aspects by {self.median_shift_db:.3f} dB"
        )


@dataclass(frozen=True, eq=False)
class Convergence:
    """A study of convergence.

    Parameters
    ----------
    sweeps : tuple of RcsSweep
        From coarse to fine, each of twice the density of the one before.
    steps : tuple of ConvergenceStep
        Between neighbours.
    target_error_db : float or None
        What was asked for.
    reached : bool or None
        Whether the last step's median change is below it; None where nothing was asked for.
    stopped : str
        Why no finer sweep was made, in words.
    seconds : tuple of float
        What each sweep took [s].
    """

    sweeps: tuple[RcsSweep, ...]
    steps: tuple[ConvergenceStep, ...]
    target_error_db: float | None = None
    reached: bool | None = None
    stopped: str = ""
    seconds: tuple[float, ...] = field(default=(), repr=False)

    @property
    def finest(self) -> RcsSweep:
        """The last sweep."""
        return self.sweeps[-1]

    @property
    def says(self) -> str:
        """What the last difference means, in a sentence."""
        last = self.steps[-1]
        if self.target_error_db is not None:
            end = "reached" if self.reached else f"NOT reached ({self.stopped})"
            return f"{last}; target {self.target_error_db:g} dB {end}"
        return f"{last}; {_verdict(last)}"

    def to_dict(self) -> dict[str, Any]:
        """Return the study without its sweeps, as ``summary.json`` has it."""
        return {
            "steps": [asdict(s) for s in self.steps],
            "target_error_db": self.target_error_db,
            "reached": self.reached,
            "stopped": self.stopped,
            "seconds": list(self.seconds),
            "says": self.says,
        }


def _verdict(step: ConvergenceStep) -> str:
    if step.p90_db <= 0.1:
        return "converged: rays as they are say what the model can"
    if step.median_shift_db <= 0.3 and step.median_db <= 0.5:
        return "statistics over aspect hold, single lobes do not yet: more rays per wavelength for those"
    return "not converged: more rays per wavelength, or --target-error-db"


def compare_densities(coarse: RcsSweep, fine: RcsSweep) -> ConvergenceStep:
    """Return what changed between two sweeps of the same axes.

    Raises
    ------
    InputError
        Sweeps of other axes.
    """
    axes = ("frequency_hz", "elevation_deg", "azimuth_deg", "polarization")
    differ = [a for a in axes if not np.array_equal(getattr(coarse, a), getattr(fine, a))]
    if differ:
        raise InputError(f"compare_densities: the sweeps differ in {', '.join(differ)}; give two of the same axes")
    peak = fine.rcs_dbsm.max(axis=(1, 2, 3), keepdims=True)
    strong = fine.rcs_dbsm >= peak - WITHIN_DB
    change = np.abs(coarse.rcs_dbsm - fine.rcs_dbsm)
    same = [p[0] == p[1] for p in fine.polarization]
    shift = np.abs(_medians(coarse) - _medians(fine))[:, same if any(same) else slice(None)]
    median, p90 = np.percentile(change[strong], [50, 90])
    densities = coarse.rays_per_wavelength, fine.rays_per_wavelength
    return ConvergenceStep(
        densities, float(median), float(p90), float(change[strong].max()), float(shift.max()), int(strong.sum())
    )


def _medians(sweep: RcsSweep) -> FloatArray:
    """Return (n_freq, n_pol) medians over aspects [dBsm]."""
    return np.asarray(np.median(sweep.rcs_dbsm, axis=(1, 2)))


def converge(
    target: TaggedMesh | str,
    *,
    target_error_db: float | None = None,
    most_doublings: int = MOST_DOUBLINGS,
    max_seconds: float | None = None,
    before: Callable[[float, float | None], None] | None = None,
    **sweep: Any,  # what sweep_rcs takes
) -> Convergence:
    """Sweep at two densities of rays, or at ever doubled ones until the change is small enough.

    Parameters
    ----------
    target, **sweep
        As :func:`shenron_rt.sweep_rcs`; ``rays_per_wavelength`` is the first density.
    target_error_db : float, optional
        Double the density until the median change of samples within 20 dB of the peak is at most this [dB]. Without
        it the density is doubled once.
    most_doublings : int
        How often at most.
    max_seconds : float, optional
        No finer sweep is begun that would end later than this after the beginning, by the time of the last one.
    before : callable, optional
        Told the density of every sweep and its expected seconds (None: unknown) before it begins.

    Returns
    -------
    Convergence

    Raises
    ------
    InputError
        A target error that is not positive, and what ``sweep_rcs`` raises.

    Notes
    -----
    A doubling shows the error of the coarser sweep. That of the finer one is smaller: edges are cut finer with the
    cells, so it about halves with every doubling.
    """
    if target_error_db is not None and not target_error_db > 0.0:
        raise InputError(f"target_error_db: {target_error_db}; allowed: > 0")
    if most_doublings < 1:
        raise InputError(f"most_doublings: {most_doublings}; allowed: 1 or more")
    started = clock.perf_counter()
    sweeps: list[RcsSweep] = []
    steps: list[ConvergenceStep] = []
    seconds: list[float] = []
    reached: bool | None = None if target_error_db is None else False
    stopped = ""
    while not stopped:
        density = sweeps[-1].rays_per_wavelength * 2.0 if sweeps else sweep.get("rays_per_wavelength")
        density = DEFAULT_RAYS_PER_WAVELENGTH if density is None else float(density)
        expected = seconds[-1] * _DEARER if seconds else None
        begun = clock.perf_counter()
        if before is not None:
            before(density, expected)
        sweeps.append(sweep_rcs(target, **sweep | {"rays_per_wavelength": density}))
        seconds.append(clock.perf_counter() - begun)
        if len(sweeps) == 1:
            continue
        steps.append(compare_densities(*sweeps[-2:]))
        if target_error_db is None:
            stopped = "twice the density"
        elif steps[-1].median_db <= target_error_db:
            reached, stopped = True, "target reached"
        elif len(steps) == most_doublings:
            stopped = f"{most_doublings} doublings are the limit"
        elif max_seconds is not None and clock.perf_counter() - started + seconds[-1] * _DEARER > max_seconds:
            stopped = f"the next doubling would take about {seconds[-1] * _DEARER:.0f} s, beyond {max_seconds:g} s"
    return Convergence(tuple(sweeps), tuple(steps), target_error_db, reached, stopped, tuple(seconds))
