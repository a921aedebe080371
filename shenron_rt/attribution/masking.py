"""Whether something else hides an object in the cube: shown by taking it out and detecting again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .._typing import FloatArray
from ..dsp import noise_threshold
from .cells import Look
from .contributions import Contributions
from .echoes import MAIN_LOBE_BINS, middle_of, near_cell
from .records import Share, Verdict
from .remedies import found_in, process_remedy, unfolding_remedy, waveform_remedy
from .sources import Case
from .waterfall import db

__all__ = ["masked", "shares"]

#: Others that are taken out one by one.
_TRIED = 3
#: Echoes within the main lobe with this part of what another object leaves in the cell make it a neighbour.
_NEIGHBOUR = 0.1
#: Another object that leaves this part of the object's own power in its cell fills it.
_FILLS = 0.25


def shares(
    contributions: Contributions, look: Look, others: list[int], own: int, names: Mapping[int, str]
) -> tuple[Share, ...]:
    """Return the share of every object, and of noise, in a cell and in its threshold; strongest first."""
    cube, at = contributions.cube, (look.row, look.column)

    def share(number: int, name: str, power: FloatArray, threshold: FloatArray) -> Share:
        return Share(number, name, db(float(power[at])) + 30, db(float(threshold[at])) + 30)

    rows = [
        share(i, names.get(i, f"object {i}"), contributions.map_of(i), contributions.threshold_of(i))
        for i in [own, *others]
    ]
    noise = np.full(cube.range_doppler.shape, cube.noise_power_w)
    level = noise_threshold(cube, pfa=cube.profile.processing.pfa, power=noise)
    rows.append(share(-1, "noise", noise, level))
    return tuple(sorted(rows, key=lambda s: -max(s.cell_dbm, s.threshold_dbm)))


@dataclass(frozen=True)
class _Masker:
    """What masks an object, and how: ``cell``, ``side lobe``, ``threshold`` or ``ambiguous``."""

    object_id: int
    name: str
    how: str
    alone: bool
    cell_db: float
    threshold_db: float
    velocity_mps: float


def masked(case: Case, contributions: Contributions, object_id: int, look: Look, others: list[int]) -> Verdict | None:
    """Return the verdict on an object that is over the threshold of noise and yet not detected.

    Returns
    -------
    Verdict or None
        ``None`` where it is not found without the others either.
    """
    if not others or not found_in(contributions.alone(object_id), object_id):
        return None
    masker = _masker(case, contributions, object_id, look, others)
    own = db(contributions.map_of(object_id)[look.row, look.column])
    mine = middle_of(contributions.returns_of(object_id))
    numbers = {
        "own_dbm": own + 30,
        "masker_in_cell_db": masker.cell_db,
        "masker_in_threshold_db": masker.threshold_db,
        "true_velocity_mps": mine.velocity_mps,
        "folded_velocity_mps": look.velocity_mps,
        "masker_velocity_mps": masker.velocity_mps,
        "max_velocity_mps": case.cube.profile.max_velocity_mps,
        "found_without": [masker.name] if masker.alone else ["all others"],
    }
    if masker.how == "ambiguous":
        text = (
            f"ambiguous in Doppler: {mine.velocity_mps:+.1f} m/s and {masker.name}'s {masker.velocity_mps:+.1f} m/s "
            f"fold into the same cells (v_max {case.cube.profile.max_velocity_mps:.1f} m/s)"
        )
        fastest = max(mine.velocity_mps, masker.velocity_mps, key=abs)
        change = unfolding_remedy(case, object_id, fastest)
        return Verdict("ambiguous in Doppler", text, numbers, change, masker.name)
    phrase = {
        "cell": f"masked by {masker.name}, which shares its cell {masker.cell_db:+.1f} dB stronger",
        "side lobe": f"masked by {masker.name}'s side lobe, {masker.cell_db:+.1f} dB over it in its cell",
        "threshold": f"masked by {masker.name}, which lifts the threshold there {masker.threshold_db:+.1f} dB over it",
    }[masker.how]
    return Verdict("masked", phrase, numbers, _remedy(case, object_id, masker), masker.name)


def _masker(case: Case, contributions: Contributions, own: int, look: Look, others: list[int]) -> _Masker:
    """Return what masks: the strongest neighbour whose removal alone suffices, else the strongest."""
    ranked = sorted(others, key=lambda i: -max(_levels(contributions, look, i)))
    alone = next((i for i in ranked[:_TRIED] if found_in(contributions.without([i]), own)), None)
    first = ranked[0] if alone is None else alone
    in_cell, in_threshold = _levels(contributions, look, first)
    mine = contributions.map_of(own)[look.row, look.column]
    name = case.names.get(first, f"object {first}")
    theirs = contributions.returns_of(first)
    near_range, near_doppler = near_cell(look, theirs)
    near = near_range & near_doppler
    power = np.abs(theirs.amplitude) ** 2
    velocity = middle_of(theirs).velocity_mps
    how = "side lobe"
    if in_cell < _FILLS * mine:
        how = "threshold"
    elif float(power[near].sum()) >= _NEIGHBOUR * in_cell:
        how = "ambiguous" if _only_folded(contributions, own, first) else "cell"
    return _Masker(first, name, how, alone is not None, db(in_cell / mine), db(in_threshold / mine), velocity)


def _levels(contributions: Contributions, look: Look, number: int) -> tuple[float, float]:
    """Return an object's strongest power in the cells around one, and what it adds to the threshold there [W]."""
    power = contributions.map_of(number)
    n_range, n_velocity = power.shape
    rows = np.clip(look.row + np.arange(-1, 2), 0, n_range - 1)
    columns = (look.column + np.arange(-1, 2)) % n_velocity
    level = contributions.threshold_of(number)[look.row, look.column]
    return float(power[np.ix_(rows, columns)].max()), float(level)


def _only_folded(contributions: Contributions, own: int, other: int) -> bool:
    """Tell whether two objects share a cell only because their velocities fold."""
    p = contributions.cube.profile
    mine, theirs = (middle_of(contributions.returns_of(i)).velocity_mps for i in (own, other))
    lobe = MAIN_LOBE_BINS[contributions.cube.doppler_window] * p.velocity_resolution_mps
    folds = max(abs(mine), abs(theirs)) >= p.max_velocity_mps
    return folds and abs(mine - theirs) > 2 * lobe


def _remedy(case: Case, object_id: int, masker: _Masker) -> str:
    """Return the first change that was tried and works; taking the other away always does."""
    away = f"take {masker.name} away: tried, it is detected then"
    if not masker.alone:
        away = "take its neighbours away: tried, it is detected then"
    return process_remedy(case, object_id) or waveform_remedy(case, object_id) or away
