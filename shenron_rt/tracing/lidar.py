"""A semantic LiDAR over any mesh scene: CARLA's scan pattern, cast by the tracer of the radar."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .._typing import FloatArray, IntArray
from ..config.profile import RadarProfile
from ..config.scene import LidarMount, Scene
from ..errors import InputError, did_you_mean
from ..frames import Pose, direction
from ..lidar.frame import LidarFrame
from ..lidar.grid import LidarGrid, surface_area
from ..randomness import frame_generator
from ..scene.motion import BodyState
from ..scene.motion_of import ego_state
from ..scene.world import World
from .backend import choose_backend
from .launch import Cells
from .trace import Columns, _aims, _cast, _launch_pattern, _prepared, _rows

__all__ = ["ScanPattern", "cast_at_radar", "cast_lidar", "lidar_of", "scan_pattern"]


@dataclass(frozen=True)
class ScanPattern:
    """Directions of one tick of a rotating LiDAR, channel after channel.

    Parameters
    ----------
    direction : (n, 3) float
        Unit vectors, sensor frame, ROS axes.
    grid : LidarGrid
    points_per_channel : int
    """

    direction: FloatArray
    grid: LidarGrid
    points_per_channel: int


def scan_pattern(lidar: LidarMount, *, tick_s: float | None = None, tick: int = 0) -> ScanPattern:
    """Return where a LiDAR looks in one tick, in CARLA's order.

    Parameters
    ----------
    lidar : LidarMount
    tick_s : float, optional
        Length of a simulation step [s]: one tick covers ``rotation_hz * tick_s`` of the circle. Default: one whole
        revolution.
    tick : int
        How many ticks went before: the head goes on where they left it.

    Raises
    ------
    InputError
        A tick that is no positive time, or too short for one point a channel.

    Notes
    -----
    Channel 0 looks at the upper edge, channel k at upper - k (upper - lower) / (channels - 1). Each channel gets
    n = round(points_per_second tick_s / channels) points, whose yaws in CARLA's sense (clockwise from above) run up
    from -180 deg + the angle turned so far, in steps of 360 deg rotation_hz tick_s / n.
    """
    step_s = 1.0 / lidar.rotation_hz if tick_s is None else tick_s
    if not (math.isfinite(step_s) and step_s > 0):
        raise InputError(f"tick_s: a positive time in seconds is needed, got {tick_s}")
    per_channel = math.floor(lidar.points_per_second * step_s / lidar.channels + 0.5)
    if per_channel < 1:
        raise InputError(
            f"lidar {lidar.name!r}: {lidar.points_per_second} points a second over {lidar.channels} channels and "
            f"{step_s:g} s are less than one point a channel; raise points_per_second or tick_s"
        )
    turn_deg = 360.0 * lidar.rotation_hz * step_s
    grid = LidarGrid(lidar.channels, lidar.upper_deg, lidar.lower_deg, turn_deg / per_channel)
    yaw_deg = (tick * turn_deg + turn_deg / per_channel * np.arange(per_channel)) % 360.0 - 180.0
    elevation_deg = np.linspace(lidar.upper_deg, lidar.lower_deg, lidar.channels)
    # CARLA's yaw grows to the right, azimuth to the left
    rays = direction(-np.radians(yaw_deg)[None, :], np.radians(elevation_deg)[:, None])
    return ScanPattern(rays.reshape(-1, 3), grid, per_channel)


def cast_lidar(
    scene: Scene,
    lidar: str | LidarMount | None = None,
    *,
    time: float = 0.0,
    tick_s: float | None = None,
    seed: int | None = None,
    frame: int = 0,
    dropoff: float = 0.0,
    noise_stddev_m: float = 0.0,
    normals: bool = False,
    materials: bool = False,
    backend: str = "auto",
) -> LidarFrame:
    """Cast a semantic LiDAR over a scene, as CARLA's ``sensor.lidar.ray_cast_semantic`` would.

    Parameters
    ----------
    scene : Scene
    lidar : str or LidarMount, optional
        Name of one of the scene's, or one of your own; may be left out where the scene has exactly one.
    time : float
        Scene seconds; the sensor, the ego vehicle and all actors stand where they are then [s].
    tick_s : float, optional
        Simulation step [s]; a step shorter than a revolution gives a part of the sweep, which begins where the ticks
        before number ``frame`` ended. Default: one whole revolution.
    seed : int, optional
        Of ``dropoff`` and ``noise_stddev_m``. Default: the scene's.
    frame : int
        Index of the tick.
    dropoff : float
        Share of points that are lost at random, 0 to 1. CARLA's semantic LiDAR loses none.
    noise_stddev_m : float
        Standard deviation of the range [m]. CARLA's semantic LiDAR has none.
    normals : bool
        Carry along the true normal of each point, which no LiDAR knows.
    materials : bool
        Carry along the material of each point: the mesh door knows one for every part, a LiDAR nothing but its tag.
    backend : str
        ``"auto"``, ``"cuda"``, ``"llvm"`` or ``"scalar"``.

    Returns
    -------
    LidarFrame
        One row a hit within ``range_m``, in CARLA's order; velocities over ground are those of the scene.

    Raises
    ------
    InputError
        No such LiDAR, a bad option, and what meshes and materials raise.
    BackendError
        The backend asked for is not usable here.

    Notes
    -----
    First hit, both sides of every triangle, glass included. Object ids are the scene's, so that a wall with an ``id``
    has it, where CARLA gives 0 to whatever is no actor. Point targets have no surface and are not seen.

    Examples
    --------
    >>> import shenron_rt as srt
    >>> roof = {"xyz_m": (0, 0, 2.5), "range_m": 80, "points_per_second": 120_000}
    >>> scene = srt.load_scene("braking", overrides={"lidars": [roof]})
    >>> points = srt.cast_lidar(scene)  # doctest: +SKIP
    """
    mount = lidar_of(scene, lidar)
    if not 0 <= dropoff <= 1:
        raise InputError(f"dropoff: a share from 0 to 1 is needed, got {dropoff}")
    if not (math.isfinite(noise_stddev_m) and noise_stddev_m >= 0):
        raise InputError(f"noise_stddev_m: a standard deviation >= 0 is needed, got {noise_stddev_m}")
    pattern = scan_pattern(mount, tick_s=tick_s, tick=frame)
    world, caster = _prepared(scene, mount, time, choose_backend(backend))
    cells = _bare_cells(pattern.direction, math.radians(pattern.grid.azimuth_step_deg))
    face = caster.cast(np.ascontiguousarray(pattern.direction.T, dtype=np.float32))
    columns = _rows(world, cells, *_hits(face, np.flatnonzero(face >= 0)))
    distance = np.linalg.norm(columns["position"], axis=1)
    kept = distance <= mount.range_m
    generator = frame_generator(scene.seed if seed is None else seed, frame, mount.name, "lidar")
    if dropoff:
        kept &= generator.random(len(kept)) >= dropoff
    columns = {name: values[kept] for name, values in columns.items()}
    columns["area"] = surface_area(pattern.grid, columns["position"], columns["cos_incidence"])
    if noise_stddev_m:
        far = distance[kept]
        moved = np.maximum(far + generator.normal(0.0, noise_stddev_m, len(far)), 0.0)
        columns["position"] = columns["position"] * (moved / far)[:, None]
    return _frame(scene, world, columns, pattern.grid, mount.pose, time, normals=normals, materials=materials)


def cast_at_radar(
    scene: Scene,
    profile: RadarProfile | None = None,
    *,
    radar: str | None = None,
    time: float = 0.0,
    seed: int | None = None,
    frame: int = 0,
    rays: int = 300_000,
    normals: bool = False,
    materials: bool = False,
    backend: str = "auto",
) -> LidarFrame:
    """Cast the rays of :func:`shenron_rt.trace`, from the radar, as a LiDAR: a check of the doors against each other.

    Parameters
    ----------
    scene, profile, radar, time, seed, frame, rays, backend
        As for :func:`shenron_rt.trace`; the poses are those of the radar's mid-frame.
    normals, materials : bool
        As for :func:`cast_lidar`.

    Returns
    -------
    LidarFrame
        At the radar; the areas are those of the radar's own cells.
    """
    mount = scene.radar(radar)
    profile = profile or scene.profile_of(mount)
    run_seed = scene.seed if seed is None else seed
    instant = time + profile.frame_mid_s
    world, caster = _prepared(scene, mount, instant, choose_backend(backend))
    aimed = _aims(world, run_seed, frame, mount.name)
    launches = [_launch_pattern(profile, rays, run_seed, frame, mount.name), *aimed.values()]
    faces, hits = _cast(world, caster, launches, list(aimed))
    parts = [_rows(world, la.cells, *_hits(f, h)) for la, f, h in zip(launches, faces, hits, strict=True)]
    columns = {name: np.concatenate([p[name] for p in parts]) for name in parts[0]}
    # a cube map has no azimuth step; its spacing stands for both
    step = float(np.degrees(launches[0].cells.spacing))
    grid = LidarGrid(max(2, round(180 / step)), 90.0, -90.0, step)
    return _frame(scene, world, columns, grid, mount.pose, instant, normals=normals, materials=materials)


def lidar_of(scene: Scene, lidar: str | LidarMount | None = None) -> LidarMount:
    """Return the scene's LiDAR of that name, or its only one; one of your own is passed on.

    Raises
    ------
    InputError
        No such LiDAR, none at all, or several and no name.
    """
    if isinstance(lidar, LidarMount):
        return lidar
    names = [m.name for m in scene.lidars]
    if lidar is None and len(names) == 1:
        return scene.lidars[0]
    if not names:
        raise InputError(f"scene {scene.name!r} has no lidars; add one under lidars:, or pass a LidarMount")
    if lidar is None:
        raise InputError(f"the scene has {len(names)} lidars, say which: lidar= one of {names}")
    for mount in scene.lidars:
        if mount.name == lidar:
            return mount
    raise InputError(f"no lidar {lidar!r} in the scene; {did_you_mean(lidar, names)}")


def _bare_cells(rays: FloatArray, spacing: float) -> Cells:
    """Return cells that have directions and nothing else: the area of a LiDAR's point comes from its grid."""
    n = len(rays)
    return Cells(
        direction=rays,
        edges=np.broadcast_to(np.zeros((1, 2, 3)), (n, 2, 3)),
        solid_angle=np.broadcast_to(np.zeros(1), (n,)),
        spacing=spacing,
        neighbour=np.broadcast_to(np.full((1, 4), -1, dtype=np.int32), (n, 4)),
    )


