"""Clouds that stand beside ours: the LiDAR of the scene or the run, and a recorded radar."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..config.scene import LidarMount
from ..errors import InputError, NotFoundError
from ..frames import Pose
from ..io.recorded import PointCloud, TiLog, read_carla_radar, read_ti_tlv
from ..run_source import RunFrame, RunSource, trailing_number
from .points import Points, lidar_points, recorded_points, scatterer_points
from .poses import EGO

__all__ = ["LidarClouds", "RecordedClouds", "lidar_clouds", "recorded_clouds"]

#: The LiDAR of a scene that has none, where one is asked for.
_ROOF: dict[str, Any] = {
    "name": "roof", "xyz_m": (0.0, 0.0, 2.5), "channels": 64, "range_m": 100.0, "points_per_second": 600_000,
}  # fmt: skip


@dataclass(frozen=True)
class LidarClouds:
    """A LiDAR whose points are cast over the scene, or come with the run.

    Parameters
    ----------
    name : str
    frame : str
        Frame of its points.
    mount : Pose or None
        Of that frame in the ego frame; None where it is the ego frame itself.
    """

    name: str
    frame: str
    mount: Pose | None
    _source: RunSource = field(repr=False)
    _lidar: LidarMount | None = field(repr=False)
    _backend: str = "auto"

    def points(self, frame: RunFrame) -> Points | None:
        """Return the points of a frame; None where the run has none."""
        if self._lidar is not None and self._source.scene is not None:
            from ..tracing.lidar import cast_lidar

            scene = self._source.scene
            cast = cast_lidar(scene, self._lidar, time=frame.mid_s, frame=frame.index, backend=self._backend)
            return lidar_points(cast)
        scatterers = frame.scatterers()
        return None if scatterers is None else scatterer_points(scatterers, self._source.radars[0].mount)


def lidar_clouds(source: RunSource, wanted: bool | None, backend: str = "auto") -> list[LidarClouds]:
    """Return the LiDARs of a run.

    Parameters
    ----------
    source : RunSource
    wanted : bool or None
        None: those of the scene, or the points that a ``lidar`` run was made of. True: of a scene without one also a
        roof LiDAR of 64 channels at (0, 0, 2.5) m. False: none.
    backend : str
        What casts the rays.

    Raises
    ------
    InputError
        Wanted of a run that is made of ADC data.
    """
    if wanted is False:
        return []
    if source.kind == "lidar":
        return [LidarClouds("points", EGO, None, source, None)]
    if source.scene is None:
        if wanted:
            raise InputError(
                f"{source.root}: made of ADC data, there is no scene to cast a LiDAR over; leave --lidar out"
            )
        return []
    mounts = list(source.scene.lidars) or ([LidarMount(**_ROOF)] if wanted else [])
    return [LidarClouds(m.name, f"lidar/{m.name}", m.pose, source, m, backend) for m in mounts]


@dataclass(frozen=True)
class RecordedClouds:
    """A recorded radar: a cloud for each frame of the run.

    Parameters
    ----------
    name : str
    mount : Pose
        In the ego frame.
    clouds : sequence of PointCloud
    numbers : tuple of int or None
        What the file of each ends in.
    """

    name: str
    mount: Pose
    clouds: Sequence[PointCloud] | TiLog = field(repr=False)
    numbers: tuple[int | None, ...] = ()

    @property
    def frame(self) -> str:
        """Name of its frame."""
        return f"recorded/{self.name}"

    def points(self, position: int, number: int | None = None) -> Points | None:
        """Return the points beside a frame of the run; None where the recording has none.

        Parameters
        ----------
        position : int
            Of the frame among the run's frames.
        number : int, optional
            CARLA's number of the frame: where the recording has numbers too, nothing is paired but what has the same.
        """
        if number is not None and any(n is not None for n in self.numbers):
            return recorded_points(self.clouds[self.numbers.index(number)]) if number in self.numbers else None
        return recorded_points(self.clouds[position]) if position < len(self.clouds) else None


def recorded_clouds(
    source: RunSource, files: Sequence[str | os.PathLike[str]] | str | os.PathLike[str] | None, mount: Pose
) -> RecordedClouds | None:
    """Read a recording: one log of TI's demo, or CARLA's radar, one file a frame or a folder of them.

    Parameters
    ----------
    source : RunSource
        The run that it stands beside.
    files : path or sequence of paths, optional
    mount : Pose
        Of the recorded radar in the ego frame.

    Raises
    ------
    NotFoundError, InputError
        No such file, another layout, or ticks of which the run has none.
    """
    if files is None:
        return None
    given = [Path(f) for f in ([files] if isinstance(files, str | os.PathLike) else files)]
    if len(given) == 1 and given[0].is_dir():
        given = sorted(given[0].glob("*.npy"))
    if not given:
        raise InputError("--recorded: no file, or a folder without .npy files")
    for file in given:
        if not file.is_file():
            raise NotFoundError(f"--recorded {file}: no such file")
    name = re.sub(r"[_\-.]?\d*$", "", given[0].stem) or "radar"
    if given[0].suffix == ".npy":
        numbers = tuple(trailing_number(f.stem) for f in given)
        ours, theirs = set(source.numbers.values()), {n for n in numbers if n is not None}
        if ours and theirs and not ours & theirs:
            raise InputError(
                f"--recorded {given[0]}: frames {min(theirs)} to {max(theirs)} of the recording are none of the run's, "
                f"{min(ours)} to {max(ours)}; names end in CARLA's frame number"
            )
        return RecordedClouds(name, mount, [read_carla_radar(f) for f in given], numbers)
    if len(given) > 1:
        raise InputError(
            f"--recorded {given[1]}: several files are those of CARLA's radar (.npy); of a TI log give one"
        )
    return RecordedClouds(name, mount, read_ti_tlv(given[0]))
