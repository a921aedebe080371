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

from .budget import Budget

__all__ = ["terms_db"]

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
