"""One frame of both sides, reduced to what its comparison and the mean over frames need."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ..errors import InputError
from ..tags import SemanticTag
from .clouds import compare_clouds
from .levels import Levels, has_surfaces
from .maps import MapPair, compare_maps
from .points import Gate, match_detections
from .record import Record
from .settings import results
from .sides import Side, frames_of
from .surfaces import Palette, used_materials

__all__ = ["FramePair", "common_frames", "palette_of", "same_axes"]


@dataclass(frozen=True)
class FramePair:
    """What a frame says; the arrays of all but the first frame are let go.

    Parameters
    ----------
    a, b : Side
    objects, tags : Levels or None
        None where neither side has echoes.
    maps : list of MapPair
    cloud : Record or None
    found : Record
        Matched detections.
    results : (Record, Record)
    """

    a: Side
    b: Side
    objects: Levels | None
    tags: Levels | None
    maps: list[MapPair]
    cloud: Record | None
    found: Record
    results: tuple[Record, Record]

    @classmethod
    def of(cls, a: Side, b: Side, palette: Palette | None, gate: Gate, voxel_m: float) -> FramePair:
        """Compare one frame."""
        echoes = a.returns is not None or b.returns is not None
        names = {**b.names, **a.names}
        tag_names = {int(tag): tag.name for tag in SemanticTag}
        cloud = None
        if a.scatterers is not None and b.scatterers is not None:
            cloud = compare_clouds(a.scatterers, b.scatterers, voxel_m)
        return cls(
            a=a,
            b=b,
            objects=Levels.of(a, b, "object_id", palette, names) if echoes else None,
            tags=Levels.of(a, b, "tag", palette, tag_names) if echoes else None,
            maps=compare_maps(a.cube, b.cube) if a.cube and b.cube and same_axes(a, b) else [],
            cloud=cloud,
            found=match_detections(a.detections, b.detections, gate),
            results=(results(a), results(b)),
        )

    def light(self) -> FramePair:
        """Return the pair with sides that keep detections and names alone."""
        bare: dict[str, Any] = {"scatterers": None, "returns": None, "cube": None}
        return replace(self, a=replace(self.a, **bare), b=replace(self.b, **bare))

    @property
    def names(self) -> Mapping[int, str]:
        """Objects by id."""
        return {**self.b.names, **self.a.names}


def common_frames(
    a: Any, b: Any, radar: str | None, frame: int | Sequence[int] | None
) -> tuple[list[int | None], list[str]]:
    """Return the frames to compare, None for the only or first one of each side, and what is left out.

    Raises
    ------
    InputError
        A list of frames for sources that are one frame, or one that a run does not have.
    """
    known = [frames_of(source, radar) for source in (a, b)]
    if isinstance(frame, int):
        return [frame], []
    runs = [k for k in known if k is not None]
    if frame is not None:
        wanted = list(frame)
        for have in runs:
            missing = sorted(set(wanted) - set(have))
            if missing:
                raise InputError(f"compare: frames {missing} are not in a run, which has {have}")
        if len(runs) < 2 or not wanted:
            raise InputError("compare: several frames need two runs, and at least one frame")
        return list(wanted), []
    if len(runs) < 2:
        return [None], []
    common = sorted(set(runs[0]) & set(runs[1]))
    if not common:
        return [None], []
    notes = [
        f"{label} has {len(have) - len(common)} frames that the other side lacks; they are left out"
        for label, have in zip("AB", runs, strict=True)
        if len(have) > len(common)
    ]
    return list(common), notes


def palette_of(a: Side, b: Side, *, several: bool) -> Palette | None:
    """Return the materials of both sides; of several frames all of the tables, as any may come up later."""
    if a.profile is None or not has_surfaces(a) or not has_surfaces(b):
        return None
    if not several:
        return Palette.of(a, b)
    used = [used_materials(s) | set(s.materials.materials if s.materials is not None else ()) for s in (a, b)]
    return Palette.of(a, b, (used[0], used[1]))


def same_axes(a: Side, b: Side) -> bool:
    """Return whether the maps of both sides have the same cells: what the axes derive from is equal."""
    if a.cube is None or b.cube is None:
        return False
    one, two = a.cube.profile, b.cube.profile
    return a.cube.n_fft == b.cube.n_fft and (one.waveform, one.array) == (two.waveform, two.array)
