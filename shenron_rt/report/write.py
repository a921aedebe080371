"""One run folder, one page: everything in it, nothing outside it."""

from __future__ import annotations

import html
import os
from collections.abc import Callable, Mapping
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import IO, Any

from ..errors import InputError
from ..io.npz import atomic_write
from ..run_source import RunSource, open_run
from .arrays import Arrays, script_json
from .extras import (
    Explained,
    Tracked,
    add_explained,
    find_extra,
    load_explained,
    load_tracks,
    made_explained,
    made_tracks,
)
from .gather import Limits, radar_record
from .geometry import SceneMeshes
from .palette import diverging, sequential
from .points import DETECTION_COLUMNS
from .truth import TRUTH_COLUMNS

__all__ = ["check_page", "write_report"]

#: All maps of a page [bytes]; base64 makes 4/3 of it, so that a page stays below 30 MB.
_MAP_BYTES = 15e6
#: All echoes of a page, seven bytes each, and those of one frame.
_ECHOES, _FRAME_ECHOES = 300_000, 2_000
#: Faces of all meshes together; 120 000 shared ones take about 3 MB.
_MOST_FACES = 120_000

_SCRIPTS = (
    "core.js", "colour.js", "canvas.js", "heatmap.js", "fan.js", "camera.js", "mesh.js", "scene.js",
    "scene_frame.js", "charts.js", "tables.js", "explain.js", "player.js", "main.js",
)  # fmt: skip


def write_report(
    run: str | os.PathLike[str],
    path: str | os.PathLike[str] | None = None,
    *,
    tracks: str | os.PathLike[str] | None = None,
    explained: str | os.PathLike[str] | None = None,
    track: bool = True,
    explain: bool = False,
    overwrite: bool = False,
    progress: Callable[[str], object] | None = None,
) -> Path:
    """Write a self-contained HTML page about a run.

    Parameters
    ----------
    run : path
        A folder written by ``run``, ``lidar`` or ``process``.
    path : path, optional
        The page. Default: beside the run, ``<run>.html``.
    tracks : path, optional
        ``tracks.csv`` of ``shenron-rt track``, or a folder with it. Default: in the run folder, if there is one.
    explained : path, optional
        ``explain.json`` of ``shenron-rt explain``, or a folder with it. Default: in the run folder, if there is one.
    track : bool
        Track the detections where no table is given, the run has a scene, three frames or more, and all their files.
    explain : bool
        Explain every object and frame where no file is given: about half a second each.
    overwrite : bool
        Replace a page that is there.
    progress : callable, optional
        Called with a phrase before each frame.

    Returns
    -------
    Path
        The page, written whole or not at all.

    Raises
    ------
    NotFoundError
        No run folder, or no file of tracks or explanations where one was given.
    InputError
        The page exists, or the run cannot be shown.

    Examples
    --------
    >>> import shenron_rt as srt
    >>> page = srt.write_report("out/braking-awrl1432")  # doctest: +SKIP
    """
    source = open_run(run)
    folder = source.root.absolute()
    target = folder.with_name(f"{folder.name}.html") if path is None else Path(path)
    check_page(target, overwrite)
    track_file = find_extra(source.root, None if tracks is None else Path(tracks), "tracks.csv")
    explain_file = find_extra(source.root, None if explained is None else Path(explained), "explain.json")
    step = progress or (lambda _: None)
    told: Explained = {}
    if explain_file is not None:
        told = load_explained(explain_file)
    elif explain:
        told = made_explained(source, step)
    followed: Tracked = {}
    if track_file is not None:
        followed = load_tracks(track_file, source.radars[0].name)
    elif track:
        followed = made_tracks(source)
    text = _page(source, followed, told, step)

    def write(file: IO[bytes]) -> None:
        file.write(text.encode("utf-8"))

    return atomic_write(target, write)


def check_page(path: Path, overwrite: bool) -> None:
    """Refuse to write a page over something that may not be replaced.

    Raises
    ------
    InputError
    """
    if path.is_dir():
        raise InputError(f"-o {path}: is a folder; give the page a name, {path / 'report.html'} for example")
    if path.exists() and not overwrite:
        raise InputError(f"-o {path}: exists; give another name, or --overwrite to replace it")


def _page(source: RunSource, tracks: Tracked, explained: Explained, progress: Callable[[str], object]) -> str:
    arrays = Arrays()
    arrays.add("lut.sequential", sequential(), "u1")
    arrays.add("lut.diverging", diverging(), "u1")
    meshes = None
    if source.scene is not None:
        meshes = SceneMeshes.add_to(arrays, source.scene, _MOST_FACES)
    count = sum(len(r.frames) for r in source.radars)
    limits = Limits(_MAP_BYTES / (2 * count), min(_FRAME_ECHOES, max(1, _ECHOES // count)))
    radars = []
    for i, radar in enumerate(source.radars):
        record = radar_record(arrays, f"r{i}", source, radar, meshes, limits, progress)
        record["explained"] = add_explained(arrays, f"r{i}", radar, record["objects"], explained)
        radars.append(record)
    about = {
        "title": source.name,
        "description": "" if source.scene is None else source.scene.description,
        "folder": source.root.resolve().name,
        "summary": {k: v for k, v in source.summary.items() if isinstance(v, str | int | float)},
        "columns": {"detections": DETECTION_COLUMNS, "truth": TRUTH_COLUMNS},
        "meshes": [] if meshes is None else meshes.records,
        "radars": radars,
        "tracks": tracks,
        "config": source.config,
    }
    return _filled(source.name, about, arrays)


def _filled(title: str, about: Mapping[str, Any], arrays: Arrays) -> str:
    folder = files(__package__) / "page"

    def text(name: str) -> str:
        return (folder / name).read_text(encoding="utf-8")

    return Template(text("page.html")).substitute(
        title=html.escape(title),
        style=text("style.css"),
        about=script_json(about),
        arrays=arrays.html(),
        later=arrays.html(later=True),
        script="\n".join(text(name) for name in _SCRIPTS),
    )
