"""One record an object, one a tag: both sides' levels, what the difference is made of, and its cause."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from ..tags import SemanticTag
from .levels import Levels
from .record import Record
from .sides import Side
from .verdict import CAUSES, blind_verdict, level_verdict

__all__ = ["object_records", "tag_records"]


def object_records(levels: Levels, a: Side, b: Side, names: Mapping[int, str]) -> list[Record]:
    """Return a record for every object of either side, by falling power.

    Parameters
    ----------
    levels : Levels
        By object, of one frame or pooled over several.
    a, b : Side
        Of any frame: what looked, and whether there were echoes.
    names : mapping of int to str
    """
    records = []
    for group, key in enumerate(levels.grouping.keys):
        number, facts = int(key), levels.facts[int(key)]
        known = _levels(levels, group)
        if known["seen_by"] is None:
            continue
        record = Record(
            id=number,
            name=names.get(number, f"object {number}" if number else "static"),
            tag=facts.tags[0] or facts.tags[1],
            tag_a=facts.tags[0],
            tag_b=facts.tags[1],
            **known,
            detected_a=_any(facts.detected[0]),
            detected_b=_any(facts.detected[1]),
            detected_frames_a=facts.detected[0],
            detected_frames_b=facts.detected[1],
            position_m=facts.position,
        )
        records.append(_judge(_with_budget(record, levels, group), levels, group, a, b, many=number == 0))
    return _by_power(records)


def tag_records(levels: Levels, a: Side, b: Side) -> list[Record]:
    """Return a record for every tag of either side, by falling power."""
    records = []
    for group, key in enumerate(levels.grouping.keys):
        record = Record(tag=SemanticTag(int(key)).name, **_levels(levels, group))
        if record["seen_by"] is not None:
            records.append(_judge(_with_budget(record, levels, group), levels, group, a, b, many=True))
    return _by_power(records)


def _any(frames: int | None) -> bool | None:
    return None if frames is None else frames > 0


def _by_power(records: list[Record]) -> list[Record]:
    return sorted(records, key=lambda r: -max(v for v in (r["power_db_a"], r["power_db_b"]) if v is not None))


def _levels(levels: Levels, group: int) -> dict[str, Any]:
    """Return both levels, their difference, and who sees the group; None where nobody does."""
    a, b = (_level(float(p[0][group])) for p in levels.powers)
    who = ("both" if b is not None else "a") if a is not None else "b" if b is not None else None
    delta = None if a is None or b is None else b - a
    return {"power_db_a": a, "power_db_b": b, "delta_db": delta, "seen_by": who}


def _level(power: float) -> float | None:
    return 10 * math.log10(power) if power > 0 else None


def _with_budget(record: Record, levels: Levels, group: int) -> Record:
    """Add rows, area, cosine, range and coherent share of each side, and the terms of the difference."""
    coherent = [power[1] for power in levels.powers]
    for side, power, echo in zip("ab", levels.powers, coherent, strict=True):
        record[f"coherent_share_{side}"] = float(echo[group] / power[0][group]) if power[0][group] > 0 else None
    if levels.budgets is not None:
        for side, budget, echo in zip("ab", levels.budgets, coherent, strict=True):
            seen = bool(budget.rows[group])
            record[f"rows_{side}"] = int(budget.rows[group])
            record[f"area_m2_{side}"] = float(budget.area[group])
            record[f"mean_cosine_{side}"] = float(budget.cosine[group]) if seen else None
            record[f"nearest_m_{side}"] = float(budget.nearest[group]) if seen else None
            record[f"mean_range_m_{side}"] = float(budget.mean_range[group]) if seen else None
            shares = {k: float(v[group]) for k, v in budget.shares.items() if v[group] > 0}
            record[f"mirror_dbw_{side}"] = _level(float(budget.mirror[group] + echo[group]))
            record[f"materials_{side}"] = Record(sorted(shares.items(), key=lambda kv: -kv[1]))
    record["terms_db"] = levels.terms(group)
    return record


def _judge(record: Record, levels: Levels, group: int, a: Side, b: Side, *, many: bool) -> Record:
    """Add the cause, and what was seen of the group from the side that has less of it."""
    poor = _poor_side(record)
    poor_side = a if poor == "a" else b
    sight = levels.facts[int(levels.grouping.keys[group])].sight["ab".index(poor)]
    rows = int(record.get(f"rows_{poor}", 0))
    if record["delta_db"] is None:
        causes = ["not_simulated"]
        if poor_side.returns is not None:
            causes = blind_verdict(poor_side.viewer, sight, rows, levels.models[0] == levels.models[1])
        record.update(cause=causes[0], also=causes[1:], meaning=CAUSES[causes[0]])
    else:
        facts: dict[str, Any] = {
            "rows_poor": rows,
            "sight": sight,
            "viewer_poor": poor_side.viewer,
            "tags_differ": record.get("tag_a") != record.get("tag_b"),
            "many": many,
            "probability": levels.probability(group),
        }
        record.update(level_verdict(record["delta_db"], record["terms_db"], levels.fluctuation_db(group), facts))
    record["sight"] = None if sight is None else Record(sight, from_side=poor)
    return record


def _poor_side(record: Record) -> str:
    """Return the side that has less of the object: no echo, or less area."""
    if record["seen_by"] != "both":
        return "b" if record["seen_by"] == "a" else "a"
    return "a" if record.get("area_m2_a", 0.0) < record.get("area_m2_b", 0.0) else "b"
