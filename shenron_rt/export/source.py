"""What every export reads: the frames of a run folder with their times, profiles and mounts."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..config.profile import RadarProfile
from ..config.scene import Scene, load_scene
from ..constants import DEFAULT_MOUNT_XYZ
from ..dsp import Detections, RadarCube
from ..errors import ConfigError, InputError, NotFoundError, did_you_mean
from ..frames import Pose
from ..io.npz import load_npz
from ..returns import Returns
from ..runs import Run, load_run
from ..scatterers import Scatterers
from ..synthesis.adc import AdcCube

__all__ = ["EPOCH_S", "MAPS", "ExportSource", "RunFrame", "RunRadar", "open_run", "stamp_ns", "trailing_number"]

#: Scene second 0 in files whose time stamps count from 1970 [s]: 2001-09-09 01:46:40 UTC. Not 0, which ROS reads as
#: "the newest there is"; a round number, so that the scene's seconds can be read off a stamp.
EPOCH_S = 1_000_000_000
#: Maps of a frame: names of arrays of ``cube.npz`` and ``maps.npz``, and of the pictures drawn of them.
MAPS = ("range_doppler", "range_azimuth")
#: Between frames of runs that do not say when they were [s].
_PERIOD_S = 0.1


def stamp_ns(time_s: float, epoch_s: int = EPOCH_S) -> int:
    """Return scene seconds as nanoseconds since 1970."""
    return epoch_s * 1_000_000_000 + round(time_s * 1e9)


@dataclass(frozen=True)
class RunFrame:
    """One frame of one radar of a run.

    Parameters
    ----------
    index : int
    folder : Path
        Of its files.
    start_s : float
        Scene seconds at the first chirp's start.
    mid_s : float
        Scene seconds at mid-frame, which detections, maps and truth refer to: the frame's time stamp.
    record : mapping
        What ``summary.json`` says of it.
    """

    index: int
    folder: Path
    start_s: float
    mid_s: float
    record: Mapping[str, Any] = field(repr=False)

    def detections(self) -> Detections:
        """Read ``detections.csv``.

        Raises
        ------
        NotFoundError
            The run has not kept it.
        """
        if not self.has("detections.csv"):
            raise NotFoundError(f"{self.folder}: the run kept no detections.csv, which every export needs")
        return Detections.from_csv(self.folder / "detections.csv")

    def adc(self) -> AdcCube | None:
        """Read ``adc.npz``; None where the run has none."""
        return AdcCube.load(self.folder / "adc.npz") if self.has("adc.npz") else None

    def cube(self, profile: RadarProfile) -> RadarCube | None:
        """Read ``cube.npz``, or make a cube that knows nothing but the maps of ``maps.npz``; None without either."""
        if self.has("cube.npz"):
            return RadarCube.load(self.folder / "cube.npz")
        if not self.has("maps.npz"):
            return None
        maps = load_npz(self.folder / "maps.npz", MAPS)
        shape = (*maps["range_doppler"].shape, profile.n_virtual)
        nothing = np.broadcast_to(np.complex128(0), shape)
        cube = RadarCube(nothing, profile, profile.processing.range_window, profile.processing.doppler_window)
        vars(cube).update({name: maps[name] for name in MAPS})  # in the place of what its properties would compute
        return cube

    def returns(self) -> Returns | None:
        """Read ``returns.npz``; None where the run has none."""
        return Returns.load(self.folder / "returns.npz") if self.has("returns.npz") else None

    def scatterers(self) -> Scatterers | None:
        """Read ``scatterers.npz``; None where the run has none."""
        return Scatterers.load(self.folder / "scatterers.npz") if self.has("scatterers.npz") else None

    def has(self, name: str) -> bool:
        """Return whether the frame has a file of that name."""
        return (self.folder / name).is_file()


@dataclass(frozen=True)
class RunRadar:
    """One radar of a run: its profile, its pose in the ego frame, its frames."""

    name: str
    profile: RadarProfile
    mount: Pose
    frames: tuple[RunFrame, ...] = field(repr=False)


@dataclass(frozen=True)
class ExportSource:
    """A run folder as the exports see it.

    Parameters
    ----------
    root : Path
    name : str
        Of the scene, or of the folder where there is none.
    kind : str
        ``"scene"``, ``"lidar"`` or ``"adc"``: what the run was made from.
    radars : tuple of RunRadar
    scene : Scene or None
    version : str
        Of the package that made the run.
    numbers : mapping of int to int
        Of a ``lidar`` run: the number that the file of each frame ends in, CARLA's frame number where the recorder
        wrote it.
    """

    root: Path
    name: str
    kind: str
    radars: tuple[RunRadar, ...]
    scene: Scene | None
    version: str
    numbers: Mapping[int, int] = field(default_factory=dict)

    @property
    def n_frames(self) -> int:
        """Frames of all radars together."""
        return sum(len(r.frames) for r in self.radars)

    def in_order(self) -> list[tuple[RunRadar, RunFrame]]:
        """Return the frames of all radars by rising time stamp."""
        pairs = [(radar, frame) for radar in self.radars for frame in radar.frames]
        return sorted(pairs, key=lambda pair: pair[1].mid_s)

    def names_of(self, frame: RunFrame) -> dict[int, str]:
        """Return the names of the objects by id."""
        told = {int(o["id"]): str(o["name"]) for o in frame.record.get("objects", ()) if o.get("name")}
        return told | ({} if self.scene is None else self.scene.object_names())


def open_run(
    run: Run | str | os.PathLike[str], *, radars: Sequence[str] | None = None, frames: Collection[int] | None = None
) -> ExportSource:
    """Read what a run folder has, without its arrays.

    Parameters
    ----------
    run : Run or path
        Written by ``run``, ``lidar`` or ``process``.
    radars : sequence of str, optional
        Names of the radars wanted. Default: all.
    frames : collection of int, optional
        Numbers of the frames wanted. Default: all.

    Raises
    ------
    NotFoundError
        No run folder.
    InputError
        A radar that it does not have, no frame of those asked for, or a folder of another kind (``rcs``, ``compare``).
    """
    loaded = run if isinstance(run, Run) else load_run(run)
    known = loaded.radars
    if not known:
        raise InputError(f"{loaded.root}: a run without radars; export takes folders written by run, lidar or process")
    wanted = list(dict.fromkeys(radars)) if radars else known
    for name in wanted:
        if name not in known:
            raise InputError(f"{loaded.root}: no radar {name!r}; {did_you_mean(name, known)}")
    kind, scene, setup = _setup(loaded)
    period = _PERIOD_S if scene is None else scene.frame_period_s
    records = {r["name"]: r["frames"] for r in loaded.summary["radars"]}
    listed = tuple(
        RunRadar(name, *setup[name], _frames(loaded, name, records[name], setup[name][0], period, frames))
        for name in wanted
        if name in setup
    )
    if len(listed) != len(wanted) or not all(r.frames for r in listed):
        _refuse(loaded, known, records, frames, setup)
    title = scene.name if scene is not None else loaded.root.name
    version = str(loaded.summary.get("version", ""))
    return ExportSource(loaded.root, title, kind, listed, scene, version, _numbers(loaded, kind))


def _numbers(run: Run, kind: str) -> dict[int, int]:
    """Return the numbers of the files that a LiDAR run was made of, by frame."""
    if kind != "lidar":
        return {}
    numbers = [trailing_number(Path(str(file)).stem) for file in run.summary.get("source", ())]
    frames = [int(f["frame"]) for f in run.summary["radars"][0]["frames"]]
    return {k: n for k, n in zip(frames, numbers, strict=False) if n is not None}


def trailing_number(name: str) -> int | None:
    """Return the digits that a name ends in, as a number."""
    found = re.search(r"\d+$", name)
    return None if found is None else int(found[0])


def _refuse(
    run: Run,
    known: Sequence[str],
    records: Mapping[str, list[dict[str, Any]]],
    frames: Collection[int] | None,
    setup: Mapping[str, Any],
) -> None:
    for name in known:
        if name not in setup:
            raise InputError(f"{run.config}: says nothing of radar {name!r}, which summary.json has")
    has = sorted({int(f["frame"]) for r in records.values() for f in r})
    asked = "all" if frames is None else f"{min(frames, default=0)}:{max(frames, default=-1) + 1}"
    raise InputError(
        f"{run.root}: no frames of {asked}; it has {has[0]}:{has[-1] + 1}" if has else f"{run.root}: no frames"
    )


def _frames(
    run: Run,
    name: str,
    records: Sequence[Mapping[str, Any]],
    profile: RadarProfile,
    period_s: float,
    wanted: Collection[int] | None,
) -> tuple[RunFrame, ...]:
    starts = [float(r.get("time_s") or 0.0) for r in records]
    if any(b <= a for a, b in itertools.pairwise(starts)):  # LiDAR files and captures do not say when they were
        starts = [int(r["frame"]) * period_s for r in records]
    return tuple(
        RunFrame(int(r["frame"]), folder, start, start + profile.frame_mid_s, r)
        for r, start, folder in zip(records, starts, run.frames[name], strict=True)
        if wanted is None or int(r["frame"]) in wanted
    )


def _setup(run: Run) -> tuple[str, Scene | None, dict[str, tuple[RadarProfile, Pose]]]:
    """Return what the run was made from, its scene, and profile and mount of every radar."""
    from ..config.loader import read_yaml

    data, _ = read_yaml(run.config)
    default = Pose(DEFAULT_MOUNT_XYZ)
    try:
        if "lidar" in data:
            mount = _pose(str(data["lidar"].get("mount", "2,0,1")))
            profiles = [RadarProfile.model_validate(p) for p in data["profiles"]]
            return "lidar", None, {p.name: (p, mount) for p in profiles}
        if "process" in data:
            profile = RadarProfile.model_validate(data["profile"])
            return "adc", None, {profile.name: (profile, default)}
    except (KeyError, TypeError, ValueError) as error:
        first = str(error).strip().splitlines()[0]
        raise ConfigError(f"{run.config}: not the config of a run that this version can read ({first})") from None
    scene = load_scene(run.config)
    return "scene", scene, {r.name: (scene.profile_of(r), r.pose) for r in scene.radars}


def _pose(text: str) -> Pose:
    """Return the pose of ``x,y,z[,yaw,pitch,roll]``, as ``lidar --mount`` takes it."""
    x, y, z, yaw, pitch, roll = [*(float(word) for word in text.split(",")), 0.0, 0.0, 0.0][:6]
    return Pose((x, y, z), (yaw, pitch, roll))
