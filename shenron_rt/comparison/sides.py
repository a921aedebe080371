"""The two things that are compared, brought to one form."""

from __future__ import annotations

import logging
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .._typing import ArrayLike, FloatArray
from ..dsp import Detections, RadarCube
from ..errors import InputError, NotFoundError, ShenronError
from ..io.recorded import PointCloud
from ..returns import Returns
from ..runs import Run, load_run
from ..scatterers import Scatterers

if TYPE_CHECKING:
    from ..config.materials import MaterialTable
    from ..config.profile import RadarProfile

__all__ = ["Side", "frames_of", "opened", "side_of"]

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Side:
    """One frame of one radar, as far as it is known.

    Parameters
    ----------
    name : str
    detections : Detections or PointCloud
    profile, scatterers, returns, cube
        ``None`` where the source has none: a processed capture has no scatterers, a recorded cloud only its points.
    names : mapping of int to str
        Objects by id.
    materials : MaterialTable or None
        Behind the echoes.
    origin : (3,) float or None
        Where the scatterers were looked at from, radar frame: the radar itself, or the LiDAR [m].
    settings : mapping
        The run's ``config.yaml``.
    frame : int
    """

    name: str
    detections: Detections | PointCloud
    profile: RadarProfile | None = None
    scatterers: Scatterers | None = None
    returns: Returns | None = None
    cube: RadarCube | None = None
    names: Mapping[int, str] = field(default_factory=dict)
    materials: MaterialTable | None = None
    origin: FloatArray | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    frame: int = 0

    @property
    def viewer(self) -> str:
        """What looked at the scene: ``"lidar"`` or ``"radar"``."""
        return "lidar" if self.scatterers is not None and self.scatterers.door == "lidar" else "radar"


def side_of(source: Any, label: str, *, radar: str | None, frame: int | None, lidar_origin: ArrayLike | None) -> Side:
    """Bring a frame, a run folder or a recorded cloud to the common form.

    Raises
    ------
    NotFoundError
        No such folder.
    InputError
        Something else; no such radar or frame in the run.
    """
    source = opened(source)
    if isinstance(source, PointCloud):
        return Side(name=source.source or label, detections=source, frame=source.frame)
    if isinstance(source, Run):
        return _of_run(source, radar, frame, lidar_origin)
    if hasattr(source, "cube") and hasattr(source, "detections"):
        return _of_frame(source, label, lidar_origin)
    raise InputError(f"compare: {label} must be a Frame, a run folder or a PointCloud, got {type(source).__name__}")


def opened(source: Any) -> Any:
    """Return the run of a folder's path; anything else as it is."""
    return load_run(source) if isinstance(source, str | os.PathLike) else source


def frames_of(source: Any, radar: str | None) -> list[int] | None:
    """Return the frames of a run's radar; None for what is one frame."""
    return sorted(_numbered(source, radar)[1]) if isinstance(source, Run) else None


def _numbered(run: Run, radar: str | None) -> tuple[str, dict[int, Path]]:
    """Return the radar's name and its frames' folders by number."""
    name = radar or next(iter(run.frames), None)
    if name is None or name not in run.frames:
        raise InputError(f"{run.root}: no radar {name!r} in this run; it has {', '.join(run.radars) or 'none'}")
    numbered = {int(folder.name.removeprefix("frame_")): folder for folder in run.frames[name]}
    if not numbered:
        raise InputError(f"{run.root}: radar {name!r} has no frames")
    return name, numbered


def _origin(scatterers: Scatterers | None, lidar_origin: ArrayLike | None) -> FloatArray | None:
    if scatterers is None:
        return None
    if scatterers.door == "mesh":
        return np.zeros(3)
    known = scatterers.origin if lidar_origin is None else lidar_origin
    if known is None:
        return None
    point = np.asarray(known, dtype=np.float64)
    if point.shape != (3,) or not np.all(np.isfinite(point)):
        raise InputError(f"lidar_origin: three finite numbers are needed (radar frame, m), got {lidar_origin!r}")
    return point


def _of_frame(frame: Any, label: str, lidar_origin: ArrayLike | None) -> Side:
    from ..config.materials import load_materials

    scatterers = getattr(frame, "scatterers", None)
    return Side(
        name=f"{label}: {getattr(frame, 'radar', 'radar')}{'' if scatterers is None else f', {scatterers.door} door'}",
        detections=frame.detections,
        profile=frame.cube.profile,
        scatterers=scatterers,
        returns=getattr(frame, "returns", None),
        cube=frame.cube,
        materials=load_materials(),
        origin=_origin(scatterers, lidar_origin),
        frame=frame.frame,
    )


def _of_run(run: Run, radar: str | None, frame: int | None, lidar_origin: ArrayLike | None) -> Side:
    name, numbered = _numbered(run, radar)
    index = min(numbered) if frame is None else frame
    if index not in numbered:
        raise InputError(f"{run.root}: radar {name!r} has no frame {index}; it has {sorted(numbered)}")
    folder = numbered[index]
    cube = RadarCube.load(folder / "cube.npz")
    scatterers = Scatterers.load(folder / "scatterers.npz") if (folder / "scatterers.npz").is_file() else None
    returns = Returns.load(folder / "returns.npz") if (folder / "returns.npz").is_file() else None
    settings = _settings(run.config)
    return Side(
        name=run.root.name,
        detections=Detections.from_csv(folder / "detections.csv"),
        profile=cube.profile,
        scatterers=scatterers,
        returns=returns,
        cube=cube,
        names=_names(run, name, index),
        materials=_materials(settings),
        origin=_origin(scatterers, lidar_origin),
        settings=settings,
        frame=index,
    )


def _names(run: Run, radar: str, index: int) -> dict[int, str]:
    return {
        int(item["id"]): str(item["name"])
        for entry in run.summary["radars"]
        if entry["name"] == radar
        for record in entry["frames"]
        if record["frame"] == index
        for item in record["objects"]
    }


def _settings(path: Path) -> dict[str, Any]:
    import yaml

    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, yaml.YAMLError):
        return {}
    return data if isinstance(data, dict) else {}


def _materials(settings: Mapping[str, Any]) -> MaterialTable:
    from ..config.materials import load_materials

    wanted = str(settings.get("materials", "automotive"))
    try:
        return load_materials(wanted)
    except (NotFoundError, ShenronError):
        _log.warning("material table %s of the run cannot be read; 'automotive' takes its place", wanted)
        return load_materials()
