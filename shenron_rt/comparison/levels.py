"""Levels of every object, or of every tag, on both sides and what they are made of: one frame, or the mean of many."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._typing import FloatArray, IntArray
from ..dsp import Detections
from ..tags import SemanticTag
from .budget import Budget, Grouping, budget_of, draw_probability, pool_budgets, received
from .record import Record
from .sides import Side
from .sight import Sight, pool_sights
from .surfaces import Palette
from .terms import terms_db

__all__ = ["Facts", "Levels"]

#: Points of an object whose line of sight is looked at; more change no share by over a percent.
_SIGHT_POINTS = 2000
#: Powers of a group: received, its coherent surface echoes alone, its incoherent ones.
_Powers = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class Facts:
    """What is known of one group beside its powers; pairs are of sides A and B.

    Parameters
    ----------
    tags : (str or None, str or None)
        Of most of its rows.
    detected : (int or None, int or None)
        Frames in which it was detected.
    position : list of float or None
        Middle of its rows, radar frame [m].
    sight : (Record or None, Record or None)
        What the rays of that side met on the way to the other side's points.
    """

    tags: tuple[str | None, str | None]
    detected: tuple[int | None, int | None]
    position: list[float] | None
    sight: tuple[Record | None, Record | None]


@dataclass(frozen=True)
class Levels:
    """Both sides over one grouping; powers are means over the frames [W].

    Parameters
    ----------
    grouping : Grouping
    powers : (powers of A, powers of B)
        Each (g,) received, coherent, incoherent.
    budgets : (Budget, Budget) or None
    models : (str, str)
        Echo models.
    facts : mapping of int to Facts
        By key.
    frames : int
    """

    grouping: Grouping
    powers: tuple[_Powers, _Powers]
    budgets: tuple[Budget, Budget] | None
    models: tuple[str, str]
    facts: Mapping[int, Facts]
    frames: int = 1

    @classmethod
    def of(cls, a: Side, b: Side, by: str, palette: Palette | None, names: Mapping[int, str]) -> Levels:
        """Return the levels of one frame.

        Parameters
        ----------
        a, b : Side
        by : str
            ``"object_id"`` or ``"tag"``.
        palette : Palette or None
            None where a side has no surfaces to make a budget of.
        names : mapping of int to str
            Of the groups, for what hides others.
        """
        found = [getattr(s, by) for side in (a, b) for s in (side.scatterers, side.returns) if s is not None]
        grouping = Grouping(np.unique(np.concatenate(found).astype(np.int64)), by)
        none = np.zeros(len(grouping.keys))
        powers = [
            (none, none, none) if s.returns is None else received(s.returns, s.scatterers, grouping) for s in (a, b)
        ]
        budgets = None
        if palette is not None and a.profile is not None and has_surfaces(a) and has_surfaces(b):
            budgets = (
                budget_of(a, a.profile, grouping, palette, palette.of_a),
                budget_of(b, a.profile, grouping, palette, palette.of_b),
            )
        looks = [_sight(side, by) for side in (a, b)]
        facts = {int(key): _facts(a, b, int(key), by, looks, names) for key in grouping.keys}
        models = ["" if s.returns is None else s.returns.model for s in (a, b)]
        return cls(grouping, (powers[0], powers[1]), budgets, (models[0], models[1]), facts)

    @classmethod
    def pool(cls, frames: Sequence[Levels]) -> Levels:
        """Return the mean over frames: linear powers, sums of the budgets; what is absent in a frame counts as 0."""
        if len(frames) == 1:
            return frames[0]
        keys = np.unique(np.concatenate([f.grouping.keys for f in frames]))
        at = [np.searchsorted(keys, f.grouping.keys) for f in frames]
        budgets = None
        if all(f.budgets is not None for f in frames):
            of_a, of_b = zip(*(f.budgets for f in frames if f.budgets is not None), strict=True)
            budgets = (pool_budgets(of_a, at, len(keys)), pool_budgets(of_b, at, len(keys)))
        powers_a, powers_b = (_mean([f.powers[side] for f in frames], at, len(keys)) for side in (0, 1))
        known = {int(key): _pool_facts([f.facts[int(key)] for f in frames if int(key) in f.facts]) for key in keys}
        return cls(
            grouping=Grouping(keys, frames[0].grouping.by),
            powers=(powers_a, powers_b),
            budgets=budgets,
            models=frames[0].models,
            facts=known,
            frames=len(frames),
        )

    def terms(self, group: int) -> dict[str, float] | None:
        """Return what the difference of a group's levels is made of [dB]; None where that is not known."""
        if self.budgets is None:
            return None
        a, b = (
            (budget, float(power[0][group]), float(power[1][group]))
            for budget, power in zip(self.budgets, self.powers, strict=True)
        )
        return terms_db(a, b, group, models=self.models)

    def fluctuation_db(self, group: int) -> float:
        """Return the standard deviation of the level difference by speckle; a strong coherent echo steadies a level."""
        if self.budgets is None:
            return 0.0
        variance = 0.0
        for budget, power in zip(self.budgets, self.powers, strict=True):
            expected = float(budget.expected[group] + budget.mirror[group])
            steady = expected / (expected + float(power[1][group])) if expected > 0 else 0.0
            variance += (steady * float(budget.fluctuation_db[group])) ** 2
        return math.sqrt(variance)

    def probability(self, group: int) -> float:
        """Return how probable the rarer of the two speckle draws is."""
        if self.budgets is None:
            return 1.0
        draws = [draw_probability(b, p[2])[group] for b, p in zip(self.budgets, self.powers, strict=True)]
        return float(min(draws))


