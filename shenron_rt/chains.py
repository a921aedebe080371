"""Chains: which objects an echo met between transmitter and receiver, and whether it shows one where none is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np

from ._typing import BoolArray, IntArray, NDArray
from .errors import InputError
from .paths import Paths

__all__ = ["Chains", "chain_name"]


def chain_name(objects: IntArray) -> str:
    """Return ``"40>101"`` for the ids 40, 101 of a way from the radar over them and back; -1 ends it."""
    return ">".join(str(int(i)) for i in objects if i >= 0)


@dataclass(frozen=True, eq=False)
class Chains:
    """The chain of every echo, and the chains there are.

    Parameters
    ----------
    objects : (m, b) int64
        Object ids of the surfaces of each chain, in the order of the wave; -1 beyond the last.
    row : (n,) int32
        Of each echo, into ``objects``.
    ghost : (n,) bool
        True where an echo met several surfaces and shows its object at a place that is not on it.
    """

    objects: IntArray
    row: IntArray
    ghost: BoolArray

    def __post_init__(self) -> None:
        if self.row.shape != self.ghost.shape or self.objects.ndim != 2:
            raise InputError(
                f"Chains: one row and one flag an echo are needed, and a table of ids; got {self.row.shape}, "
                f"{self.ghost.shape} and {self.objects.shape}"
            )

    def __len__(self) -> int:
        return len(self.row)

    def __repr__(self) -> str:
        return f"Chains({len(self)} echoes over {len(self.objects)} chains, {int(self.ghost.sum())} ghosts)"

    @cached_property
    def names(self) -> NDArray[Any]:
        """(m,) str, ids joined by ``>``."""
        return np.array([chain_name(ids) for ids in self.objects] or [""][:0], dtype=np.str_)

    @classmethod
    def of(cls, first: IntArray, paths: Paths, reverse: BoolArray, ghost: BoolArray) -> Self:
        """Tell the chains of echoes of first surfaces, then of paths.

        Parameters
        ----------
        first : (n,) int
            Object ids of the echoes of first surfaces.
        paths : Paths
            Those of the k further echoes.
        reverse : (k,) bool
            Which of them run backwards.
        ghost : (k,) bool

        Returns
        -------
        Chains
            Of n + k echoes.
        """
        alone, row = np.unique(np.asarray(first, dtype=np.int64), return_inverse=True)
        count = paths.count.astype(np.int64)[:, None]
        column = np.arange(paths.object_id.shape[1])
        order = np.where(reverse[:, None], np.maximum(count - 1 - column, 0), column[None, :])
        ids = np.take_along_axis(paths.object_id.astype(np.int64), order, axis=1)
        several, over = np.unique(np.where(column < count, ids, -1), axis=0, return_inverse=True)
        single = np.full((len(alone), paths.object_id.shape[1]), -1, dtype=np.int64)
        single[:, 0] = alone
        return cls(
            objects=np.concatenate([single, several]),
            row=np.concatenate([row.ravel(), len(alone) + over.ravel()]).astype(np.int32),
            ghost=np.concatenate([np.zeros(len(first), dtype=bool), ghost]),
        )
