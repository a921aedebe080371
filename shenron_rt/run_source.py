"""What exports and pages read: the frames of a run folder with their times, profiles and mounts."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ._typing import FloatArray
from .config.loader import read_yaml
from .config.profile import RadarProfile
from .config.scene import Scene, load_scene
from .constants import DEFAULT_MOUNT_XYZ
from .dsp import Detections, RadarCube
from .errors import ConfigError, InputError, NotFoundError
from .frames import Pose
from .io.npz import load_npz
from .returns import Returns
from .runs import Run, load_run
from .scatterers import Scatterers
from .synthesis.adc import AdcCube

__all__ = ["MAPS", "RunFrame", "RunRadar", "RunSource", "open_run", "scene_of", "trailing_number"]

#: Maps of a frame: names of arrays of ``cube.npz`` and ``maps.npz``, and of the pictures drawn of them.
MAPS = ("range_doppler", "range_azimuth")
_AXES = ("range_m", "velocity_mps", "azimuth_rad")
#: Between frames of runs that do not say when they were [s].
_PERIOD_S = 0.1


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

    def has(self, name: str) -> bool:
        """Return whether the frame has a file of that name."""
        return (self.folder / name).is_file()

    def detections(self) -> Detections:
        """Read ``detections.csv``.

        Raises
        ------
        NotFoundError
            The run has not kept it.
        """
        if not self.has("detections.csv"):
            raise NotFoundError(f"{self.folder}: the run kept no detections.csv, which is needed here")
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

    def maps(self) -> dict[str, FloatArray] | None:
        """Read both maps [W] with their axes, without the cube behind them; None where the run has kept neither.

        Raises
        ------
        InputError
            A file that cannot be read.
        """
        for name in ("maps.npz", "cube.npz"):
            file = self.folder / name
            if file.is_file():
                try:
                    with np.load(file, allow_pickle=False) as data:
                        return {key: np.asarray(data[key], dtype=np.float64) for key in (*MAPS, *_AXES)}
                except (OSError, ValueError, KeyError, EOFError) as error:
                    raise InputError(f"{file}: the maps in it cannot be read ({error})") from None
        return None

    def returns(self) -> Returns | None:
        """Read ``returns.npz``; None where the run has none."""
        return Returns.load(self.folder / "returns.npz") if self.has("returns.npz") else None

    def scatterers(self) -> Scatterers | None:
        """Read ``scatterers.npz``; None where the run has none."""
        return Scatterers.load(self.folder / "scatterers.npz") if self.has("scatterers.npz") else None


@dataclass(frozen=True)
class RunRadar:
    """One radar of a run: its profile, its pose in the ego frame, its frames."""

    name: str
    profile: RadarProfile
    mount: Pose
    frames: tuple[RunFrame, ...] = field(repr=False)


@dataclass(frozen=True)
class RunSource:
    """A run folder without its arrays.

    Parameters
    ----------
    root : Path
    kind : str
        ``"scene"``, ``"lidar"`` or ``"adc"``: what the run was made from.
    radars : tuple of RunRadar
    scene : Scene or None
    config : str
        Text of ``config.yaml``.
    summary : mapping
        ``summary.json``.
    """

    root: Path
    kind: str
    radars: tuple[RunRadar, ...]
    scene: Scene | None
    config: str = field(repr=False)
    summary: Mapping[str, Any] = field(repr=False)

    @property
    def name(self) -> str:
        """Of the scene, or of the folder where there is none."""
        return self.scene.name if self.scene is not None else self.root.resolve().name

    @property
    def version(self) -> str:
        """Of the package that made the run."""
        return str(self.summary.get("version", ""))

    @property
    def n_frames(self) -> int:
        """Frames of all radars together."""
        return sum(len(r.frames) for r in self.radars)

    @property
    def numbers(self) -> dict[int, int]:
        """Of a ``lidar`` run: the number that the file of each frame ends in, as CARLA's recorder wrote it."""
        if self.kind != "lidar":
            return {}
        numbers = [trailing_number(Path(str(file)).stem) for file in self.summary.get("source", ())]
        frames = [int(f["frame"]) for f in self.summary["radars"][0]["frames"]]
        return {k: n for k, n in zip(frames, numbers, strict=False) if n is not None}

    def in_order(self) -> list[tuple[RunRadar, RunFrame]]:
        """Return the frames of all radars by rising time stamp."""
        pairs = [(radar, frame) for radar in self.radars for frame in radar.frames]
        return sorted(pairs, key=lambda pair: pair[1].mid_s)

    def names_of(self, frame: RunFrame) -> dict[int, str]:
        """Return the names of the objects by id."""
        told = {int(o["id"]): str(o["name"]) for o in frame.record.get("objects", ()) if o.get("name")}
        return told | ({} if self.scene is None else self.scene.object_names())

    def select(self, radars: Sequence[str] | None = None, frames: Collection[int] | None = None) -> RunSource:
        """Return some radars and frames of it; all of them by default.

        Raises
        ------
        InputError
            A radar that it does not have, or no frame of those asked for.
        """
        known = {r.name: r for r in self.radars}
        for name in radars or ():
            if name not in known:
                raise InputError(f"{self.root}: no radar {name!r} in this run; it has {', '.join(known)}")
        chosen = [known[name] for name in dict.fromkeys(radars or known)]
        if frames is not None:
            chosen = [replace(r, frames=tuple(f for f in r.frames if f.index in frames)) for r in chosen]
        if not all(r.frames for r in chosen):
            has = sorted({f.index for r in self.radars for f in r.frames})
            asked = "all" if frames is None else f"{min(frames, default=0)}:{max(frames, default=-1) + 1}"
            raise InputError(f"{self.root}: no frames of {asked}; it has {has[0]}:{has[-1] + 1}")
        return replace(self, radars=tuple(chosen))


