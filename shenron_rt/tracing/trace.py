"""Trace a scene from one radar: rays to scatterers."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from .._parallel import map_blocks, pool
from .._typing import BoolArray, ComplexArray, FloatArray, IntArray, NDArray
from ..config._base import Placed
from ..config.materials import MaterialTable
from ..config.profile import RadarProfile
from ..config.scene import Scene
from ..constants import MOST_SCENE_BOUNCES
from ..errors import InputError
from ..paths import Paths
from ..randomness import frame_generator
from ..scatterers import Scatterers
from ..scene.motion_of import point_state
from ..scene.world import Body, World, build_world, load_bodies, relative_motion
from ..tags import SemanticTag
from .advice import advise_thin
from .assembly import assembled
from .backend import Backend, choose_backend
from .launch import Cells, aimed_cells, pattern_cells, turned
from .launches import Launch, launch_directions
from .mirrors import bounced_paths, image_launches
from .points import point_paths
from .world_caster import WorldCaster, anchor

__all__ = ["trace"]

#: Cosines below this are treated as this: a surface seen edge-on has no usable footprint.
_MIN_COS = 1e-4
#: One array a column of the scatterers; each has a dtype of its own.
Columns: TypeAlias = dict[str, NDArray[Any]]
#: Slack of the visibility test of a point target [m].
_POINT_SLACK_M = 1e-3


def trace(
    scene: Scene,
    profile: RadarProfile | None = None,
    *,
    radar: str | None = None,
    time: float = 0.0,
    seed: int | None = None,
    frame: int = 0,
    rays: int = 300_000,
    max_bounces: int | None = None,
    backend: str = "auto",
) -> Scatterers:
    """Cast rays from a radar over a scene.

    Parameters
    ----------
    scene : Scene
    profile : RadarProfile, optional
        Replaces the radar's own; its pattern decides where rays go, its timing where mid-frame is.
    radar : str, optional
        Name of the radar; needed where the scene has several.
    time : float
        Scene seconds at the first chirp's start [s].
    seed : int, optional
        Default: the scene's.
    frame : int
        Frame index, for the random numbers.
    rays : int
        About how many cells cover the antenna pattern down to -40 dB two-way. Objects with ``aim`` get theirs on top.
    max_bounces : int, optional
        Surfaces along a path, 1 to 5; default: the scene's, which is 1 unless it says otherwise. With more than 1,
        ``paths`` of the result holds the ways over several.
    backend : str
        ``"auto"``, ``"cuda"``, ``"llvm"`` or ``"scalar"``.

    Returns
    -------
    Scatterers
        In the radar's frame at mid-frame, one row a cell that hits something and one a visible point target.

    Raises
    ------
    InputError
        Unknown radar, fewer than 100 rays, ``max_bounces`` out of bounds, and what meshes and materials raise.
    BackendError
        The backend asked for is not usable here.
    """
    if rays < 100:
        raise InputError(f"rays: at least 100 are needed to cover an antenna pattern, got {rays}")
    max_bounces = scene.max_bounces if max_bounces is None else max_bounces
    if not 1 <= max_bounces <= MOST_SCENE_BOUNCES:
        raise InputError(f"max_bounces: {max_bounces}; allowed: 1 (first surfaces) to {MOST_SCENE_BOUNCES}")
    mount = scene.radar(radar)
    profile = profile or scene.profile_of(mount)
    run_seed = scene.seed if seed is None else seed
    world, caster = _prepared(scene, mount, time + profile.frame_mid_s, choose_backend(backend))

    aimed = _aims(world, run_seed, frame, mount.name)
    advise_thin(world, profile.pattern, pattern_cells(profile.pattern, rays).spacing, aimed)
    launches = [_launch_pattern(profile, rays, run_seed, frame, mount.name), *aimed.values()]
    drawn = [pool().submit(launch.draw) for launch in launches]  # while the rays are under way
    parts, hits = _cast(world, caster, launches, list(aimed))
    if mount.blocked_below_deg is not None:
        hits = [_clear(launch.cells, h, mount.blocked_below_deg) for launch, h in zip(launches, hits, strict=True)]
    numbers = [d.result() for d in drawn]
    points = _point_rows(scene, world, caster, time + profile.frame_mid_s)
    columns = _gathered(world, launches, parts, hits, numbers, points)
    bounced = None
    if max_bounces > 1:
        wavenumber = 2.0 * np.pi / profile.wavelength_m
        image = image_launches(world, caster, aimed, run_seed, frame, mount.name)
        bounced = bounced_paths(world, caster, launches, parts, hits, image, max_bounces, wavenumber)
        bounced = Paths.join([bounced, point_paths(world, caster, points, max_bounces)])
    return assembled(columns, bounced, scene, world, caster, mount.name, run_seed, frame)


def _gathered(
    world: World,
    launches: Sequence[Launch],
    parts: Sequence[IntArray],
    hits: Sequence[IntArray],
    numbers: Sequence[tuple[ComplexArray, FloatArray]],
    points: Columns,
) -> dict[str, Any]:
    """Return the columns of all scatterers by name: of each launch's hits that count, then of the point targets.

    ``parts`` has the face that each cell of a launch hits, ``numbers`` the random numbers of each cell.
    """
    rows = [
        block
        for launch, p, h, d in zip(launches, parts, hits, numbers, strict=True)
        for block in _all_rows(world, launch.cells, p, h, d)
    ]
    rows.append(points)
    return {name: np.concatenate([r[name] for r in rows]) for name in rows[0]}


def _aims(world: World, seed: int, frame: int, radar: str) -> dict[int, Launch]:
    """Return the launches of the bodies that have rays of their own, by body."""
    return {b: launch for b in range(len(world.bodies)) if (launch := _aim(world, b, seed, frame, radar))}


def _cast(
    world: World, caster: WorldCaster, launches: list[Launch], aimed: list[int]
) -> tuple[list[IntArray], list[IntArray]]:
    """Return the face that each cell of each launch hits, and the cells that count; the first launch is the grid."""
    face = caster.cast(launch_directions(launches), coherent=True)
    parts = np.split(face, np.cumsum([len(launch.cells) for launch in launches])[:-1])
    # An aimed object is seen by its own rays alone, everything else by the common grid alone: neither depends on
    # what else there is, and no solid angle of an object counts twice.
    own = np.append(np.isin(world.face_body, aimed), False)  # a miss, -1, reads the last: scenes may be empty
    hits = [np.flatnonzero((parts[0] >= 0) & ~own[parts[0]])]
    hits += [np.flatnonzero((p >= 0) & (world.face_body[p] == b)) for b, p in zip(aimed, parts[1:], strict=True)]
    return parts, hits


def bodies_of(scene: Scene) -> tuple[tuple[Body, ...], MaterialTable]:
    """Return the bodies of a scene, kept from the last frames."""
    return _bodies_of(_SceneKey(scene))


@functools.lru_cache(maxsize=4)
def _bodies_of(scene_key: _SceneKey) -> tuple[tuple[Body, ...], MaterialTable]:
    return load_bodies(scene_key.scene)


def _clear(cells: Cells, hit: IntArray, below_deg: float) -> IntArray:
    """Return the cells that do not look at the vehicle's own body."""
    keep = cells.directions_of(hit)[:, 2] >= np.sin(np.radians(below_deg))
    return np.asarray(hit[keep])


