"""Rules that read a tag from one name: Unreal asset paths, RoadRunner tokens, blueprint ids, words."""

from __future__ import annotations

import re
from pathlib import PurePosixPath
from typing import Literal, NamedTuple

from ..errors import InputError, did_you_mean
from ..tags import SemanticTag as Tag
from .lexicon import find_tag, is_whole_phrase

__all__ = ["NameKind", "NameResult", "by_asset_path", "by_material", "by_roadrunner", "by_words", "classify_name"]

NameKind = Literal["object", "material", "blueprint", "file"]


class NameResult(NamedTuple):
    """Tag, the rule that gave it ("" for none) and the text it rests on."""

    tag: Tag
    rule: str
    evidence: str


NOTHING = NameResult(Tag.Unlabeled, "", "")

# Folders below .../Static/ that carry a tag (CARLA Tagger.cpp GetLabelByFolderName: singular since 0.9.14, plural
# before; Rock, Stone and Bush in UE5). "Props" was the old name of Other, "Vehicles" held every vehicle.
_FOLDERS: dict[str, Tag] = {
    "building": Tag.Buildings, "fence": Tag.Fences, "pedestrian": Tag.Pedestrians, "pole": Tag.Poles,
    "other": Tag.Other, "prop": Tag.Other, "road": Tag.Roads, "roadline": Tag.RoadLines, "sidewalk": Tag.Sidewalks,
    "trafficsign": Tag.TrafficSigns, "vegetation": Tag.Vegetation, "bush": Tag.Vegetation, "car": Tag.Car,
    "vehicle": Tag.Car, "wall": Tag.Walls, "sky": Tag.Sky, "ground": Tag.Ground, "bridge": Tag.Bridge,
    "railtrack": Tag.RailTrack, "guardrail": Tag.GuardRail, "trafficlight": Tag.TrafficLight, "static": Tag.Static,
    "dynamic": Tag.Dynamic, "water": Tag.Water, "terrain": Tag.Terrain, "truck": Tag.Truck,
    "motorcycle": Tag.Motorcycle, "bicycle": Tag.Bicycle, "bus": Tag.Bus, "rider": Tag.Rider, "train": Tag.Train,
    "rock": Tag.Rock, "stone": Tag.Rock,
}  # fmt: skip
_FOLDERS |= {f"{name}s": tag for name, tag in _FOLDERS.items()}
_STATIC_FOLDER = re.compile(r"(?:^|[/\\])Static[/\\]([^/\\]+)[/\\]", re.IGNORECASE)

# CARLA MoveAssetsCommandlet.cpp and RoadRunner's node names; a token ends where a letter does not follow.
_ROADRUNNER = re.compile(
    r"(?<![A-Za-z])Roads?_(Road|Marking|Sidewalk|Curb|Gutter|Crosswalk|Grass)(?=[^a-z]|Node|$)", re.IGNORECASE
)
_ROADRUNNER_TAGS = {
    "road": Tag.Roads, "marking": Tag.RoadLines, "sidewalk": Tag.Sidewalks, "curb": Tag.Sidewalks,
    "gutter": Tag.Sidewalks, "crosswalk": Tag.Roads, "grass": Tag.Terrain,
}  # fmt: skip
_ROADRUNNER_WHOLE = re.compile(r"^Roads(?:_Layer\d+)?(?:_\d+)?Node(?:_\d+)?$", re.IGNORECASE)
_TERRAIN = re.compile(r"(?<![A-Za-z])Terrain(?=[^a-z]|$)")

# CarlaExporter and LibCarla MeshFactory; "block" is everything else.
_EXPORTER = {
    "road": Tag.Roads, "sidewalk": Tag.Sidewalks, "crosswalk": Tag.Roads, "grass": Tag.Terrain,
}  # fmt: skip
_NO_INFORMATION = {"block", "none", "default", "defaultmaterial", "material", ""}
# Folders of CARLA that hold only materials and decals: what lies there says nothing about a surface's owner.
_SHARED_FOLDERS = {"genericmaterials", "decals"}


def by_asset_path(name: str) -> NameResult:
    """Rule 4: the folder after ``/Static/`` in an Unreal asset path."""
    match = _STATIC_FOLDER.search(name)
    tag = None if match is None else _FOLDERS.get(match[1].lower())
    return NOTHING if match is None or tag is None else NameResult(tag, "4 asset path", f"/Static/{match[1]}/")


def by_roadrunner(name: str) -> NameResult:
    """Rule 5: RoadRunner's layer tokens, anywhere in the name."""
    match = _ROADRUNNER.search(name)
    if match is not None:
        return NameResult(_ROADRUNNER_TAGS[match[1].lower()], "5 RoadRunner token", match[0])
    if _ROADRUNNER_WHOLE.match(name):
        return NameResult(Tag.Roads, "5 RoadRunner token", name)
    match = _TERRAIN.search(name)
    return NOTHING if match is None else NameResult(Tag.Terrain, "5 RoadRunner token", match[0])


