"""One record an object, one a tag: both sides' levels, what the difference is made of, and its cause."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._typing import FloatArray
from ..dsp import Detections
from ..tags import SemanticTag
from .budget import Budget, Grouping, budget_of, draw_probability, received, terms_db
from .record import Record
from .sides import Side
from .sight import Sight
from .surfaces import Palette
from .verdict import CAUSES, blind_verdict, level_verdict

__all__ = ["compare_objects", "compare_tags"]

#: Points of an object whose line of sight is looked at; more change no share by over a percent.
_SIGHT_POINTS = 2000


@dataclass(frozen=True)
class _Pair:
    """Both sides' levels and budgets over one grouping."""

    grouping: Grouping
    power: tuple[FloatArray, FloatArray]
    coherent: tuple[FloatArray, FloatArray]
    probability: tuple[FloatArray, FloatArray]
    budgets: tuple[Budget, Budget] | None
    models: tuple[str, str]

    @classmethod
    def of(cls, a: Side, b: Side, by: str) -> _Pair:
        keys = [getattr(s, by) for side in (a, b) for s in (side.scatterers, side.returns) if s is not None]
        grouping = Grouping(np.unique(np.concatenate(keys).astype(np.int64)), by)
        none = np.zeros(len(grouping.keys))
        levels = [
            (none, none, none) if s.returns is None else received(s.returns, s.scatterers, grouping) for s in (a, b)
        ]
        budgets = None
        if all(_has_surfaces(s) for s in (a, b)) and a.profile is not None:
            palette = Palette.of(a, b)
            budgets = (
                budget_of(a, a.profile, grouping, palette, palette.of_a),
                budget_of(b, a.profile, grouping, palette, palette.of_b),
            )
        probable = [np.ones(len(grouping.keys))] * 2
        if budgets is not None:
            probable = [draw_probability(x, level[2]) for x, level in zip(budgets, levels, strict=True)]
        models = ["" if s.returns is None else s.returns.model for s in (a, b)]
        return cls(
            grouping=grouping,
            power=(levels[0][0], levels[1][0]),
            coherent=(levels[0][1], levels[1][1]),
            probability=(probable[0], probable[1]),
            budgets=budgets,
            models=(models[0], models[1]),
        )

    def terms(self, group: int) -> dict[str, float] | None:
        if self.budgets is None:
            return None
        a, b = (
            (budget, float(p[group]), float(c[group]))
            for budget, p, c in zip(self.budgets, self.power, self.coherent, strict=True)
        )
        return terms_db(a, b, group, models=self.models)

    def fluctuation_db(self, group: int) -> float:
        """Return the standard deviation of the level difference by speckle; a strong coherent echo steadies a level."""
        if self.budgets is None:
            return 0.0
        variance = 0.0
        for budget, coherent in zip(self.budgets, self.coherent, strict=True):
            expected = float(budget.expected[group] + budget.mirror[group])
            steady = expected / (expected + float(coherent[group])) if expected > 0 else 0.0
            variance += (steady * float(budget.fluctuation_db[group])) ** 2
        return math.sqrt(variance)


def _has_surfaces(side: Side) -> bool:
    s = side.scatterers
    return s is not None and side.returns is not None and len(s) > 0 and (s.area is not None or s.rcs is not None)


def compare_objects(a: Side, b: Side) -> list[Record]:
    """Return a record for every object of either side, by falling power; empty where neither side has echoes."""
    if a.returns is None and b.returns is None:
        return []
    pair = _Pair.of(a, b, "object_id")
    names = {**b.names, **a.names}
    sights = {"a": _sight(a, "object_id"), "b": _sight(b, "object_id")}
    records = [_object(pair, group, a, b, names, sights) for group in range(len(pair.grouping.keys))]
    return _by_power([r for r in records if r is not None])


def compare_tags(a: Side, b: Side) -> list[Record]:
    """Return a record for every tag of either side, by falling power."""
    if a.returns is None and b.returns is None:
        return []
    pair = _Pair.of(a, b, "tag")
    names = {int(tag): tag.name for tag in SemanticTag}
    sights = {"a": _sight(a, "tag"), "b": _sight(b, "tag")}
    records = []
    for group, tag in enumerate(pair.grouping.keys):
        record = Record(tag=SemanticTag(int(tag)).name, **_levels(pair, group))
        if record["seen_by"] is not None:
            record = _with_budget(record, pair, group)
            records.append(_judge(record, pair, group, a, b, names, sights, many=True))
    return _by_power(records)


def _by_power(records: list[Record]) -> list[Record]:
    return sorted(records, key=lambda r: -max(v for v in (r["power_db_a"], r["power_db_b"]) if v is not None))


def _levels(pair: _Pair, group: int) -> dict[str, Any]:
    """Return both levels, their difference, and who sees the group; None where nobody does."""
    a, b = (_level(float(p[group])) for p in pair.power)
    who = ("both" if b is not None else "a") if a is not None else "b" if b is not None else None
    delta = None if a is None or b is None else b - a
    return {"power_db_a": a, "power_db_b": b, "delta_db": delta, "seen_by": who}


def _level(power: float) -> float | None:
    return 10 * math.log10(power) if power > 0 else None


