"""The sidecar file that says what the names in a mesh mean: explicit tags and materials, frame, and policy."""

from __future__ import annotations

import fnmatch
import os
import re
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from ..config._base import ConfigModel
from ..config.loader import parse_model
from ..tags import parse_tag
from .mesh import Part
from .mesh_frames import MESH_FRAMES, mesh_matrix

__all__ = [
    "Frame",
    "Match",
    "PartRule",
    "TagManifest",
    "describe",
    "load_manifest",
    "manifest_material",
    "manifest_tag",
]


class Match(ConfigModel):
    """Which parts a rule is for; every key given must fit.

    ``object`` also fits the group, so that it names the actor in both layouts of CARLA's exporter; ``object_regex`` is
    searched in either; ``file`` is a glob on the file's name or its last folders.
    """

    object: str | None = None
    group: str | None = None
    material: str | None = None
    object_regex: str | None = None
    file: str | None = None

    @field_validator("object_regex")
    @classmethod
    def _compiles(cls, value: str | None) -> str | None:
        if value is not None:
            try:
                re.compile(value)
            except re.error as error:
                raise ValueError(f"not a regular expression: {error}") from None
        return value

    @model_validator(mode="after")
    def _not_empty(self) -> Match:
        if not self.model_dump(exclude_none=True):
            raise ValueError("give at least one of object, group, material, object_regex, file")
        return self

    @property
    def rank(self) -> int:
        """0 for an exact name, 1 for a regular expression, 2 for a file glob."""
        if self.object is not None or self.group is not None or self.material is not None:
            return 0
        return 1 if self.object_regex is not None else 2

    def fits(self, part: Part) -> bool:
        """Whether every key that is given fits the part."""
        names = (part.object, part.group)
        path = Path(part.file).as_posix()
        return (
            (self.object is None or self.object in names)
            and (self.group is None or self.group == part.group)
            and (self.material is None or self.material == part.material)
            and (self.object_regex is None or any(re.search(self.object_regex, n) for n in names if n))
            and (
                self.file is None
                or fnmatch.fnmatchcase(Path(part.file).name, self.file)
                or fnmatch.fnmatchcase(path, f"*/{self.file}")
            )
        )


class PartRule(ConfigModel):
    """A tag, a material or both for the parts that match; what is absent stays as the other rules find it."""

    match: Match
    tag: str | int | None = None
    material: str | None = None

    @field_validator("tag")
    @classmethod
    def _known(cls, value: str | int | None) -> str | int | None:
        if isinstance(value, str):
            parse_tag(value)
        return value

    @model_validator(mode="after")
    def _says_something(self) -> PartRule:
        if self.tag is None and self.material is None:
            raise ValueError("give a tag, a material or both (tag: 'None' marks parts that shall stay without one)")
        return self


class Frame(ConfigModel):
    """Axes and unit of the mesh file."""

    preset: str | None = None
    units: str | float = "m"
    matrix: tuple[tuple[float, ...], ...] | None = None

    @model_validator(mode="after")
    def _usable(self) -> Frame:
        if self.preset is not None and self.matrix is not None:
            raise ValueError(f"give preset or matrix, not both; presets: {', '.join(MESH_FRAMES)}")
        mesh_matrix(self.mesh_frame, self.units)
        return self

    @property
    def mesh_frame(self) -> Any:  # a preset name or a nested tuple, as read_mesh takes either
        """The value for ``mesh_frame=`` of :func:`~shenron_rt.scene.readers.read_mesh`."""
        return self.matrix if self.matrix is not None else self.preset or "ros_z_up"


class Defaults(ConfigModel):
    """What happens to parts that no rule knows."""

    unlabelled: Literal["error", "warn"] | None = None
    max_unlabelled_area: Annotated[float, Field(ge=0, le=1)] | None = None
    material: str | None = None


class TagManifest(ConfigModel):
    """A sidecar manifest (``town.tags.yaml``).

    ``carla_tags`` names the numbering of every tag number in the manifest, the mesh and the environment-object dump.
    ``actors`` is accepted for tools that place moving meshes from the same file, and not used by the resolver.
    """

    version: Literal[1]
    carla_tags: str | None = None
    frame: Frame | None = None
    defaults: Defaults = Defaults()
    environment_objects: str | None = None
    parts: tuple[PartRule, ...] = ()
    actors: tuple[dict[str, Any], ...] = ()


def load_manifest(path: str | os.PathLike[str]) -> TagManifest:
    """Read a manifest.

    Raises
    ------
    ConfigError, NotFoundError
        With file, line and key.
    """
    return parse_model(TagManifest, path)


def manifest_tag(rules: tuple[PartRule, ...], part: Part) -> tuple[int, PartRule] | None:
    """Return the first rule, exact names before expressions before globs, that gives the part a tag, and its number."""
    return _first(rules, part, "tag")


def manifest_material(rules: tuple[PartRule, ...], part: Part) -> tuple[int, PartRule] | None:
    """Return the first rule that gives the part a material, and its number."""
    return _first(rules, part, "material")


def _first(rules: tuple[PartRule, ...], part: Part, what: Literal["tag", "material"]) -> tuple[int, PartRule] | None:
    ordered = sorted(enumerate(rules), key=lambda item: item[1].match.rank)
    return next(((k, r) for k, r in ordered if getattr(r, what) is not None and r.match.fits(part)), None)


def describe(rule: PartRule) -> str:
    """Return the match as ``object_regex ^BP_.*`` for the evidence column."""
    return ", ".join(f"{k} {v}" for k, v in rule.match.model_dump(exclude_none=True).items())
