"""Rays that go on: from the first surfaces of a scene over others and back to the radar.

A tube keeps its cell of solid angle; every flat facet mirrors it, so that it seems to come from an image of the radar.
Of the ways back only those are kept whose phase is nearly stationary somewhere in the tube: on a smooth surface the
others cancel against their neighbours.

Rays know nothing of diffraction, so a current is integrated where the light is still that of a mirror larger than its
Fresnel zone, or of the corner itself. A small body seen over a road radiates itself: towards the radar, whose way is
also that of the reverse path, and towards the radar's image below the road. What rays would draw, a beam from the body
as narrow as its shadow that lights a strip of road, would be too strong by the ratio of the distances.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .._typing import BoolArray, FloatArray, IntArray
from ..paths import Paths
from ..scene.world import World
from .launch import Cells
from .world_caster import WorldCaster

__all__ = ["MIRROR_M2", "facing", "lifted", "reaches", "trace_paths"]

#: Smallest flat piece of surface that counts as a mirror: larger than its Fresnel zone wherever a radar looks [m^2].
MIRROR_M2 = 1.0
#: Height above a surface at which reflected rays start, and its growth with distance (float32 coordinates) [m].
_LIFT_M, _LIFT_PER_M = 2e-5, 1e-5
#: Phase over half a tube, beyond that of its curvature, up to which a tube is kept [rad].
_MARGIN = 4.0 * np.pi
#: Phase at the rim of a tube up to which a bent surface echoes as one mirror [rad].
_ONE_MIRROR = 0.5 * np.pi


@dataclass(frozen=True, eq=False)
class _Tubes:
    """Tubes at one order of bounce: their hits so far, and where they seem to come from."""

    direction: FloatArray
    edges: FloatArray
    image: FloatArray
    length: FloatArray
    faces: tuple[IntArray, ...]
    points: tuple[FloatArray, ...]

    def select(self, rows: IntArray | BoolArray) -> _Tubes:
        return _Tubes(
            self.direction[rows],
            self.edges[rows],
            self.image[rows],
            self.length[rows],
            tuple(f[rows] for f in self.faces),
            tuple(p[rows] for p in self.points),
        )


def trace_paths(
    world: World,
    caster: WorldCaster,
    cells: Cells,
    face: IntArray,
    cell: IntArray,
    max_bounces: int,
    wavenumber: float,
    second: Callable[[IntArray, IntArray], BoolArray] | None = None,
) -> Paths:
    """Follow the tubes of some cells over their first hits.

    Parameters
    ----------
    world : World
    caster : WorldCaster
    cells : Cells
    face : (m,) int
        Face that each of the cells hits first.
    cell : (m,) int
        Rows of ``cells``.
    max_bounces : int
        Surfaces along a path, at least 2.
    wavenumber : float
        k = 2 pi / lambda of the centre frequency [rad/m].
    second : callable, optional
        (first face (m,), second face (m,)) -> (m,) bool: which tubes to keep after their second hit.

    Returns
    -------
    Paths
    """
    direction = cells.directions_of(cell)
    length = np.abs(world.face_offset[face] / np.einsum("ij,ij->i", world.face_normal[face], direction))
    point = direction * length[:, None]
    tubes = _Tubes(direction, cells.edges_of(cell), np.zeros_like(point), length, (face,), (point,))
    found = []
    for order in range(1, max_bounces):
        tubes = _bounced(world, caster, tubes)
        if order == 1 and second is not None:
            tubes = tubes.select(second(tubes.faces[0], tubes.faces[1]))
        if not len(tubes.length):
            break
        found.append(_paths(world, caster, tubes, wavenumber))
    return Paths.join(found)


def facing(world: World, face: IntArray, direction: FloatArray) -> FloatArray:
    """Return (n, 3) normals on the side that rays come from."""
    normal = world.face_normal[face]
    along = np.einsum("ij,ij->i", normal, direction)
    return normal * np.where(along > 0, -1.0, 1.0)[:, None]


def lifted(point: FloatArray, normal: FloatArray) -> FloatArray:
    """Return points (n, 3) a little above their surface, so that rays from there do not hit it."""
    height = _LIFT_M + _LIFT_PER_M * np.linalg.norm(point, axis=1)
    return np.asarray(point + height[:, None] * normal)


def _cast(caster: WorldCaster, origin: FloatArray, direction: FloatArray) -> IntArray:
    d, o = (np.ascontiguousarray(a.T, dtype=np.float32) for a in (direction, origin))
    return caster.cast(d, o)


def _bounced(world: World, caster: WorldCaster, tubes: _Tubes) -> _Tubes:
    """Return the tubes after one more reflection, those that hit something."""
    point = tubes.points[-1]
    normal = facing(world, tubes.faces[-1], tubes.direction)
    out = tubes.direction - 2.0 * np.einsum("ij,ij->i", tubes.direction, normal)[:, None] * normal
    face = _cast(caster, lifted(point, normal), out)
    hit = np.flatnonzero(face >= 0)
    face, normal, out, tubes = face[hit], normal[hit], out[hit], tubes.select(hit)
    point = tubes.points[-1]
    turned = tubes.edges - 2.0 * np.einsum("nki,ni->nk", tubes.edges, normal)[:, :, None] * normal[:, None, :]
    plane = world.face_normal[face]
    along = np.einsum("ij,ij->i", plane, out)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = (world.face_offset[face] - np.einsum("ij,ij->i", plane, point)) / along
    image = point - tubes.length[:, None] * out
    good = np.flatnonzero(np.isfinite(reach) & (reach > 0))
    moved = replace(
        tubes,
        direction=out,
        edges=turned,
        image=image,
        length=tubes.length + reach,
        faces=(*tubes.faces, face),
        points=(*tubes.points, point + reach[:, None] * out),
    )
    return moved.select(good)


def _paths(world: World, caster: WorldCaster, tubes: _Tubes, wavenumber: float) -> Paths:
    """Return the ways back from the last hits of tubes to the radar that matter."""
    mirror = [world.face_patch[face] >= MIRROR_M2 for face in tubes.faces]
    beamless = np.flatnonzero(~mirror[-1] | mirror[-2])
    over = np.flatnonzero(mirror[0] & ~mirror[-1])
    radar = np.zeros(3)
    direct = _received(world, caster, tubes.select(beamless), np.tile(radar, (len(beamless), 1)), None, wavenumber)
    plane = tubes.faces[0][over]
    image = 2.0 * world.face_offset[plane][:, None] * world.face_normal[plane]  # of the radar, which is the origin
    reflected = _received(world, caster, tubes.select(over), image, plane, wavenumber)
    return Paths.join([direct, reflected])


def _received(
    world: World, caster: WorldCaster, tubes: _Tubes, eye: FloatArray, plane: IntArray | None, wavenumber: float
) -> Paths:
    """Return the paths from the last hits of tubes to the radar at ``eye`` (n, 3), or its images in planes."""
    kept = _nearly_stationary(world, tubes, eye, wavenumber)
    tubes, eye = tubes.select(kept), eye[kept]
    normal = facing(world, tubes.faces[-1], tubes.direction)
    if plane is None:
        free = reaches(world, caster, lifted(tubes.points[-1], normal), eye)
    else:
        plane = plane[kept]
        free, back = _reflected_back(world, caster, tubes.points[-1], normal, eye, plane)
        plane, back = plane[free], back[free]
    tubes, eye, normal = tubes.select(free), eye[free], normal[free]
    share = _share(world, tubes, normal, wavenumber)
    tubes = replace(tubes, edges=tubes.edges * share[:, None, None])
    slope, curvature, flat = _expanded(tubes, normal, eye)
    radiates = len(tubes.faces) - 1
    tubes = tubes.select(flat)
    edges = _footprint(normal[flat], tubes)
    area = np.cross(edges[:, 0], edges[:, 1])
    area *= (np.sign(np.einsum("ij,ij->i", area, normal[flat])) / share[flat])[:, None]
    if plane is not None:
        tubes = replace(tubes, faces=(*tubes.faces, plane[flat]), points=(*tubes.points, back[flat]))
    return _assembled(world, tubes, radiates, area, slope[flat], curvature[flat])


def reaches(world: World, caster: WorldCaster, start: FloatArray, end: FloatArray) -> IntArray:
    """Return the rows of pairs of points with nothing between them."""
    way = end - start
    length = np.linalg.norm(way, axis=1)
    face = _cast(caster, start, way / np.maximum(length, 1e-12)[:, None])
    plane = world.face_normal[face]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = (world.face_offset[face] - np.einsum("ij,ij->i", plane, start)) / np.einsum("ij,ij->i", plane, way)
    return np.flatnonzero((face < 0) | ~(reach < 1.0))


def _reflected_back(
    world: World, caster: WorldCaster, start: FloatArray, side: FloatArray, image: FloatArray, face: IntArray
) -> tuple[IntArray, FloatArray]:
    """Return which points, lit on one side, see the radar in the planes of some faces, and (n, 3) where on them."""
    normal = world.face_normal[face]
    way = image - start
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (world.face_offset[face] - np.einsum("ij,ij->i", normal, start)) / np.einsum("ij,ij->i", normal, way)
    where = start + np.nan_to_num(share)[:, None] * way
    seen = _cast(caster, lifted(start, side), way / np.maximum(np.linalg.norm(way, axis=1), 1e-12)[:, None])
    shown = (share > 0) & (share < 1) & (seen >= 0) & (world.face_plane[seen] == world.face_plane[face])
    rows = np.flatnonzero(shown)
    towards = facing(world, face[rows], where[rows])  # light from the radar arrives along ``where``
    origin = lifted(where[rows], towards)
    return rows[reaches(world, caster, origin, np.zeros_like(origin))], where


def _share(world: World, tubes: _Tubes, normal: FloatArray, wavenumber: float) -> FloatArray:
    """Return the share, up to 1, of the sides of a last footprint over which the surface is one mirror.

    As for first surfaces, see :mod:`shenron_rt.echo.physical`: of n facets of like tilt one is known, and n have
    sqrt(n) times its amplitude where the surface bends by more than a fraction of the wavelength.
    """
    edges = _footprint(normal, tubes)
    area = 4.0 * np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    face = tubes.faces[-1]
    sides = np.sqrt(np.minimum(world.face_patch[face] / np.maximum(area, 1e-30), 1.0))
    departure = 0.25 * wavenumber * np.sqrt(area) * world.face_bend[face] / sides
    return np.asarray(sides ** -np.expm1(-((departure / _ONE_MIRROR) ** 2)))


def _footprint(normal: FloatArray, tubes: _Tubes) -> FloatArray:
    """Return (n, 2, 3) half edges of the tubes' footprints on their last planes [m]."""
    along = np.einsum("ij,ij->i", normal, tubes.direction)
    lean = np.einsum("nki,ni->nk", tubes.edges, normal) / along[:, None]
    across = tubes.edges - lean[:, :, None] * tubes.direction[:, None, :]
    return np.asarray(tubes.length[:, None, None] * across)