class _SceneKey:
    """Identity of a scene object: scenes are frozen, but hold meshes that cannot be hashed."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene

    def __hash__(self) -> int:
        return id(self.scene)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _SceneKey) and other.scene is self.scene


_last: dict[str, tuple[object, World, WorldCaster]] = {}


def _prepared(scene: Scene, mount: Placed, time: float, backend: Backend) -> tuple[World, WorldCaster]:
    """Return world and caster: those of the last call at the same instant, else with what moves where it is now."""
    scene_key, key = (_SceneKey(scene), backend), (_SceneKey(scene), mount, time, backend)
    before = _last.get("world")
    if before is not None and before[0] == key:
        return before[1:]
    bodies, materials = bodies_of(scene)
    world = build_world(scene, mount, time, bodies, materials)
    caster = _casters.get(scene_key)
    if caster is None:
        _casters.clear()  # of one scene at a time: a town's search tree takes hundreds of megabytes
        caster = _casters[scene_key] = WorldCaster(world, anchor(scene), backend)
    else:
        caster.place(world)
    _last["world"] = (key, world, caster)
    return world, caster


_casters: dict[tuple[_SceneKey, Backend], WorldCaster] = {}


def _launch_pattern(profile: RadarProfile, rays: int, seed: int, frame: int, radar: str) -> Launch:
    shift = frame_generator(seed, frame, radar, "rays").uniform(-0.5, 0.5, 2)
    cells = turned(pattern_cells(profile.pattern, rays), shift)  # patterns are frozen, so they hash
    return Launch(cells, frame_generator(seed, frame, radar, "speckle"))


def _aim(world: World, body: int, seed: int, frame: int, radar: str) -> Launch | None:
    item = world.bodies[body]
    if item.source.aim is None:
        return None
    generator = _aim_generator(item, seed, frame, radar)
    points = world.vertices[world.vertex_start[body] : world.vertex_start[body + 1]]
    cells = aimed_cells(points, item.source.aim, generator.uniform(-0.5, 0.5, 2))
    return None if cells is None else Launch(cells, generator)


def _aim_generator(item: Body, seed: int, frame: int, radar: str) -> np.random.Generator:
    """Return the generator of a body's own rays: two numbers place their grid, then each gets its own."""
    return frame_generator(seed, frame, radar, f"aim {item.object_id} {item.source.name}")


def _all_rows(
    world: World, cells: Cells, hit: IntArray, cell: IntArray, drawn: tuple[ComplexArray, FloatArray]
) -> list[Columns]:
    """Return the columns of a row for each of the cells ``cell``; ``hit`` is the face each cell of the launch hits."""
    plane = np.append(world.face_plane, np.int32(-1))[hit]  # a miss, -1, picks the last

    def block(rows: slice) -> Columns:
        index = cell[rows]
        columns = _rows(world, cells, hit[index], index)
        # across each edge: the plane of the neighbouring cell; none, -1, picks the last
        beyond = np.where(cells.neighbour[index] < 0, np.int32(-2), plane[cells.neighbour[index]])
        columns["joined"] = beyond == plane[index][:, None]
        columns["bend"] = _bend(world, cells, hit, index, columns["patch"] < columns["area"])
        columns["speckle"], columns["jitter"] = drawn[0][index], drawn[1][index]
        return columns

    return map_blocks(block, len(cell)) or [block(slice(0, 0))]


