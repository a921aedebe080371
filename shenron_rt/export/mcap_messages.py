"""Foxglove's messages, made of ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .._typing import FloatArray, IntArray
from ..tags import SemanticTag
from .points import Points
from .poses import PlacedBody, Transform

__all__ = ["cloud", "image", "log_text", "scene_update", "timestamp", "transforms"]

#: Colours of bodies by tag (red, green, blue); everything else is grey.
_COLOURS: dict[SemanticTag, tuple[float, float, float]] = {
    SemanticTag.Roads: (0.25, 0.26, 0.29), SemanticTag.Sidewalks: (0.48, 0.46, 0.50),
    SemanticTag.Buildings: (0.55, 0.55, 0.58), SemanticTag.Walls: (0.52, 0.54, 0.62),
    SemanticTag.Fences: (0.66, 0.58, 0.52), SemanticTag.Poles: (0.62, 0.62, 0.60),
    SemanticTag.Vegetation: (0.32, 0.52, 0.24), SemanticTag.Terrain: (0.45, 0.55, 0.38),
    SemanticTag.Pedestrians: (0.86, 0.24, 0.30), SemanticTag.Rider: (0.90, 0.30, 0.20),
    SemanticTag.Car: (0.20, 0.36, 0.68), SemanticTag.Truck: (0.22, 0.30, 0.52), SemanticTag.Bus: (0.20, 0.48, 0.55),
    SemanticTag.Motorcycle: (0.42, 0.28, 0.60), SemanticTag.Bicycle: (0.52, 0.24, 0.40),
}  # fmt: skip
_GREY = (0.60, 0.60, 0.60)


def timestamp(stamp: int) -> Any:
    """Return nanoseconds since 1970 as a Foxglove time stamp."""
    from foxglove.messages import Timestamp

    return Timestamp(sec=stamp // 1_000_000_000, nsec=stamp % 1_000_000_000)


def cloud(points: Points, frame: str, stamp: int) -> Any:
    """Return a ``foxglove.PointCloud`` of packed records."""
    from foxglove.messages import PackedElementField, PackedElementFieldNumericType, PointCloud, Pose

    numeric = PackedElementFieldNumericType
    kinds = {"f4": numeric.Float32, "i4": numeric.Int32, "u4": numeric.Uint32, "u1": numeric.Uint8}
    layout: Mapping[str, Any] = points.dtype.fields or {}
    fields = [
        PackedElementField(name=name, offset=int(place[1]), type=kinds[place[0].str[1:]])
        for name, place in layout.items()
    ]
    return PointCloud(
        timestamp=timestamp(stamp), frame_id=frame, pose=Pose(position=_vector(np.zeros(3)), orientation=_quaternion()),
        point_stride=points.dtype.itemsize, fields=fields, data=points.tobytes(),
    )  # fmt: skip


def transforms(items: Sequence[Transform], stamp: int) -> Any:
    """Return a ``foxglove.FrameTransforms``."""
    from foxglove.messages import FrameTransform, FrameTransforms, Vector3

    return FrameTransforms(
        transforms=[
            FrameTransform(
                timestamp=timestamp(stamp), parent_frame_id=t.parent, child_frame_id=t.child,
                translation=Vector3(x=float(t.origin[0]), y=float(t.origin[1]), z=float(t.origin[2])),
                rotation=_quaternion(t),
            )
            for t in items
        ]
    )  # fmt: skip


def image(png: bytes, frame: str, stamp: int) -> Any:
    """Return a ``foxglove.CompressedImage`` of a PNG picture."""
    from foxglove.messages import CompressedImage

    return CompressedImage(timestamp=timestamp(stamp), frame_id=frame, data=png, format="png")


def log_text(text: str, name: str, stamp: int) -> Any:
    """Return a ``foxglove.Log`` line."""
    from foxglove.messages import Log, LogLevel

    return Log(timestamp=timestamp(stamp), level=LogLevel.Info, message=text, name=name)


def scene_update(bodies: Sequence[PlacedBody], stamp: int) -> Any:
    """Return a ``foxglove.SceneUpdate`` with the triangles of every body, in its frame; one list for each tag."""
    from foxglove.messages import KeyValuePair, SceneEntity, SceneUpdate

    return SceneUpdate(
        entities=[
            SceneEntity(
                timestamp=timestamp(stamp), frame_id=placed.frame, id=placed.label, frame_locked=True,
                metadata=[KeyValuePair(key="object_id", value=str(placed.body.object_id))],
                triangles=[_triangles(placed, tag) for tag in np.unique(placed.body.tag[placed.faces])],
            )
            for placed in bodies
        ]
    )  # fmt: skip


def _triangles(placed: PlacedBody, tag: np.integer[Any]) -> Any:
    """Return the triangles of one tag: vertices of a moving body as they are, of a static one with its pose."""
    from foxglove.messages import Color, Point3, Pose, TriangleListPrimitive

    body = placed.body
    faces = body.mesh.faces[placed.faces[body.tag[placed.faces] == tag]]
    used, index = np.unique(faces, return_inverse=True)
    points = [Point3(x=x, y=y, z=z) for x, y, z in body.mesh.vertices[used].tolist()]
    known = int(tag) in SemanticTag._value2member_map_
    red, green, blue = _COLOURS.get(SemanticTag(int(tag)), _GREY) if known else _GREY
    moving = placed.frame != placed.pose.parent
    pose = (
        Pose(position=_vector(np.zeros(3)), orientation=_quaternion())
        if moving
        else Pose(position=_vector(placed.pose.origin), orientation=_quaternion(placed.pose))
    )
    indices: IntArray = index.ravel()
    return TriangleListPrimitive(
        pose=pose, points=points, color=Color(r=red, g=green, b=blue, a=1.0), indices=indices.tolist()
    )


def _vector(v: FloatArray) -> Any:
    from foxglove.messages import Vector3

    return Vector3(x=float(v[0]), y=float(v[1]), z=float(v[2]))


def _quaternion(transform: Transform | None = None) -> Any:
    from foxglove.messages import Quaternion

    x, y, z, w = (0.0, 0.0, 0.0, 1.0) if transform is None else (float(q) for q in transform.quaternion)
    return Quaternion(x=x, y=y, z=z, w=w)