def has_surfaces(side: Side) -> bool:
    """Return whether a budget can be made of a side."""
    s = side.scatterers
    return s is not None and side.returns is not None and len(s) > 0 and (s.area is not None or s.rcs is not None)


def _mean(frames: Sequence[_Powers], at: Sequence[IntArray], size: int) -> _Powers:
    """Return the mean powers of a side over frames whose groups are at these places among all."""
    total = np.zeros((3, size))
    for powers, place in zip(frames, at, strict=True):
        total[:, place] += np.stack(powers)
    whole, coherent, incoherent = total / len(frames)
    return whole, coherent, incoherent


# ---- beside the powers
def _sight(side: Side, by: str) -> Sight | None:
    s = side.scatterers
    if s is None or side.origin is None:
        return None
    first = np.ones(len(s), dtype=bool) if s.bounces is None else s.bounces <= 1
    return Sight(s.position[first], getattr(s, by)[first], side.origin)


def _facts(a: Side, b: Side, key: int, by: str, looks: Sequence[Sight | None], names: Mapping[int, str]) -> Facts:
    """Return what one frame says of a group."""
    sight = [_seen(rich, key, by, look, names) for rich, look in zip((b, a), looks, strict=True)]
    if by == "tag":
        return Facts((None, None), (None, None), None, (sight[0], sight[1]))
    return Facts(
        tags=(_tag(a, key), _tag(b, key)),
        detected=(_detected(a, key), _detected(b, key)),
        position=_center(a, b, key),
        sight=(sight[0], sight[1]),
    )


def _pool_facts(facts: Sequence[Facts]) -> Facts:
    def both(name: str) -> list[list[Any]]:
        return [[v for v in (getattr(f, name)[side] for f in facts) if v is not None] for side in (0, 1)]

    tags = [Counter(values).most_common(1)[0][0] if values else None for values in both("tags")]
    detected = [sum(values) if values else None for values in both("detected")]
    sight = [pool_sights(values) if values else None for values in both("sight")]
    return Facts(
        tags=(tags[0], tags[1]),
        detected=(detected[0], detected[1]),
        position=next((f.position for f in facts if f.position is not None), None),
        sight=(sight[0], sight[1]),
    )


def _seen(rich: Side, key: int, by: str, look: Sight | None, names: Mapping[int, str]) -> Record | None:
    """Return what one side's rays met on the way to the other side's points of a group."""
    s = rich.scatterers
    if look is None or s is None:
        return None
    mine = getattr(s, by) == key
    points = s.position[mine if s.bounces is None else mine & (s.bounces <= 1)]
    return look.of(points[:: max(1, len(points) // _SIGHT_POINTS)], key, names) if len(points) else None


def _tag(side: Side, number: int) -> str | None:
    source = side.scatterers if side.scatterers is not None else side.returns
    if source is None:
        return None
    tags = source.tag[source.object_id == number]
    return SemanticTag(int(np.bincount(tags).argmax())).name if len(tags) else None


def _detected(side: Side, number: int) -> int | None:
    found = side.detections
    return int(np.any(found.object_id == number)) if isinstance(found, Detections) else None


def _center(a: Side, b: Side, number: int) -> list[float] | None:
    for side in (a, b):
        if side.scatterers is not None:
            rows = side.scatterers.object_id == number
            if rows.any():
                return [float(v) for v in np.median(side.scatterers.position[rows], axis=0)]
    return None
