"""Scatterers: the list where mesh scenes and semantic LiDAR meet."""

from __future__ import annotations

import os
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, Self

import numpy as np

from ._typing import ArrayLike, BoolArray, ComplexArray, FloatArray, IntArray
from .errors import InputError
from .io.npz import load_npz, save_npz
from .paths import Paths

__all__ = ["TABLE_COLUMNS", "Scatterers", "Weather"]

#: The columns of :meth:`Scatterers.table`.
TABLE_COLUMNS = ("x", "y", "z", "v", "cos_inc", "id", "tag")


@dataclass(frozen=True)
class Weather:
    """Weather along the path, as plain numbers.

    Parameters
    ----------
    rain_mm_h : float
        Rain rate [mm/h].
    fog_visibility_m : float or None
        Optical visibility in fog [m]; ``None`` is clear.
    temperature_c : float
        Air temperature [deg C].
    """

    rain_mm_h: float = 0.0
    fog_visibility_m: float | None = None
    temperature_c: float = 15.0

    def two_way_loss(self, range_m: ArrayLike, frequency_hz: float, polarization: str) -> FloatArray:
        """Return the linear factor, >= 1, by which the way out and back divides an echo's power."""
        from .physics.attenuation import two_way_loss

        return two_way_loss(
            range_m,
            frequency_hz,
            rain_mm_h=self.rain_mm_h,
            fog_visibility_m=self.fog_visibility_m,
            temperature_c=self.temperature_c,
            polarization=polarization[0],
        )

    def to_array(self) -> FloatArray:
        """Return (3,) rain, visibility (infinite when clear) and temperature, for files."""
        fog = np.inf if self.fog_visibility_m is None else self.fog_visibility_m
        return np.array([self.rain_mm_h, fog, self.temperature_c])

    @classmethod
    def from_array(cls, values: ArrayLike) -> Self:
        """Undo :meth:`to_array`."""
        rain, fog, temperature = (float(v) for v in np.asarray(values))
        return cls(rain, None if np.isinf(fog) else fog, temperature)


