"""What ``shenron-rt rcs`` does with its options: plan, sweep, refine, write."""

from __future__ import annotations

import functools
import time as clock
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..constants import SPEED_OF_LIGHT
from ..errors import InputError
from .common import progress, say
from .rcs_options import RcsOptions, load_target

if TYPE_CHECKING:
    from ..rcs import RcsSweep
    from ..scene.mesh import TaggedMesh
    from ..turntable import Convergence, SweepPlan

__all__ = ["RcsJob", "check_positive"]

#: Wavelengths over how far facets may lie from a round surface: 0.05 rad of phase there and back.
_ROUND = 256.0


def check_positive(**options: float | None) -> None:
    """Refuse values, by the names of their options, that are not more than 0; None is not given."""
    for name, value in options.items():
        if value is not None and not value > 0.0:
            raise InputError(f"--{name.replace('_', '-')} {value:g}: more than 0 is needed")


@dataclass(frozen=True)
class RcsJob:
    """A target, how it is swept, how far that is refined, and what is made of it.

    Parameters
    ----------
    target, mesh_frame, units, manifest
        As on the command line.
    options : RcsOptions
        Of the sweep.
    converge : bool
        Sweep again at twice the density.
    target_error_db : float or None
        Double the density until the median change is at most this [dB].
    max_seconds : float or None
        Longest run; None is without limit [s].
    window_deg : float or None
        Of the statistics [deg].
    round_below_deg : float or None
        Facets that meet at less are rounded; None leaves them [deg].
    pictures, quiet : bool
    """

    target: str
    mesh_frame: str
    units: str
    manifest: Path | None
    options: RcsOptions
    _: KW_ONLY
    converge: bool
    target_error_db: float | None
    max_seconds: float | None
    window_deg: float | None
    round_below_deg: float | None
    pictures: bool
    quiet: bool

    def __post_init__(self) -> None:
        check_positive(
            target_error_db=self.target_error_db, window_deg=self.window_deg, round_below_deg=self.round_below_deg
        )

    @functools.cached_property
    def _loaded(self) -> tuple[str, TaggedMesh]:
        from ..scene.rounding import round_mesh

        parts = self.options.material is None
        name, mesh = load_target(
            self.target, mesh_frame=self.mesh_frame, units=self.units, parts=parts, manifest=self.manifest
        )
        if self.round_below_deg is not None:
            shortest = SPEED_OF_LIGHT / max(self.options.arguments()["frequency_hz"])
            mesh = round_mesh(mesh, shortest / _ROUND, below_deg=self.round_below_deg)
        return name, mesh

    @property
    def name(self) -> str:
        """Name of the target."""
        return self._loaded[0]

    @property
    def refines(self) -> bool:
        """Whether several densities are compared."""
        return self.converge or self.target_error_db is not None

    @functools.cached_property
    def _plans(self) -> tuple[SweepPlan, SweepPlan]:
        """Of the first sweep, and of all that are sure to come."""
        from ..turntable.plan import plan_sweep

        _, mesh = self._loaded
        with progress(1, "trying a few aspects", quiet=self.quiet):
            first = plan_sweep(mesh, **self.options.arguments())
            if not self.refines:
                return first, first
            return first, first + plan_sweep(mesh, **self.options.doubled().arguments())

    @property
    def cost(self) -> SweepPlan:
        """What the job takes."""
        return self._plans[1]

    def check(self) -> None:
        """Refuse a job that takes too long."""
        from ..turntable.plan import check_plan

        check_plan(self.cost, float("inf") if self.max_seconds is None else self.max_seconds)

    def run(self, root: Path) -> dict[str, Any]:
        """Sweep, write all files into a folder and return the summary."""
        from .rcs_output import write_results

        if not self.quiet:
            say(f"{self.name}: {self.cost}")
        started = clock.perf_counter()
        sweep, report = self._sweep()
        facts = {
            "target": self.name, "seconds": clock.perf_counter() - started, "settings": self.options.record(),
            "plan": self.cost.to_dict(), "convergence": None if report is None else report.to_dict(),
        }  # fmt: skip
        source = {
            "target": _located(self.target), "mesh_frame": self.mesh_frame, "units": self.units,
            "manifest": self.manifest, "round_below_deg": self.round_below_deg,
        }  # fmt: skip
        return write_results(
            root, sweep, self._loaded[1], facts, source, window_deg=self.window_deg, report=report,
            pictures=self.pictures,
        )  # fmt: skip

    def _sweep(self) -> tuple[RcsSweep, Convergence | None]:
        """Return the (finest) sweep, and the report where densities are compared."""
        from ..rcs import sweep_rcs
        from ..turntable.convergence import converge

        name, mesh = self._loaded
        seconds, arguments = self._plans[0].seconds, self.options.arguments()
        with progress(100, "sweeping", quiet=self.quiet) as step:
            bar = _Bar(step, f"sweeping, % done of about {seconds:.0f} s")
            if not self.refines:
                return replace(sweep_rcs(mesh, **arguments, progress=bar.show), target=name), None

            def before(density: float, expected: float | None) -> None:
                bar.restart(f"{density:g} rays per wavelength, % done of about {expected or seconds:.0f} s")

            report = converge(
                mesh, target_error_db=self.target_error_db, max_seconds=self.max_seconds, before=before,
                progress=bar.show, **arguments,
            )  # fmt: skip
        return replace(report.finest, target=name), report


class _Bar:
    """A progress bar that is told shares."""

    def __init__(self, step: Callable[..., None], what: str) -> None:
        self._step, self._what, self._shown = step, what, 0

    def restart(self, what: str) -> None:
        """Begin a next part."""
        self._what = what
        self.show(0.0)

    def show(self, share: float) -> None:
        """Fill the bar so far."""
        percent = int(100.0 * share)
        self._step(self._what, advance=percent - self._shown)
        self._shown = percent


def _located(target: str) -> str:
    file = Path(target)
    return str(file.resolve()) if file.is_file() else target
