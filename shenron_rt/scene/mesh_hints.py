"""Look at a tagged mesh and say what seems wrong with its axes, units or handedness.

Nothing here changes the mesh; each hint is a sentence with the evidence and what to try. The sizes are those of CARLA's
vehicles (2.2 to 6 m long, 1.3 to 2.6 m high) and ordinary street furniture, with margins.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from .._typing import BoolArray, FloatArray, IntArray
from ..frames import from_carla_points
from ..tags import SemanticTag as Tag
from .mesh import TaggedMesh
from .resolver_names import join_key

__all__ = ["mesh_hints"]

# Smallest and largest plausible longest side of the biggest object with that tag [m].
_SIZES = {
    Tag.Car: (2.0, 6.5), Tag.Truck: (3.5, 30.0), Tag.Bus: (5.0, 30.0), Tag.Motorcycle: (1.2, 3.5),
    Tag.Bicycle: (1.0, 2.5), Tag.Pedestrians: (0.8, 2.3), Tag.Buildings: (2.0, 2000.0), Tag.Vegetation: (0.2, 200.0),
    Tag.Poles: (0.5, 60.0), Tag.TrafficSigns: (0.2, 15.0), Tag.TrafficLight: (0.2, 15.0),
}  # fmt: skip
_UNITS = {"cm": 0.01, "mm": 0.001, "inch": 0.0254}
_VEHICLES = (Tag.Car, Tag.Truck, Tag.Bus)
_LEVEL = (Tag.Roads, Tag.Sidewalks, Tag.RoadLines)
_CAR_HEIGHT = (1.3, 2.6)
_MOST_BOXES = 500
_BINS = 16  # slices across a vehicle: 0.1 m, coarser than modelling noise, finer than a roof


def mesh_hints(mesh: TaggedMesh, *, environment_objects: Iterable[Mapping[str, Any]] | None = None) -> list[str]:
    """Return what looks wrong, worst first; empty where nothing does.

    Parameters
    ----------
    mesh : TaggedMesh
        With resolved tags, in ROS axes and metres as the chosen preset made it.
    environment_objects : iterable of mapping, optional
        CARLA's environment objects with ``name`` and ``location`` (x, y, z in CARLA axes, metres): the only evidence
        that tells a mirrored town from a right one beyond doubt, because a town has no handedness of its own.

    Notes
    -----
    Size cannot tell which of a car's short sides is its height (1.9 m wide, 1.5 m high), so two further facts are used:
    a road is level, and a vehicle is symmetric from side to side but not from top to bottom.
    """
    return [
        *_size_hints(mesh),
        *_level_hints(mesh),
        *_vehicle_hints(mesh),
        *_winding_hints(mesh),
        *([] if environment_objects is None else _position_hints(mesh, environment_objects)),
    ]


def _largest_object(mesh: TaggedMesh, tag: Tag) -> FloatArray | None:
    """Return (2, 3) bounds of the biggest object with a tag; parts whose boxes touch count as one object."""
    rows = [k for k, p in enumerate(mesh.parts) if p.tag is tag]
    if not rows:
        return None
    boxes = mesh.part_bounds()[rows]
    boxes = boxes[np.isfinite(boxes).all(axis=(1, 2))]
    # Every pair is compared: a town has thousands of trees, and a wrong unit shows in the biggest of them.
    boxes = boxes[np.argsort(-np.ptp(boxes, axis=1).max(axis=1), kind="stable")[:_MOST_BOXES]]
    low, high = boxes[:, 0], boxes[:, 1]
    reach = 0.02 * np.linalg.norm(high - low, axis=1)
    gap = reach[:, None] + reach[None]
    touch = np.all(
        (low[:, None] <= high[None] + gap[..., None]) & (low[None] <= high[:, None] + gap[..., None]), axis=2
    )
    group = _components(touch)
    merged = [np.stack([low[group == g].min(axis=0), high[group == g].max(axis=0)]) for g in np.unique(group)]
    return np.asarray(max(merged, key=lambda b: float(np.ptp(b, axis=0).max())))


def _components(touch: BoolArray) -> IntArray:
    """Return (n,) a component label for each node of an undirected graph."""
    label = np.arange(len(touch))
    while True:
        lowest = np.where(touch, label[None, :], len(touch)).min(axis=1)
        if np.array_equal(lowest, label):
            return label
        label = lowest


def _size_hints(mesh: TaggedMesh) -> list[str]:
    for tag, (smallest, largest) in _SIZES.items():
        box = _largest_object(mesh, tag)
        if box is None:
            continue
        size = np.ptp(box, axis=0)
        longest = float(size.max())
        if smallest <= longest <= largest:
            continue
        shown = " x ".join(f"{v:.3g}" for v in size)
        for unit, scale in _UNITS.items():
            if smallest <= longest * scale <= largest:
                return [f"looks like {unit}: a {tag.name} object is {shown} m; try units={unit!r} or a _cm mesh_frame"]
        if smallest <= longest * 100.0 <= largest:
            return [f"looks like metres read as cm: a {tag.name} object is {shown} m; leave the unit out"]
        return [f"unusual size: a {tag.name} object is {shown} m (x, y, z); check the unit"]
    return []


def _level_hints(mesh: TaggedMesh) -> list[str]:
    level = np.isin(mesh.face_tag, [int(t) for t in _LEVEL])
    if not level.any():
        return []
    area = mesh.face_area[level]
    steep = np.abs(mesh.face_normal[level])
    mean = (steep * area[:, None]).sum(axis=0) / area.sum()
    if mean[2] > 0.9 or mean[2] >= mean[:2].max():
        return []
    if mean[1] > mean[0]:
        return [
            (
                f"looks like y-up: roads and sidewalks face along y (mean |n_y| {mean[1]:.2f}, |n_z| {mean[2]:.2f}); "
                "try mesh_frame='carla_exporter', 'ue_gltf' or 'gltf_y_up'"
            )
        ]
    return [f"looks like x-up: roads and sidewalks face along x (mean |n_x| {mean[0]:.2f}); give a matrix"]


def _vehicle_hints(mesh: TaggedMesh) -> list[str]:
    """Hints for a mesh that is one vehicle and nothing else, as a moving actor's is."""
    tags = set(mesh.face_tag.tolist())
    if len(tags) != 1 or Tag(next(iter(tags))) not in _VEHICLES:
        return []
    name, size = Tag(next(iter(tags))).name, np.ptp(mesh.bounds, axis=0)
    if size.max() < 2.0:
        return []  # a wheel, a mirror: a piece of a vehicle has no such shape
    uneven = _asymmetry(mesh)
    if uneven[2] < 0.5 * uneven[1] and uneven[1] > 0.15:
        return [
            (
                f"looks like y-up: the {name} is symmetric along z ({size[2]:.3g} m) but not along y ({size[1]:.3g} m)"
                "; try mesh_frame='gltf_y_up' or 'ue_gltf'"
            )
        ]
    if size[2] > max(size[0], size[1]):
        return [f"looks as if it stands on end: the {name}'s longest side is z ({size[2]:.3g} m)"]
    if size[1] > 1.3 * size[0]:
        return [f"the {name}'s longest side is y ({size[1]:.3g} m): actors face +x; turn it with ypr_deg or a matrix"]
    if name == "Car" and 2.0 <= size[0] <= 6.5 and not _CAR_HEIGHT[0] <= size[2] <= _CAR_HEIGHT[1]:
        return [f"unusual height: the Car is {size[2]:.3g} m high, expected {_CAR_HEIGHT[0]} to {_CAR_HEIGHT[1]} m"]
    return []


