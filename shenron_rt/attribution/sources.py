"""What is explained: one frame of one radar, from a run folder or straight from the chain."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..config.scene import Scene
from ..dsp import Detections, RadarCube
from ..errors import InputError
from ..returns import Returns
from ..run_source import scene_of
from ..runs import Run, load_run
from ..scatterers import Scatterers
from ..synthesis import AdcCube

if TYPE_CHECKING:
    from ..pipeline import Frame

__all__ = ["Case", "cases"]


@dataclass(frozen=True)
class Case:
    """One frame of one radar with all that an explanation needs.

    Parameters
    ----------
    radar, frame, time
        Name, index, scene seconds at the first chirp's start [s].
    cube : RadarCube
        With its returns.
    detections : Detections
    returns : Returns
    scatterers : Scatterers or None
    scene : Scene or None
        What the frame was traced from; ``None`` behind the LiDAR door.
    adc : callable
        Returns the samples; they are read only where they are needed.
    names : mapping of int to str
        Objects by id.
    """

    radar: str
    frame: int
    time: float
    cube: RadarCube
    detections: Detections
    returns: Returns
    scatterers: Scatterers | None
    scene: Scene | None
    adc: Callable[[], AdcCube]
    names: Mapping[int, str] = field(default_factory=dict)

    @property
    def seed(self) -> int:
        """Seed of the frame's random numbers."""
        return 0 if self.scatterers is None else self.scatterers.seed


def cases(
    source: Frame | Run | str | os.PathLike[str], *, radar: str | None, frame: int | None, scene: Scene | None
) -> Iterator[Case]:
    """Yield the frames of a source.

    Raises
    ------
    NotFoundError
        No such folder, or not a run.
    InputError
        No such radar or frame; a frame without returns; levels that are not watts.
    """
    if isinstance(source, str | os.PathLike):
        source = load_run(source)
    found = _of_run(source, radar, frame) if isinstance(source, Run) else iter([_of_frame(source, scene)])
    for case in found:
        if not case.returns.calibrated:
            raise InputError(
                f"explain: echo model {case.returns.model} gives the counts of the released code, not watts; run the "
                "scene with --model physical or shenron"
            )
        yield case


def _of_frame(source: Frame, scene: Scene | None) -> Case:
    names = {} if scene is None else scene.object_names()
    return Case(
        radar=source.radar,
        frame=source.frame,
        time=source.time,
        cube=replace(source.cube, returns=source.returns),
        detections=source.detections,
        returns=source.returns,
        scatterers=source.scatterers,
        scene=scene,
        adc=lambda: source.adc,
        names=names,
    )


def _of_run(run: Run, radar: str | None, frame: int | None) -> Iterator[Case]:
    wanted = [radar] if radar is not None else run.radars
    if radar is not None and radar not in run.frames:
        raise InputError(f"{run.root}: no radar {radar!r} in this run; it has {', '.join(run.radars) or 'none'}")
    scene = _scene(run.config)
    for entry in run.summary["radars"]:
        if entry["name"] not in wanted:
            continue
        records = {int(r["frame"]): r for r in entry["frames"]}
        if frame is not None and frame not in records:
            raise InputError(f"{run.root}: radar {entry['name']!r} has no frame {frame}; it has {sorted(records)}")
        folders = dict(zip(records, run.frames[entry["name"]], strict=True))
        for index in sorted(records) if frame is None else [frame]:
            yield _of_folder(folders[index], entry["name"], index, records[index], scene)


def _of_folder(folder: Path, radar: str, index: int, record: Mapping[str, Any], scene: Scene | None) -> Case:
    if not (folder / "returns.npz").is_file():
        raise InputError(f"{folder}: no returns.npz; only runs with simulated echoes can be explained")
    if not (folder / "cube.npz").is_file():
        raise InputError(
            f"{folder}: the run kept no cube.npz; run it with --write returns,cube,detections, or all parts"
        )
    returns = Returns.load(folder / "returns.npz")
    rows = folder / "scatterers.npz"
    names = {int(o["id"]): str(o["name"]) for o in record["objects"]}
    return Case(
        radar=radar,
        frame=index,
        time=float(record["time_s"]),
        cube=replace(RadarCube.load(folder / "cube.npz"), returns=returns),
        detections=Detections.from_csv(folder / "detections.csv"),
        returns=returns,
        scatterers=Scatterers.load(rows) if rows.is_file() else None,
        scene=scene,
        adc=lambda: replace(AdcCube.load(folder / "adc.npz"), returns=returns),
        names=names if scene is None else scene.object_names() | names,
    )


def _scene(config: Path) -> Scene | None:
    """Return the scene behind a run, or None where it came from a LiDAR."""
    return scene_of(config) if config.is_file() else None
