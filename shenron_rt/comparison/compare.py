"""The comparison as one call and one value."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._typing import ArrayLike
from ..errors import InputError
from .clouds import compare_clouds
from .maps import MapPair, compare_maps, map_record
from .objects import compare_objects, compare_tags
from .points import Gate, match_detections
from .record import Record
from .settings import changed_settings, results
from .sides import Side, side_of

if TYPE_CHECKING:
    from ..config.profile import RadarProfile

__all__ = ["Comparison", "compare"]


@dataclass(frozen=True)
class Comparison:
    """Where two sides agree and differ; differences are B minus A.

    Parameters
    ----------
    name_a, name_b : str
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
    """

    name_a: str
    name_b: str
    objects: list[Record]
    tags: list[Record]
    maps: dict[str, Record]
    scatterers: Record | None
    detections: Record
    settings: list[Record]
    results: Record
    notes: list[str]
    sides: tuple[Side, Side] = field(repr=False)
    map_pairs: list[MapPair] = field(repr=False)

    def __repr__(self) -> str:
        found = self.detections
        return (
            f"Comparison({self.name_a!r} with {self.name_b!r}: {len(self.objects)} objects, {len(found.matched)} "
            f"detections matched, {len(found.missed)} missed, {len(found.extra)} extra)"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return everything but the arrays, ready for JSON."""
        names = ("objects", "tags", "maps", "scatterers", "detections", "settings", "results", "notes")
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
    frame: int | None = None,
    lidar_origin: ArrayLike | None = None,
    gate_cells: float = 2.0,
    voxel_m: float = 0.5,
) -> Comparison:
    """Compare two frames of one radar: mesh with LiDAR, any two runs, or a run with a recorded point cloud.

    Parameters
    ----------
    a, b : Frame, run folder (path or Run) or PointCloud
        A recorded cloud on one side only.
    radar : str, optional
        Radar of a run folder; default its first.
    frame : int, optional
        Frame of a run folder; default its first.
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
    left, right = (
        side_of(source, label, radar=radar, frame=frame, lidar_origin=lidar_origin)
        for source, label in ((a, "A"), (b, "B"))
    )
    profile = left.profile or right.profile
    if profile is None:
        raise InputError("compare: two recorded clouds have no profile whose cells could match them; give one run")
    notes = _notes(left, right)
    pairs = compare_maps(left.cube, right.cube) if left.cube and right.cube and _same_axes(left, right) else []
    both = left.scatterers is not None and right.scatterers is not None
    return Comparison(
        name_a=left.name,
        name_b=right.name,
        objects=compare_objects(left, right),
        tags=compare_tags(left, right),
        maps={pair.name: map_record(pair) for pair in pairs},
        scatterers=compare_clouds(left.scatterers, right.scatterers, voxel_m) if both else None,  # type: ignore[arg-type]
        detections=match_detections(left.detections, right.detections, _gate(left, right, gate_cells)),
        settings=changed_settings(left, right),
        results=Record(a=results(left), b=results(right)),
        notes=notes,
        sides=(left, right),
        map_pairs=pairs,
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


def _same_axes(a: Side, b: Side) -> bool:
    if a.cube is None or b.cube is None:
        return False
    return a.cube.n_fft == b.cube.n_fft and _cells(a.cube.profile) == _cells(b.cube.profile)


def _cells(profile: RadarProfile) -> tuple[Any, ...]:
    """Return what the axes of the maps derive from."""
    return (profile.waveform, profile.array)


def _notes(a: Side, b: Side) -> list[str]:
    notes = []
    for side, label in ((a, "A"), (b, "B")):
        if side.cube is None:
            notes.append(f"{label} ({side.name}) is a recorded point cloud: only detections are compared")
        elif side.returns is None:
            notes.append(f"{label} ({side.name}) has no echoes (a processed capture): no objects on that side")
        if side.viewer == "lidar" and side.origin is None:
            notes.append(f"{label}: the LiDAR's origin is not known; give lidar_origin to prove what is hidden from it")
    if a.cube is not None and b.cube is not None and not _same_axes(a, b):
        names = f"{a.cube.profile.name!r} and {b.cube.profile.name!r}"
        notes.append(f"maps skipped: the waveforms or arrays of {names} differ, so their cells are not the same")
    windows = [(s.cube.range_window, s.cube.doppler_window) for s in (a, b) if s.cube is not None]
    if len(set(windows)) == 2:
        notes.append(f"windows differ: {windows[0]} and {windows[1]}; side lobes count as map differences")
    if a.frame != b.frame and a.cube is not None and b.cube is not None:
        notes.append(f"frames differ: {a.frame} and {b.frame}")
    return notes
