"""Scenes: static meshes, moving actors, point targets, radars, weather. The same fields in YAML and in Python."""

from __future__ import annotations

import itertools
import os
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import ConfigDict, Field, field_validator, model_validator

from ..constants import DEFAULT_MOUNT_XYZ, MOST_SCENE_BOUNCES
from ..errors import InputError, did_you_mean
from ..resources import find
from ..scatterers import Weather
from ..scene.mesh import TaggedMesh
from ..tags import SemanticTag
from ._base import ConfigModel, Placed, Vector3
from .interferer import Interferer
from .loader import apply_overrides, read_yaml, validate_model
from .profile import RadarProfile, load_profile

__all__ = [
    "Actor", "Ego", "Keyframe", "LidarMount", "MeshSource", "Moving", "PointTarget", "RadarMount", "Scene",
    "SpinningPart", "StaticPart", "load_scene",
]  # fmt: skip

ZERO = (0.0, 0.0, 0.0)
ObjectId = Annotated[int, Field(ge=0, lt=2**32)]
ActorId = Annotated[int, Field(gt=0, lt=2**32)]


def _known_tag(value: str | None) -> str | None:
    names = {t.name.lower(): t.name for t in SemanticTag}
    if value is None:
        return None
    if value.lower() not in names:
        raise ValueError(f"unknown tag {value!r}; {did_you_mean(value, [t.name for t in SemanticTag])}")
    return names[value.lower()]


class Keyframe(Placed):
    """A pose at one instant, in the frame of the ``xyz_m`` and ``ypr_deg`` of what moves: by default the world."""

    t_s: float


class Moving(Placed):
    """What moves: steadily from a pose at time 0, or along a trajectory.

    ``velocity_mps`` is in world axes and turns with the body when ``yaw_rate_deg_s`` is given. Beside a trajectory
    ``xyz_m`` and ``ypr_deg`` are the frame of its poses, and a ``velocity_mps`` other than zero is the one at its
    first keyframe.
    """

    velocity_mps: Vector3 = ZERO
    yaw_rate_deg_s: float = 0.0
    trajectory: tuple[Keyframe, ...] | None = None
    trajectory_file: str | Path | None = None
    trajectory_id: int | None = None
    trajectory_frame: Literal["ros", "carla"] | None = None
    trajectory_outside: Literal["error", "hold"] = "error"

    @model_validator(mode="after")
    def _one_motion(self) -> Self:
        if self.trajectory is not None and self.trajectory_file is not None:
            raise ValueError("give trajectory (keyframes) or trajectory_file (a recording), not both")
        if not self.has_trajectory:
            return self
        if self.yaw_rate_deg_s != 0:
            raise ValueError("yaw_rate_deg_s and a trajectory contradict each other; the keyframes' ypr_deg turn it")
        if self.trajectory_file is not None and self.trajectory_frame is None:
            raise ValueError("trajectory_file needs trajectory_frame: carla (y right) or ros (y left)")
        if self.trajectory is not None:
            times = [k.t_s for k in self.trajectory]
            if len(times) < 2:
                raise ValueError(f"trajectory: at least two keyframes are needed, got {len(times)}")
            for k, (before, after) in enumerate(itertools.pairwise(times), start=1):
                if after <= before:
                    raise ValueError(
                        f"trajectory: keyframe {k} at {after:g} s does not follow {before:g} s; sort them by time"
                    )
        return self

    @property
    def has_trajectory(self) -> bool:
        """Whether keyframes or a recording say where it is."""
        return self.trajectory is not None or self.trajectory_file is not None

    @property
    def moves(self) -> bool:
        """Whether it is ever anywhere else than at ``xyz_m`` and ``ypr_deg``."""
        return self.has_trajectory or any(self.velocity_mps) or self.yaw_rate_deg_s != 0