@dataclass(frozen=True)
class Scatterers:
    """Scatterers in the frame of one radar (x out of the antenna, y left, z up), mid-frame.

    Parameters
    ----------
    position : (n, 3) float
        Where the ray or the LiDAR point hit [m].
    range_rate : (n,) float
        Positive = receding [m/s].
    cos_incidence : (n,) float
        Cosine of the incidence angle at the surface, in [0, 1]; from the LiDAR's origin at the LiDAR door.
    object_id : (n,) uint32
        Actor or point-target id; 0 = static.
    tag : (n,) uint8
        :class:`~shenron_rt.tags.SemanticTag`.
    area : (n,) float or None
        Surface the row stands for, R^2 dOmega / cos [m^2].
    velocity : (n, 3) float or None
        Velocity relative to the radar, in its (turning) frame [m/s].
    normal : (n, 3) float or None
        Unit normal facing the radar; 0 0 0 where it is not known.
    slope : (n,) float or None
        RMS slope of the surface about ``normal`` across the row, as a tangent; for rows without footprint. Where it is
        above 0, a row without a normal has the mirror-like part that its cosine says.
    material : (n,) uint16 or None
        Index into ``material_names``.
    material_names : tuple of str
        Names in the material table.
    footprint : (n, 2, 3) float or None
        Half edges e_u, e_v of the ray's cell: its corners are the directions d +- e_u +- e_v, d = position / range.
    joined : (n, 4) bool or None
        Whether the surface goes on in the same plane across the cell's edges towards -v, +u, +v, -u.
    patch : (n,) float or None
        Area of the flat piece of surface that was hit [m^2]; below ``area`` where the mesh is finer than the rays.
    bend : (n,) float or None
        Angle between the surface's normals here and at the neighbouring rays, RMS [rad]; 0 where ``patch`` is wider
        than the ray.
    speckle : (n,) complex or None
        Unit-power circular Gaussian number of the row, drawn by the tracer from the frame's seed.
    jitter : (n, 2) float or None
        Where in its cell the incoherent echo of the row sits, uniform in [-1, 1].
    rcs : (n,) float or None
        Given RCS of a point target [m^2]; NaN for surfaces.
    bounces : (n,) uint8 or None
        Surfaces met on the way; ``None`` means 1 everywhere.
    paths : Paths or None
        Ways over several surfaces, beside the rows.
    weather : Weather or None
        Weather of the scene.
    radar : str
        Name of the radar whose frame this is.
    seed, frame : int
        What the random numbers derive from.
    backend : str
        What traced the rays; ``""`` where nothing did.
    door : str
        ``"mesh"`` or ``"lidar"``.
    origin : (3,) tuple of float or None
        Where a LiDAR saw the rows from [m]; ``None`` is the radar itself, or not known.

    Notes
    -----
    ``area``, not the number of rows, carries brightness.
    """

    position: FloatArray
    range_rate: FloatArray
    cos_incidence: FloatArray
    object_id: IntArray
    tag: IntArray
    area: FloatArray | None = None
    velocity: FloatArray | None = None
    normal: FloatArray | None = None
    slope: FloatArray | None = None
    material: IntArray | None = None
    material_names: tuple[str, ...] = ()
    footprint: FloatArray | None = None
    joined: BoolArray | None = None
    patch: FloatArray | None = None
    bend: FloatArray | None = None
    speckle: ComplexArray | None = None
    jitter: FloatArray | None = None
    rcs: FloatArray | None = None
    bounces: IntArray | None = None
    paths: Paths | None = None
    weather: Weather | None = None
    radar: str = ""
    seed: int = 0
    frame: int = 0
    backend: str = ""
    door: Literal["mesh", "lidar"] = "mesh"
    origin: tuple[float, float, float] | None = None

    def __post_init__(self) -> None:
        n = len(self.position)
        shapes: dict[str, tuple[int, ...]] = {
            "position": (n, 3), "range_rate": (n,), "cos_incidence": (n,), "object_id": (n,), "tag": (n,),
            "area": (n,), "velocity": (n, 3), "normal": (n, 3), "slope": (n,), "material": (n,), "footprint": (n, 2, 3),
            "joined": (n, 4), "patch": (n,), "bend": (n,), "speckle": (n,), "jitter": (n, 2), "rcs": (n,),
            "bounces": (n,),
        }  # fmt: skip
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value is not None and np.shape(value) != shape:
                raise InputError(f"Scatterers.{name}: shape {shape} is needed, got {np.shape(value)}")

    def __len__(self) -> int:
        return len(self.position)

    def __repr__(self) -> str:
        objects = len(np.unique(self.object_id))
        return f"Scatterers({len(self)} rows of {objects} objects, {self.door} door, radar {self.radar!r})"

    @property
    def range(self) -> FloatArray:
        """(n,) distance from the radar [m]."""
        distance: FloatArray = np.linalg.norm(self.position, axis=1)
        return distance

    def select(self, rows: ArrayLike | slice) -> Self:
        """Return the rows picked by a mask, an index array or a slice."""
        index = rows if isinstance(rows, slice) else np.asarray(rows)
        picked = {
            f.name: getattr(self, f.name)[index] for f in fields(self) if isinstance(getattr(self, f.name), np.ndarray)
        }
        return replace(self, **picked)

    def table(self) -> FloatArray:
        """Return the (n, 7) float64 list ``[x, y, z, v, cos_inc, id, tag]`` that both doors produce."""
        columns = (self.position, self.range_rate, self.cos_incidence, self.object_id, self.tag)
        return np.column_stack(columns).astype(np.float64)

    @classmethod
    def from_table(
        cls, table: ArrayLike, *, area: ArrayLike | None = None, door: Literal["mesh", "lidar"] = "lidar"
    ) -> Self:
        """Build scatterers from the (n, 7) list, in the radar frame.

        Parameters
        ----------
        table : (n, 7) array_like
            ``[x, y, z, v, cos_inc, id, tag]``; tags in the canonical numbering.
        area : (n,) array_like, optional
            Surface of each row [m^2]; the ``physical`` echo model needs it.
        door : str
            Where the list came from.

        Raises
        ------
        InputError
            Wrong shape, values that are not finite, a cosine outside [0, 1], an id or tag that is no whole number.
        """
        rows = np.asarray(table, dtype=np.float64)
        if rows.ndim != 2 or rows.shape[1] != len(TABLE_COLUMNS):
            raise InputError(f"a scatterer table has columns {TABLE_COLUMNS}; got an array of shape {rows.shape}")
        if not np.all(np.isfinite(rows)):
            raise InputError(f"a scatterer table needs finite numbers; {np.sum(~np.isfinite(rows))} are not")
        cos = rows[:, 4]
        if np.any((cos < 0) | (cos > 1)):
            raise InputError(f"column cos_inc is a cosine in [0, 1]; got {cos.min():g} to {cos.max():g}")
        for column, name, top in ((5, "id", 2**32 - 1), (6, "tag", 255)):
            value = rows[:, column]
            if np.any((value != np.round(value)) | (value < 0) | (value > top)):
                raise InputError(f"column {name} holds whole numbers from 0 to {top}; were its bits cast to float?")
        return cls(
            position=rows[:, :3].copy(),
            range_rate=rows[:, 3].copy(),
            cos_incidence=cos.copy(),
            object_id=rows[:, 5].astype(np.uint32),
            tag=rows[:, 6].astype(np.uint8),
            area=None if area is None else np.asarray(area, dtype=np.float64),
            door=door,
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Save every field to an ``.npz`` file."""
        plain = [f.name for f in fields(self) if f.name not in ("weather", "paths")]
        arrays: dict[str, Any] = {name: getattr(self, name) for name in plain}
        if self.paths is not None:
            arrays |= {f"path_{f.name}": getattr(self.paths, f.name) for f in fields(self.paths)}
        arrays["material_names"] = np.asarray(self.material_names, dtype=str)
        if self.weather is not None:
            arrays["weather"] = self.weather.to_array()
        save_npz(path, arrays)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Load what :meth:`save` wrote.

        Raises
        ------
        NotFoundError, InputError
        """
        arrays = load_npz(path, ("position", "range_rate", "cos_incidence", "object_id", "tag"))
        known = {f.name for f in fields(cls)}
        values: dict[str, Any] = {k: v[()] if v.ndim == 0 else v for k, v in arrays.items() if k in known}
        values["material_names"] = tuple(str(v) for v in arrays.get("material_names", ()))
        if "weather" in values:
            values["weather"] = Weather.from_array(values["weather"])
        if "path_count" in arrays:
            values["paths"] = Paths(**{f.name: arrays[f"path_{f.name}"] for f in fields(Paths)})
        if "origin" in values:
            values["origin"] = tuple(float(v) for v in values["origin"])
        for name, kind in (("radar", str), ("backend", str), ("door", str), ("seed", int), ("frame", int)):
            if name in values:
                values[name] = kind(values[name])
        return cls(**values)