def by_words(name: str, rule: str = "6 words") -> NameResult:
    """Rule 6: the lexicon, on the words of the last segment of a path."""
    hit = find_tag(strip_decoration(name.rsplit("/", 1)[-1]))
    return NOTHING if hit is None else NameResult(hit[0], rule, f"{hit[1]!r} in {name}")


def by_material(name: str) -> NameResult:
    """Rule 7: a tag from a material's name, the exporter's five first."""
    lowered = name.lower()
    if lowered in _NO_INFORMATION or lowered.startswith(("itu_", "mat-itu_", "mat_itu_")):
        return NOTHING
    if lowered in _EXPORTER:
        return NameResult(_EXPORTER[lowered], "7 material", f"exporter's {name!r}")
    folder = _STATIC_FOLDER.search(name)
    if folder is not None and folder[1].lower() in _SHARED_FOLDERS:
        return NOTHING
    found = by_asset_path(name)
    return found if found.rule else by_words(name, "7 material")


def carries_no_material(name: str) -> bool:
    """Whether a material's name is one of the exporter's classes, or a placeholder: the tag says more than it."""
    return name.lower() in _NO_INFORMATION or name.lower() in _EXPORTER


def by_file(path: str) -> NameResult:
    """Rule 8: the words of the file's name, then a parent folder that is a tag's name and nothing else."""
    file = PurePosixPath(path.replace("\\", "/"))
    found = by_words(file.stem, "8 file name")
    if found.rule:
        return found
    folder = file.parent.name
    tag = _FOLDERS.get(folder.lower()) or is_whole_phrase(folder)
    return NOTHING if tag is None else NameResult(tag, "8 folder", folder)


_GUID = re.compile(r"^\{[0-9A-Fa-f-]{8,}\}")
# What CarlaExporter appends to a component's name.
_COLLISION_KIND = re.compile(r"_(?:box|convex|mesh)(?:_\d+)?$")
# UObject boilerplate, whose "Static" and "Mesh" are no information.
_BOILERPLATE = re.compile(
    r"(?:Hierarchical)?(?:Instanced)?(?:Static|Skeletal)Mesh(?:Component|Actor)?|DefaultSceneRoot|SceneComponent"
)
_SUFFIXES = re.compile(
    r"(?:_(?:SM|SKM)_\d+|_Inst_\d+_\d+|_Inst_\d+|_(?:box|convex|mesh)(?:_\d+)?|_LOD\d+|Node|[_.]?\d+|_)$", re.IGNORECASE
)


def strip_decoration(name: str) -> str:
    """Return a name without GUID prefix, collision kind and Unreal boilerplate."""
    return _BOILERPLATE.sub(" ", _COLLISION_KIND.sub("", _GUID.sub("", name)))


def join_key(name: str) -> str:
    """Return the stem by which names of one thing in different lists are joined (rule 3)."""
    stem = strip_decoration(name).replace(" ", "").rstrip("_")
    while (shorter := _SUFFIXES.sub("", stem)) != stem and shorter:
        stem = shorter
    return stem.lower()


# Kinds of blueprint id that carry a tag by themselves (CARLA's blueprint library).
_BLUEPRINT_PREFIXES = {
    "walker.": Tag.Pedestrians,
    "traffic.traffic_light": Tag.TrafficLight,
    "traffic.": Tag.TrafficSigns,
}


def _by_blueprint(name: str) -> NameResult:
    for prefix, tag in _BLUEPRINT_PREFIXES.items():
        if name.startswith(prefix):
            return NameResult(tag, "6 blueprint id", prefix)
    if not name.startswith("vehicle."):
        return NOTHING  # static.prop.*: CARLA documents no tag
    found = by_words(name.removeprefix("vehicle."), "6 blueprint id")
    return found if found.rule else NameResult(Tag.Car, "6 blueprint id", "vehicle., unknown model")


def classify_name(name: str, kind: NameKind = "object") -> NameResult:
    """Return what one name says, without a mesh.

    Parameters
    ----------
    name : str
        Of an object, actor, node or asset (also an Unreal asset path), a material, a blueprint id or a file.
    kind : {"object", "material", "blueprint", "file"}

    Returns
    -------
    NameResult
        ``tag`` (Unlabeled where the name says nothing), ``rule``, ``evidence``.

    Raises
    ------
    InputError
        Unknown kind.

    Examples
    --------
    >>> classify_name("SM_StreetLight_01").tag.name
    'Poles'
    """
    if kind == "material":
        return by_material(name)
    if kind == "blueprint":
        return _by_blueprint(name)
    if kind == "file":
        return by_file(name)
    if kind != "object":
        kinds = ("object", "material", "blueprint", "file")
        raise InputError(f"unknown kind of name {kind!r}; {did_you_mean(str(kind), kinds)}")
    for rule in (by_asset_path, by_roadrunner, by_words):
        found = rule(name)
        if found.rule:
            return found
    return NOTHING
