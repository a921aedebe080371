"""``shenron-rt track``: objects and tracks of a run, held against its truth."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from .common import Json, Output, Overwrite, print_json, progress, say, show_table

if TYPE_CHECKING:
    from ..objects import Tracking

__all__ = ["track"]

_MAX_ROWS = 30


def track(
    run: Path,
    /,
    *,
    radar: str | None = None,
    min_speed: Annotated[
        float, Parameter(help="Detections slower over ground are left out [m/s]; 0 tracks what stands, too.")
    ] = 1.0,
    output: Output = None,
    overwrite: Overwrite = False,
    json_: Json = False,
) -> int:
    """Gather the detections of a run to objects, track them, and compare with the truth.

    Parameters
    ----------
    run
        Run folder of several frames.
    radar
        Radar of the run. Default: the first.
    output
        Folder for tracks.csv, tracks.json and tracks.png. Default: out/track-<run>-<radar>, numbered.
    """
    from .. import runs
    from ..objects import observe_run
    from ..objects import track as track_all
    from ..plot import track_view
    from ..plot._style import save

    loaded = runs.load_run(run)
    name = radar or next(iter(loaded.frames), "radar")
    default = functools.partial(runs.default_folder, f"track-{loaded.root.name}", name)
    if output is not None:
        runs.check_target(output, overwrite)
    with progress(len(loaded.frames.get(name, [])), "reading", quiet=json_) as step:
        seen = []
        for item in observe_run(loaded, radar=radar):
            seen.append(item)
            step(advance=1)
    found = track_all(seen, radar=name, min_speed_mps=min_speed)
    with runs.write_run(output or default(), overwrite=overwrite, another=None if output else default) as place:
        found.to_csv(place.partial / "tracks.csv")
        runs.write_json(place.partial / "tracks.json", found.summary())
        save(track_view(found, seen, title=f"{loaded.root.name}, {name}"), place.partial / "tracks.png")
    if json_:
        print_json(found.summary())
    else:
        _show(found, _names(loaded.summary, name))
        say(f"{place.folder}: written")
    return 0


def _names(summary: Mapping[str, Any], radar: str) -> dict[int, str]:
    frames = next(r["frames"] for r in summary["radars"] if r["name"] == radar)
    return {int(o["id"]): str(o["name"]) for f in frames for o in f["objects"]}


def _show(found: Tracking, names: Mapping[int, str]) -> None:
    rows = []
    for number in dict.fromkeys(r.track for r in found.rows):
        mine = [r for r in found.rows if r.track == number]
        last = mine[-1]
        owner = next((names.get(i, str(i)) for i, tracks in found.tracks_of.items() if number in tracks[:1]), None)
        speed = (last.vx_mps**2 + last.vy_mps**2) ** 0.5
        rows.append(
            (number, owner, f"{mine[0].frame} to {last.frame}", sum(r.coasting for r in mine), f"{last.range_m:.2f}",
             f"{last.azimuth_deg:z.1f}", f"{speed:.2f}")
        )  # fmt: skip
    columns = ("track", "follows", "frames", "coasting [1]", "range [m]", "azimuth [deg]", "speed [m/s]")
    show_table(f"Tracks of {found.radar} over {len(found.frames)} frames, as they ended", columns, rows[:_MAX_ROWS])
    if len(rows) > _MAX_ROWS:
        say(f"... and {len(rows) - _MAX_ROWS} more in tracks.csv")
    figures = found.summary()
    keys = (
        "ospa_m", "ospa_place_m", "ospa_number_m", "truths", "matches", "misses", "false_tracks", "switches",
        "fragmentations", "mota", "motp", "idf1",
    )  # fmt: skip
    values = [(k, _text(figures[k])) for k in keys]
    show_table(f"Against the truth (OSPA cut off at {found.cutoff_m:g} m)", ("figure", "value [-]"), values)


def _text(value: Any) -> str | None:
    return None if value is None else f"{value:z.3f}" if isinstance(value, float) else str(value)