def _nearly_stationary(world: World, tubes: _Tubes, eye: FloatArray, wavenumber: float) -> IntArray:
    point = tubes.points[-1] - eye
    distance = np.linalg.norm(point, axis=1)
    normal = facing(world, tubes.faces[-1], tubes.direction)
    lit = np.einsum("ij,ij->i", normal, point) < 0  # the radar is on the side that is lit
    edges = _footprint(normal, tubes)
    slope = np.abs(np.einsum("nki,ni->nk", edges, tubes.direction + point / distance[:, None]))
    bend = np.einsum("nki,nki->nk", edges, edges) * (1.0 / tubes.length + 1.0 / distance)[:, None]
    return np.flatnonzero(lit & np.all(slope <= bend + _MARGIN / wavenumber, axis=1))


def _expanded(tubes: _Tubes, normal: FloatArray, eye: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return first and second derivatives of the way to ``eye`` over tubes, from its exact value at nine points.

    Returns
    -------
    slope : (n, 2) float
    curvature : (n, 3) float
    flat : (m,) int
        Rows whose corners lie before the horizon of the last plane.
    """
    height = np.einsum("ij,ij->i", normal, tubes.points[-1] - tubes.image)
    way = np.empty((3, 3, len(height)))
    good = np.ones(len(height), dtype=bool)
    for i in range(3):
        for j in range(3):
            w = tubes.direction + (i - 1) * tubes.edges[:, 0] + (j - 1) * tubes.edges[:, 1]
            with np.errstate(divide="ignore", invalid="ignore"):
                reach = height / np.einsum("ij,ij->i", normal, w)
            good &= np.isfinite(reach) & (reach > 0)
            reach = np.where(good, reach, 1.0)
            there = tubes.image + reach[:, None] * w
            way[i, j] = reach * np.linalg.norm(w, axis=1) + np.linalg.norm(there - eye, axis=1)
    slope = np.stack([way[2, 1] - way[0, 1], way[1, 2] - way[1, 0]], axis=1) / 2.0
    curvature = np.stack(
        [
            way[2, 1] + way[0, 1] - 2.0 * way[1, 1],
            way[1, 2] + way[1, 0] - 2.0 * way[1, 1],
            (way[2, 2] - way[2, 0] - way[0, 2] + way[0, 0]) / 4.0,
        ],
        axis=1,
    )
    return slope, curvature, np.flatnonzero(good)


def _assembled(
    world: World, tubes: _Tubes, radiates: int, area: FloatArray, slope: FloatArray, curvature: FloatArray
) -> Paths:
    n = len(area)
    faces = np.stack(tubes.faces, axis=1)
    point = np.stack(tubes.points, axis=1)
    body = world.face_body[faces]
    before = np.concatenate([np.zeros((n, 1, 3)), point[:, :-1]], axis=1)
    normal = world.face_normal[faces]
    side = np.einsum("nbi,nbi->nb", normal, point - before)
    mirror = world.face_patch[faces] >= MIRROR_M2
    last = faces.shape[1] - 1
    return Paths(
        count=np.full(n, faces.shape[1], dtype=np.uint8),
        point=point,
        normal=normal * np.where(side > 0, -1.0, 1.0)[:, :, None],
        velocity=world.velocity_of(faces, point),
        material=world.face_material[faces],
        object_id=world.object_id[body],
        tag=world.face_tag[faces],
        radiates=np.full(n, radiates, dtype=np.uint8),
        two_way=(mirror[:, 0] & ~mirror[:, radiates]) if radiates == last else np.zeros(n, dtype=bool),
        area=area,
        slope=slope,
        curvature=curvature,
        rcs=np.full(n, np.nan),
    )
