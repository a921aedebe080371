"""What other verbs have found about a run: tracks.csv of ``track``, explain.json of ``explain``."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import InputError, NotFoundError
from ..run_source import RunFrame, RunRadar, RunSource
from .arrays import Arrays

__all__ = [
    "Explained",
    "Tracked",
    "add_explained",
    "find_extra",
    "load_explained",
    "load_tracks",
    "made_explained",
    "made_tracks",
]

#: Frames that a track needs at least to be confirmed.
_LEAST_FRAMES = 3
#: Columns of tracks.csv that a page shows, world axes [m], [m/s].
_TRACK_COLUMNS = ("frame", "x_m", "y_m", "vx_mps", "vy_mps", "range_m", "azimuth_deg", "coasting")
#: Of an explained object: what its row of the table shows.
_ROW = (
    "rows", "visible_area_m2", "range_m", "azimuth_deg", "velocity_mps", "power_dbm", "cell_dbm", "threshold_dbm",
    "noise_threshold_dbm",
)  # fmt: skip

Explained = dict[tuple[str, int], Mapping[str, Any]]
#: By radar: ``tracks`` and ``figures``.
Tracked = dict[str, dict[str, Any]]


def find_extra(run: Path, given: Path | None, name: str) -> Path | None:
    """Return the file of that name: a given one or in a given folder, else beside the run's other files, else None.

    Raises
    ------
    NotFoundError
        A given file or folder that has none.
    """
    if given is None:
        beside = run / name
        return beside if beside.is_file() else None
    file = given / name if given.is_dir() else given
    if not file.is_file():
        raise NotFoundError(f"{given}: there is no {name}")
    return file


def load_tracks(file: Path, default: str) -> Tracked:
    """Return the tracks of a table of one radar, which ``tracks.json`` beside it names; else ``default``.

    Raises
    ------
    InputError
        Columns are missing or not numbers.
    """
    rows: list[tuple[int, int, list[float]]] = []
    with file.open(encoding="utf-8", newline="") as text:
        reader = csv.DictReader(text)
        missing = sorted({"track", "object_id", *_TRACK_COLUMNS} - set(reader.fieldnames or ()))
        if missing:
            raise InputError(f"{file}:1: not a table of tracks, it has no column {missing[0]!r}")
        try:
            for row in reader:
                rows.append((int(row["track"]), int(row["object_id"]), [float(row[n]) for n in _TRACK_COLUMNS]))
        except (TypeError, ValueError) as error:
            raise InputError(f"{file}:{reader.line_num}: numbers are needed ({error})") from None
    figures = _figures(file.with_name("tracks.json"))
    return {str(figures.get("radar", default)): {"tracks": _tracks(rows), "figures": figures}}


def made_tracks(source: RunSource) -> Tracked:
    """Track what every radar of a run has detected, as ``shenron-rt track`` does.

    Runs that cannot be tracked have none: that takes three frames, the motion of a scene, and all files of a frame.
    """
    from ..objects import observe_run, track

    found: Tracked = {}
    for radar in source.radars:
        whole = all(
            f.has("detections.csv") and f.has("returns.npz") and (f.has("cube.npz") or f.has("maps.npz"))
            for f in radar.frames
        )
        if source.scene is None or len(radar.frames) < _LEAST_FRAMES or not whole:
            continue
        tracking = track(observe_run(source, radar=radar.name), radar=radar.name)
        rows = [(r.track, r.object_id, [float(getattr(r, n)) for n in _TRACK_COLUMNS]) for r in tracking.rows]
        found[radar.name] = {"tracks": _tracks(rows), "figures": _plain(tracking.summary())}
    return found


def _tracks(rows: Sequence[tuple[int, int, list[float]]]) -> list[dict[str, Any]]:
    """Return ``track``, ``object_id`` (the truth most often behind it) and ``rows`` of each track."""
    tracks = []
    for number in dict.fromkeys(track for track, _, _ in rows):
        mine = [(owner, [round(v, 4) for v in values]) for track, owner, values in rows if track == number]
        true = [owner for owner, _ in mine if owner > 0]
        owner = max(set(true), key=true.count) if true else -1
        tracks.append({"track": number, "object_id": owner, "rows": [values for _, values in mine]})
    return tracks


def _plain(figures: Mapping[str, Any]) -> dict[str, Any]:
    return {k: v for k, v in figures.items() if isinstance(v, str | int | float)}


def _figures(file: Path) -> dict[str, Any]:
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (FileNotFoundError, ValueError):
        return {}
    return _plain(found) if isinstance(found, dict) else {}


def load_explained(file: Path) -> Explained:
    """Return the frames of ``explain.json`` by radar and frame.

    Raises
    ------
    InputError
        Not what ``explain`` writes.
    """
    try:
        return _by_frame(json.loads(file.read_text(encoding="utf-8")))
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{file}: not what shenron-rt explain writes ({type(error).__name__}: {error})") from None


def made_explained(source: RunSource, progress: Callable[[str], object]) -> Explained:
    """Explain every object and frame of a run, as ``shenron-rt explain`` does."""
    from ..attribution import explain

    return _by_frame(explain(source.root, progress=progress).to_dict())


def _by_frame(found: Mapping[str, Any]) -> Explained:
    return {(str(f["radar"]), int(f["frame"])): f for f in found["frames"] if isinstance(f["objects"], list | tuple)}


def add_explained(
    arrays: Arrays, prefix: str, radar: RunRadar, objects: Sequence[Mapping[str, Any]], explained: Explained
) -> dict[str, Any] | None:
    """Add ``<prefix>.explain.<k>``, the explanation of every frame that has one; return an overview.

    Returns
    -------
    dict or None
        ``has``: by frame; ``verdicts``: name of the verdict by object and frame, None where there is none. None without
        any explanation of this radar.
    """
    frames = [explained.get((radar.name, frame.index)) for frame in radar.frames]
    if not any(frames):
        return None
    verdicts: dict[int, list[str | None]] = {int(o["id"]): [None] * len(frames) for o in objects}
    for k, (source, frame) in enumerate(zip(frames, radar.frames, strict=True)):
        if source is None:
            continue
        try:
            arrays.add_json(f"{prefix}.explain.{k}", _compact(source), later=k > 0)
            for item in source["objects"]:
                verdicts.setdefault(int(item["object_id"]), [None] * len(frames))[k] = str(item["verdict"]["name"])
        except (KeyError, TypeError) as error:
            raise InputError(_bad(radar, frame, error)) from None
    return {"has": [f is not None for f in frames], "verdicts": [verdicts[int(o["id"])] for o in objects]}


def _bad(radar: RunRadar, frame: RunFrame, error: Exception) -> str:
    what = f"{type(error).__name__}: {error}"
    return f"explain.json: {radar.name} frame {frame.index} is not what shenron-rt explain writes ({what})"


def _compact(frame: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a page shows of a frame, numbers to four decimals."""
    objects = {}
    for item in frame["objects"]:
        kept = {name: item.get(name) for name in _ROW}
        kept |= {name: item["verdict"].get(name) for name in ("text", "by", "numbers", "change")}
        kept["verdict"] = item["verdict"]["name"]
        shares = item.get("shares") or ()
        kept["shares"] = [[s["name"], s["cell_dbm"], s["threshold_dbm"]] for s in shares]
        budget = item.get("waterfall") or {}
        stages = budget.get("stages") or ()
        kept["stages"] = [[s["name"], s["gain_db"], s["level"], s["unit"], s["note"]] for s in stages]
        kept["closes"] = budget.get("closes")
        objects[str(item["object_id"])] = _rounded(kept)
    return {"objects": objects, "labels": list(frame.get("detection_labels") or ())}


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return round(value, 4) if math.isfinite(value) else None
    if isinstance(value, list | tuple):
        return [_rounded(v) for v in value]
    if isinstance(value, Mapping):
        return {k: _rounded(v) for k, v in value.items()}
    return value
