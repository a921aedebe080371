"""The tables at the end of a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .common import say, show_table

__all__ = ["show_run"]

_MAX_ROWS = 30


def show_run(summary: Mapping[str, Any]) -> None:
    """Print the strongest return of every frame, and of every object its power, its SNR and whether it was seen."""
    rows = [_strongest(radar["name"], frame) for radar in summary["radars"] for frame in radar["frames"]]
    columns = ("radar", "frame", "range [m]", "azimuth [deg]", "velocity [m/s]", "SNR [dB]", "object")
    show_table("Strongest return", columns, rows[:_MAX_ROWS])
    _hidden(len(rows), "frames")
    for radar in summary["radars"]:
        frame = radar["frames"][-1]
        if frame["objects"]:
            items = [_object(o) for o in frame["objects"]]
            title = f"Objects as {radar['name']} receives them, frame {frame['frame']}"
            show_table(title, ("id", "object", "tag", "power [dBm]", "SNR [dB]", "detected"), items[:_MAX_ROWS])
            _hidden(len(items), "objects")


def _strongest(radar: str, frame: Mapping[str, Any]) -> list[Any]:
    best = frame["strongest"]
    if best is None:
        return [radar, frame["frame"], None, None, None, None, "nothing detected"]
    names = {o["id"]: o["name"] for o in frame["objects"]}
    nobody = "noise" if names else "unknown"  # of a capture nobody knows what is there
    who = nobody if best["object_id"] < 0 else names.get(best["object_id"], f"object {best['object_id']}")
    values = [f"{best[k]:.2f}" for k in ("range_m", "azimuth_deg", "velocity_mps")]
    chain = best.get("chain", "")
    if ">" in chain:
        who += f" ({'ghost, ' if best['ghost'] else ''}{chain})"
    return [radar, frame["frame"], *values, f"{best['snr_db']:.1f}", who]


def _object(item: Mapping[str, Any]) -> list[Any]:
    level = None if item["power_dbw"] is None else f"{item['power_dbw'] + 30:.1f}"
    snr = None if item["snr_db"] is None else f"{item['snr_db']:.1f}"
    seen = "yes" if item["detected"] else "no"
    if ghosts := item.get("ghosts", 0):
        seen += f", {ghosts} ghost{'s' if ghosts > 1 else ''}"
    return [item["id"], item["name"], item["tag"], level, snr, seen]


def _hidden(count: int, what: str) -> None:
    if count > _MAX_ROWS:
        say(f"... and {count - _MAX_ROWS} more {what} in summary.json")
