"""What ``shenron-rt rcs`` leaves behind: table, arrays, summary, config, pictures."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .common import say, show_table

if TYPE_CHECKING:
    from .._typing import FloatArray
    from ..rcs import RcsSweep
    from ..scene.mesh import TaggedMesh
    from ..turntable import Convergence, Reference

__all__ = ["show_summary", "write_results"]

_MAX_ROWS = 12


def write_results(
    root: Path,
    sweep: RcsSweep,
    mesh: TaggedMesh,
    facts: Mapping[str, Any],
    source: Mapping[str, Any],
    *,
    window_deg: float | None,
    report: Convergence | None,
    pictures: bool,
) -> dict[str, Any]:
    """Write all files of a sweep and return the summary."""
    from .. import runs
    from ..tracing.backend import choose_backend
    from ..turntable import reference_of
    from . import _version

    metal = facts["settings"]["material"] == "metal"
    reference = reference_of(sweep) if metal else None
    sweep.save(root / "rcs.npz")
    sweep.to_csv(root / "rcs.csv")
    drawn: list[str] = []
    notes: list[str] = []
    if pictures:
        from .rcs_pictures import draw

        drawn, notes = draw(root, sweep, mesh, reference, report, window_deg)
    summary = {
        "version": _version(),
        "backend": choose_backend(facts["settings"]["backend"]),
        "seed": sweep.seed,
        **facts,
        "rays_per_wavelength": sweep.rays_per_wavelength,
        "peak": _peak(sweep),
        "statistics": _statistics(sweep),
        "reference": None if reference is None else _deviation(sweep, reference),
        "pictures": drawn,
        "notes": notes,
    }
    runs.write_json(root / "summary.json", summary)
    _write_config(root / "config.yaml", facts["settings"], source)
    return summary


def _dbsm(power: float) -> float:
    return 10.0 * math.log10(max(power, 1e-12))


def _peak(sweep: RcsSweep) -> dict[str, Any]:
    import numpy as np

    f, e, a, p = np.unravel_index(int(sweep.rcs_m2.argmax()), sweep.rcs_m2.shape)
    return {
        "rcs_dbsm": float(sweep.rcs_dbsm[f, e, a, p]),
        "frequency_hz": float(sweep.frequency_hz[f]),
        "elevation_deg": float(sweep.elevation_deg[e]),
        "azimuth_deg": float(sweep.azimuth_deg[a]),
        "polarization": sweep.polarization[p],
    }


def _statistics(sweep: RcsSweep) -> list[dict[str, Any]]:
    """Return one record a frequency and polarisation, over all aspects; the mean is that of linear power."""
    import numpy as np

    records = []
    for f, frequency in enumerate(sweep.frequency_hz.tolist()):
        for p, name in enumerate(sweep.polarization):
            power: FloatArray = sweep.rcs_m2[f, :, :, p]
            low, median, high = np.percentile(power, [10, 50, 90])
            records.append(
                {
                    "frequency_hz": frequency, "polarization": name, "peak_dbsm": _dbsm(float(power.max())),
                    "median_dbsm": _dbsm(float(median)), "mean_dbsm": _dbsm(float(power.mean())),
                    "p10_dbsm": _dbsm(float(low)), "p90_dbsm": _dbsm(float(high)),
                }
            )  # fmt: skip
    return records


def _deviation(sweep: RcsSweep, reference: Reference) -> dict[str, Any]:
    import numpy as np

    off = np.abs(reference.deviation_db(sweep))
    return {
        "formula": reference.formula, "samples_within_20_db_of_peak": len(off), "mean_abs_db": float(off.mean()),
        "max_abs_db": float(off.max()),
    }  # fmt: skip


def _write_config(path: Path, settings: Mapping[str, Any], source: Mapping[str, Any]) -> None:
    import yaml

    from ..runs import plain

    data = plain({"rcs": {**source, **settings}})
    text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=120, default_flow_style=None)
    path.write_text(f"# Written by shenron-rt rcs.\n{text}", encoding="utf-8")


def show_summary(summary: Mapping[str, Any]) -> None:
    """Print peak, statistics, what the closed form says, and the convergence report."""
    peak = summary["peak"]
    say(
        f"peak {peak['rcs_dbsm']:.2f} dBsm ({peak['polarization']}) at azimuth {peak['azimuth_deg']:g} deg, elevation "
        f"{peak['elevation_deg']:g} deg, {peak['frequency_hz'] / 1e9:g} GHz"
    )
    rows = [
        (f"{r['frequency_hz'] / 1e9:g} GHz", r["polarization"], *(f"{r[k]:.2f}" for k in _COLUMNS))
        for r in summary["statistics"]
    ]
    columns = ("frequency", "pol", "peak [dBsm]", "median [dBsm]", "mean [dBsm]", "10 % [dBsm]", "90 % [dBsm]")
    show_table("Over all aspects", columns, rows[:_MAX_ROWS])
    if len(rows) > _MAX_ROWS:
        say(f"... and {len(rows) - _MAX_ROWS} more in summary.json")
    closed = summary["reference"]
    if closed is not None:
        say(
            f"closed form ({closed['formula']}): {closed['mean_abs_db']:.3f} dB off on the mean, "
            f"{closed['max_abs_db']:.2f} dB at most, over {closed['samples_within_20_db_of_peak']} samples "
            "within 20 dB of its peak"
        )
    if summary["convergence"] is not None:
        for step in summary["convergence"]["steps"][:-1]:
            coarse, fine = step["rays_per_wavelength"]
            say(f"convergence: {coarse:g} to {fine:g} rays per wavelength: {step['median_db']:.3f} dB (median)")
        say(f"convergence: {summary['convergence']['says']}")
    for note in summary["notes"]:
        say(f"note: {note}")


_COLUMNS = ("peak_dbsm", "median_dbsm", "mean_dbsm", "p10_dbsm", "p90_dbsm")
