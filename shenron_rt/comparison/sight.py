"""Whether a point that one side sees can be seen from where the other side looked, by the other side's own points."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from .._typing import FloatArray, IntArray
from .record import Record

__all__ = ["Sight", "pool_sights"]

#: Rays around a line of sight that have a say.
_NEIGHBOURS = 4
#: A ray counts while it passes within this many ray spacings of the point.
_REACH = 1.5
#: Two surfaces closer than this along a ray are one [m], [share of the range].
_SAME_M, _SAME_SHARE = 0.3, 0.02
_MIN_SPREAD_RAD = 1e-4
#: So many of what hides an object are named.
_OCCLUDERS = 3


class Sight:
    """The rays of one side, by direction from where it looked.

    Parameters
    ----------
    position : (n, 3) float
        Where the rays ended [m].
    label : (n,) int
        Object id, or tag, of what they met.
    origin : (3,) float
        Where they began [m].
    """

    def __init__(self, position: FloatArray, label: IntArray, origin: FloatArray) -> None:
        from scipy.spatial import cKDTree

        arm = position - origin
        self._range = np.linalg.norm(arm, axis=1)
        seen = self._range > 0
        self._origin = origin
        self._range = self._range[seen]
        self._label = label[seen].astype(np.int64)
        unit = arm[seen] / self._range[:, None]
        self._unit = unit
        self._tree = cKDTree(unit) if len(unit) else None

    def _spacing(self, ray: IntArray) -> FloatArray:
        """Return the angle between some rays and their neighbours [rad]; the fourth is across the wider step."""
        k = min(_NEIGHBOURS + 1, len(self._unit))
        assert self._tree is not None
        rays, back = np.unique(ray, return_inverse=True)
        distance = np.reshape(np.asarray(self._tree.query(self._unit[rays], k=k)[0]), (len(rays), k))[:, -1]
        return np.asarray(np.maximum(distance, _MIN_SPREAD_RAD)[back].reshape(ray.shape), dtype=np.float64)

    def of(self, position: FloatArray, label: int, names: Mapping[int, str]) -> Record:
        """Tell what the rays met on the way to some points of an object, or of a tag.

        Returns
        -------
        Record
            Shares of the points, which add up to 1: ``seen``, ``behind_itself``, ``behind_other``, ``other_label`` (a
            surface of another label in the same place), ``through`` (the ray went on behind the point), ``no_ray``; and
            ``occluders``, name -> share; ``points``, how many were looked at.
        """
        shares = dict.fromkeys(("seen", "behind_itself", "behind_other", "other_label", "through", "no_ray"), 0.0)
        if self._tree is None or not len(position):
            return Record(shares, no_ray=1.0, occluders=Record(), points=len(position))
        arm = position - self._origin
        reach = np.linalg.norm(arm, axis=1)
        k = min(_NEIGHBOURS, len(self._range))
        distance, ray = self._tree.query(arm / np.maximum(reach, 1e-9)[:, None], k=k)
        distance, ray = np.reshape(distance, (len(position), k)), np.reshape(ray, (len(position), k))
        near = distance <= _REACH * self._spacing(ray)
        weight = near / np.maximum(near.sum(axis=1), 1)[:, None] / len(position)
        gap = self._range[ray] - reach[:, None]
        same = np.abs(gap) <= np.maximum(_SAME_M, _SAME_SHARE * reach)[:, None]
        own = self._label[ray] == label
        before = ~same & (gap < 0)
        kinds = {
            "seen": own & same, "behind_itself": own & before, "behind_other": ~own & before,
            "other_label": ~own & same, "through": ~same & (gap > 0),
        }  # fmt: skip
        for name, mask in kinds.items():
            shares[name] = float(np.sum(weight[mask]))
        shares["no_ray"] = float(np.mean(~near.any(axis=1)))
        hiding = self._occluders(ray, weight, kinds["behind_other"], names)
        return Record(shares, occluders=hiding, points=len(position))

    def _occluders(self, ray: IntArray, weight: FloatArray, mask: IntArray, names: Mapping[int, str]) -> Record:
        ids, row = np.unique(self._label[ray[mask]], return_inverse=True)
        share = np.bincount(row, weight[mask], len(ids)) if len(ids) else np.zeros(0)
        order = np.argsort(-share)[:_OCCLUDERS]
        return Record({names.get(int(ids[i]), f"object {ids[i]}"): float(share[i]) for i in order if share[i] > 0})


def pool_sights(sights: Sequence[Record]) -> Record:
    """Return the shares over all points of several frames."""
    total = max(sum(s["points"] for s in sights), 1)
    shares = [k for k in sights[0] if k not in ("occluders", "points")]
    pooled = {k: sum(s[k] * s["points"] for s in sights) / total for k in shares}
    hiding: Counter[str] = Counter()
    for sight in sights:
        hiding.update({name: share * sight["points"] / total for name, share in sight["occluders"].items()})
    return Record(pooled, occluders=Record(hiding.most_common(_OCCLUDERS)), points=sum(s["points"] for s in sights))
