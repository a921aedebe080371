"""The tables of docs/rcs-atlas.md, written between its marks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import IO, Any

import numpy as np

from shenron_rt.io.npz import atomic_write

from . import distance
from .cases import BANDS_GHZ, MIRRORED, NEAR_M, SAMPLED, STEP_DEG, TRIAL_RAYS, VARIANTS
from .levels import Circle, dbsm, mean_dbsm, measured_levels, published_levels
from .published import BICYCLIST, HUMAN_SCHULTZ_DBSM, KIND, ROOF, SIGMA_DB
from .store import Curve

PLACES = {"25m": "25 m", "far": "far field"}
Curves = dict[str, Curve]


def line(name: str, curve: Curve) -> str:
    """Return what is said of a case while the command runs."""
    level = curve.rcs_dbsm
    return (
        f"{name}: {len(level)} values, {level.min():.1f} to {level.max():.1f}, median {np.median(level):.2f} dBsm, "
        f"{curve.seconds:.0f} s"
    )


def _table(head: tuple[str, ...], rows: list[list[str]]) -> str:
    lines = [head, ("---",) * len(head), *rows]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def _tenths(value: float | np.floating[Any]) -> str:
    """Return a level to a tenth; the last bit of a mean, which is the processor's, decides no digit."""
    return f"{round(float(value), 9):.1f}"


def _circles(found: Curves) -> dict[tuple[str, float, str], Circle]:
    """Return the circles that are there by shape, band and place."""
    keys = [(s, ghz, place) for s in STEP_DEG for ghz in BANDS_GHZ for place in PLACES]
    return {k: Circle.of(found[n]) for k in keys if (n := f"{k[0]}-{k[1]:g}-{k[2]}") in found}


def statistics(found: Curves) -> str:
    """Return the levels of every circle."""
    rows = []
    for (shape, ghz, place), circle in _circles(found).items():
        levels = (circle.median, circle.mean, circle.sigma, *(circle.highest(d) for d in ("front", "side", "back")))
        rows.append([shape, f"{ghz:g}", PLACES[place], *map(_tenths, levels)])
    return _table(("target", "GHz", "at", "median", "mean", "sigma", "front", "side", "back"), rows)


def _beside(value: float, level: float, allowed: float) -> str:
    off = value - level
    cell = f"{value:.1f} ({off:+.1f})"
    return f"**{cell}**" if abs(off) > allowed else cell


def _roof(found: Curves) -> list[list[str]]:
    """Return the rows of the view from above: mean power from 80 deg of elevation to the zenith."""
    rows = []
    for shape in MIRRORED:
        curves = [found.get(f"{shape}-{ghz:g}-roof") for ghz in BANDS_GHZ]
        elevation = np.arange(80.0, 90.1, 2.0)
        level = mean_dbsm(np.array([float(ROOF.level(0.0, 90.0 - e)) for e in elevation]))
        cells = [
            "" if c is None else _beside(mean_dbsm(c.rcs_dbsm[c.x >= 80.0 - 1e-9]), level, SIGMA_DB["vehicle"])
            for c in curves
        ]
        rows.append([shape, "roof lobe", _tenths(level), *cells, "", ""])
    return rows


def published(found: Curves) -> str:
    """Return the levels beside the published ones; what is off by more than the published spread is bold."""
    circles = _circles(found)
    places = [(ghz, place) for place in PLACES for ghz in BANDS_GHZ]
    rows = []
    for shape in KIND:
        levels = [measured_levels(shape, c) if (c := circles.get((shape, *p))) else {} for p in places]
        for name, (level, allowed) in published_levels(shape).items():
            cells = [_beside(m[name], level, allowed) if m else "" for m in levels]
            rows.append([shape, name, _tenths(level), *cells])
    low, high = HUMAN_SCHULTZ_DBSM
    means = [_tenths(c.mean) if (c := circles.get(("pedestrian", *p))) else "" for p in places]
    rows += [["pedestrian", "mean, at 9.4 GHz", f"{low:.1f} to {high:.1f}", *means], *_roof(found)]
    for name, (first, last, level) in BICYCLIST.items():
        cells = [
            _beside(c.sector(first, last), level, 3.41) if (c := circles.get(("bicycle", *p))) else "" for p in places
        ]
        rows.append(["bicycle", f"mean {name}, with rider", _tenths(level), *cells])
    law = float(dbsm(distance.pole_on_turntable(NEAR_M)))
    cells = [_beside(c.mean, law, 1.0) if (c := circles.get(("pole", *p))) and p[1] != "far" else "" for p in places]
    rows.append(["pole", "mean, closed form at 25 m", _tenths(law), *cells])
    head = ("target", "what", "published", *(f"{ghz:g} GHz, {PLACES[place]}" for ghz, place in places))
    return _table(head, rows)


