"""Which tag table a frame speaks for: a suggestion with its evidence, and the check that the named one is possible.

A level surface below the sensor has cos(incidence) = -z / R exactly. The tag that most such points have is the road's,
whatever its number: 7 before CARLA 0.9.14, 1 since. Numbers from 23 up exist only in the new table.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from .._typing import BoolArray, FloatArray, IntArray
from ..errors import InputError
from ..tags import SemanticTag, TagTable
from .readers import RawPoints, read_points

__all__ = ["TableSuggestion", "check_table", "level_points", "suggest_from_points", "suggest_tag_table"]

_LEVEL = 0.03
_FIRST_NEW, _FIRST_UE5 = 23, 29
#: Below these a frame says too little of its ground, or of its cars.
_ENOUGH_GROUND, _ENOUGH_VEHICLE = 200, 100
#: Cars no higher than this over an extent longer than this are a road or a lawn [m].
_FLAT_M, _HUGE_M = 0.3, 15.0
_GROUND_NAMES = (
    "Roads", "Sidewalks", "Terrain", "Ground", "RoadLines", "Water", "Bridge", "RailTrack", "Rock", "Vegetation",
)  # fmt: skip
_GROUND = {SemanticTag[name] for name in _GROUND_NAMES}
_VEHICLES = (SemanticTag.Car, SemanticTag.Truck, SemanticTag.Bus, SemanticTag.Motorcycle, SemanticTag.Bicycle)


@dataclass(frozen=True)
class TableSuggestion:
    """What a frame suggests.

    Parameters
    ----------
    table : str or None
        ``"0.9.13"``, ``"0.9.14"``, ``"ue5"``, or None where the frame does not tell.
    evidence : str
        Why.
    """

    table: str | None
    evidence: str


def suggest_tag_table(path: str | os.PathLike[str]) -> TableSuggestion:
    """Say which tag table a file seems to use, and why. Nothing is ever chosen from this.

    Parameters
    ----------
    path : path
        Any layout of :func:`shenron_rt.read_semantic_lidar`.
    """
    return suggest_from_points(read_points(path))


def suggest_from_points(raw: RawPoints) -> TableSuggestion:
    """Return the suggestion for points in the sensor's frame."""
    if len(raw) == 0 or int(raw.tag.max(initial=0)) == 0:
        return TableSuggestion(None, "all tags are 0")
    top = int(raw.tag.max())
    if top > _FIRST_UE5:
        return TableSuggestion(
            None, f"the largest tag is {top}, in no table of CARLA's: a fork needs a table of its own"
        )
    if top == _FIRST_UE5:
        return TableSuggestion("ue5", f"the largest tag is {top}, Rock, which only the UE5 table has")
    if top >= _FIRST_NEW:
        return TableSuggestion("0.9.14", f"the largest tag is {top}; the table before 0.9.14 ends at 22")
    level = level_points(raw.xyz, raw.cos)
    if level.sum() < _ENOUGH_GROUND:
        return TableSuggestion(None, f"the largest tag is {top} and only {int(level.sum())} points are level ground")
    count = np.bincount(raw.tag[level].astype(np.int64))
    number = int(np.argmax(count))
    said = f"{count[number]} of {int(level.sum())} level points below the sensor have tag {number}"
    table = {7: "0.9.13", 8: "0.9.13", 1: "0.9.14", 2: "0.9.14", 10: "0.9.14", 22: "0.9.13"}.get(number)
    return TableSuggestion(table, f"{said}, {_meaning(number)}")


def _meaning(number: int) -> str:
    from ..tags import tag_table

    names = [
        f"{tag_table(t).meaning[number].name} in {t}" for t in ("0.9.13", "0.9.14") if number in tag_table(t).meaning
    ]
    return " and ".join(names)


def level_points(xyz: FloatArray, cos: FloatArray) -> BoolArray:
    """Return the mask of points of a level surface below a level sensor."""
    distance = np.maximum(np.linalg.norm(xyz, axis=1), 1e-9)
    level: BoolArray = (np.abs(np.abs(cos) + xyz[:, 2] / distance) < _LEVEL) & (xyz[:, 2] < -0.2)
    return level


def check_table(path: str, table: TagTable, raw: RawPoints, tag: IntArray) -> None:
    """Refuse a table that the points contradict.

    Parameters
    ----------
    path : str
        For messages.
    table : TagTable
        The table that was named.
    raw : RawPoints
        At the sensor.
    tag : (n,) uint8
        Translated by the table.

    Raises
    ------
    InputError
    """
    problem = _flat_vehicles(raw.xyz, tag) or _odd_ground(raw, tag)
    if problem:
        other = suggest_from_points(raw)
        hint = (
            f" The points suggest {other.table!r}: {other.evidence}." if other.table not in (None, table.name) else ""
        )
        raise InputError(f"{path}: tag table {table.name!r} contradicts the points: {problem}.{hint}")


def _flat_vehicles(xyz: FloatArray, tag: IntArray) -> str:
    for kind in _VEHICLES:
        points = xyz[tag == kind]
        if len(points) < _ENOUGH_VEHICLE:
            continue
        low, high = np.percentile(points, (5, 95), axis=0)
        extent = high - low
        if extent[2] < _FLAT_M and max(extent[:2]) > _HUGE_M:
            size = f"{extent[2]:.2f} m high over {extent[0]:.0f} x {extent[1]:.0f} m"
            return f"its {kind.name} points are {size}, flat and huge"
    return ""


def _odd_ground(raw: RawPoints, tag: IntArray) -> str:
    level = level_points(raw.xyz, raw.cos)
    if level.sum() < max(_ENOUGH_GROUND, 0.1 * len(raw)):
        return ""
    count = np.bincount(tag[level], minlength=len(SemanticTag))
    kind = SemanticTag(int(np.argmax(count)))
    share = float(count[[int(g) for g in _GROUND]].sum() / level.sum())
    if share > 0.3 or kind == SemanticTag.Unlabeled:
        return ""
    return (
        f"of {int(level.sum())} level points below the sensor only {100 * share:.0f} % are ground, {count[kind]} are "
        f"{kind.name}"
    )
