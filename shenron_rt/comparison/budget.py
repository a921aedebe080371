"""What an object's expected power is made of: sums over its rows, of one frame or the mean of many.

How two of them split the difference of two powers is in :mod:`shenron_rt.comparison.terms`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .._typing import BoolArray, FloatArray, IntArray
from ..constants import FOUR_PI_CUBED
from ..echo.link import link_amplitude
from ..echo.plane import across_share
from ..frames import spherical
from ..scatterers import Scatterers
from .sides import Side
from .surfaces import Palette, material_index, mirror_sigma0

if TYPE_CHECKING:
    from ..config.profile import RadarProfile
    from ..returns import Returns

__all__ = ["Budget", "Grouping", "budget_of", "draw_probability", "pool_budgets", "received"]

_POINT = "(given RCS)"
#: Two-way pattern down to which rays are cast; rows below it do not count as seen (power).
_EDGE = 1e-4


@dataclass(frozen=True)
class Grouping:
    """Rows to groups: by object, or by tag.

    Parameters
    ----------
    keys : (g,) int
        Ascending.
    by : str
        ``"object_id"`` or ``"tag"``.
    """

    keys: IntArray
    by: str

    def index(self, source: Scatterers | Returns) -> IntArray:
        """Return the group of every row."""
        keys: IntArray = getattr(source, self.by)
        return np.asarray(np.searchsorted(self.keys, keys.astype(np.int64)))

    def sum(self, index: IntArray, weight: FloatArray) -> FloatArray:
        """Return (g,) sums over the rows."""
        return np.asarray(np.bincount(index, weight, len(self.keys)), dtype=np.float64)


@dataclass(frozen=True)
class Budget:
    """Sums over the rows of each group, (g,) each, of one side; of several frames ``rows`` is all, the rest a mean.

    Parameters
    ----------
    rows : int
    area, backscatter, spread, patterned, profiled, expected : float
        sum A; sum A s; sum A s / R^4; with the pattern of the common profile; of the own; with the weather [W].
    mirror : float
        Expected mirror-like part of rows with normals and no footprints [W].
    random, squares : float
        Sum over the rows of what fluctuates of ``expected + mirror``, and of its squares.
    mean_range, nearest, cosine : float
        Range weighted by backscatter, of the nearest row (infinite without rows) [m]; cosine weighted by area.
    shares : dict of str to (g,) float
        Area share of each material.
    curves : dict of str to (g,) float
        Mean sigma0 of each material over the group's cosines, whatever the group is made of.
    """

    rows: IntArray
    area: FloatArray
    backscatter: FloatArray
    spread: FloatArray
    patterned: FloatArray
    profiled: FloatArray
    expected: FloatArray
    mirror: FloatArray
    random: FloatArray
    squares: FloatArray
    mean_range: FloatArray
    nearest: FloatArray
    cosine: FloatArray
    shares: dict[str, FloatArray]
    curves: dict[str, FloatArray]

    @property
    def looks(self) -> FloatArray:
        """Independent echoes of the same power that fluctuate as ``expected + mirror`` do, (sum p)^2 / sum p^2."""
        return np.maximum(_ratio(self.random**2, self.squares), 1.0)

    @property
    def fluctuation_db(self) -> FloatArray:
        """Standard deviation that speckle gives the level of ``expected + mirror``."""
        share = _ratio(self.random, self.expected + self.mirror)
        return np.asarray(_fluctuation_db(self.looks) * share, dtype=np.float64)


def received(
    returns: Returns, scatterers: Scatterers | None, grouping: Grouping
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (g,) received power, that of the coherent surface echoes alone, and that of the incoherent ones [W].

    Coherent echoes of one object add as phasors, as in :meth:`shenron_rt.Returns.power_by_object`; objects in power.
    """
    phasor = returns.amplitude * np.exp(2j * np.pi * returns.center_hz * returns.delay_s)
    given = np.zeros(len(returns), dtype=bool)
    if scatterers is not None and scatterers.rcs is not None:
        given = ~np.isnan(scatterers.rcs[returns.scatterer])
    pair = (returns.object_id.astype(np.int64) << 8) | (returns.tag if grouping.by == "tag" else 0)
    pairs, first, row = np.unique(pair, return_index=True, return_inverse=True)
    group = grouping.index(returns)[first]

    def coherent_power(rows: BoolArray) -> FloatArray:
        kept = np.where(rows, phasor, 0.0)
        re, im = np.bincount(row, kept.real, len(pairs)), np.bincount(row, kept.imag, len(pairs))
        return grouping.sum(group, np.asarray(re**2 + im**2, dtype=np.float64))

    speckle = grouping.sum(grouping.index(returns), np.where(returns.coherent, 0.0, np.abs(returns.amplitude) ** 2))
    return coherent_power(returns.coherent) + speckle, coherent_power(returns.coherent & ~given), speckle


