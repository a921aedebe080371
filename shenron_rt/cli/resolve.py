"""``shenron-rt resolve``: which tag every part of a mesh gets, and why."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from .common import Json, print_json, say, show_table

__all__ = ["resolve"]


def resolve(
    mesh: Path,
    /,
    *,
    manifest: Annotated[Path | None, Parameter(name=["--manifest", "--resolve"], help="Sidecar YAML of tags.")] = None,
    carla_tags: Annotated[str, Parameter(help="Numbering of tag numbers: 0.9.13, 0.9.14, ue5 or a file.")] = "0.9.14",
    mesh_frame: Annotated[str, Parameter(help="Axes of the file, for example carla_exporter.")] = "ros_z_up",
    units: Annotated[str, Parameter(help="m, cm, mm or inch.")] = "m",
    unlabelled: Annotated[Literal["error", "warn"], Parameter(help="What too much unlabelled area is.")] = "warn",
    environment_objects: Annotated[Path | None, Parameter(help="JSON dump of CARLA's environment objects.")] = None,
    json_: Json = False,
) -> int:
    """Show part, tag, rule, triangles and area of a mesh, and what looks wrong with it.

    Parameters
    ----------
    mesh
        OBJ, glTF/GLB, PLY, STL or Mitsuba XML.
    """
    from ..scene.mesh_hints import mesh_hints
    from ..scene.readers import read_mesh
    from ..scene.resolver import resolve_tags
    from ..scene.resolver_report import coverage, resolution_table

    read = read_mesh(mesh, mesh_frame=mesh_frame, units=units)
    found = resolve_tags(
        read, manifest=manifest, carla_tags=carla_tags, unlabelled=unlabelled, environment_objects=environment_objects
    )
    rows, hints, total = resolution_table(found), mesh_hints(found), coverage(found)
    if json_:
        parts = [
            {
                "part": r.part, "tag": r.tag.name, "rule": r.rule, "evidence": r.evidence, "triangles": r.triangles,
                "area_m2": r.area_m2, "material": r.material,
            }
            for r in rows
        ]  # fmt: skip
        print_json({"mesh": str(mesh), "parts": parts, "hints": hints, "unlabelled_parts": total.unlabelled_parts})
        return 0
    columns = ("part", "tag", "rule", "evidence", "triangles [-]", "area [m2]")
    show_table(
        str(mesh), columns, [(r.part, r.tag.name, r.rule, r.evidence, r.triangles, f"{r.area_m2:.4g}") for r in rows]
    )
    bare = 100 * total.unlabelled_area_m2 / total.area_m2 if total.area_m2 else 0.0
    say(
        f"{total.parts} parts, {total.triangles} triangles, {total.area_m2:.4g} m2; "
        f"{total.unlabelled_parts} parts ({bare:.3g} % of the area) without a tag"
    )
    for hint in hints:
        say(f"hint: {hint}")
    return 0