def _hits(face: IntArray, cell: IntArray) -> tuple[IntArray, IntArray]:
    """Return face and cell of the cells that count."""
    return face[cell], cell


def _over_ground(columns: Columns, eye: BodyState) -> FloatArray:
    """Return velocities over ground in the sensor's axes; the tracer's are relative, in the frame that turns."""
    spin = eye.rotation.T @ eye.spin
    carried: FloatArray = eye.rotation.T @ eye.velocity + np.cross(spin, columns["position"])
    return np.asarray(columns["velocity"] + carried)


def _frame(
    scene: Scene,
    world: World,
    columns: Columns,
    grid: LidarGrid,
    pose: Pose,
    time: float,
    *,
    normals: bool,
    materials: bool,
) -> LidarFrame:
    ego = ego_state(scene, time)
    return LidarFrame(
        position=columns["position"],
        cos_incidence=columns["cos_incidence"],
        object_id=columns["object_id"],
        tag=columns["tag"],
        area=columns["area"],
        grid=grid,
        sensor_pose=pose,
        velocity=_over_ground(columns, world.radar_state),
        ego_velocity=ego.rotation.T @ ego.velocity,
        ego_yaw_rate=ego.yaw_rate,
        normal=columns["normal"] if normals else None,
        material=columns["material"] if materials else None,
        material_names=tuple(world.materials.materials) if materials else (),
        path=scene.name,
        layout="cast over a mesh scene",
        tag_table="0.9.14",
        names={i: name for i, name in scene.object_names().items() if i},
        n_read=len(columns["position"]),
    )