def open_run(
    run: RunSource | Run | str | os.PathLike[str],
    *,
    radars: Sequence[str] | None = None,
    frames: Collection[int] | None = None,
) -> RunSource:
    """Read what a run folder has, without its arrays.

    Parameters
    ----------
    run : RunSource, Run or path
        Written by ``run``, ``lidar`` or ``process``; one that is open already is not read again.
    radars : sequence of str, optional
        Names of the radars wanted. Default: all.
    frames : collection of int, optional
        Numbers of the frames wanted. Default: all.

    Raises
    ------
    NotFoundError
        No run folder.
    InputError, ConfigError
        A radar that it does not have, no frame of those asked for, a folder of another kind (``rcs``, ``compare``), or
        a config that cannot be read.
    """
    source = run if isinstance(run, RunSource) else _opened(run if isinstance(run, Run) else load_run(run))
    return source.select(radars, frames)


def _opened(run: Run) -> RunSource:
    if not any(run.frames.values()):
        raise InputError(f"{run.root}: a run without frames; folders written by run, lidar or process have some")
    try:
        text = run.config.read_text(encoding="utf-8")
    except OSError:
        raise NotFoundError(f"{run.root}: not a whole run folder, its config.yaml cannot be read") from None
    kind, scene, setup = _setup(run.config, text)
    period = _PERIOD_S if scene is None else scene.frame_period_s
    radars = []
    for record in run.summary["radars"]:
        name = record["name"]
        if name not in setup:
            raise InputError(f"{run.config}: says nothing of radar {name!r}, which summary.json has")
        profile, mount = setup[name]
        radars.append(
            RunRadar(name, profile, mount, _frames(record["frames"], run.frames[name], profile.frame_mid_s, period))
        )
    return RunSource(run.root, kind, tuple(radars), scene, text, run.summary)


def _frames(
    records: Sequence[Mapping[str, Any]], folders: Sequence[Path], mid_s: float, period_s: float
) -> tuple[RunFrame, ...]:
    starts = [float(r.get("time_s") or 0.0) for r in records]
    if any(b <= a for a, b in itertools.pairwise(starts)):  # LiDAR files and captures do not say when they were
        starts = [int(r["frame"]) * period_s for r in records]
    return tuple(
        RunFrame(int(r["frame"]), folder, start, start + mid_s, r)
        for r, start, folder in zip(records, starts, folders, strict=True)
    )


def scene_of(config: Path, text: str | None = None) -> Scene | None:
    """Return the scene behind a ``config.yaml``; None where a run was made of LiDAR frames or ADC data.

    Raises
    ------
    NotFoundError, ConfigError
        The file, or the scene in it, cannot be read.
    """
    text = config.read_text(encoding="utf-8") if text is None else text
    # a scene of many actors is slow to read: tell it by its keys, and leave the reading to its own loader
    return load_scene(config) if re.search(r"^(lidar|process):", text, flags=re.MULTILINE) is None else None


def _setup(config: Path, text: str) -> tuple[str, Scene | None, dict[str, tuple[RadarProfile, Pose]]]:
    """Return what the run was made from, its scene, and profile and mount of every radar by name."""
    scene = scene_of(config, text)
    if scene is not None:
        return "scene", scene, {r.name: (scene.profile_of(r), r.pose) for r in scene.radars}
    data, _ = read_yaml(config)
    try:
        if "lidar" in data:
            mount = _pose(str(data["lidar"].get("mount") or "2,0,1"))
            profiles = [RadarProfile.model_validate(p) for p in data["profiles"]]
            return "lidar", None, {p.name: (p, mount) for p in profiles}
        profile = RadarProfile.model_validate(data["profile"])
        return "adc", None, {profile.name: (profile, Pose(DEFAULT_MOUNT_XYZ))}
    except (KeyError, TypeError, ValueError) as error:
        first = str(error).strip().splitlines()[0]
        raise ConfigError(f"{config}: not the config of a run that this version can read ({first})") from None


def _pose(text: str) -> Pose:
    """Return the pose of ``x,y,z[,yaw,pitch,roll]``, as ``lidar --mount`` takes it."""
    x, y, z, yaw, pitch, roll = [*(float(word) for word in text.split(",")), 0.0, 0.0, 0.0][:6]
    return Pose((x, y, z), (yaw, pitch, roll))


def trailing_number(name: str) -> int | None:
    """Return the digits that a name ends in, as a number."""
    found = re.search(r"\d+$", name)
    return None if found is None else int(found[0])