class MeshSource(Placed):
    """A mesh file or a ready-made shape, and what is known of its tags, its materials and its round surfaces.

    ``round_below_deg`` rounds what facets stand for where they meet at less than this; None leaves them as they are.
    """

    model_config = ConfigDict(arbitrary_types_allowed=True)

    name: str = ""
    mesh: str | Path | TaggedMesh | None = None
    shape: str | None = None
    mesh_frame: str = "ros_z_up"
    units: str | float = "m"
    carla_tags: str = "0.9.14"
    resolve: str | Path | None = None
    unlabelled: Literal["error", "warn"] = "error"
    tag: str | None = None
    material: str | None = None
    aim: Annotated[int, Field(ge=1)] | None = None
    round_below_deg: Annotated[float, Field(gt=0, le=90)] | None = None

    _tag = field_validator("tag")(_known_tag)

    @model_validator(mode="after")
    def _one_geometry(self) -> Self:
        if (self.mesh is None) == (self.shape is None):
            raise ValueError("give exactly one of mesh (a file) and shape (a ready-made shape)")
        return self


class StaticPart(MeshSource):
    """Something that does not move. ``id`` 0 is the common static object."""

    id: ObjectId = 0


class SpinningPart(ConfigModel):
    """Parts of a mesh that turn about an axis: at a rate, or as a wheel that rolls on the ground.

    ``part`` is a name of the mesh's own, ``*`` for any text; the turn is right-handed about ``axis``, and a wheel's
    axis points to the left.
    """

    part: str
    center_m: Vector3
    axis: Vector3 = (0.0, 1.0, 0.0)
    radius_m: Annotated[float, Field(gt=0)] | None = None
    rate_deg_s: float = 0.0

    @model_validator(mode="after")
    def _one_rate(self) -> Self:
        if not any(self.axis):
            raise ValueError("axis: a direction is needed, got 0 0 0")
        if (self.radius_m is None) == (self.rate_deg_s == 0):
            raise ValueError("give either radius_m (a wheel that rolls) or rate_deg_s")
        return self


class Actor(Moving, MeshSource):
    """A body that moves; the wheels and limbs of ready-made ones with it where ``articulation`` is ``auto``."""

    id: ActorId
    articulation: Literal["auto", "off"] = "off"
    spinning_parts: tuple[SpinningPart, ...] = ()


class PointTarget(ConfigModel):
    """A point with a given RCS; of an ``actor`` it is fixed to, ``xyz_m`` and ``velocity_mps`` are in its frame."""

    id: ActorId
    xyz_m: Vector3
    velocity_mps: Vector3 = ZERO
    actor: ActorId | None = None
    rcs_dbsm: float
    tag: str = "Other"
    name: str = ""

    _tag = field_validator("tag")(_known_tag)


class Ego(Moving):
    """The vehicle that carries the sensors; its frame has the origin on the ground."""


class RadarMount(Placed):
    """A radar and its pose in the ego frame.

    ``blocked_below_deg`` is the elevation in the radar's frame below which the vehicle's own body, which is not part of
    the scene, hides everything.
    """

    name: str = "radar"
    profile: str | Path | RadarProfile = "awrl1432"
    xyz_m: Vector3 = DEFAULT_MOUNT_XYZ
    blocked_below_deg: Annotated[float, Field(ge=-90, lt=90)] | None = None

    @field_validator("name")
    @classmethod
    def _name_is_a_folder_name(cls, value: str) -> str:
        if not value or not all(c.isalnum() or c in "-_." for c in value) or value.startswith("."):
            raise ValueError("a radar's name becomes a folder: letters, digits, '-', '_' and '.' only")
        return value


class LidarMount(Placed):
    """A semantic LiDAR and its pose in the ego frame, with CARLA's attributes."""

    name: str = "lidar"
    channels: Annotated[int, Field(ge=1)] = 32
    upper_deg: float = 10.0
    lower_deg: float = -30.0
    range_m: Annotated[float, Field(gt=0)] = 10.0
    points_per_second: Annotated[int, Field(ge=1)] = 56_000
    rotation_hz: Annotated[float, Field(gt=0)] = 10.0


class WeatherModel(ConfigModel):
    """Weather of the scene. A scene without it has no attenuation at all; with it, air attenuates even when dry."""

    rain_mm_h: Annotated[float, Field(ge=0, le=200)] = 0.0
    fog_visibility_m: Annotated[float, Field(gt=0)] | None = None
    temperature_c: Annotated[float, Field(ge=-60, le=60)] = 15.0

    def plain(self) -> Weather:
        """Return the numbers without the model."""
        return Weather(self.rain_mm_h, self.fog_visibility_m, self.temperature_c)


