"""Processes of this machine, one a worker, each in an executor of its own: one that is killed takes no other along."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from multiprocessing.connection import wait as wait_for

from .expansion import Unit
from .work import Outcome, failed, render_unit

__all__ = ["LocalWorkers", "cores"]

#: Libraries under NumPy read these when they are loaded.
_THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class LocalWorkers:
    """Worker processes on this machine that share its cores.

    Parameters
    ----------
    count : int
    """

    def __init__(self, count: int) -> None:
        self.threads = max(1, cores() // count)
        self._idle: list[ProcessPoolExecutor | None] = [None] * count  # None: to be started
        self._busy: dict[Future[Outcome], tuple[Unit, ProcessPoolExecutor]] = {}

    @property
    def room(self) -> int:
        """Units that can be taken now."""
        return len(self._idle)

    def submit(self, unit: Unit) -> None:
        """Give a unit to an idle worker."""
        executor = self._idle.pop() or ProcessPoolExecutor(
            1, mp_context=multiprocessing.get_context("spawn"), initializer=_follow_the_parent
        )
        with _environment(dict.fromkeys(_THREAD_VARIABLES, str(self.threads))):  # a process starts at its first work
            future = executor.submit(render_unit, replace(unit, threads=self.threads))
        self._busy[future] = (unit, executor)

    def finished(self) -> list[tuple[Unit, Outcome]]:
        """Wait for work to end, and return what has."""
        done, _ = wait(self._busy, return_when=FIRST_COMPLETED)
        return [self._ended(future) for future in done]

    def _ended(self, future: Future[Outcome]) -> tuple[Unit, Outcome]:
        unit, executor = self._busy.pop(future)
        try:
            outcome = future.result()
        except BrokenProcessPool:
            executor.shutdown(wait=False)
            self._idle.append(None)
            return unit, Outcome("other", "its worker process ended: killed, or out of memory")
        except Exception as error:
            outcome = failed(error)
        self._idle.append(executor)
        return unit, outcome

    def close(self) -> None:
        """End all workers; work in progress is given up."""
        for executor in [*self._idle, *(e for _, e in self._busy.values())]:
            if executor is not None:
                for process in list((executor._processes or {}).values()):
                    process.terminate()
                executor.shutdown(wait=True, cancel_futures=True)


def _follow_the_parent() -> None:
    """End this process when the one that started it does; it would wait for work for ever.

    An interrupt from the keyboard goes to the whole group of processes; the driver ends its workers itself.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if parent is not None:
            wait_for([parent.sentinel])
            os._exit(1)

    threading.Thread(target=watch, daemon=True, name="shenron-rt-parent").start()


@contextlib.contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    """Set environment variables that are not set, for processes started in the ``with`` block."""
    new = {k: v for k, v in values.items() if k not in os.environ}
    os.environ.update(new)
    try:
        yield
    finally:
        for key in new:
            del os.environ[key]
