"""Measure docs/rcs-atlas.md: ``python examples/rcs_atlas.py``; ``--write`` puts results, tables and pictures there.

Every case is kept in ``out/rcs_atlas`` as it goes, so that an interrupted run goes on where it stopped; what another
state of the solver has computed counts as missing. ``--only WORD`` takes the cases whose name begins so (may be given
again), the others stay as docs/rcs-atlas.json has them; ``--list`` names them. ``--page`` writes page and pictures
again from that file alone. ``--quick`` measures ten aspects of the car at 24 GHz and
says how far they are from the file.
"""

from __future__ import annotations

import argparse
import logging
import sys
from pathlib import Path

import numpy as np
from atlas import cases, distance, figures, page, store

from shenron_rt._typing import FloatArray

ROOT = Path(__file__).resolve().parents[1]
PAGE, RESULTS, IMAGES = ROOT / "docs/rcs-atlas.md", ROOT / "docs/rcs-atlas.json", ROOT / "docs/images"
PARTS = ROOT / "out/rcs_atlas"


def all_cases() -> list[cases.Case]:
    """Return every case of the page, the cheap ones of a kind first."""
    return [
        *cases.turntable_cases(),
        *cases.roof_cases(),
        *cases.why_cases(),
        *cases.sampling_cases(),
        *distance.distance_cases(),
    ]


def chosen(only: list[str] | None) -> list[cases.Case]:
    """Return the cases that were asked for."""
    return [c for c in all_cases() if only is None or c.name.startswith(tuple(only))]


def deviation(name: str, part: int) -> FloatArray:
    """Return what one part of a case, computed now, is above that of docs/rcs-atlas.json [dB].

    Parameters
    ----------
    name : str
    part : int
        Number of the part, 0 the first.
    """
    kept = store.load(RESULTS)[name]
    case = next(c for c in all_cases() if c.name == name)
    values = slice(part * store.PART, (part + 1) * store.PART)
    return np.asarray(10.0 * np.log10(case.sweep(kept.x[values])) - kept.rcs_dbsm[values])


def main() -> None:
    """Measure, print, and write if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="update docs/rcs-atlas.json, the page and its pictures")
    parser.add_argument("--only", action="append", metavar="WORD", help="cases whose name begins so")
    parser.add_argument("--fresh", action="store_true", help="take nothing that was kept")
    parser.add_argument("--page", action="store_true", help="write the page from docs/rcs-atlas.json, measure nothing")
    parser.add_argument("--quick", action="store_true", help="ten aspects of the car, beside the file")
    parser.add_argument("--list", action="store_true", help="name the cases and stop")
    args = parser.parse_args()
    logging.disable(logging.WARNING)
    if args.quick:
        print("car, 24 GHz, 25 m, 40 to 58 deg, less docs/rcs-atlas.json [dB]:", deviation("car-24-25m", 2).round(2))
        return
    wanted = [] if args.page else chosen(args.only)
    if args.list:
        print("\n".join(c.name for c in wanted))
        return
    curves = {}
    for case in wanted:
        curves[case.name] = store.compute(case, PARTS, fresh=args.fresh)
        print(page.line(case.name, curves[case.name]), file=sys.stderr, flush=True)
        if args.write:
            store.save(RESULTS, store.load(RESULTS) | {case.name: curves[case.name]})
    if args.write or args.page:
        found = store.load(RESULTS)
        page.write(PAGE, found)
        figures.write(IMAGES, found)


if __name__ == "__main__":
    main()
