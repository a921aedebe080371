"""Detections to objects: density clustering over position and range rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._typing import FloatArray, IntArray
from ..errors import InputError

__all__ = ["ClusterSettings", "Clusters", "cluster", "density_clusters"]


@dataclass(frozen=True)
class ClusterSettings:
    """What belongs together.

    Parameters
    ----------
    reach_m : float
        Detections at most this far apart are neighbours, at equal range rate [m].
    reach_mps : float
        The same for range rates, at equal places [m/s]. Both distances add in squares.
    min_points : int
        Detections within reach, itself included, that make one the core of an object.
    """

    reach_m: float = 2.5
    reach_mps: float = 1.5
    min_points: int = 1

    def __post_init__(self) -> None:
        if not (self.reach_m > 0 and self.reach_mps > 0 and self.min_points >= 1):
            raise InputError(
                f"ClusterSettings: reach_m {self.reach_m} and reach_mps {self.reach_mps} must be > 0, min_points "
                f"{self.min_points} >= 1"
            )


@dataclass(frozen=True)
class Clusters:
    """Objects made of detections, strongest first.

    Parameters
    ----------
    position : (n, 2) float
        Mean of the detections by power [m].
    range_rate : (n,) float
        Mean by power [m/s].
    size_m : (n, 2) float
        Extent of the detections along both axes [m].
    power : (n,) float
        Sum [W].
    count : (n,) int
        Detections.
    label : (n_detection,) int
        Object of each detection; -1 none.
    """

    position: FloatArray
    range_rate: FloatArray
    size_m: FloatArray
    power: FloatArray
    count: IntArray
    label: IntArray

    def __len__(self) -> int:
        return len(self.power)

    def members(self, number: int) -> IntArray:
        """Return the detections of one object."""
        return np.flatnonzero(self.label == number)


def density_clusters(features: FloatArray, min_points: int) -> IntArray:
    """Label points by density: DBSCAN with unit reach.

    Parameters
    ----------
    features : (n, d) float
        Scaled so that neighbours are at most 1 apart.
    min_points : int
        Points within reach, itself included, that make a core.

    Returns
    -------
    (n,) int
        Running number of the cluster; -1 is noise. A point of the border belongs to its nearest core.

    References
    ----------
    .. [1] M. Ester, H.-P. Kriegel, J. Sander, X. Xu, Proc. KDD-96, 226-231 (1996).
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    n = len(features)
    label = np.full(n, -1, dtype=np.int64)
    if n == 0:
        return label
    pairs = cKDTree(features).query_pairs(1.0, output_type="ndarray")
    neighbours = np.bincount(pairs.ravel(), minlength=n) + 1
    core = np.flatnonzero(neighbours >= min_points)
    if not len(core):
        return label
    is_core = np.zeros(n, dtype=bool)
    is_core[core] = True
    links = pairs[is_core[pairs].all(axis=1)]
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(n, n))
    _, component = connected_components(graph, directed=False)
    label[core] = np.unique(component[core], return_inverse=True)[1]
    border = np.flatnonzero(~is_core)
    if len(border):
        distance, nearest = cKDTree(features[core]).query(features[border])
        near = np.asarray(distance) <= 1.0
        label[border[near]] = label[core[np.asarray(nearest)[near]]]
    return label


def cluster(
    position: FloatArray, range_rate: FloatArray, power: FloatArray, settings: ClusterSettings | None = None
) -> Clusters:
    """Gather detections to objects.

    Parameters
    ----------
    position : (n, 2) float
        In any frame [m].
    range_rate : (n,) float
        [m/s].
    power : (n,) float
        Received power, or any weight.
    settings : ClusterSettings, optional

    Returns
    -------
    Clusters
    """
    chosen = settings or ClusterSettings()
    features = np.column_stack([position / chosen.reach_m, range_rate / chosen.reach_mps])
    label = density_clusters(features, chosen.min_points)
    count = int(label.max(initial=-1)) + 1
    total = np.bincount(label[label >= 0], power[label >= 0], count).astype(np.float64)
    order = np.argsort(-total, kind="stable")
    label = np.append(np.argsort(order), -1)[label]  # strongest first; -1 picks the last
    kept = label >= 0
    which, weight = label[kept], power[kept]

    def mean(values: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(which, weight * values[kept], count) / total[order], dtype=np.float64)

    size = np.zeros((count, 2))
    for k in range(2):
        low, high = np.full(count, np.inf), np.full(count, -np.inf)
        np.minimum.at(low, which, position[kept, k])
        np.maximum.at(high, which, position[kept, k])
        size[:, k] = high - low
    return Clusters(
        position=np.column_stack([mean(position[:, 0]), mean(position[:, 1])]),
        range_rate=mean(range_rate),
        size_m=size,
        power=total[order],
        count=np.bincount(which, minlength=count),
        label=label,
    )