def _sight(side: Side, by: str) -> Sight | None:
    s = side.scatterers
    if s is None or side.origin is None:
        return None
    first = np.ones(len(s), dtype=bool) if s.bounces is None else s.bounces <= 1
    return Sight(s.position[first], getattr(s, by)[first], side.origin)


def _object(
    pair: _Pair, group: int, a: Side, b: Side, names: dict[int, str], sights: dict[str, Sight | None]
) -> Record | None:
    number = int(pair.grouping.keys[group])
    levels = _levels(pair, group)
    if levels["seen_by"] is None:
        return None
    tags = [_tag(side, number) for side in (a, b)]
    record = Record(
        id=number,
        name=names.get(number, f"object {number}" if number else "static"),
        tag=tags[0] or tags[1],
        tag_a=tags[0],
        tag_b=tags[1],
        **levels,
        detected_a=_detected(a, number),
        detected_b=_detected(b, number),
        position_m=_center(a, b, number),
    )
    record = _with_budget(record, pair, group)
    return _judge(record, pair, group, a, b, names, sights, many=number == 0)


def _with_budget(record: Record, pair: _Pair, group: int) -> Record:
    """Add rows, area, cosine, range and coherent share of each side, and the terms of the difference."""
    for side, power, coherent in zip("ab", pair.power, pair.coherent, strict=True):
        record[f"coherent_share_{side}"] = float(coherent[group] / power[group]) if power[group] > 0 else None
    if pair.budgets is not None:
        for side, budget, coherent in zip("ab", pair.budgets, pair.coherent, strict=True):
            seen = bool(budget.rows[group])
            record[f"rows_{side}"] = int(budget.rows[group])
            record[f"area_m2_{side}"] = float(budget.area[group])
            record[f"mean_cosine_{side}"] = float(budget.cosine[group]) if seen else None
            record[f"nearest_m_{side}"] = float(budget.nearest[group]) if seen else None
            record[f"mean_range_m_{side}"] = float(budget.mean_range[group]) if seen else None
            shares = {k: float(v[group]) for k, v in budget.shares.items() if v[group] > 0}
            record[f"mirror_dbw_{side}"] = _level(float(budget.mirror[group] + coherent[group]))
            record[f"materials_{side}"] = Record(sorted(shares.items(), key=lambda kv: -kv[1]))
    record["terms_db"] = pair.terms(group)
    return record


def _judge(
    record: Record,
    pair: _Pair,
    group: int,
    a: Side,
    b: Side,
    names: dict[int, str],
    sights: dict[str, Sight | None],
    *,
    many: bool,
) -> Record:
    """Add the cause, and what was seen of the group from the side that has less of it."""
    poor = _poor_side(record)
    poor_side, rich_side = (a, b) if poor == "a" else (b, a)
    sight = _seen(rich_side, int(pair.grouping.keys[group]), pair.grouping.by, sights[poor], names)
    rows = int(record.get(f"rows_{poor}", 0))
    if record["delta_db"] is None:
        causes = ["not_simulated"]
        if poor_side.returns is not None:
            causes = blind_verdict(poor_side.viewer, sight, rows, pair.models[0] == pair.models[1])
        record.update(cause=causes[0], also=causes[1:], meaning=CAUSES[causes[0]])
    else:
        facts: dict[str, Any] = {
            "rows_poor": rows,
            "sight": sight,
            "viewer_poor": poor_side.viewer,
            "tags_differ": record.get("tag_a") != record.get("tag_b"),
            "many": many,
            "probability": min(float(p[group]) for p in pair.probability),
        }
        record.update(level_verdict(record["delta_db"], record["terms_db"], pair.fluctuation_db(group), facts))
    record["sight"] = None if sight is None else Record(sight, from_side=poor)
    return record


def _seen(rich: Side, key: int, by: str, look: Sight | None, names: dict[int, str]) -> Record | None:
    """Return what the poorer side's rays met on the way to the richer side's points of a group."""
    s = rich.scatterers
    if look is None or s is None:
        return None
    mine = getattr(s, by) == key
    points = s.position[mine if s.bounces is None else mine & (s.bounces <= 1)]
    return look.of(points[:: max(1, len(points) // _SIGHT_POINTS)], key, names) if len(points) else None


def _poor_side(record: Record) -> str:
    """Return the side that has less of the object: no echo, or less area."""
    if record["seen_by"] != "both":
        return "b" if record["seen_by"] == "a" else "a"
    return "a" if record.get("area_m2_a", 0.0) < record.get("area_m2_b", 0.0) else "b"


def _tag(side: Side, number: int) -> str | None:
    """Return the tag of most of the object's rows."""
    source = side.scatterers if side.scatterers is not None else side.returns
    if source is None:
        return None
    tags = source.tag[source.object_id == number]
    return SemanticTag(int(np.bincount(tags).argmax())).name if len(tags) else None


def _detected(side: Side, number: int) -> bool | None:
    found = side.detections
    return bool(np.any(found.object_id == number)) if isinstance(found, Detections) else None


def _center(a: Side, b: Side, number: int) -> list[float] | None:
    """Return the middle of the object's rows, in the radar frame [m]."""
    for side in (a, b):
        if side.scatterers is not None:
            rows = side.scatterers.object_id == number
            if rows.any():
                return [float(v) for v in np.median(side.scatterers.position[rows], axis=0)]
    return None
