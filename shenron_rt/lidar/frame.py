"""One frame of a semantic LiDAR, in the sensor's own frame, ROS axes."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np

from .._typing import ArrayLike, FloatArray, IntArray
from ..errors import InputError
from ..frames import Pose
from ..io.npz import load_npz, save_npz
from ..tags import SemanticTag
from .grid import MIN_AREA_COS, LidarGrid

__all__ = ["LidarFrame"]


@dataclass(frozen=True)
class LidarFrame:
    """Points of a semantic LiDAR (x forward, y left, z up, at the sensor).

    Parameters
    ----------
    position : (n, 3) float
        At the sensor, ROS axes [m].
    cos_incidence : (n,) float
        Cosine of the incidence angle as the sensor recorded it, in [0, 1]: seen from the sensor, not from any radar.
    object_id : (n,) uint32
        CARLA actor id; 0 = environment, which is not one object.
    tag : (n,) uint8
        :class:`~shenron_rt.tags.SemanticTag`.
    area : (n,) float
        Surface the point stands for, R^2 dOmega / cos, as its own sweep saw it [m^2].
    grid : LidarGrid
    sensor_pose : Pose or None
        Sensor in the ego frame.
    velocity : (n, 3) float or None
        Over ground (not relative to the ego vehicle), in the sensor's axes [m/s]; ``None`` where nothing is known.
    ego_velocity : (3,) float or None
        Of the ego vehicle over ground, ego axes, ROS [m/s].
    ego_yaw_rate : float
        + left [rad/s].
    range_rate : (n,) float or None
        The recorded velocity column, relative to the sensor, positive = receding [m/s].
    normal : (n, 3) float or None
        Unit normals facing the sensor, estimated on demand; 0 0 0 where none could be.
    slope : (n,) float or None
        RMS slope of the surface between a point and its neighbours, as a tangent; comes with ``normal``.
    material : (n,) uint16 or None
        Index into ``material_names``; only frames cast over a scene can have it. ``None`` leaves it to the tags.
    material_names : tuple of str
        Names in the material table.
    path, layout, tag_table : str
        Where the points came from, how they were stored, how their tags were numbered.
    names : mapping of int to str
        Names of actors.
    notes : tuple of str
        What was done to the points: conversions, crops, merges.
    n_read, n_clipped : int
        Points in the file; cosines outside [0, 1] that were clipped or whose sign was dropped.
    """

    position: FloatArray
    cos_incidence: FloatArray
    object_id: IntArray
    tag: IntArray
    area: FloatArray
    grid: LidarGrid
    sensor_pose: Pose | None = None
    velocity: FloatArray | None = None
    ego_velocity: FloatArray | None = None
    ego_yaw_rate: float = 0.0
    range_rate: FloatArray | None = None
    normal: FloatArray | None = None
    slope: FloatArray | None = None
    material: IntArray | None = None
    material_names: tuple[str, ...] = ()
    path: str = ""
    layout: str = ""
    tag_table: str = ""
    names: Mapping[int, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    n_read: int = 0
    n_clipped: int = 0

    def __post_init__(self) -> None:
        n = len(self.position)
        shapes: dict[str, tuple[int, ...]] = {
            "position": (n, 3), "cos_incidence": (n,), "object_id": (n,), "tag": (n,), "area": (n,),
            "velocity": (n, 3), "range_rate": (n,), "normal": (n, 3), "slope": (n,), "material": (n,),
        }  # fmt: skip
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value is not None and np.shape(value) != shape:
                raise InputError(f"LidarFrame.{name}: shape {shape} is needed, got {np.shape(value)}")

    def __len__(self) -> int:
        return len(self.position)

    def __repr__(self) -> str:
        return f"LidarFrame({len(self)} points of {len(np.unique(self.object_id))} ids, {self.layout}, {self.path!r})"

    def select(self, rows: ArrayLike, note: str = "") -> Self:
        """Return the points picked by a mask or an index array.

        Parameters
        ----------
        rows : array_like
        note : str
            Added to ``notes``.
        """
        index = np.asarray(rows)
        picked = {
            f.name: value[index]
            for f in fields(self)
            if isinstance(value := getattr(self, f.name), np.ndarray) and f.name != "ego_velocity"
        }
        return replace(self, **picked, notes=(*self.notes, note) if note else self.notes)

    def with_normals(self, *, neighbours: int = 8, flatness: float = 0.2) -> Self:
        """Return the frame with normals estimated from neighbouring points; see :func:`estimate_normals`."""
        from .normals import estimate_normals

        normal, slope = estimate_normals(self, neighbours=neighbours, flatness=flatness)
        found = int(np.any(normal != 0, axis=1).sum())
        return replace(
            self,
            normal=normal,
            slope=slope,
            notes=(*self.notes, f"normals estimated for {found} of {len(self)} points"),
        )

    def without_normals(self) -> Self:
        """Return the frame with "none" for every normal: recorded cosines everywhere, and no mirror-like part."""
        return replace(
            self,
            normal=np.zeros_like(self.position),
            slope=np.zeros(len(self)),
            notes=(*self.notes, "no normals, as asked"),
        )

    def crop_ego(
        self, length_m: float = 5.0, width_m: float = 2.2, height_m: float = 2.0, *, center_x_m: float = 0.0
    ) -> Self:
        """Return the frame without the points inside the ego vehicle's box; see :func:`crop_ego`."""
        from .crops import crop_ego

        return self.select(*crop_ego(self, (length_m, width_m, height_m), center_x_m))

    def crop_old_pipeline(self) -> Self:
        """Return the frame with the crops the LiDAR pipeline before this one hid; see :func:`crop_old_pipeline`."""
        from .crops import crop_old_pipeline

        return self.select(*crop_old_pipeline(self))

    def hide_occluded(self, mount: Pose | None = None) -> Self:
        """Return the frame without the points that others hide from a radar; see :func:`hidden_from_radar`.

        Parameters
        ----------
        mount : Pose, optional
            Radar in the ego frame.
        """
        from .occlusion import hidden_from_radar

        hidden = hidden_from_radar(self, mount)
        return self.select(~hidden, f"hidden from the radar by nearer points: {int(hidden.sum())} points left out")

    def thin(self, voxel_m: float) -> LidarFrame:
        """Return one point a voxel, which stands for the area of all points in it; see :func:`thin`."""
        from .crops import thin

        return thin(self, voxel_m)

    def summary(self) -> dict[str, Any]:
        """Return counts for people and for ``summary.json``: tags, actors, untagged share, grid, what was clipped."""
        tags, counts = np.unique(self.tag, return_counts=True)
        ids, points = np.unique(self.object_id[self.object_id > 0], return_counts=True)
        histogram = {SemanticTag(int(t)).name: int(c) for t, c in zip(tags, counts, strict=True)}
        n = max(len(self), 1)
        return {
            "path": self.path,
            "layout": self.layout,
            "tag_table": self.tag_table,
            "points_read": self.n_read,
            "points": len(self),
            "tags": dict(sorted(histogram.items(), key=lambda item: -item[1])),
            "points_per_actor": {int(i): int(c) for i, c in zip(ids, points, strict=True)},
            "names": {int(i): self.names[int(i)] for i in ids if int(i) in self.names},
            "untagged_share": histogram.get("Unlabeled", 0) / n,
            "grid": str(self.grid),
            "reach_m": float(np.linalg.norm(self.position, axis=1).max(initial=0.0)),
            "azimuth_covered_deg": self._azimuth_covered_deg(),
            "cosines_clipped": self.n_clipped,
            "areas_limited": int(np.sum(self.cos_incidence < MIN_AREA_COS)),
            "normals": 0 if self.normal is None else int(np.any(self.normal != 0, axis=1).sum()),
            "velocity": self._velocity_source(),
            "notes": list(self.notes),
        }

    def _azimuth_covered_deg(self) -> float:
        """Return how much of the circle has points, in sectors of 5 degrees."""
        azimuth = np.degrees(np.arctan2(self.position[:, 1], self.position[:, 0]))
        return 5.0 * len(np.unique(np.floor(azimuth / 5.0).astype(np.int64) % 72))

    def _velocity_source(self) -> str:
        if self.velocity is not None:
            moving = int(np.any(self.velocity != 0, axis=1).sum())
            return f"of actors from a side file or given ({moving} points move over ground)"
        return "recorded column" if self.range_rate is not None else "none: everything stands"

    def save(self, path: str | os.PathLike[str]) -> None:
        """Save every field to an ``.npz`` file."""
        arrays: dict[str, Any] = {f.name: getattr(self, f.name) for f in fields(self)}
        g = self.grid
        arrays["grid"] = np.array([g.channels, g.upper_deg, g.lower_deg, g.azimuth_step_deg, float(g.estimated)])
        pose = self.sensor_pose
        arrays["sensor_pose"] = None if pose is None else np.array([*pose.xyz, *pose.ypr_deg])
        arrays["names"] = np.array([f"{k}={v}" for k, v in self.names.items()], dtype=str)
        arrays["notes"] = np.array(self.notes, dtype=str)
        arrays["material_names"] = np.array(self.material_names, dtype=str)
        save_npz(path, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Load what :meth:`save` wrote.

        Raises
        ------
        NotFoundError, InputError
        """
        arrays = load_npz(path, ("position", "cos_incidence", "object_id", "tag", "area", "grid"))
        known = {f.name for f in fields(cls)}
        values: dict[str, Any] = {k: v for k, v in arrays.items() if k in known}
        channels, upper, lower, step, estimated = (float(v) for v in arrays["grid"])
        values["grid"] = LidarGrid(int(channels), upper, lower, step, bool(estimated))
        if "sensor_pose" in values:
            x, y, z, yaw, pitch, roll = (float(v) for v in arrays["sensor_pose"])
            values["sensor_pose"] = Pose((x, y, z), (yaw, pitch, roll))
        pairs = (str(item).partition("=") for item in arrays.get("names", ()))
        values["names"] = {int(k): v for k, _, v in pairs}
        values["notes"] = tuple(str(v) for v in arrays.get("notes", ()))
        values["material_names"] = tuple(str(v) for v in arrays.get("material_names", ()))
        for name, kind in (("path", str), ("layout", str), ("tag_table", str), ("n_read", int), ("n_clipped", int)):
            values[name] = kind(arrays[name]) if name in arrays else kind()
        values["ego_yaw_rate"] = float(arrays.get("ego_yaw_rate", 0.0))
        return cls(**values)
