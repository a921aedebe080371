"""``explain``: for every object and frame, what became of its echo and why."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from ..config.scene import Scene
from ..dsp import noise_threshold
from ..errors import InputError
from ..tags import SemanticTag
from .cells import Look, look_at_peak, strongest_beam
from .contributions import GHOST, Contributions
from .echoes import Middle, detection_labels, looks_of, middle_of
from .masking import shares
from .records import FrameExplanation, ObjectExplanation, Peak
from .sources import Case, cases
from .unhidden import projected_area
from .verdict import Judge
from .waterfall import db, waterfall

if TYPE_CHECKING:
    from ..pipeline import Frame
    from ..runs import Run

__all__ = ["Explanation", "explain"]

#: Parts whose share is told in every cell: of ten thousand objects the strongest.
_MOST_PARTS = 100


@dataclass(frozen=True)
class Explanation:
    """The frames of one or several radars, explained.

    Parameters
    ----------
    frames : tuple of FrameExplanation
    """

    frames: tuple[FrameExplanation, ...]

    def __repr__(self) -> str:
        return f"Explanation({len(self.frames)} frames: {', '.join(map(repr, self.frames[:3]))})"

    def __iter__(self) -> Iterator[FrameExplanation]:
        return iter(self.frames)

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain values, ready for JSON."""
        return {"frames": [frame.to_dict() for frame in self.frames]}

    def evidence(self) -> list[dict[str, Any]]:
        """Return the strongest peak of every frame: frame, radar, range, azimuth, level, and whose it is."""
        return [
            {"frame": f.frame, "radar": f.radar} | asdict(f.strongest) for f in self.frames if f.strongest is not None
        ]


def explain(
    source: Frame | Run | str | os.PathLike[str],
    *,
    object_id: int | None = None,
    frame: int | None = None,
    radar: str | None = None,
    scene: Scene | None = None,
    progress: Callable[[str], object] | None = None,
) -> Explanation:
    """Tell for every object and frame whether it is seen, and why not.

    Parameters
    ----------
    source : Frame, Run, or path of a run folder
    object_id : int, optional
        One object. Default: all of the scene, and all that echo.
    frame : int, optional
        One frame of a run. Default: all.
    radar : str, optional
        One radar of a run. Default: all.
    scene : Scene, optional
        What a Frame was traced from. Without it, and behind the LiDAR door, what the rays did not meet is ``absent``.
    progress : callable, optional
        Called with a phrase before each frame.

    Returns
    -------
    Explanation

    Raises
    ------
    NotFoundError, InputError
        No such run, radar, frame or object.

    Notes
    -----
    Each object's echoes are synthesised and processed alone, without noise; the chain is linear, so the parts and the
    noise add up to the cube. Causes are proven by taking them away: other objects out of the cube, or everything else
    out of the scene.

    Examples
    --------
    >>> import shenron_rt as srt
    >>> scene = srt.Scene(point_targets=[{"id": 1, "xyz_m": (30, 0, 1), "rcs_dbsm": 10}])
    >>> found = srt.explain(srt.simulate(scene), scene=scene)  # doctest: +SKIP
    >>> found.frames[0].of(1).verdict.text  # doctest: +SKIP
    'detected'
    """
    done = []
    for case in cases(source, radar=radar, frame=frame, scene=scene):
        if progress is not None:
            progress(f"{case.radar} frame {case.frame}")
        done.append(_explain_frame(case, object_id))
    return Explanation(tuple(done))


def _explain_frame(case: Case, wanted: int | None) -> FrameExplanation:
    contributions = Contributions(case.returns, case.cube)
    judge = Judge.of(case, contributions)
    labels = detection_labels(case.detections)
    looks = looks_of(case.cube, case.detections)
    echoing = {i: sum(contributions.returns_of(i).power_by_object().values()) for i in contributions.ids}
    known = {i % GHOST for i in echoing} | {i for i in case.names if i}
    ids = sorted(known, key=lambda i: -echoing.get(i, 0.0))
    names = {i: case.names.get(i, f"object {i}" if i else "static") for i in known}
    case = replace(case, names=names | {i + GHOST: f"ghost of {name}" for i, name in names.items()})
    if wanted is not None:
        if wanted not in ids:
            listed = ", ".join(f"{i} ({names[i]})" for i in sorted(ids))
            raise InputError(f"explain: no object {wanted} in frame {case.frame}; there are {listed or 'none'}")
        ids = [wanted]
    view = _View(case, contributions, judge, labels, looks, echoing)
    objects = tuple(view.explained(i) for i in ids)
    return FrameExplanation(case.radar, case.frame, case.time, objects, labels, view.strongest())


