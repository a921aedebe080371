"""Which cause explains an object's difference, as far as the data of both sides prove one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from .record import Record

__all__ = ["CAUSES", "MIN_POINTS", "blind_verdict", "level_verdict"]

#: LiDAR points below which an object's area is a guess: its sampling error 1/sqrt(n) exceeds 0.8 dB.
MIN_POINTS = 30
#: Levels nearer than this agree [dB].
_AGREES_DB = 1.0
#: A cause is proven when what it predicts leaves at most this share of the difference.
_REST = 0.5
#: Share of the difference, at least 1 dB, below which a further cause is not worth its name.
_WORTH = 0.1
#: Share of an object's points that must be hidden for "hidden" to be the cause.
_HIDDEN = 0.5
_FEW_SIGMA = 2.0
#: A draw of the speckle rarer than this is not taken for one; three of a thousand objects are.
_PROBABLE = 0.003

#: What each cause says.
CAUSES = {
    "agrees": "levels agree within 1 dB or twice what speckle does",
    "hidden_from_lidar": "the LiDAR's own points stand between it and the object",
    "hidden_from_radar": "the radar's own rays end before the object",
    "outside_lidar_view": "no ray of the LiDAR goes there",
    "outside_radar_view": "no ray of the radar goes there",
    "not_there": "rays of that side go through the place: the object is not in its data, or stands elsewhere",
    "other_label": "that side has a surface there, under another object id",
    "too_few_points": f"fewer than {MIN_POINTS} rows stand for the object on one side",
    "different_surfaces": "the sides see different parts or areas of the object",
    "incidence": "seen under other angles; sigma0 at both sides' cosines predicts the difference",
    "material": "made of another material",
    "tag": "tagged differently, and so made of another material",
    "surface_mix": "which material lies at which angle differs",
    "range": "at another range",
    "beam": "at other angles in the antenna pattern",
    "profile": "other transmit power, gain, pattern, losses or wavelength",
    "weather": "other weather",
    "mirror_part": "the mirror-like part differs: coherent on one side, none or expected from points on the other",
    "model": "the echo models differ",
    "speckle": "a draw of the speckle",
    "not_simulated": "the object is only in one side's data",
    "unexplained": "nothing in the data of the two sides proves a cause",
}

_TERM_CAUSE = {
    "coverage": "different_surfaces", "incidence": "incidence", "material": "material", "surfaces": "surface_mix",
    "range": "range", "beam": "beam", "profile": "profile", "weather": "weather", "mirror": "mirror_part",
    "model": "model", "speckle": "speckle",
}  # fmt: skip


#: Terms that, of many things at once, only say that the sides see different ones.
_WHICH_PART = ("coverage", "material", "surfaces", "range", "beam")


def level_verdict(
    delta_db: float, terms: Mapping[str, float] | None, fluctuation_db: float, facts: Mapping[str, Any]
) -> Record:
    """Return the cause of a difference of two levels.

    Parameters
    ----------
    delta_db : float
        B over A.
    terms : mapping or None
        What it is made of, of :func:`shenron_rt.comparison.budget.terms_db`; they add up to ``delta_db``.
    fluctuation_db : float
        Standard deviation of ``delta_db`` by speckle.
    facts : mapping
        ``rows_poor``, ``sight`` (of the side with less area onto the other's points), ``viewer_poor``, ``tags_differ``,
        ``probability`` of the rarer of the two speckle draws; ``many``: the group is many things (all that is static, a
        tag), of which each side may see others.

    Returns
    -------
    Record
        ``cause``, ``also`` (further causes needed), ``explained_db``, ``unexplained_db``, ``tolerance_db``.
    """
    tolerance = max(_AGREES_DB, _FEW_SIGMA * fluctuation_db)
    if abs(delta_db) <= tolerance:
        return _record("agrees", [], delta_db, 0.0, tolerance)
    if terms is None:
        return _record("unexplained", [], delta_db, 0.0, tolerance)
    if facts.get("many") and "coverage" in terms:
        parts = sum(terms[k] for k in _WHICH_PART)
        terms = {"coverage": parts} | {k: v for k, v in terms.items() if k not in _WHICH_PART}
    sign = math.copysign(1.0, delta_db)
    # a draw that speckle does not make is no explanation, and neither is the rest of a formula that is not ours
    probable = facts.get("probability", 1.0) >= _PROBABLE
    usable = {k: v for k, v in terms.items() if k != "rest" and (k != "speckle" or probable)}
    order = sorted((k for k in usable if sign * usable[k] > 0), key=lambda k: -sign * usable[k])
    explained = sum(v for v in usable.values() if sign * v < 0)
    chosen: list[str] = []
    for name in order:
        if abs(delta_db - explained) <= tolerance:
            break
        chosen.append(name)
        explained += usable[name]
    if not chosen or abs(delta_db - explained) > max(tolerance, _REST * abs(delta_db)):
        return _record("unexplained", [], delta_db, explained, tolerance)
    worth = max(_AGREES_DB, _WORTH * abs(delta_db))
    causes = list(
        dict.fromkeys(_cause(name, facts) for name in chosen if name == chosen[0] or abs(usable[name]) >= worth)
    )
    if "mirror_part" in causes and facts.get("rows_poor", MIN_POINTS) < MIN_POINTS:
        causes.append("too_few_points")  # so few that no point need lie where the surface is a mirror
    return _record(causes[0], causes[1:], delta_db, explained, tolerance)


def _cause(term: str, facts: Mapping[str, Any]) -> str:
    if term == "material" and facts.get("tags_differ"):
        return "tag"
    if term != "coverage":
        return _TERM_CAUSE[term]
    sight = facts.get("sight")
    viewer = facts.get("viewer_poor", "radar")
    if sight is not None and sight["behind_other"] >= _HIDDEN:
        return f"hidden_from_{viewer}"
    if sight is not None and sight["no_ray"] >= _HIDDEN:
        return f"outside_{viewer}_view"
    if facts.get("rows_poor", MIN_POINTS) < MIN_POINTS:
        return "too_few_points"
    return "different_surfaces"


def blind_verdict(viewer: str, sight: Mapping[str, Any] | None, rows: int, same_model: bool) -> list[str]:
    """Return why a side has no echo of an object that the other side sees: the causes that half of it needs.

    Parameters
    ----------
    viewer : str
        ``"lidar"`` or ``"radar"``: what looked on the side that has none.
    sight : mapping or None
        Of :meth:`shenron_rt.comparison.sight.Sight.of`, from that side onto the other's points; None where it is not
        known from where it looked.
    rows : int
        Scatterers of the object on that side: with some, its surface is seen but gives nothing.
    same_model : bool
        Both sides are ``physical``, where a surface without diffuse echo has its mirror part alone.
    """
    if rows:
        return ["mirror_part" if same_model else "model"]
    if sight is None:
        return ["unexplained"]
    reasons = {
        f"hidden_from_{viewer}": sight["behind_other"],
        f"outside_{viewer}_view": sight["no_ray"],
        "other_label": sight["other_label"],
        "not_there": sight["through"],
    }
    causes: list[str] = []
    for cause in sorted(reasons, key=lambda k: -reasons[k]):
        causes.append(cause)
        if sum(reasons[c] for c in causes) >= _HIDDEN:
            return causes
    return ["unexplained"]


def _record(cause: str, also: list[str], delta_db: float, explained_db: float, tolerance_db: float) -> Record:
    rest = delta_db - explained_db if cause != "agrees" else delta_db
    return Record(
        cause=cause, also=also, explained_db=explained_db, unexplained_db=rest, tolerance_db=tolerance_db,
        meaning=CAUSES[cause],
    )  # fmt: skip