class Scene(ConfigModel):
    """A scene in its world frame (ROS axes).

    Examples
    --------
    >>> scene = Scene(point_targets=[{"id": 1, "xyz_m": (30, 0, 1), "rcs_dbsm": 10}])
    >>> scene.radars[0].profile
    'awrl1432'
    """

    version: Literal[1] = 1
    name: str = "scene"
    description: str = ""
    seed: Annotated[int, Field(ge=0)] = 0
    frame_period_s: Annotated[float, Field(gt=0)] = 0.1
    #: Surfaces along a path, for scenes whose echoes need several; ``trace`` and the command line can say otherwise.
    max_bounces: Annotated[int, Field(ge=1, le=MOST_SCENE_BOUNCES)] = 1
    materials: str | Path = "automotive"
    weather: WeatherModel | None = None
    ego: Ego = Ego()
    static: tuple[StaticPart, ...] = ()
    actors: tuple[Actor, ...] = ()
    point_targets: tuple[PointTarget, ...] = ()
    radars: tuple[RadarMount, ...] = (RadarMount(),)
    lidars: tuple[LidarMount, ...] = ()
    interferers: tuple[Interferer, ...] = ()
    #: Options of the run that wrote this file (``config.yaml`` of a run folder); the command line takes them up again.
    run: Mapping[str, Any] = Field(default_factory=dict, repr=False)
    folder: Path = Field(default_factory=Path.cwd, exclude=True, repr=False)

    @model_validator(mode="after")
    def _ids_and_names_are_unique(self) -> Self:
        moving = [item.id for group in (self.actors, self.point_targets) for item in group]
        ids = [*moving, *{s.id for s in self.static if s.id}]
        names = [r.name for r in self.radars]
        for label, values in (("id", [str(i) for i in ids]), ("radar name", names)):
            twice = sorted(v for v, count in Counter(values).items() if count > 1)
            if twice:
                raise ValueError(f"{label} {twice[0]} is given to more than one thing")
        return self

    @model_validator(mode="after")
    def _points_have_their_actors(self) -> Self:
        known = {a.id for a in self.actors}
        for point in self.point_targets:
            if point.actor is not None and point.actor not in known:
                raise ValueError(
                    f"point target {point.id}: no actor {point.actor}; the scene's actors: {sorted(known)}"
                )
        return self

    def radar(self, name: str | None = None) -> RadarMount:
        """Return the radar of that name, or the only one.

        Raises
        ------
        InputError
            No such radar, or several and no name; lists them.
        """
        names = [r.name for r in self.radars]
        if name is None and len(names) == 1:
            return self.radars[0]
        if name is None:
            raise InputError(f"the scene has {len(names)} radars, say which: radar= one of {names}")
        for radar in self.radars:
            if radar.name == name:
                return radar
        raise InputError(f"no radar {name!r} in the scene; {did_you_mean(name, names)}")

    def profile_of(self, radar: RadarMount | Interferer) -> RadarProfile:
        """Return the profile of a radar, simulated or not; a relative path is looked for beside the scene first."""
        if isinstance(radar.profile, RadarProfile):
            return radar.profile
        beside = self.folder / radar.profile
        return load_profile(beside if beside.is_file() else radar.profile)

    def object_names(self) -> dict[int, str]:
        """Return id -> name of everything with an id of its own; 0 is the common static object."""
        named: Iterator[Any] = (i for group in (self.static, self.actors, self.point_targets) for i in group)
        return {0: "static"} | {i.id: i.name or f"object {i.id}" for i in named if i.id}


def load_scene(name_or_path: str | os.PathLike[str], overrides: Mapping[str, Any] | None = None) -> Scene:
    """Load a scene.

    Parameters
    ----------
    name_or_path : str or path
        A bundled name such as ``"braking"``, or a YAML file; relative paths in it start at its folder.
    overrides : mapping, optional
        Dotted keys, for example ``{"weather.rain_mm_h": 25}``.

    Raises
    ------
    NotFoundError, ConfigError
        The latter lists every problem as ``file:line: key: what``.
    """
    file = find("scenes", name_or_path)
    data, node = read_yaml(file)
    data = {"name": file.stem, **apply_overrides(data, overrides or {}), "folder": file.parent}
    return validate_model(Scene, data, str(file), node)
