"""Work in fixed blocks of rows, on a few threads.

The partition depends on the number of rows alone, never on the number of threads, so results are the same bytes
whatever the machine; blocks are small enough to stay in the cache. NumPy releases the interpreter lock in its loops.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from typing import TypeVar

__all__ = ["BLOCK", "limit_threads", "map_blocks", "pool", "threads"]

Result = TypeVar("Result")

#: Rows of a block; 2^14 rows of three float64 are 400 kB.
BLOCK = 1 << 14


#: 0 is no limit; see :func:`limit_threads`.
_limit = 0


def limit_threads(most: int) -> None:
    """Let this process use at most so many threads, 0 for no limit; counts from before the first work on.

    For several processes side by side, which would otherwise start a thread for each core, each of them.
    """
    global _limit
    _limit = most


def threads() -> int:
    """Return how many threads this process may use: its cores, or fewer where :func:`limit_threads` says so."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(cores, _limit) if _limit else cores


@functools.cache
def pool() -> Executor:
    """Return the package's thread pool: one thread a core this process may use."""
    return ThreadPoolExecutor(max_workers=threads(), thread_name_prefix="shenron-rt")


def map_blocks(function: Callable[[slice], Result], n: int, block: int = BLOCK) -> list[Result]:
    """Call ``function`` on slices that cover ``range(n)`` and return the results in order.

    Parameters
    ----------
    function : callable
        Gets a slice; must not call this function itself.
    n : int
        Rows.
    block : int
        Rows a slice.
    """
    slices = [slice(i, min(i + block, n)) for i in range(0, n, block)]
    if len(slices) < 2:
        return [function(s) for s in slices]
    return list(pool().map(function, slices))
