"""How well tracks tell the truth: OSPA of a set of places, identity over time."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from .._typing import FloatArray
from ..errors import InputError

__all__ = ["Identity", "Ospa", "identity_metrics", "ospa"]

#: One frame: place (2,) or (3,) of every thing by its id [m].
Places = Mapping[int, FloatArray]


class Ospa(NamedTuple):
    """OSPA distance [m] and what errors of place and of number have in it; total^p = place^p + number^p."""

    total: float
    place: float
    number: float


def ospa(estimates: FloatArray, truths: FloatArray, *, cutoff_m: float = 5.0, order: float = 1.0) -> Ospa:
    """Return the optimal sub-pattern assignment distance of two sets of places.

    Parameters
    ----------
    estimates, truths : (n, d), (m, d) float
        [m].
    cutoff_m : float
        c, what a missing or a surplus place costs, and the most that a wrong one can [m].
    order : float
        p >= 1.

    Returns
    -------
    Ospa
        0 where both sets are empty.

    Notes
    -----
    With m <= n: d = (1/n (min over assignments of sum min(c, d_ij)^p + c^p (n - m)))^(1/p).

    References
    ----------
    .. [1] D. Schuhmacher, B.-T. Vo, B.-N. Vo, IEEE Trans. Signal Process. 56, 3447-3457 (2008),
       doi:10.1109/TSP.2008.920469.

    Examples
    --------
    >>> ospa(np.array([[0.0, 1.0]]), np.array([[0.0, 0.0], [9.0, 9.0]]), cutoff_m=5)
    Ospa(total=3.0, place=0.5, number=2.5)
    """
    from scipy.optimize import linear_sum_assignment

    if not (cutoff_m > 0 and order >= 1):
        raise InputError(f"ospa: cutoff_m must be > 0 and order >= 1, got {cutoff_m} and {order}")
    n, m = len(estimates), len(truths)
    most = max(n, m)
    if most == 0:
        return Ospa(0.0, 0.0, 0.0)
    place = 0.0
    if min(n, m):
        cost = np.minimum(_distances(estimates, truths), cutoff_m) ** order
        place = float(cost[linear_sum_assignment(cost)].sum())
    number = cutoff_m**order * abs(n - m)
    total, place, number = (float((v / most) ** (1 / order)) for v in (place + number, place, number))
    return Ospa(total, place, number)


class Identity(NamedTuple):
    """Identity metrics over a sequence.

    ``truths`` appearances of true objects, ``matches`` of them that a track follows, ``misses``, ``false_tracks``
    (appearances of tracks that follow nothing), ``switches`` of the track that follows an object, ``fragmentations``
    (times an object is followed again after a gap), ``mota`` = 1 - (misses + false_tracks + switches) / truths,
    ``motp`` mean distance of matches [m], ``idf1`` = 2 IDTP / (truths + track appearances) under the best one-to-one
    assignment of identities over the whole sequence.
    """

    truths: int
    matches: int
    misses: int
    false_tracks: int
    switches: int
    fragmentations: int
    mota: float
    motp: float
    idf1: float


def identity_metrics(truths: Sequence[Places], tracks: Sequence[Places], *, gate_m: float = 3.0) -> Identity:
    """Compare tracks with the truth, frame by frame and over the whole sequence.

    Parameters
    ----------
    truths, tracks : sequence of mapping of int to (d,) float
        Places by id, one mapping a frame [m].
    gate_m : float
        Farthest that a track may be from what it follows [m].

    Notes
    -----
    CLEAR metrics: a pair that matched in the frame before stays matched while within the gate; the rest is assigned
    at least total distance. IDF1 assigns identities once for all frames.

    References
    ----------
    .. [1] K. Bernardin, R. Stiefelhagen, EURASIP J. Image Video Process. 2008, 246309, doi:10.1155/2008/246309.
    .. [2] E. Ristani et al., ECCV Workshops 2016, doi:10.1007/978-3-319-48881-3_2.
    """
    if len(truths) != len(tracks):
        raise InputError(f"identity_metrics: {len(truths)} frames of truth and {len(tracks)} of tracks")
    follower: dict[int, int] = {}
    before: dict[int, int] = {}
    seen: set[int] = set()
    matches = switches = fragmentations = 0
    distance = 0.0
    for true, found in zip(truths, tracks, strict=True):
        pairs = _matched(true, found, before, gate_m)
        for thing, track in pairs.items():
            switches += thing in follower and follower[thing] != track
            fragmentations += thing in seen and thing not in before
            follower[thing] = track
            seen.add(thing)
            distance += float(np.linalg.norm(true[thing] - found[track]))
        matches += len(pairs)
        # an object that is not there cannot lose its track
        before = {t: k for t, k in before.items() if t not in true} | pairs
    n_true, n_track = sum(map(len, truths)), sum(map(len, tracks))
    wrong = (n_true - matches) + (n_track - matches) + switches
    shared = _identity_true_positives(truths, tracks, gate_m)
    return Identity(
        truths=n_true,
        matches=matches,
        misses=n_true - matches,
        false_tracks=n_track - matches,
        switches=switches,
        fragmentations=fragmentations,
        mota=1 - wrong / n_true if n_true else float("nan"),
        motp=distance / matches if matches else float("nan"),
        idf1=2 * shared / (n_true + n_track) if n_true + n_track else float("nan"),
    )


def _matched(true: Places, found: Places, before: Mapping[int, int], gate_m: float) -> dict[int, int]:
    """Return the track of each true object in one frame."""
    pairs = {
        thing: track
        for thing, track in before.items()
        if thing in true and track in found and np.linalg.norm(true[thing] - found[track]) <= gate_m
    }
    things = [t for t in true if t not in pairs]
    free = [k for k in found if k not in pairs.values()]
    return pairs | {things[i]: free[j] for i, j in _assigned(true, found, things, free, gate_m)}


def _assigned(true: Places, found: Places, things: list[int], free: list[int], gate_m: float) -> list[tuple[int, int]]:
    from scipy.optimize import linear_sum_assignment

    if not (things and free):
        return []
    cost = _distances(np.array([true[t] for t in things]), np.array([found[k] for k in free]))
    # as many pairs within the gate as there can be, then the least distance
    far = 1e3 * gate_m * (1 + min(cost.shape))
    rows, columns = linear_sum_assignment(np.where(cost <= gate_m, cost, far))
    return [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if cost[i, j] <= gate_m]


def _identity_true_positives(truths: Sequence[Places], tracks: Sequence[Places], gate_m: float) -> int:
    """Return the frames in which an object is near the one track that is best for it over the whole sequence."""
    from scipy.optimize import linear_sum_assignment

    together: Counter[tuple[int, int]] = Counter()
    for true, found in zip(truths, tracks, strict=True):
        together.update((t, k) for t, p in true.items() for k, q in found.items() if np.linalg.norm(p - q) <= gate_m)
    if not together:
        return 0
    things, labels = (sorted({pair[i] for pair in together}) for i in range(2))
    count = np.zeros((len(things), len(labels)))
    for (t, k), n in together.items():
        count[things.index(t), labels.index(k)] = n
    return int(count[linear_sum_assignment(-count)].sum())


def _distances(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(np.asarray(a)[:, None] - np.asarray(b)[None], axis=-1), dtype=np.float64)
