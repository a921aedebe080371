"""Semantic tags: CARLA's numbering since 0.9.14, and the named tables that translate other numberings to it.

CARLA renumbered its tags in 0.9.14; the old and the new table agree only at 0 and 9, so a wrong table turns roads into
traffic lights without any error. A table is therefore always named by the caller, and a number it does not list is
refused. The numbers are those of ``carla::rpc::CityObjectLabel`` (LibCarla ``rpc/ObjectLabel.h``).
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np

from ._typing import IntArray
from .errors import ConfigError, InputError, did_you_mean

__all__ = ["SemanticTag", "TagTable", "parse_tag", "tag_table"]


class SemanticTag(IntEnum):
    """What a surface belongs to, in CARLA's numbering since 0.9.14, with UE5's Rock added."""

    Unlabeled = 0
    Roads = 1
    Sidewalks = 2
    Buildings = 3
    Walls = 4
    Fences = 5
    Poles = 6
    TrafficLight = 7
    TrafficSigns = 8
    Vegetation = 9
    Terrain = 10
    Sky = 11
    Pedestrians = 12
    Rider = 13
    Car = 14
    Truck = 15
    Bus = 16
    Train = 17
    Motorcycle = 18
    Bicycle = 19
    Static = 20
    Dynamic = 21
    Other = 22
    Water = 23
    RoadLines = 24
    Ground = 25
    Bridge = 26
    RailTrack = 27
    GuardRail = 28
    Rock = 29


# Index = number in CARLA 0.9.10 to 0.9.13. "Vehicles" held every kind of vehicle, and "Pedestrians" held riders too.
# fmt: off
_NAMES_0913 = (
    "Unlabeled", "Buildings", "Fences", "Other", "Pedestrians", "Poles", "RoadLines", "Roads", "Sidewalks",
    "Vegetation", "Car", "Walls", "TrafficSigns", "Sky", "Ground", "Bridge", "RailTrack", "GuardRail",
    "TrafficLight", "Static", "Dynamic", "Water", "Terrain",
)
# fmt: on

_ALIASES = {
    "none": SemanticTag.Unlabeled,
    "unlabelled": SemanticTag.Unlabeled,
    "vehicles": SemanticTag.Car,
    "vehicle": SemanticTag.Car,
    "trafficlights": SemanticTag.TrafficLight,
}
_BY_NAME: dict[str, SemanticTag] = {tag.name.lower(): tag for tag in SemanticTag}
# "Road", "Pole", "Cars" are what people write; the enum mixes singular and plural.
_BY_NAME |= {name[:-1]: tag for name, tag in list(_BY_NAME.items()) if name.endswith("s") and tag.name != "Bus"}
_BY_NAME |= {f"{name}s": tag for name, tag in list(_BY_NAME.items()) if not name.endswith("s")}
_BY_NAME |= _ALIASES


def parse_tag(value: str | int) -> SemanticTag:
    """Return the tag for a name (case-insensitive, singular or plural) or a canonical number.

    Parameters
    ----------
    value : str or int
        ``"Car"``, ``"road"``, ``"None"``, ``14`` ...

    Raises
    ------
    InputError
        Unknown name or number, with the known ones.

    Examples
    --------
    >>> parse_tag("roads").name, parse_tag(14).name
    ('Roads', 'Car')
    """
    if isinstance(value, str):
        tag = _BY_NAME.get(value.strip().replace("_", "").replace(" ", "").lower())
        if tag is None:
            raise InputError(f"unknown tag {value!r}; {did_you_mean(value, [t.name for t in SemanticTag])}")
        return tag
    try:
        return SemanticTag(int(value))
    except ValueError:
        raise InputError(f"unknown tag number {value!r}; CARLA 0.9.14 and later use 0 to {max(SemanticTag)}") from None


@dataclass(frozen=True)
class TagTable:
    """A numbering of tags and what each number means here.

    Parameters
    ----------
    name : str
        How messages call it.
    meaning : mapping of int to SemanticTag
        The number in the data, and the tag it stands for.
    """

    name: str
    meaning: Mapping[int, SemanticTag]

    def __post_init__(self) -> None:
        bad = sorted(n for n in self.meaning if not 0 <= n <= 255)
        if bad:
            raise InputError(f"tag table {self.name!r}: numbers {bad} do not fit one byte (0 to 255)")

    def translate(self, numbers: IntArray) -> IntArray:
        """Return canonical tags for tags in this numbering.

        Parameters
        ----------
        numbers : (n,) integer array
            Tags as in the data.

        Returns
        -------
        (n,) uint8 ndarray
            Values of :class:`SemanticTag`.

        Raises
        ------
        InputError
            The array is not of an integer type, or holds numbers the table does not list; each with its count.
        """
        values = np.asarray(numbers)
        if values.dtype.kind not in "iu":
            raise InputError(f"tags must be integers, got an array of {values.dtype}; view the bits, never cast floats")
        known = np.array(sorted(self.meaning), dtype=np.int64)
        canonical = np.array([int(self.meaning[int(n)]) for n in known], dtype=np.uint8)
        wide = values.astype(np.int64)
        slot = np.clip(np.searchsorted(known, wide), 0, known.size - 1)
        unknown = known[slot] != wide
        if np.any(unknown):
            found, counts = np.unique(wide[unknown], return_counts=True)
            listed = ", ".join(f"{n} ({c} times)" for n, c in zip(found[:8], counts[:8], strict=True))
            raise InputError(
                f"tag table {self.name!r} does not list {listed}; it knows {_ranges(known)}. Is it the right CARLA "
                "version? Forks need a YAML table: {base: '0.9.14', tags: {30: Dynamic}}"
            )
        return canonical[slot]

    def tag(self, number: int) -> SemanticTag:
        """Return the tag for one number; :class:`InputError` where it is unknown."""
        return SemanticTag(int(self.translate(np.array([number], dtype=np.int64))[0]))


def _ranges(numbers: IntArray) -> str:
    """Return sorted numbers as ``0-22, 30``."""
    breaks = np.flatnonzero(np.diff(numbers) > 1)
    starts = np.concatenate([numbers[:1], numbers[breaks + 1]])
    ends = np.concatenate([numbers[breaks], numbers[-1:]])
    return ", ".join(f"{a}" if a == b else f"{a}-{b}" for a, b in zip(starts, ends, strict=True))


_NEW = {int(tag): tag for tag in SemanticTag if tag is not SemanticTag.Rock}
_TABLES = {
    "0.9.13": TagTable("0.9.13", {n: SemanticTag[name] for n, name in enumerate(_NAMES_0913)}),
    "0.9.14": TagTable("0.9.14", _NEW),
    "ue5": TagTable("ue5", {int(tag): tag for tag in SemanticTag}),
}
# The numbering did not change between the releases listed here (CARLA CHANGELOG).
_SAME_AS = {"0.9.10": "0.9.13", "0.9.11": "0.9.13", "0.9.12": "0.9.13", "0.9.15": "0.9.14", "0.9.16": "0.9.14"}


def tag_table(name_or_path: str | os.PathLike[str] | TagTable) -> TagTable:
    """Return a named tag table, or read one from a YAML file.

    Parameters
    ----------
    name_or_path : str, path or TagTable
        ``"0.9.13"`` (0.9.10 to 0.9.13), ``"0.9.14"`` (0.9.14 to 0.9.16), ``"ue5"`` (0.10), or a file with the keys
        ``tags`` (number: name of a :class:`SemanticTag`) and, optionally, ``base`` (a named table that it extends).

    Raises
    ------
    InputError, ConfigError, NotFoundError
        Unknown name; bad or missing file.
    """
    if isinstance(name_or_path, TagTable):
        return name_or_path
    name = os.fspath(name_or_path)
    if (known := _TABLES.get(_SAME_AS.get(name.lower(), name.lower()))) is not None:
        return known
    if Path(name).suffix in (".yaml", ".yml"):
        return _read_table(Path(name))
    raise InputError(f"unknown tag table {name!r}; {did_you_mean(name, _TABLES)}, or the path of a .yaml table")


def _read_table(file: Path) -> TagTable:
    from .config.loader import read_yaml  # keeps pydantic and yaml out of the import of this module

    data, _ = read_yaml(file)
    extra = sorted(set(map(str, data)) - {"version", "base", "tags"})
    if extra:
        raise ConfigError(f"{file}: {extra[0]}: unknown key; known: base, tags, version")
    tags: Any = data.get("tags")
    if not isinstance(tags, dict) or not tags:
        raise ConfigError(f"{file}: tags: a mapping of number to tag name is needed, got {tags!r}")
    meaning: dict[int, SemanticTag] = dict(tag_table(str(data["base"])).meaning) if "base" in data else {}
    for number, label in tags.items():
        if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number <= 255:
            raise ConfigError(f"{file}: tags.{number}: the key must be a number 0 to 255")
        try:
            # An unquoted None in YAML is the string "None"; a bare ~ or null means the same here.
            meaning[number] = SemanticTag.Unlabeled if label is None else parse_tag(label)
        except InputError as error:
            raise ConfigError(f"{file}: tags.{number}: {error}") from None
    return TagTable(str(file), meaning)
