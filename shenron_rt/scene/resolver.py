"""Give every part of a mesh its tag and material, and say why.

The rules, first hit wins: 1 manifest, 2 data in the mesh file, 3 environment-object dump, 4 Unreal asset path,
5 RoadRunner token, 6 words of object then group, 7 material name, 8 file name then parent folder, 9 nothing.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from .._typing import ArrayLike
from ..errors import InputError
from ..tags import SemanticTag, TagTable, parse_tag, tag_table
from .lexicon import find_material
from .mesh import Part, TaggedMesh
from .readers import read_mesh
from .resolver_dump import EnvironmentObjects, read_environment_objects
from .resolver_manifest import Frame, TagManifest, describe, load_manifest, manifest_material, manifest_tag
from .resolver_names import (
    NOTHING,
    NameResult,
    by_asset_path,
    by_file,
    by_material,
    by_roadrunner,
    by_words,
    carries_no_material,
    classify_name,
)
from .resolver_report import Coverage, ResolutionRow, coverage, is_unlabelled, resolution_table

__all__ = [
    "Coverage",
    "ResolutionRow",
    "classify_name",
    "coverage",
    "load_tagged_mesh",
    "resolution_table",
    "resolve_tags",
]

_log = logging.getLogger(__name__)

Policy = Literal["error", "warn"]
_GIVEN = "2 given by the program"


def resolve_tags(
    mesh: TaggedMesh,
    *,
    manifest: str | os.PathLike[str] | TagManifest | None = None,
    carla_tags: str | os.PathLike[str] = "0.9.14",
    unlabelled: Policy = "error",
    max_unlabelled_area: float = 0.05,
    fallback_material: str = "concrete",
    environment_objects: str | os.PathLike[str] | list[Any] | None = None,
) -> TaggedMesh:
    """Return the mesh with tag, rule, evidence and, where a name says it, material on every part; sky is dropped.

    Parameters
    ----------
    mesh : TaggedMesh
        As read.
    manifest : path or TagManifest, optional
        Sidecar file; what it sets (``carla_tags``, ``defaults``, ``environment_objects``) wins over the arguments.
    carla_tags : str or path
        Numbering of tag *numbers* in the mesh file, the manifest and the dump: see :func:`shenron_rt.tags.tag_table`.
    unlabelled : {"error", "warn"}
        What happens where more area than allowed has neither a tag nor a material.
    max_unlabelled_area : float
        Allowed share of the area, 0 to 1.
    fallback_material : str
        Material of the parts that stay without; logged.
    environment_objects : path or list, optional
        CARLA's ``world.get_environment_objects()`` as JSON: entries with ``name`` and ``type``.

    Raises
    ------
    InputError
        Unlabelled area above the limit, an unknown tag number, bad arguments.
    ConfigError, NotFoundError
        Bad manifest.
    """
    if unlabelled not in ("error", "warn"):
        raise InputError(f"unlabelled must be 'error' or 'warn', got {unlabelled!r}")
    sidecar = _manifest(manifest)
    folder = Path(manifest).parent if isinstance(manifest, str | os.PathLike) else Path()
    table = tag_table(sidecar.carla_tags or carla_tags)
    dump = environment_objects
    if sidecar.environment_objects is not None:
        dump = folder / sidecar.environment_objects
    known = None if dump is None else read_environment_objects(dump, table)
    parts = tuple(_resolve(part, sidecar, table, known) for part in mesh.parts)
    _report_unused(sidecar, mesh.parts)
    _report_unknown_materials(parts)
    resolved = _without_sky(mesh.with_parts(parts))
    limit = sidecar.defaults.max_unlabelled_area
    return _apply_policy(
        resolved,
        sidecar.defaults.unlabelled or unlabelled,
        max_unlabelled_area if limit is None else limit,
        sidecar.defaults.material or fallback_material,
    )


def load_tagged_mesh(
    path: str | os.PathLike[str],
    *,
    manifest: str | os.PathLike[str] | TagManifest | None = None,
    mesh_frame: str | ArrayLike | None = None,
    units: str | float | None = None,
    carla_tags: str | os.PathLike[str] = "0.9.14",
    unlabelled: Policy = "error",
    max_unlabelled_area: float = 0.05,
) -> TaggedMesh:
    """Read a mesh file and resolve its tags: :func:`read_mesh` and :func:`resolve_tags` in one.

    Parameters
    ----------
    path : path
    manifest : path or TagManifest, optional
    mesh_frame, units : optional
        As for :func:`read_mesh`; where absent, those of the manifest's ``frame``, else ``"ros_z_up"`` and ``"m"``.
    carla_tags, unlabelled, max_unlabelled_area
        As for :func:`resolve_tags`.
    """
    sidecar = _manifest(manifest)
    frame = sidecar.frame or Frame()
    mesh = read_mesh(
        path,
        mesh_frame=frame.mesh_frame if mesh_frame is None else mesh_frame,
        units=units if units is not None else frame.units if mesh_frame is None else "m",
    )
    return resolve_tags(
        mesh,
        manifest=manifest,
        carla_tags=carla_tags,
        unlabelled=unlabelled,
        max_unlabelled_area=max_unlabelled_area,
    )


def _manifest(manifest: str | os.PathLike[str] | TagManifest | None) -> TagManifest:
    if manifest is None:
        return TagManifest(version=1)
    return manifest if isinstance(manifest, TagManifest) else load_manifest(manifest)


def _resolve(part: Part, manifest: TagManifest, table: TagTable, dump: EnvironmentObjects | None) -> Part:
    rules: tuple[Callable[[], NameResult], ...] = (
        lambda: _by_manifest(part, manifest, table),
        lambda: _by_declaration(part, table),
        lambda: NOTHING if dump is None else dump.find(part),
        lambda: _first_of(part, by_asset_path),
        lambda: _first_of(part, by_roadrunner),
        lambda: _first_of(part, by_words),
        lambda: by_material(part.material),
        lambda: by_file(part.file),
    )
    result = next((found for rule in rules if (found := rule()).rule), NOTHING)
    return replace(
        part, tag=result.tag, rule=result.rule, evidence=result.evidence, em_material=_material(part, manifest)
    )


def _first_of(part: Part, rule: Callable[[str], NameResult]) -> NameResult:
    for name in (part.object, part.group):
        found = rule(name) if name else NOTHING
        if found.rule:
            return found
    return NOTHING


def _by_manifest(part: Part, manifest: TagManifest, table: TagTable) -> NameResult:
    hit = manifest_tag(manifest.parts, part)
    if hit is None or hit[1].tag is None:
        return NOTHING
    number, rule = hit
    return NameResult(_named_or_number(rule.tag, table), "1 manifest", f"parts[{number}]: {describe(rule)}")


def _by_declaration(part: Part, table: TagTable) -> NameResult:
    if part.declared_tag is None:
        given = part.tag is not SemanticTag.Unlabeled and part.rule in ("", _GIVEN)
        return NameResult(part.tag, _GIVEN, part.tag.name) if given else NOTHING
    try:
        tag = _named_or_number(part.declared_tag, table)
    except InputError as error:
        raise InputError(f"{part.file}: part {part.label!r}: {error}") from None
    return NameResult(tag, "2 in the file", f"tag {part.declared_tag} ({table.name})")


def _named_or_number(value: Any, table: TagTable) -> SemanticTag:
    if isinstance(value, str) and not value.strip().isdigit():
        return parse_tag(value)
    if isinstance(value, bool) or float(value) != int(value):
        raise InputError(f"tag {value!r} is neither a name nor a whole number")
    return table.tag(int(value))


def _material(part: Part, manifest: TagManifest) -> str | None:
    hit = manifest_material(manifest.parts, part)
    if hit is not None:
        return hit[1].material
    if part.declared_material is not None:
        return part.declared_material
    if part.em_material is not None and part.rule != "9 none":
        return part.em_material
    named = None if carries_no_material(part.material) else find_material(part.material)
    if named is None:
        named = next((m for n in (part.object, part.group) if n and (m := find_material(n, pieces_only=True))), None)
    return None if named is None else named[0]


def _report_unused(manifest: TagManifest, parts: tuple[Part, ...]) -> None:
    for number, rule in enumerate(manifest.parts):
        if not any(rule.match.fits(p) for p in parts):
            _log.warning("manifest: parts[%d] (%s) matches no part of the mesh", number, describe(rule))


def _report_unknown_materials(parts: tuple[Part, ...]) -> None:
    """Warn of materials by ITU-R P.2040 name that no table here has: a stated material must not vanish silently."""
    unknown = {p.material for p in parts if p.em_material is None and "itu_" in p.material.lower()}
    for name in sorted(unknown):
        _log.warning("material %r is not known; its parts take the material of their tag", name)


def _without_sky(mesh: TaggedMesh) -> TaggedMesh:
    sky = mesh.face_tag == int(SemanticTag.Sky)
    if not sky.any():
        return mesh
    if sky.all():
        raise InputError("every part of the mesh is sky; nothing is left to reflect")
    kept = mesh.select(~sky)
    _log.info("dropped %d triangles of the sky", int(sky.sum()))
    return replace(kept, repaired={**kept.repaired, "sky_faces": int(sky.sum())})


def _apply_policy(mesh: TaggedMesh, policy: Policy, limit: float, fallback: str) -> TaggedMesh:
    bare = np.array([is_unlabelled(p) for p in mesh.parts])
    if not bare.any():
        return mesh
    area = mesh.part_area
    share = float(area[bare].sum() / area.sum())
    order = sorted(np.flatnonzero(bare), key=lambda k: -area[k])
    listed = ", ".join(f"{mesh.parts[k].label!r} ({area[k]:.4g} m^2)" for k in order[:5])
    more = f" and {len(order) - 5} more" if len(order) > 5 else ""
    if policy == "error" and share > limit:
        raise InputError(
            f"{100 * share:.3g} % of the mesh area has no tag and no material, allowed are {100 * limit:.3g} %: "
            f"{listed}{more}. Name them in a manifest (parts: - {{match: {{object: ...}}, tag: ...}}), give the part "
            "a tag in the scene, or set unlabelled: warn"
        )
    _log.warning(
        "%.3g %% of the mesh area has no tag and no material and is taken as %s: %s%s",
        100 * share, fallback, listed, more,
    )  # fmt: skip
    return mesh.with_parts(
        [
            replace(p, rule="9 none", evidence=f"taken as {fallback}", em_material=fallback) if b else p
            for p, b in zip(mesh.parts, bare, strict=True)
        ]
    )
