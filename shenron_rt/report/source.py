"""What a page reads of a run folder: its frames with their profiles and mounts, and the maps of each."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .._typing import FloatArray
from ..config.loader import read_yaml
from ..config.profile import RadarProfile
from ..config.scene import Scene, load_scene
from ..constants import DEFAULT_MOUNT_XYZ
from ..dsp import Detections
from ..errors import ConfigError, InputError, NotFoundError
from ..frames import Pose
from ..returns import Returns
from ..runs import load_run

__all__ = ["FrameFiles", "RadarFiles", "RunFiles", "open_run"]

_MAPS = ("range_doppler", "range_azimuth", "range_m", "velocity_mps", "azimuth_rad")


@dataclass(frozen=True)
class FrameFiles:
    """One frame of one radar.

    Parameters
    ----------
    index : int
    start_s, mid_s : float
        Scene seconds at the first chirp's start and at mid-frame, which detections, maps and truth refer to.
    folder : Path
    record : mapping
        What ``summary.json`` says of it.
    """

    index: int
    start_s: float
    mid_s: float
    folder: Path
    record: Mapping[str, Any] = field(repr=False)

    def detections(self) -> Detections | None:
        """Read ``detections.csv``; None where the run has none."""
        file = self.folder / "detections.csv"
        return Detections.from_csv(file) if file.is_file() else None

    def returns(self) -> Returns | None:
        """Read ``returns.npz``; None where the run has none."""
        file = self.folder / "returns.npz"
        return Returns.load(file) if file.is_file() else None

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
                        return {key: np.asarray(data[key], dtype=np.float64) for key in _MAPS}
                except (OSError, ValueError, KeyError, EOFError) as error:
                    raise InputError(f"{file}: the maps in it cannot be read ({error})") from None
        return None


@dataclass(frozen=True)
class RadarFiles:
    """One radar of a run: its profile, its pose in the ego frame, its frames."""

    name: str
    profile: RadarProfile
    mount: Pose
    frames: tuple[FrameFiles, ...] = field(repr=False)


@dataclass(frozen=True)
class RunFiles:
    """A run folder as a page shows it; ``scene`` is None for runs made from LiDAR frames or ADC data."""

    root: Path
    scene: Scene | None
    config: str = field(repr=False)
    summary: Mapping[str, Any] = field(repr=False)
    radars: tuple[RadarFiles, ...]

    @property
    def title(self) -> str:
        """Name of the scene, or of the folder."""
        return self.scene.name if self.scene is not None else self.root.resolve().name


def open_run(path: str | os.PathLike[str]) -> RunFiles:
    """Read what a run folder holds, without its arrays.

    Raises
    ------
    NotFoundError
        No run folder.
    InputError, ConfigError
        A run without radars or frames (``rcs``, ``compare``), or a config that cannot be read.
    """
    run = load_run(path)
    if not any(run.frames.values()):
        raise InputError(f"{run.root}: a run without frames; report takes folders written by run, lidar or process")
    try:
        text = run.config.read_text(encoding="utf-8")
    except OSError:
        raise NotFoundError(f"{run.root}: not a whole run folder, its config.yaml cannot be read") from None
    scene, setup = _setup(run.config, text)
    radars = []
    for record in run.summary["radars"]:
        name = record["name"]
        if name not in setup:
            raise InputError(f"{run.config}: says nothing of radar {name!r}, which summary.json has")
        profile, mount = setup[name]
        radars.append(RadarFiles(name, profile, mount, _frames(record["frames"], run.frames[name], profile)))
    return RunFiles(run.root, scene, text, run.summary, tuple(radars))


def _frames(records: list[Mapping[str, Any]], folders: list[Path], profile: RadarProfile) -> tuple[FrameFiles, ...]:
    pairs = zip(records, folders, strict=True)
    starts = ((int(r["frame"]), float(r.get("time_s") or 0.0), folder, r) for r, folder in pairs)
    return tuple(FrameFiles(k, t, t + profile.frame_mid_s, folder, r) for k, t, folder, r in starts)


def _setup(config: Path, text: str) -> tuple[Scene | None, dict[str, tuple[RadarProfile, Pose]]]:
    """Return the scene, where there is one, and profile and mount of every radar by name."""
    # a scene of many actors is slow to read: tell it by its keys, and leave the reading to its own loader
    if re.search(r"^(lidar|process):", text, flags=re.MULTILINE) is None:
        scene = load_scene(config)
        return scene, {r.name: (scene.profile_of(r), r.pose) for r in scene.radars}
    data, _ = read_yaml(config)
    try:
        if "lidar" in data:
            numbers = [float(word) for word in str(data["lidar"].get("mount") or "2,0,1").split(",")]
            x, y, z, *turned = numbers
            yaw, pitch, roll = [*turned, 0.0, 0.0, 0.0][:3]
            profiles = [RadarProfile.model_validate(p) for p in data["profiles"]]
            return None, {p.name: (p, Pose((x, y, z), (yaw, pitch, roll))) for p in profiles}
        profile = RadarProfile.model_validate(data["profile"])
        return None, {profile.name: (profile, Pose(DEFAULT_MOUNT_XYZ))}
    except (KeyError, TypeError, ValueError) as error:
        first = str(error).strip().splitlines()[0]
        raise ConfigError(f"{config}: not the config of a run that this version can read ({first})") from None