def _asymmetry(mesh: TaggedMesh) -> FloatArray:
    """Return (3,) share of the surface that has no mirror image along each axis, 0 (symmetric) to 1."""
    low, high = mesh.bounds
    centre = (mesh.vertices[mesh.faces].mean(axis=1) - low) / np.maximum(high - low, 1e-9)
    bins = np.minimum((centre * _BINS).astype(np.int64), _BINS - 1)
    result = np.zeros(3)
    for axis in range(3):
        share = np.bincount(bins[:, axis], mesh.face_area, _BINS) / mesh.face_area.sum()
        result[axis] = 0.5 * np.abs(share - share[::-1]).sum()
    return result


def _winding_hints(mesh: TaggedMesh) -> list[str]:
    """Inward windings: what is left of a mirrored axis when the faces were not turned with it."""
    volume, area = _closed_volumes(mesh)
    if area.sum() > 0 and area[volume < 0].sum() > 0.5 * area.sum():
        return [
            (
                f"looks mirrored or inside out: {int((volume < 0).sum())} of {len(volume)} closed parts have inward "
                "winding. Check the handedness of mesh_frame; an inside-out export is harmless, surfaces are two-sided"
            )
        ]
    level = np.isin(mesh.face_tag, [int(t) for t in _LEVEL])
    weight = mesh.face_area[level] * mesh.face_normal[level, 2]
    if level.any() and not area.sum() > 0 and weight.sum() < -0.9 * mesh.face_area[level].sum():
        return ["looks mirrored or inside out: roads and sidewalks face down; check the handedness of mesh_frame"]
    return []


