"""Measure the tables of docs/rcs-validation.md: ``python examples/rcs_validation.py``; ``--write`` puts them there.

``--quick`` takes a subset of the samples (a minute), ``--only NAME`` one group. Needs the reference tables beside the
checkout, or where SHENRON_RT_SHARED says. All of it takes about twenty minutes on two cores, most of it the vehicles.
"""

from __future__ import annotations

import argparse
import importlib
import logging
import sys
from pathlib import Path

from rcs_bars.bars import Bar, Figure
from rcs_bars.tables import shared_folder

import shenron_rt as srt

PAGE = Path(__file__).resolve().parents[1] / "docs/rcs-validation.md"
GROUPS = {
    "flat": "Plates, discs, boxes",
    "corners": "Dihedrals and trihedrals",
    "curved": "Spheres and cylinders",
    "dielectric": "Dielectrics",
    "near_range": "Near range",
    "emcc": "EMCC targets",
    "invariants": "What must not matter",
    "vehicles": "Vehicles and a pedestrian",
}
HEAD = ("what", "reference", "statistic", "bar", "measured", "finer rays change it by", "holds", "s")


def row(bar: Bar, figure: Figure, seconds: str) -> str:
    """Return a line of the table."""
    most, change, unit = figure.limit.most, figure.change, bar.unit
    digits = ".1e" if unit == "" else ".3f" if unit == "dB" else ".2f"
    holds = "reported" if most is None else "yes" if figure.holds else "**no**"
    cells = (
        bar.what.replace("|", "\\|"),
        bar.reference.replace("|", "\\|"),
        str(figure.limit),
        "" if most is None else f"{most:g} {unit}".strip(),
        f"{figure.value:{digits}} {unit}".strip(),
        "" if change is None else f"{change:{digits}}",
        holds,
        seconds,
    )
    return "| " + " | ".join(cells) + " |"


def table(group: str, shared: Path, quick: bool) -> list[str]:
    """Measure a group and return its table as lines of markdown."""
    bars: tuple[Bar, ...] = importlib.import_module(f"rcs_bars.{group}").BARS
    lines = [f"### {GROUPS[group]}", "", "| " + " | ".join(HEAD) + " |", "|---" * len(HEAD) + "|"]
    for bar in bars:
        if bar.slow and quick:
            continue
        try:
            figures, seconds = bar.figures(shared, quick=quick)
        except srt.ShenronError as error:  # a claim that the solver refuses is one that does not hold
            lines.append(f"| {bar.what} | {bar.reference} | | | {str(error).splitlines()[0]} | | **no** | |")
        else:
            lines += [row(bar, f, f"{seconds:.1f}" if n == 0 else "") for n, f in enumerate(figures)]
        print(lines[-1], file=sys.stderr, flush=True)
    return [*lines, ""]


def main() -> None:
    """Measure, print, and write if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--write", action="store_true", help="put the tables into docs/rcs-validation.md")
    parser.add_argument("--quick", action="store_true", help="a subset of the samples")
    parser.add_argument("--only", choices=GROUPS, action="append", help="one group; may be given again")
    arguments = parser.parse_args()
    logging.disable(logging.WARNING)
    shared = shared_folder()
    if shared is None:
        parser.error("the reference tables are not beside the checkout: set SHENRON_RT_SHARED to their folder")
    page = PAGE.read_text(encoding="utf-8")
    for group in arguments.only or GROUPS:
        text = "\n".join(table(group, shared, arguments.quick))
        print(text)
        begin, end = f"<!-- {group} -->\n", f"<!-- end of {group} -->"
        page = page[: page.index(begin) + len(begin)] + text + page[page.index(end) :]
        if arguments.write:
            PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
