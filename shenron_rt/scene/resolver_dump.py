"""Rule 3: the environment objects of a running CARLA world, saved as JSON, joined to mesh parts by name."""

from __future__ import annotations

import json
import os
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError, NotFoundError
from ..tags import SemanticTag, TagTable, parse_tag
from .mesh import Part
from .resolver_names import NOTHING, NameResult, join_key

__all__ = ["EnvironmentObjects", "read_environment_objects"]


@dataclass(frozen=True)
class EnvironmentObjects:
    """Tags by full name, and by the stem left when counters and component suffixes are stripped."""

    exact: dict[str, SemanticTag]
    stems: dict[str, frozenset[SemanticTag]]

    def find(self, part: Part) -> NameResult:
        """Return the tag of the entry a part belongs to; nothing where the stem's entries disagree."""
        names = [n for n in (part.object, part.group) if n]
        for name in names:
            if name in self.exact:
                return NameResult(self.exact[name], "3 environment object", name)
        for name in names:
            tags = self.stems.get(join_key(name), frozenset())
            if len(tags) == 1:
                return NameResult(next(iter(tags)), "3 environment object", f"{join_key(name)}* of the dump")
        return NOTHING


def read_environment_objects(source: str | os.PathLike[str] | list[Any], table: TagTable) -> EnvironmentObjects:
    """Read a dump: a list of ``{"name": ..., "type": number or label}``, or a mapping with it as its only list.

    Raises
    ------
    NotFoundError, InputError
        Missing file, not JSON, entries without name or type, unknown types.
    """
    where, entries = ("environment objects", source) if isinstance(source, list) else _load(Path(source))
    exact: dict[str, SemanticTag] = {}
    stems: dict[str, set[SemanticTag]] = defaultdict(set)
    for number, entry in enumerate(entries):
        try:
            name, kind = str(entry["name"]), entry["type"]
        except (TypeError, KeyError):
            raise InputError(f"{where}: entry {number} needs name and type, got {entry!r}") from None
        # str(carla.CityObjectLabel.Buildings) is "Buildings"; repr adds the class
        tag = parse_tag(kind.rsplit(".", 1)[-1]) if isinstance(kind, str) else table.tag(int(kind))
        if tag is SemanticTag.Unlabeled:
            continue  # CARLA has no tag either; names may still say something
        exact[name] = tag
        stems[join_key(name)].add(tag)
    return EnvironmentObjects(exact, {stem: frozenset(tags) for stem, tags in stems.items()})


def _load(file: Path) -> tuple[str, list[Any]]:
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise NotFoundError(f"environment-object file {str(file)!r} does not exist") from None
    except (UnicodeDecodeError, json.JSONDecodeError) as error:
        raise InputError(f"{file}: not JSON: {error}") from None
    if isinstance(data, dict):
        lists = [v for v in data.values() if isinstance(v, list)]
        data = lists[0] if len(lists) == 1 else None
    if not isinstance(data, list):
        raise InputError(f"{file}: a list of entries with name and type is needed")
    return str(file), data