def _closed_volumes(mesh: TaggedMesh) -> tuple[FloatArray, FloatArray]:
    """Return signed volume [m^3] and area [m^2] of the parts that are closed and consistently wound."""
    # Exporters repeat a vertex for each normal or texture seam; weld to a micrometre of the mesh's own size.
    step = 1e-6 * max(float(np.ptp(mesh.bounds, axis=0).max()), 1e-9)
    _, weld = np.unique(np.round(mesh.vertices / step).astype(np.int64), axis=0, return_inverse=True)
    corner = weld.reshape(-1)[mesh.faces].astype(np.int64)
    start, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
    base = int(corner.max()) + 1
    key = (np.repeat(mesh.part.astype(np.int64), 3) * base + np.minimum(start, end)) * base + np.maximum(start, end)
    _, first, edge = np.unique(key, return_index=True, return_inverse=True)
    net = np.bincount(edge.reshape(-1), weights=np.sign(end - start).astype(np.float64))
    open_part = np.zeros(len(mesh.parts), dtype=bool)
    np.logical_or.at(open_part, np.repeat(mesh.part, 3)[first], net != 0)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] - mesh.bounds.mean(axis=0) for k in range(3))
    signed = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    volume: FloatArray = np.asarray(np.bincount(mesh.part, signed, len(mesh.parts)), dtype=np.float64)
    # a flat part closes on itself only if it is two-sided: no volume, no evidence
    solid = ~open_part & (np.abs(volume) > 1e-4 * mesh.part_area**1.5) & (mesh.part_faces > 3)
    return volume[solid], mesh.part_area[solid]


def _position_hints(mesh: TaggedMesh, entries: Iterable[Mapping[str, Any]]) -> list[str]:
    """Compare the sides on which CARLA and the mesh have the same objects."""
    centre = mesh.part_bounds().mean(axis=1)
    own: dict[str, list[int]] = {}
    for row, part in enumerate(mesh.parts):
        for name in {part.object, part.group} - {""}:
            own.setdefault(name, []).append(row)
            own.setdefault(join_key(name), []).append(row)
    pairs = []
    for entry in entries:
        name, location = str(entry.get("name", "")), _location(entry)
        rows = set(own.get(name) or own.get(join_key(name)) or ())
        if location is not None and len(rows) == 1:
            pairs.append((centre[rows.pop()], from_carla_points(location)))
    if len(pairs) < 3:
        return []
    mesh_y, carla_y = np.array([[m[1], c[1]] for m, c in pairs]).T
    right, mirrored = float(np.median(np.abs(mesh_y - carla_y))), float(np.median(np.abs(mesh_y + carla_y)))
    if mirrored < 0.2 * right:
        return [
            (
                f"mirrored: {len(pairs)} objects lie at CARLA's y instead of -y (median distance {right:.3g} m, "
                f"mirrored {mirrored:.3g} m); choose a mesh_frame that flips y once"
            )
        ]
    return []


def _location(entry: Mapping[str, Any]) -> list[float] | None:
    place = entry.get("location") or entry.get("transform", {}).get("location")
    if isinstance(place, Mapping):
        place = [place.get(axis) for axis in "xyz"]
    if place is None or len(place) != 3 or any(v is None for v in place):
        return None
    return [float(v) for v in place]
