"""Workers of a Dask cluster."""

from __future__ import annotations

import importlib
import itertools
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..errors import InputError
from .expansion import Unit
from .work import Outcome, failed, render_unit

__all__ = ["DaskWorkers"]

#: Units given to each thread of a worker, so that none waits for the next.
_AHEAD = 2
_TIMEOUT_S = 30


class DaskWorkers:
    """Threads of the workers of a Dask cluster, as many as there are at any time.

    Parameters
    ----------
    address : str
        Of the scheduler, ``tcp://host:port``, or the path of the file that ``dask scheduler --scheduler-file`` writes.

    Raises
    ------
    InputError
        ``dask.distributed`` is not installed, no such file, no scheduler or no worker answers.
    """

    def __init__(self, address: str) -> None:
        try:
            distributed: Any = importlib.import_module("distributed")
        except ImportError:
            raise InputError(
                "--cluster needs dask.distributed, which is not installed; pip install 'shenron-rt[cluster]'"
            ) from None
        file = Path(address)
        if "://" not in address and not file.is_file():
            raise InputError(f"--cluster {address}: neither an address like tcp://host:8786 nor a scheduler file")
        where: dict[str, Any] = {"address": address} if "://" in address else {"scheduler_file": str(file)}
        try:
            self._client = distributed.Client(**where, timeout=_TIMEOUT_S, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise InputError(f"--cluster {address}: no scheduler answers ({error})") from None
        try:
            self._client.wait_for_workers(1, timeout=_TIMEOUT_S)
        except TimeoutError:
            self._client.close()
            raise InputError(f"--cluster {address}: the scheduler has no workers; start some: dask worker") from None
        self._wait = distributed.wait
        self._busy: dict[Any, Unit] = {}
        self._count = itertools.count()
        self._threads: dict[str, int] = dict(self._client.nthreads())

    @property
    def room(self) -> int:
        """Units that can be taken now."""
        self._threads = dict(self._client.nthreads()) or self._threads
        return max(0, _AHEAD * sum(self._threads.values()) - len(self._busy))

    def submit(self, unit: Unit) -> None:
        """Give a unit to the cluster."""
        key = f"shenron-rt {unit.label} ({next(self._count)})"
        threads = min(self._threads.values())
        future = self._client.submit(render_unit, replace(unit, threads=threads), key=key, pure=False)
        self._busy[future] = unit

    def finished(self) -> list[tuple[Unit, Outcome]]:
        """Wait for work to end, and return what has."""
        with self._client.as_current():  # it is no default for others in this process, and wait takes the default
            done: Iterable[Any] = self._wait(list(self._busy), return_when="FIRST_COMPLETED").done
        return [(self._busy.pop(future), _outcome(future)) for future in done]

    def close(self) -> None:
        """Give up what is not done, and leave the cluster as it was."""
        self._client.cancel(list(self._busy))
        self._client.close()


def _outcome(future: Any) -> Outcome:
    try:
        outcome: Outcome = future.result()
    except Exception as error:  # a worker that was lost again and again, a package that it does not have
        return failed(error)
    return outcome
