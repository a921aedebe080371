"""``shenron-rt compare``: two runs, or a run and a recording, side by side."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from ..errors import InputError, NotFoundError
from .common import Json, Output, Overwrite, frame_range, print_json, say, show_table

if TYPE_CHECKING:
    from ..comparison import Comparison
    from ..io.recorded import PointCloud

__all__ = ["compare"]

_MAX_ROWS = 40


def compare(
    a: Path,
    b: Path,
    /,
    *,
    output: Output = None,
    overwrite: Overwrite = False,
    radar: str | None = None,
    frame: int | None = None,
    frames: Annotated[
        str | None, Parameter(help="Frames A:B of both runs, B not included. Default: all in common.")
    ] = (None),
    lidar_origin: Annotated[
        str | None, Parameter(allow_leading_hyphen=True, help="x,y,z of the LiDAR in the radar frame [m].")
    ] = None,
    gate: Annotated[float, Parameter(help="Resolution cells within which detections match.")] = 2.0,
    json_: Json = False,
) -> int:
    """Compare two runs of one radar, or a run with a recorded point cloud, and say what makes them differ.

    Parameters
    ----------
    a, b
        Run folders. One side may be a TI demo log (.dat, .tlv, .bin) or CARLA radar rows (.npy).
    radar
        Radar of the runs. Default: the first.
    frame
        One frame of the runs and of a log. Default: all that two runs have in common; the first of a log.
    """
    from .. import runs
    from ..comparison import compare as compare_sides

    if frame is not None and frames is not None:
        raise InputError("compare: --frame or --frames, not both")
    sides = [_source(path, frame) for path in (a, b)]
    origin = None if lidar_origin is None else _numbers(lidar_origin)
    which = frame if frames is None else frame_range(frames)
    result = compare_sides(*sides, radar=radar, frame=which, lidar_origin=origin, gate_cells=gate)
    default = functools.partial(runs.default_folder, f"compare-{a.stem}", b.stem)
    with runs.write_run(output or default(), overwrite=overwrite, another=None if output else default) as place:
        result.save(place.partial)
    if json_:
        print_json(result.to_dict())
    else:
        _show(result)
        say(f"{place.folder}: written")
    return 0


def _source(path: Path, frame: int | None) -> Path | PointCloud:
    """Return a run folder as it is, a recording as a cloud."""
    if path.is_dir():
        return path
    if not path.is_file():
        raise NotFoundError(f"{path}: no such run folder or recording")
    from ..io.recorded import read_carla_radar, read_ti_tlv

    if path.suffix == ".npy":
        return read_carla_radar(path)
    log = read_ti_tlv(path)
    index = frame or 0
    if not 0 <= index < len(log):
        raise InputError(f"--frame {index}: {path} has {len(log)} frames that can be read")
    return log[index]


def _numbers(text: str) -> list[float]:
    try:
        values = [float(v) for v in text.split(",")]
    except ValueError:
        values = []
    if len(values) != 3:
        raise InputError(f"--lidar-origin {text}: three numbers x,y,z in metres are needed")
    return values


def _show(result: Comparison) -> None:
    say(f"A = {result.name_a}\nB = {result.name_b}    differences are B minus A\n")
    if len(result.frames) > 1:
        say(f"{len(result.frames)} frames: powers and maps are linear means, rows and detections of all together")
    for note in result.notes:
        say(f"note: {note}")
    _table("Changed settings", ("setting", "A", "B"), [(r["key"], r["a"], r["b"]) for r in result.settings])
    left, right = result.results["a"], result.results["b"]
    rows = [
        (key, _text(left[key]), _text(right[key])) for key in left if left[key] is not None or right[key] is not None
    ]
    show_table("Results", ("figure", "A", "B"), rows)
    _table(
        "Objects",
        ("object", "tag", "A [dBm]", "B [dBm]", "B - A [dB]", "cause", "unexplained [dB]"),
        [_object(r) for r in result.objects],
    )
    _table(
        "Tags",
        ("tag", "A [dBm]", "B [dBm]", "B - A [dB]", "cause"),
        [
            (r["tag"], _dbm(r["power_db_a"]), _dbm(r["power_db_b"]), _text(r["delta_db"]), r.get("cause"))
            for r in result.tags
        ],
    )
    maps = [
        (
            name,
            _text(r["correlation"]),
            _text(r["log_spectral_distance_db"]),
            _text(r["log_spectral_distance_signal_db"]),
        )
        for name, r in result.maps.items()
    ]
    _table("Maps", ("map", "correlation [1]", "log-spectral distance [dB]", "where there is an echo [dB]"), maps)
    _detections(result)


def _object(record: Mapping[str, Any]) -> tuple[Any, ...]:
    cause = ", ".join([record["cause"], *record["also"]])
    levels = (_dbm(record["power_db_a"]), _dbm(record["power_db_b"]), _text(record["delta_db"]))
    return (record["name"], record["tag"], *levels, cause, _text(record.get("unexplained_db")))


def _detections(result: Comparison) -> None:
    found = result.detections
    rows = [
        (name, e["count"], _text(e["mean"], 3), _text(e["std"], 3), _text(e["largest"], 3))
        for name, e in found["errors"].items()
    ]
    lonely = [
        f"{len(found[k])} only in {s} ({_false(found[k])} of no object)" for k, s in (("missed", "A"), ("extra", "B"))
    ]
    title = f"Detections: {len(found['matched'])} matched, {lonely[0]}, {lonely[1]}"
    show_table(title, ("error, B - A", "count", "mean", "standard deviation", "largest"), rows)
    if result.scatterers is not None:
        o = result.scatterers["occupancy"]
        say(
            f"Scatterers fill {o['cells_a']} and {o['cells_b']} cells of {o['voxel_m']:g} m: {o['share_both']:.0%} in "
            f"both, {o['share_a_only']:.0%} only in A, {o['share_b_only']:.0%} only in B"
        )


def _false(records: list[Mapping[str, Any]]) -> int:
    """Return how many detections belong to nothing: noise and side lobes."""
    return sum(1 for r in records if r["object_id"] == -1)


def _table(title: str, columns: tuple[str, ...], rows: list[tuple[Any, ...]]) -> None:
    if rows:
        show_table(title, columns, rows[:_MAX_ROWS])
    if len(rows) > _MAX_ROWS:
        say(f"... and {len(rows) - _MAX_ROWS} more in compare.json")


def _dbm(level: float | None) -> str | None:
    return None if level is None else f"{level + 30:.1f}"


def _text(value: Any, digits: int = 2) -> str | None:
    return None if value is None else f"{value:.{digits}f}" if isinstance(value, float) else str(value)