def budget_of(side: Side, common: RadarProfile, grouping: Grouping, palette: Palette, keys: dict[str, str]) -> Budget:
    """Return the sums of one side; ``common`` is the profile whose pattern both sides are weighed with."""
    s, own = side.scatterers, side.profile
    assert s is not None
    assert own is not None
    index = grouping.index(s)
    given = np.zeros(len(s), dtype=bool) if s.rcs is None else ~np.isnan(s.rcs)
    area = np.nan_to_num(np.zeros(len(s)) if s.area is None else s.area)
    area = np.where(given, 0.0 if s.rcs is None else np.nan_to_num(s.rcs), area * _in_beam(s, common, own))
    total = grouping.sum(index, area)
    across = across_share(s, np.arange(len(s)), s.position / np.maximum(s.range, 1e-12)[:, None])
    means = {k: palette.sigma0(k, s.cos_incidence, across) for k in palette.curves}
    sigma, shares = _surfaces(side, grouping, index, np.where(given, 0.0, area), means, keys)
    sigma = np.where(given, 1.0, sigma)
    curves = {k: _ratio(grouping.sum(index, area * value), total) for k, value in means.items()}
    shares = {k: _ratio(v, total) for k, v in shares.items()}
    shares[_POINT] = _ratio(grouping.sum(index, np.where(given, area, 0.0)), total)
    curves[_POINT] = np.ones(len(grouping.keys))
    scattered = area * sigma
    spread = scattered / np.maximum(s.range, 1e-6) ** 4
    expected = spread * _gain(own, s, weather=True)
    columns = {
        "area": area, "backscatter": scattered, "spread": spread, "expected": expected,
        "mirror": area * mirror_sigma0(side) / np.maximum(s.range, 1e-6) ** 4 * _gain(own, s, weather=True),
        "patterned": spread * _gain(common, s, weather=False), "profiled": spread * _gain(own, s, weather=False),
    }  # fmt: skip
    sums = {name: grouping.sum(index, value) for name, value in columns.items()}
    random = np.where(given, 0.0, expected + columns["mirror"])
    nearest = np.full(len(grouping.keys), np.inf)
    np.minimum.at(nearest, index, s.range)
    return Budget(
        rows=np.bincount(index, minlength=len(grouping.keys)),
        **sums,
        random=grouping.sum(index, random),
        squares=grouping.sum(index, random**2),
        mean_range=_ratio(grouping.sum(index, scattered * s.range), sums["backscatter"]),
        nearest=nearest,
        cosine=_ratio(grouping.sum(index, area * s.cos_incidence), total),
        shares=shares,
        curves=curves,
    )


_SUMS = ("area", "backscatter", "spread", "patterned", "profiled", "expected", "mirror", "random")