def _bend(world: World, cells: Cells, hit: IntArray, cell: IntArray, wanted: BoolArray) -> FloatArray:
    """Return (m,) RMS angle between the normals of cells and of their neighbours on the same body, where wanted [rad].

    A right angle where no neighbour hits the body: it is smaller than a cell.
    """
    bend = np.zeros(len(cell))
    rows = np.flatnonzero(wanted)
    face = hit[cell[rows]]
    neighbour = cells.neighbour[cell[rows]]
    other = np.where(neighbour < 0, np.int32(-1), hit[neighbour])
    same = (other >= 0) & (world.face_body[other] == world.face_body[face][:, None])
    cos = np.abs(np.einsum("nj,nkj->nk", world.face_normal[face], world.face_normal[other]))
    square = np.where(same, 2.0 * np.maximum(1.0 - cos, 0.0), 0.0)
    count = same.sum(axis=1)
    bend[rows] = np.where(count > 0, np.sqrt(square.sum(axis=1) / np.maximum(count, 1)), 0.5 * np.pi)
    return bend


def _rows(world: World, cells: Cells, face: IntArray, cell: IntArray) -> Columns:
    """Return the columns that follow from the face each cell hits."""
    d = cells.directions_of(cell)
    normal = world.face_normal[face]
    along = np.einsum("ij,ij->i", normal, d)
    facing = np.where(along > 0, -1.0, 1.0)
    cos = np.maximum(np.abs(along), _MIN_COS)
    # float64 on the triangle's plane: a float32 hit distance errs by 3 degrees of 77 GHz phase at 100 m
    distance = np.abs(world.face_offset[face]) / cos
    position = d * distance[:, None]
    body = world.face_body[face]
    velocity = world.velocity_of(face, position)
    return {
        "position": position,
        "range_rate": np.einsum("ij,ij->i", velocity, d),
        "cos_incidence": np.minimum(cos, 1.0),
        "object_id": world.object_id[body],
        "tag": world.face_tag[face],
        "area": distance**2 * cells.solid_angle[cell] / cos,
        "velocity": velocity,
        "normal": normal * facing[:, None],
        "material": world.face_material[face],
        "footprint": cells.edges_of(cell),
        "patch": world.face_patch[face],
        "rcs": np.full(len(cell), np.nan),
        "bounces": np.ones(len(cell), dtype=np.uint8),
    }


def _point_rows(scene: Scene, world: World, caster: WorldCaster, time: float) -> Columns:
    """Return the columns of the point targets nothing stands before."""
    targets, eye = scene.point_targets, world.radar_state
    states = [point_state(scene, target, time) for target in targets]
    where = np.array([state.origin for state in states]).reshape(-1, 3)
    position = (where - eye.origin) @ eye.rotation
    distance = np.linalg.norm(position, axis=1)
    d = position / np.maximum(distance, 1e-12)[:, None]
    face = caster.cast(np.ascontiguousarray(d.T, dtype=np.float32))
    along = np.abs(np.einsum("ij,ij->i", world.face_normal[face], d)) if world.face_normal.size else np.ones(len(d))
    ahead = np.abs(world.face_offset[face]) if world.face_normal.size else np.full(len(d), np.inf)
    hidden = (face >= 0) & (ahead < (distance - _POINT_SLACK_M) * along)
    seen = np.flatnonzero(~hidden & (distance > 0))
    motion = [relative_motion(replace(state, spin=np.zeros(3)), eye) for state in states]
    velocity = np.array([drift + np.cross(turn, p) for (drift, turn), p in zip(motion, position, strict=True)])
    velocity = velocity.reshape(-1, 3)[seen]
    n = len(seen)
    return {
        "position": position[seen],
        "range_rate": np.einsum("ij,ij->i", velocity, d[seen]),
        "cos_incidence": np.ones(n),
        "object_id": np.array([t.id for t in targets], dtype=np.uint32)[seen],
        "tag": np.array([int(SemanticTag[t.tag]) for t in targets], dtype=np.uint8)[seen],
        "area": np.zeros(n),
        "velocity": velocity,
        "normal": -d[seen],
        "material": np.zeros(n, dtype=np.uint16),
        "footprint": np.zeros((n, 2, 3)),
        "patch": np.zeros(n),
        "bend": np.zeros(n),
        "joined": np.zeros((n, 4), dtype=np.bool_),
        "speckle": np.zeros(n, dtype=np.complex128),
        "jitter": np.zeros((n, 2)),
        "rcs": np.array([10 ** (t.rcs_dbsm / 10) for t in targets], dtype=np.float64)[seen],
        "bounces": np.ones(n, dtype=np.uint8),
    }