def why(found: Curves) -> str:
    """Return the trials: median, mean, and the mean power in the half circles before and behind, and at the sides."""
    rows = []
    labels = [
        (shape, f"why-{shape}-{key}", label)
        for shape, variants in VARIANTS.items()
        for key, label in [("as-it-is", "as it is"), *((k, v[0]) for k, v in variants.items())]
    ]
    labels += [("truck", f"rays-truck-77-{rays:g}", f"77 GHz, {rays:g} rays per wavelength") for rays in TRIAL_RAYS]
    for shape, name, label in labels:
        if (curve := found.get(name)) is not None:
            circle = Circle.of(curve)
            sectors = (circle.sector(0.0, 30.0), circle.sector(60.0, 120.0), circle.sector(150.0, 180.0))
            rows.append([shape, label, *map(_tenths, (circle.median, circle.mean, *sectors))])
    return _table(
        ("target", "25 m, 24 GHz unless it says", "median", "mean", "0-30 deg", "60-120 deg", "150-180 deg"), rows
    )


def sampling(found: Curves) -> str:
    """Return what coarser steps make of a fully sampled window: the spread over every place of the first aspect."""
    rows = []
    for shape, (low, high, fine, coarse) in SAMPLED.items():
        if (curve := found.get(f"sampling-{shape}-24")) is None:
            continue
        for step in (fine, *coarse):
            stride = round(step / fine)
            combs = [curve.rcs_dbsm[k::stride] for k in range(stride)]
            cells = []
            for statistic in (np.median, mean_dbsm, lambda v: np.percentile(v, 10), np.max):
                values = np.array([float(statistic(v)) for v in combs])
                swing = "" if stride == 1 else f" ± {_tenths(values.std())}"
                cells.append(_tenths(values.mean()) + swing)
            rows.append([shape, f"{low:g} to {high:g}", f"{step:g}", str(len(combs[0])), *cells])
    return _table(("target", "window [deg]", "step [deg]", "aspects", "median", "mean", "10 %", "highest"), rows)


def distances(found: Curves) -> str:
    """Return apparent RCS at four distances, and the mean level over all of them less that of the closed form."""
    rows = []
    shown: list[float] = []
    for name, formula in distance.FORMULAS.items():
        for ghz in BANDS_GHZ:
            if (curve := found.get(f"distance-{name}-{ghz:g}")) is None:
                continue
            picked = np.linspace(0, len(curve.x) - 1, 4).round().astype(int)
            shown = [float(curve.x[k]) for k in picked]
            off = curve.rcs_dbsm - dbsm(distance.closed_form(name, curve.x, ghz))
            cells = [_tenths(curve.rcs_dbsm[k]) for k in picked]
            rows.append(
                [distance.TITLES[name], f"{ghz:g}", *cells, formula, f"{mean_dbsm(off):+.1f}", _tenths(np.std(off))]
            )
    head = ("target", "GHz", *(f"{v:.1f} m" for v in shown or [5.0, 10.8, 23.2, 50.0]))
    return _table((*head, "closed form", "over it", "spread"), rows)


def cost(found: Curves) -> str:
    """Return how long every kind of case took and by which state of the solver."""
    kinds: dict[str, list[Curve]] = {}
    for name, curve in found.items():
        kind = name.split("-")[0]
        kinds.setdefault(
            {"why": "trials", "rays": "trials", "sampling": "sampling", "distance": "over distance"}.get(kind, kind), []
        ).append(curve)
    rows = [
        [kind, str(len(c)), str(sum(len(v.x) for v in c)), f"{sum(v.seconds for v in c) / 60:.1f}",
         ", ".join(sorted({v.solver for v in c}))]
        for kind, c in sorted(kinds.items())
    ]  # fmt: skip
    return _table(("what", "curves", "values", "minutes", "state of the solver"), rows)


TABLES: dict[str, Callable[[Curves], str]] = {
    "statistics": statistics,
    "published": published,
    "why": why,
    "sampling": sampling,
    "distances": distances,
    "cost": cost,
}


def filled(text: str, found: Curves) -> str:
    """Return the page with its tables between their marks."""
    for name, table in TABLES.items():
        begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
        text = text[: text.index(begin) + len(begin)] + table(found) + text[text.index(end) :]
    return text


def write(path: Path, found: Curves) -> None:
    """Put the tables into the page."""
    text = filled(path.read_text(encoding="utf-8"), found)

    def put(file: IO[bytes]) -> None:
        file.write(text.encode())

    atomic_write(path, put)
