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

__all__ = ["BLOCK", "map_blocks", "pool"]

Result = TypeVar("Result")

#: Rows of a block; 2^14 rows of three float64 are 400 kB.
BLOCK = 1 << 14


@functools.cache
def pool() -> Executor:
    """Return the package's thread pool: one thread a core this process may use."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return ThreadPoolExecutor(max_workers=cores, thread_name_prefix="shenron-rt")


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
