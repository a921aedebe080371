"""``shenron-rt report``: a run as one HTML page."""

from __future__ import annotations

import time as clock
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from .common import Json, print_json, progress, say

__all__ = ["report"]


def report(
    run: Path,
    /,
    *,
    output: Annotated[
        Path | None, Parameter(name=["-o", "--output"], help="The page. Default: beside the run, RUN.html.")
    ] = None,
    overwrite: Annotated[bool, Parameter(negative=(), help="Replace a page that is there.")] = False,
    tracks: Path | None = None,
    explained: Path | None = None,
    track: bool = True,
    explain: bool = False,
    json_: Json = False,
) -> int:
    """Write one HTML page about a run: scene, maps, points, objects over time, settings. It opens offline.

    Parameters
    ----------
    run
        Run folder, written by run, lidar or process.
    tracks
        tracks.csv, or a folder with it. Default: in the run folder, if there is one.
    explained
        explain.json, or a folder with it. Default: in the run folder, if there is one.
    track
        Track the detections where there is no table: needs a scene, and three frames or more.
    explain
        Explain every object and frame where there is no file: about half a second each.
    """
    from ..report import write_report
    from ..runs import load_run

    started = clock.perf_counter()
    frames = sum(len(f) for f in load_run(run).frames.values())
    with progress(frames * (2 if explain else 1), "reading", quiet=json_) as step:
        page = write_report(
            run,
            output,
            tracks=tracks,
            explained=explained,
            track=track,
            explain=explain,
            overwrite=overwrite,
            progress=lambda what: step(what, advance=1),
        )
    size = page.stat().st_size
    if json_:
        print_json({"path": page, "bytes": size, "frames": frames})
    else:
        say(f"{page}: {size / 1e6:.1f} MB, {frames} frames, in {clock.perf_counter() - started:.1f} s")
    return 0
