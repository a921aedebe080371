"""What an object's power is made of: a difference of two powers splits into causes without a rest.

For the rows i of an object, with area A, backscatter s, distance R and link L = Pt Gt Gr / losses, the power expected
is
    E = lambda^2 / (4 pi)^3 * sum A_i s_i L_i / R_i^4,

and the power received is P; M is the mirror-like part: what the coherent echoes add up to, or, of LiDAR points, what
geometric optics expects. In dB, from side A to side B,

    10 log10(P_B / P_A) = coverage + incidence + material + surfaces + range + beam + profile + weather
                          + mirror + speckle

where each term belongs to one factor: the area; the cosines at which it is seen; what it is made of; which materials
lie at which cosines; R^-4; the antenna pattern (all weighted means over the object's rows); the profile; the weather;
and speckle is the rest, P / (E + M), the draw. The sum E + M splits by logarithmic means: M takes
(M_B - M_A) / L(E_B + M_B, E_A + M_A) nepers, L(x, y) = (x - y) / ln(x / y), and each factor of E counts with weight
L(E_B, E_A) / L(E_B + M_B, E_A + M_A), so that what changes a negligible part explains nothing. Where the echo models
differ all of the difference is the term model. Where both are another one than ``physical`` the weight is 1 and the
last two terms are one, rest: E is not their formula.
Points of given RCS count with area = RCS and s = 1.

References
----------
B. W. Ang, "The LMDI approach to decomposition analysis: a practical guide", Energy Policy 33 (2005) 867-871.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .._typing import BoolArray, FloatArray, IntArray
from ..constants import FOUR_PI_CUBED
from ..echo.link import link_amplitude
from ..frames import spherical
from ..scatterers import Scatterers
from .sides import Side
from .surfaces import COSINES, Palette, material_index, mirror_sigma0

if TYPE_CHECKING:
    from ..config.profile import RadarProfile
    from ..returns import Returns

__all__ = ["Budget", "Grouping", "budget_of", "draw_probability", "received", "terms_db"]

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
    """Sums over the rows of each group, (g,) each, of one side.

    Parameters
    ----------
    rows : int
    area, backscatter, spread, patterned, profiled, expected : float
        sum A; sum A s; sum A s / R^4; with the pattern of the common profile; of the own; with the weather [W].
    mirror : float
        Expected mirror-like part of rows with normals and no footprints [W].
    looks : float
        Independent echoes of the same power that fluctuate as ``expected + mirror`` do, (sum p)^2 / sum p^2.
    fluctuation_db : float
        Standard deviation that speckle gives the level of ``expected + mirror``.
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
    looks: FloatArray
    fluctuation_db: FloatArray
    mean_range: FloatArray
    nearest: FloatArray
    cosine: FloatArray
    shares: dict[str, FloatArray]
    curves: dict[str, FloatArray]