@dataclass(frozen=True)
class _View:
    """What all objects of a frame share."""

    case: Case
    contributions: Contributions
    judge: Judge
    labels: tuple[str, ...]
    looks: list[Look]
    power_w: dict[int, float]

    @cached_property
    def strongest_parts(self) -> list[int]:
        """The parts that are looked for in other cells: those with the most power, unless it is next to nothing."""
        order = sorted(self.power_w, key=lambda i: -self.power_w[i])[:_MOST_PARTS]
        return [i for i in order if not self.contributions.negligible(i)]

    def explained(self, number: int) -> ObjectExplanation:
        """Return the explanation of one object."""
        case = self.case
        mine = tuple(int(i) for i in np.flatnonzero(case.detections.object_id == number))
        labels = tuple(self.labels[i] for i in mine)
        echo = self.contributions.returns_of(number) if number in self.power_w else None
        silent = echo is None or not np.any(echo.amplitude)
        middle = None if echo is None or silent else middle_of(echo)
        look = None if silent else self._look(number, mine)
        others = [i for i in self.strongest_parts if i != number]
        verdict = self.judge.verdict(number, look, others, labels)
        return ObjectExplanation(
            object_id=number,
            name=case.names[number],
            detections=mine,
            labels=labels,
            power_dbm=db(self.power_w[number]) + 30 if self.power_w.get(number, 0.0) > 0 else None,
            verdict=verdict,
            **self._surface(number),
            **_place(middle),
            **self._cell(number, look, middle, others),
        )

    def strongest(self) -> Peak | None:
        """Return the strongest cell of the range-azimuth map beyond blanking."""
        cube = self.case.cube
        found = strongest_beam(cube, self.judge.first_row)
        if found is None:
            return None
        look, azimuth, power = found
        levels = {i: abs(look.beamformed(self.contributions.of(i))) for i in self.strongest_parts}
        best = max(levels, key=lambda i: levels[i], default=-1)
        name = "noise" if best < 0 else self.case.names[best]
        return Peak(float(cube.range_m[look.row]), azimuth, db(power) + 30, best % GHOST if best >= 0 else -1, name)

    def _look(self, number: int, detections: tuple[int, ...]) -> Look | None:
        """Return the cell of the strongest detection, else that of the object's own peak."""
        direct = [i for i in detections if not self.labels[i].startswith("ghost")]
        if direct:
            return self.looks[direct[0]]
        own = self.contributions.of(number)
        return look_at_peak(own, self.judge.first_row) or look_at_peak(own)

    def _surface(self, number: int) -> dict[str, Any]:
        rows = self.case.scatterers
        if rows is None:
            return {"rows": 0, "visible_area_m2": None, "projected_area_m2": None, "tag": None}
        mine = rows.object_id == number
        own = rows.select(mine)
        area = None if own.area is None else float(own.area.sum())
        tag = SemanticTag(int(own.tag[0])).name if len(own) else None
        return {
            "rows": len(own),
            "visible_area_m2": area,
            "projected_area_m2": None if area is None else projected_area(own),
            "tag": tag,
        }

    def _cell(self, number: int, look: Look | None, middle: Middle | None, others: list[int]) -> dict[str, Any]:
        names = ("cell", "cell_dbm", "threshold_dbm", "noise_threshold_dbm", "waterfall")
        if look is None or middle is None:
            return dict.fromkeys(names) | {"shares": ()}
        cube = self.case.cube
        threshold = noise_threshold(cube, pfa=cube.profile.processing.pfa)
        at = (look.row, look.column)
        return {
            "cell": look.record(),
            "cell_dbm": db(float(cube.range_doppler[at])) + 30,
            "threshold_dbm": db(float(threshold[at])) + 30,
            "noise_threshold_dbm": db(float(self.judge.noise_threshold_w[at])) + 30,
            "shares": shares(self.contributions, look, others, number, self.case.names),
            "waterfall": waterfall(self.contributions, number, look, middle.position),
        }


def _place(middle: Middle | None) -> dict[str, Any]:
    names = ("range_m", "azimuth_deg", "elevation_deg", "velocity_mps")
    if middle is None:
        return dict.fromkeys(names)
    x, y, z = (float(v) for v in middle.position)
    return {
        "range_m": middle.range_m,
        "azimuth_deg": float(np.degrees(np.arctan2(y, x))),
        "elevation_deg": float(np.degrees(np.arctan2(z, np.hypot(x, y)))),
        "velocity_mps": middle.velocity_mps,
    }
