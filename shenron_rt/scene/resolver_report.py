"""What the resolver decided, as rows and totals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..tags import SemanticTag
from .mesh import Part, TaggedMesh

__all__ = ["Coverage", "ResolutionRow", "coverage", "is_unlabelled", "resolution_table"]


@dataclass(frozen=True)
class ResolutionRow:
    """One part: its name, tag, the rule and text that gave it, triangles, area [m^2], material ("" = by tag)."""

    part: str
    tag: SemanticTag
    rule: str
    evidence: str
    triangles: int
    area_m2: float
    material: str


@dataclass(frozen=True)
class Coverage:
    """How much of a mesh is labelled.

    ``str()`` gives one line for the terminal.
    """

    parts: int
    triangles: int
    area_m2: float
    unlabelled_parts: int
    unlabelled_area_m2: float
    area_by_tag_m2: dict[str, float]

    @property
    def unlabelled_share(self) -> float:
        """Share of the area without tag and without material of its own, 0 to 1."""
        return self.unlabelled_area_m2 / self.area_m2

    def __str__(self) -> str:
        labelled = 100.0 * (1.0 - self.unlabelled_share)
        named = self.parts - self.unlabelled_parts
        return (
            f"{labelled:.1f} % of {self.area_m2:.1f} m^2 labelled: {named} of {self.parts} "
            f"parts, {self.triangles} triangles, {len(self.area_by_tag_m2)} tags"
        )


def is_unlabelled(part: Part) -> bool:
    """Whether neither a rule gave a tag (or "no tag" on purpose) nor anything but the fallback a material."""
    return part.rule == "9 none" or (part.tag is SemanticTag.Unlabeled and not part.rule and part.em_material is None)


def resolution_table(mesh: TaggedMesh) -> list[ResolutionRow]:
    """Return one row for each part, in the mesh's order."""
    return [
        ResolutionRow(p.label, p.tag, p.rule or "9 none", p.evidence, int(n), float(a), p.em_material or "")
        for p, n, a in zip(mesh.parts, mesh.part_faces, mesh.part_area, strict=True)
    ]


def coverage(mesh: TaggedMesh) -> Coverage:
    """Return the totals of a resolved mesh."""
    area = mesh.part_area
    bare = np.array([is_unlabelled(p) for p in mesh.parts])
    tags = np.array([int(p.tag) for p in mesh.parts])
    return Coverage(
        parts=len(mesh.parts),
        triangles=mesh.n_faces,
        area_m2=float(area.sum()),
        unlabelled_parts=int(bare.sum()),
        unlabelled_area_m2=float(area[bare].sum()),
        area_by_tag_m2={SemanticTag(int(t)).name: float(area[tags == t].sum()) for t in np.unique(tags)},
    )