def received(returns: Returns, scatterers: Scatterers | None, grouping: Grouping) -> tuple[FloatArray, ...]:
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
    sigma, shares = _surfaces(side, grouping, index, np.where(given, 0.0, area), palette, keys)
    sigma = np.where(given, 1.0, sigma)
    means = {k: np.interp(s.cos_incidence, COSINES, curve) for k, curve in palette.curves.items()}
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
    total_random = grouping.sum(index, random)
    looks = np.maximum(_ratio(total_random**2, grouping.sum(index, random**2)), 1.0)
    share = _ratio(total_random, sums["expected"] + sums["mirror"])
    nearest = np.full(len(grouping.keys), np.inf)
    np.minimum.at(nearest, index, s.range)
    return Budget(
        rows=np.bincount(index, minlength=len(grouping.keys)),
        **sums,
        looks=looks,
        fluctuation_db=_fluctuation_db(looks) * share,
        mean_range=_ratio(grouping.sum(index, scattered * s.range), sums["backscatter"]),
        nearest=nearest,
        cosine=_ratio(grouping.sum(index, area * s.cos_incidence), total),
        shares=shares,
        curves=curves,
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
    side: Side, grouping: Grouping, index: IntArray, area: FloatArray, palette: Palette, keys: dict[str, str]
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return (n,) sigma0 of every row, and the area of each material by group."""
    s = side.scatterers
    assert s is not None
    names, number = material_index(side)
    sigma, areas = np.zeros(len(s)), {}
    for name, key in keys.items():
        here = number == names.index(name)
        sigma[here] = np.interp(s.cos_incidence[here], COSINES, palette.curves[key])
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


_NEPER_DB = 10 / math.log(10)
_DIFFUSE = ("coverage", "incidence", "material", "surfaces", "range", "beam", "profile", "weather")


def terms_db(
    a: tuple[Budget, float, float], b: tuple[Budget, float, float], group: int, *, models: tuple[str, str]
) -> dict[str, float] | None:
    """Return the terms of one group, B over A; they add up to the difference of its levels.

    Parameters
    ----------
    a, b : (Budget, received power [W], coherent power [W])
    group : int
    models : (str, str)
        Echo models of the sides.

    Returns
    -------
    dict of str to float or None
        None where a side has nothing.
    """
    (x, p_a, c_a), (y, p_b, c_b) = a, b
    factors = ("area", "backscatter", "spread", "patterned", "profiled", "expected")
    values = [[float(getattr(budget, f)[group]) for f in factors] for budget in (x, y)]
    e_a, e_b = values[0][-1], values[1][-1]
    m_a, m_b = c_a + float(x.mirror[group]), c_b + float(y.mirror[group])
    if min(e_a + m_a, e_b + m_b, p_a, p_b) <= 0:
        return None
    if models[0] != models[1]:
        return {"model": _db(p_b / p_a)}
    physical = models[0] == "physical"
    terms = dict.fromkeys(_DIFFUSE, 0.0)
    whole = _log_mean(e_b + m_b, e_a + m_a)
    if min(e_a, e_b) > 0:
        weight = _log_mean(e_b, e_a) / whole if physical else 1.0
        terms = {name: value * weight for name, value in _diffuse_terms(x, y, values, group).items()}
    elif physical:  # metal has no diffuse part: on one side, or on both
        terms["coverage"] = _NEPER_DB * (e_b - e_a) / whole
    if not physical:
        return terms | {"rest": _db(p_b / p_a) - sum(terms.values())}
    terms["mirror"] = _NEPER_DB * (m_b - m_a) / whole
    terms["speckle"] = _db(p_b / (e_b + m_b)) - _db(p_a / (e_a + m_a))
    return terms


def _diffuse_terms(x: Budget, y: Budget, values: list[list[float]], group: int) -> dict[str, float]:
    """Return how the expected diffuse powers differ, factor by factor [dB]."""
    steps = [[_db(v[i + 1] / v[i]) for i in range(5)] for v in values]
    d_sigma, d_range, d_beam, d_profile, d_weather = (q - p for p, q in zip(*steps, strict=True))
    incidence, material = _incidence_and_material(x, y, group)
    return {
        "coverage": _db(values[1][0] / values[0][0]),
        "incidence": incidence,
        "material": material,
        "surfaces": d_sigma - incidence - material,
        "range": d_range,
        "beam": d_beam,
        "profile": d_profile,
        "weather": d_weather,
    }


def _log_mean(x: float, y: float) -> float:
    """Return (x - y) / ln(x / y), the logarithmic mean of two positive numbers; x where they are equal."""
    difference = (x - y) / y
    # the quotient loses its digits where x is near y; there its series has them
    return y * (1 + difference / 2) if abs(difference) < 1e-6 else (x - y) / math.log(x / y)


def _incidence_and_material(a: Budget, b: Budget, group: int) -> tuple[float, float]:
    """Return what the cosines alone and the materials alone change, each the mean over the two orders of changing."""

    def mean(view: Budget, made: Budget) -> float:
        """Mean sigma0 of what ``made`` consists of, at the cosines of ``view``."""
        return sum(float(share[group] * view.curves[name][group]) for name, share in made.shares.items())

    aa, ab, ba, bb = mean(a, a), mean(a, b), mean(b, a), mean(b, b)
    if min(aa, ab, ba, bb) <= 0:
        return 0.0, 0.0
    return (_db(ba / aa) + _db(bb / ab)) / 2, (_db(ab / aa) + _db(bb / ba)) / 2


def _db(ratio: float) -> float:
    return 10 * math.log10(ratio)
