"""How long a sweep will take and what memory it needs, measured on a few of its aspects before it starts."""

from __future__ import annotations

import os
import time as clock
import tracemalloc
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from .._typing import ArrayLike, FloatArray, IntArray
from ..errors import InputError
from ..rcs import DEFAULT_RAYS_PER_WAVELENGTH, cell_side, sweep_rcs
from ..sbr.solver import CHUNK
from ..scene.mesh import TaggedMesh
from ..tracing.caster import RayCaster

__all__ = ["SweepPlan", "check_plan", "machine_memory", "plan_sweep"]

#: Seconds that the timed part of a trial shall about take; an aspect that takes long is swept once for
#: it, and what is over in no time twice.
_TRIAL_SECONDS, _LONG_SECONDS, _SHORT_SECONDS = 1.5, 3.0, 0.7
#: Aspects that a trial has at least, and frequencies at most.
_LEAST_ASPECTS, _FEW = 5, 8
#: Cells of an aspect beyond which the trial is made with fewer rays, and scaled.
_TRIAL_CELLS = 2_000_000
#: Bytes kept for every frequency and aspect: four complex amplitudes, their sum, and copies on the way out.
_BYTES_A_RESULT = 4 * 16 * 4


@dataclass(frozen=True)
class SweepPlan:
    """What a sweep will cost.

    Parameters
    ----------
    frequencies, aspects : int
    cells : int
        Of the coarsest lattice, all aspects together.
    rays : int
        Cast on the way, bounces and finer cells at edges included.
    seconds : float
        Wall time of the sweep, reading the mesh and pictures apart [s].
    memory_bytes : int
        Peak of the process.
    machine_bytes : int
        What this machine, or the container, has.
    trial_seconds : float
        What the estimate itself took.
    trial_aspects : int
        On how many aspects it rests.
    """

    frequencies: int
    aspects: int
    cells: int
    rays: int
    seconds: float
    memory_bytes: int
    machine_bytes: int
    trial_seconds: float
    trial_aspects: int

    def __add__(self, other: SweepPlan) -> SweepPlan:
        """Return the cost of both sweeps, one after the other."""
        return replace(
            other,
            cells=self.cells + other.cells,
            rays=self.rays + other.rays,
            seconds=self.seconds + other.seconds,
            memory_bytes=max(self.memory_bytes, other.memory_bytes),
            trial_seconds=self.trial_seconds + other.trial_seconds,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the plan as ``summary.json`` has it."""
        return asdict(self)

    def __str__(self) -> str:
        n, f = self.aspects, self.frequencies
        return (
            f"{n} aspect{'s' * (n != 1)} x {f} frequenc{'ies' if f != 1 else 'y'}: {self.cells:.3g} cells, "
            f"about {self.rays:.2g} rays, {_duration(self.seconds)}, peak memory {self.memory_bytes / 1e9:.1f} GB of "
            f"{self.machine_bytes / 1e9:.0f} GB (from a trial of {self.trial_aspects})"
        )


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.1f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


@dataclass(frozen=True)
class _Trial:
    """Some aspects that were swept: their share of the work, seconds, rays, and peak bytes of their arrays."""

    share: float
    seconds: float
    rays: int
    peak: int = 0


def plan_sweep(
    mesh: TaggedMesh,
    *,
    frequency_hz: ArrayLike,
    azimuth_deg: ArrayLike,
    elevation_deg: ArrayLike = 0.0,
    rays_per_wavelength: float | None = None,
    distance_m: float | None = None,
    bistatic: tuple[float, float] | None = None,
    **settings: Any,  # what else sweep_rcs takes
) -> SweepPlan:
    """Run a sweep on a few of its aspects and say what all of it will cost.

    Parameters
    ----------
    mesh : TaggedMesh
    frequency_hz, azimuth_deg, elevation_deg, rays_per_wavelength, distance_m, bistatic, **settings
        As :func:`shenron_rt.sweep_rcs`.

    Returns
    -------
    SweepPlan

    Raises
    ------
    InputError, BackendError
        What ``sweep_rcs`` raises.

    Notes
    -----
    One aspect warms up and compiles; then as many, evenly spread, as take some 1.5 s are timed with up to eight
    frequencies, and with one where there are more. Time and rays are taken to grow with the cells of the aspects (in a
    bistatic sweep, with the receivers) and linearly with frequencies. Memory is what the process holds, plus the peak
    of the trial's arrays, scaled to a full batch of cells. Aspects of more than two million cells are tried with fewer
    rays and scaled by their number.
    """
    frequency, azimuth, elevation = (
        np.atleast_1d(np.asarray(a, dtype=np.float64)) for a in (frequency_hz, azimuth_deg, elevation_deg)
    )
    density = DEFAULT_RAYS_PER_WAVELENGTH if rays_per_wavelength is None else rays_per_wavelength
    if min(len(frequency), len(azimuth), len(elevation)) == 0 or not (frequency.max() > 0.0 and density > 0.0):
        raise InputError("plan_sweep: frequencies above 0, azimuths, elevations and rays per wavelength are needed")
    el, az = (a.ravel() for a in np.meshgrid(elevation, azimuth, indexing="ij"))
    lit = (az, el) if bistatic is None else (np.array([bistatic[0]]), np.array([bistatic[1]]))
    cells = lattice_cells(mesh, lit[0], lit[1], cell_side(float(frequency.max()), density, distance_m))
    thinned = min(1.0, _TRIAL_CELLS / float(cells.max()))
    work = cells * thinned if bistatic is None else np.ones(len(az))
    fixed = settings | {
        "rays_per_wavelength": density * np.sqrt(thinned), "distance_m": distance_m, "bistatic": bistatic
    }  # fmt: skip
    started = clock.perf_counter()
    trial = _Bench(mesh, frequency, azimuth, elevation, work.reshape(len(elevation), len(azimuth)), fixed)
    seconds, rays, peak, tried = trial.extrapolate(float(cells.mean() * thinned) if bistatic is None else float(CHUNK))
    memory = _resident_bytes() + peak + len(frequency) * len(az) * _BYTES_A_RESULT
    return SweepPlan(
        len(frequency), len(az), int(cells.sum()), int(rays / thinned), seconds / thinned, int(memory),
        machine_memory(), clock.perf_counter() - started, tried,
    )  # fmt: skip


def lattice_cells(mesh: TaggedMesh, azimuth_deg: FloatArray, elevation_deg: FloatArray, spacing: float) -> FloatArray:
    """Return (n,) how many cells of a side [m] cover the silhouette's bounding rectangle, seen from each direction."""
    az, el = np.radians(azimuth_deg), np.radians(elevation_deg)
    h = np.stack([-np.sin(az), np.cos(az), np.zeros_like(az)])
    v = np.stack([-np.sin(el) * np.cos(az), -np.sin(el) * np.sin(az), np.cos(el)])
    points = mesh.vertices[np.unique(mesh.faces)]
    sides = []
    for start in range(0, len(az), 64):  # bounds memory: vertices times aspects
        part = slice(start, start + 64)
        sides.append([np.ptp(points @ axis[:, part], axis=0) for axis in (h, v)])
    width, height = (np.concatenate(s) for s in zip(*sides, strict=True))
    return np.asarray((np.ceil(width / spacing) + 1.0) * (np.ceil(height / spacing) + 1.0))


@dataclass(frozen=True, eq=False)
class _Bench:
    """Aspects of a sweep to be tried; ``work`` (n_el, n_az) is what time is taken to be proportional to."""

    mesh: TaggedMesh
    frequency: FloatArray
    azimuth: FloatArray
    elevation: FloatArray
    work: FloatArray
    fixed: dict[str, Any]

    def extrapolate(self, cells_an_aspect: float) -> tuple[float, float, float, int]:
        """Return seconds, rays and peak bytes of the whole, and of how many aspects they were measured."""
        f = self.frequency
        few = f if len(f) <= _FEW else np.sort(f)[_spread(len(f), _FEW, ends=True)]
        middle = np.array([len(self.elevation) // 2]), np.array([len(self.azimuth) // 2])
        one = self.run(middle, few)  # kernels are compiled and libraries loaded
        if one.seconds < _LONG_SECONDS:
            one = self.run(middle, few)
        least = _LEAST_ASPECTS if one.seconds < _LONG_SECONDS else 2
        grid = self.grid(max(int(_TRIAL_SECONDS / max(one.seconds, 1e-4)), least))
        many = self.run(grid, few)
        a_batch = max(1, int(np.ceil(CHUNK / max(cells_an_aspect, 1.0))))
        if many.seconds < _SHORT_SECONDS:  # aspects share the fixed costs of a batch: fill one, or try these again
            tried = len(grid[0]) * len(grid[1])
            again = self.grid(min(max(tried, a_batch), max(tried, int(tried * _TRIAL_SECONDS / many.seconds))))
            larger = self.run(again, few)
            if larger.seconds / larger.share < many.seconds / many.share:
                grid, many = again, larger
        seconds, rays = many.seconds / many.share, many.rays / many.share
        batch = grid[0][:1], grid[1][:a_batch]
        traced = self.run(batch, few, traced=True)
        # memory grows until a batch of cells is full
        full = min(1.0 / traced.share, max(CHUNK / (len(batch[1]) * cells_an_aspect), 1.0))
        peak = traced.peak * full
        if len(f) > len(few):
            top = f[[int(f.argmax())]]
            more = (len(f) - len(few)) / (len(few) - 1)
            seconds += more * max(many.seconds - self.run(grid, top).seconds, 0.0) / many.share
            peak += more * max(traced.peak - self.run(batch, top, traced=True).peak, 0) * full
        return seconds, rays, peak, len(grid[0]) * len(grid[1])

    def grid(self, count: int) -> tuple[IntArray, IntArray]:
        """Return rows and columns of about ``count`` aspects, spread over elevation and azimuth."""
        n_el, n_az = self.work.shape
        rows = min(n_el, max(round(np.sqrt(count * n_el / n_az)), min(2, count // 3)), count) or 1
        return _spread(n_el, rows), _spread(n_az, -(-count // rows))

    def run(self, grid: tuple[IntArray, IntArray], frequency: FloatArray, *, traced: bool = False) -> _Trial:
        """Sweep some aspects and measure; tracing memory slows small ones down, so that is another run."""
        share = float(self.work[np.ix_(*grid)].sum() / self.work.sum())
        rays, peak = RayCaster.rays_cast, 0
        if traced:
            tracemalloc.start()
        begun = clock.perf_counter()
        try:
            el, az = self.elevation[grid[0]], self.azimuth[grid[1]]
            sweep_rcs(self.mesh, frequency_hz=frequency, azimuth_deg=az, elevation_deg=el, **self.fixed)
            seconds = clock.perf_counter() - begun
            if traced:
                peak = tracemalloc.get_traced_memory()[1]
        finally:
            if traced:
                tracemalloc.stop()
        return _Trial(share, seconds, RayCaster.rays_cast - rays, peak)


def _spread(n: int, count: int, *, ends: bool = False) -> IntArray:
    """Return about ``count`` rows of ``n``, evenly spread; without the ends, often symmetric and atypical aspects."""
    if count >= n:
        return np.arange(n)
    if ends:
        return np.unique(np.linspace(0, n - 1, count).round().astype(np.int64))
    return np.unique(np.linspace(0, n - 1, count + 2).round().astype(np.int64)[1:-1])


def check_plan(plan: SweepPlan, max_seconds: float) -> None:
    """Refuse a sweep that this machine cannot hold, or that takes too long.

    Raises
    ------
    InputError
        With what to change.
    """
    advice = "a coarser step, fewer aspects or frequencies, or fewer --rays-per-wavelength"
    if plan.memory_bytes > plan.machine_bytes:
        raise InputError(
            f"rcs: needs about {plan.memory_bytes / 1e9:.1f} GB, this machine has {plan.machine_bytes / 1e9:.1f} GB; "
            f"take {advice}"
        )
    if plan.seconds > max_seconds:
        raise InputError(
            f"rcs: would take about {_duration(plan.seconds)}, more than {_duration(max_seconds)} (--max-seconds); "
            f"take {advice}, or give --yes"
        )


def machine_memory() -> int:
    """Return the bytes of memory that this process may use: the machine's, or its container's if that is less."""
    physical = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    try:
        limit = int(Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii"))
    except (OSError, ValueError):  # no cgroup, or "max"
        return physical
    return min(physical, limit)


def _resident_bytes() -> int:
    """Return the memory this process holds now; where the system does not say, its peak so far."""
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    except OSError:
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return pages * os.sysconf("SC_PAGE_SIZE")