def pool_budgets(budgets: Sequence[Budget], at: Sequence[IntArray], size: int) -> Budget:
    """Return the mean over frames; a frame without a group counts as 0 of it.

    Parameters
    ----------
    budgets : sequence of Budget
        One a frame, of the same materials.
    at : sequence of (g,) int
        Where each one's groups are among all.
    size : int
        Number of all groups.

    Notes
    -----
    Frames have speckle of their own, so the squares add: n frames of one look have n looks.
    """
    n = len(budgets)

    def total(values: Iterable[FloatArray]) -> FloatArray:
        out = np.zeros(size)
        for value, place in zip(values, at, strict=True):
            out[place] += value
        return out

    def weighted(values: Iterable[FloatArray], by: str) -> FloatArray:
        return _ratio(total(v * getattr(b, by) for v, b in zip(values, budgets, strict=True)), n * sums[by])

    sums = {name: total(getattr(b, name) for b in budgets) / n for name in _SUMS}
    nearest = np.full(size, np.inf)
    for budget, place in zip(budgets, at, strict=True):
        nearest[place] = np.minimum(nearest[place], budget.nearest)
    names = dict.fromkeys(name for b in budgets for name in b.shares)
    none = [np.zeros(len(place)) for place in at]
    return Budget(
        rows=total(b.rows for b in budgets).astype(np.int64),
        **sums,
        squares=total(b.squares for b in budgets) / n**2,
        mean_range=weighted((b.mean_range for b in budgets), "backscatter"),
        nearest=nearest,
        cosine=weighted((b.cosine for b in budgets), "area"),
        shares={k: weighted((b.shares.get(k, z) for b, z in zip(budgets, none, strict=True)), "area") for k in names},
        curves={k: weighted((b.curves[k] for b in budgets), "area") for k in budgets[0].curves},
    )


def _in_beam(s: Scatterers, *profiles: RadarProfile) -> BoolArray:
    """Return the rows that either pattern lights: a LiDAR sees all around, and what is behind the radar is no area."""
    _, azimuth, elevation = spherical(s.position)
    return np.asarray(np.any([p.pattern(azimuth, elevation) ** 2 >= _EDGE for p in profiles], axis=0))


def _gain(profile: RadarProfile, s: Scatterers, *, weather: bool) -> FloatArray:
    """Return (n,) Pt Gt Gr lambda^2 / ((4 pi)^3 losses) [W m^2]."""
    link = link_amplitude(profile, s.position, s.weather if weather else None)
    return np.asarray(link**2 * (profile.wavelength_m**2 / FOUR_PI_CUBED), dtype=np.float64)


def _surfaces(
    side: Side,
    grouping: Grouping,
    index: IntArray,
    area: FloatArray,
    means: dict[str, FloatArray],
    keys: dict[str, str],
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return (n,) sigma0 of every row, and the area of each material by group."""
    s = side.scatterers
    assert s is not None
    names, number = material_index(side)
    sigma, areas = np.zeros(len(s)), {}
    for i in np.unique(number):
        here, key = number == i, keys[names[i]]
        sigma[here] = means[key][here]
        areas[key] = grouping.sum(index, np.where(here, area, 0.0))
    return sigma, areas


def _fluctuation_db(looks: FloatArray) -> FloatArray:
    """Return the standard deviation of the level of so many exponential powers, 10/ln 10 sqrt(psi_1(n)) [dB]."""
    trigamma = 1 / looks + 1 / (2 * looks**2) + 1 / (6 * looks**3)  # asymptotic series, 1.3 % high at n = 1
    return np.asarray(10 / math.log(10) * np.sqrt(trigamma), dtype=np.float64)


def _ratio(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0)


def draw_probability(budget: Budget, incoherent: FloatArray) -> FloatArray:
    """Return (g,) how probable it is that speckle alone departs so far from its mean; 1 without incoherent echoes.

    The sum of n equal exponential powers over its mean is gamma distributed, shape n, scale 1/n; twice the
    smaller tail.
    """
    from scipy.special import gammainc

    mean = budget.expected + budget.mirror
    ratio = _ratio(incoherent, mean)
    below = gammainc(budget.looks, budget.looks * ratio)
    return np.where((mean > 0) & (incoherent > 0), 2 * np.minimum(below, 1 - below), 1.0)
