"""The comparison as one call and one value."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .._typing import ArrayLike
from ..errors import InputError
from .clouds import pool_clouds
from .frame_pair import FramePair, common_frames, palette_of, same_axes
from .levels import Levels
from .maps import MapPair, map_record, pool_maps
from .objects import object_records, tag_records
from .points import Gate, pool_matches
from .record import Record
from .settings import changed_settings, pool_results
from .sides import Side, opened, side_of

__all__ = ["Comparison", "compare"]


@dataclass(frozen=True)
class Comparison:
    """Where two sides agree and differ; differences are B minus A. Over several frames powers are linear means.

    Parameters
    ----------
    name_a, name_b : str
    frames : list of int
        The frames compared, of A where the sides number them differently.
    objects : list of Record
        One an object: ``id, name, tag, power_db_a, power_db_b`` [dBW], ``delta_db, seen_by`` ("both", "a", "b"),
        ``cause``, its ``meaning``, further causes in ``also``, and the numbers behind it: ``terms_db`` (what the
        difference is made of), rows, areas, cosines, ``sight``.
    tags : list of Record
        The same levels per semantic tag.
    maps : dict of str to Record
        ``range_doppler`` and ``range_azimuth``: correlation and log-spectral distance; empty where a side has none, or
        other axes.
    scatterers : Record or None
        Occupancy of a grid, area and cosines per tag.
    detections : Record
        ``matched``, ``missed`` (in A only), ``extra`` (in B only), ``errors``.
    settings : list of Record
        Keys of the runs' configurations whose values differ.
    results : Record
        Figures of each side, ``a`` and ``b``.
    notes : list of str
        What could not be compared, and why.
    sides : (Side, Side)
        Of the first frame, with all that was compared.
    later_sides : list of (Side, Side)
        Of the others, their detections alone.
    map_pairs : list of MapPair
    """

    name_a: str
    name_b: str
    frames: list[int]
    objects: list[Record]
    tags: list[Record]
    maps: dict[str, Record]
    scatterers: Record | None
    detections: Record
    settings: list[Record]
    results: Record
    notes: list[str]
    sides: tuple[Side, Side] = field(repr=False)
    later_sides: list[tuple[Side, Side]] = field(repr=False)
    map_pairs: list[MapPair] = field(repr=False)

    def __repr__(self) -> str:
        found = self.detections
        frames = f"{len(self.frames)} frames, " if len(self.frames) > 1 else ""
        return (
            f"Comparison({self.name_a!r} with {self.name_b!r}: {frames}{len(self.objects)} objects, "
            f"{len(found.matched)} detections matched, {len(found.missed)} missed, {len(found.extra)} extra)"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the arrays, ready for JSON."""
        names = ("frames", "objects", "tags", "maps", "scatterers", "detections", "settings", "results", "notes")
        return {"a": self.name_a, "b": self.name_b} | {name: getattr(self, name) for name in names}

    def save(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write ``compare.json`` and the figure page ``compare.png`` into a folder, which is made."""
        from ..plot.compare import comparison_page
        from ..runs import write_json

        root = Path(folder)
        root.mkdir(parents=True, exist_ok=True)
        write_json(root / "compare.json", self.to_dict())
        return [root / "compare.json", comparison_page(self, root / "compare.png")]


def compare(
    a: Any,
    b: Any,
    *,
    radar: str | None = None,
    frame: int | Sequence[int] | None = None,
    lidar_origin: ArrayLike | None = None,
    gate_cells: float = 2.0,
    voxel_m: float = 0.5,
) -> Comparison:
    """Compare two sides of one radar: mesh with LiDAR, any two runs, or a run with a recorded point cloud.

    Parameters
    ----------
    a, b : Frame, run folder (path or Run) or PointCloud
        A recorded cloud on one side only.
    radar : str, optional
        Radar of a run folder; default its first.
    frame : int or sequence of int, optional
        Frame of the run folders, or several of both. Default: all that two runs have in common; beside a Frame or a
        recorded cloud a run's first.
    lidar_origin : (3,) array_like, optional
        Where the LiDAR stood, in the radar frame [m]; without it "hidden from the LiDAR" cannot be proven.
    gate_cells : float
        Detections match within this many resolution cells in range, velocity and sine of azimuth.
    voxel_m : float
        Edge of the occupancy grid's cells [m].

    Returns
    -------
    Comparison

    Raises
    ------
    NotFoundError
    InputError
        Something that cannot be compared: two recorded clouds, no profile on either side.

    Examples
    --------
    >>> import shenron_rt as srt
    >>> scene = srt.Scene(point_targets=[{"id": 1, "xyz_m": (30, 0, 1), "rcs_dbsm": 10}])
    >>> frame = srt.simulate(scene, rays=1000)  # doctest: +SKIP
    >>> srt.compare(frame, frame).objects[0].cause  # doctest: +SKIP
    'agrees'
    """
    if gate_cells <= 0 or voxel_m <= 0:
        raise InputError(f"gate_cells and voxel_m must be positive, got {gate_cells:g} and {voxel_m:g}")
    a, b = opened(a), opened(b)
    numbers, left_out = common_frames(a, b, radar, frame)
    pairs: list[FramePair] = []
    palette = gate = None
    for number in numbers:
        left, right = (
            side_of(source, label, radar=radar, frame=number, lidar_origin=lidar_origin)
            for source, label in ((a, "A"), (b, "B"))
        )
        if left.profile is None and right.profile is None:
            raise InputError("compare: two recorded clouds have no profile whose cells could match them; give one run")
        gate = gate or _gate(left, right, gate_cells)
        palette = palette or palette_of(left, right, several=len(numbers) > 1)
        pair = FramePair.of(left, right, palette, gate, voxel_m)
        pairs.append(pair.light() if pairs else pair)
    return _pooled(pairs, left_out)


def _pooled(pairs: Sequence[FramePair], left_out: list[str]) -> Comparison:
    left, right = pairs[0].a, pairs[0].b
    names = {key: name for pair in reversed(pairs) for key, name in pair.names.items()}
    by_object, by_tag = (
        [level for pair in pairs if (level := getattr(pair, kind)) is not None] for kind in ("objects", "tags")
    )
    maps = pool_maps([pair.maps for pair in pairs])
    clouds = [pair.cloud for pair in pairs if pair.cloud is not None]
    return Comparison(
        name_a=left.name,
        name_b=right.name,
        frames=[pair.a.frame for pair in pairs],
        objects=object_records(Levels.pool(by_object), left, right, names) if by_object else [],
        tags=tag_records(Levels.pool(by_tag), left, right) if by_tag else [],
        maps={pair.name: map_record(pair) for pair in maps},
        scatterers=pool_clouds(clouds) if clouds else None,
        detections=pool_matches([(pair.a.frame, pair.found) for pair in pairs]),
        settings=changed_settings(left, right),
        results=Record({side: pool_results([pair.results[k] for pair in pairs]) for k, side in enumerate("ab")}),
        notes=[*_notes(left, right), *left_out],
        sides=(left, right),
        later_sides=[(pair.a, pair.b) for pair in pairs[1:]],
        map_pairs=maps,
    )


def _gate(a: Side, b: Side, cells: float) -> Gate:
    """Return the wider gate of the two sides' profiles."""
    gates = [Gate.of(s.profile, cells) for s in (a, b) if s.profile is not None]
    spans = {round(g.velocity_span_mps, 9) for g in gates}
    return Gate(
        max(g.range_m for g in gates),
        max(g.velocity_mps for g in gates),
        max(g.sine for g in gates),
        # velocities folded to different spans cannot be compared modulo either
        gates[0].velocity_span_mps if len(spans) == 1 else float("inf"),
    )


def _notes(a: Side, b: Side) -> list[str]:
    notes = []
    for side, label in ((a, "A"), (b, "B")):
        if side.cube is None:
            notes.append(f"{label} ({side.name}) is a recorded point cloud: only detections are compared")
        elif side.returns is None:
            notes.append(f"{label} ({side.name}) has no echoes (a processed capture): no objects on that side")
        if side.viewer == "lidar" and side.origin is None:
            notes.append(f"{label}: the LiDAR's origin is not known; give lidar_origin to prove what is hidden from it")
    if a.cube is not None and b.cube is not None and not same_axes(a, b):
        names = f"{a.cube.profile.name!r} and {b.cube.profile.name!r}"
        notes.append(f"maps skipped: the waveforms or arrays of {names} differ, so their cells are not the same")
    windows = [(s.cube.range_window, s.cube.doppler_window) for s in (a, b) if s.cube is not None]
    if len(set(windows)) == 2:
        notes.append(f"windows differ: {windows[0]} and {windows[1]}; side lobes count as map differences")
    if a.frame != b.frame and a.cube is not None and b.cube is not None:
        notes.append(f"frames differ: {a.frame} and {b.frame}")
    return notes
