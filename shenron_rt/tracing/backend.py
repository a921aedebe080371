"""Which Mitsuba variant runs, decided before any kernel does.

Dr.Jit 1.5 aborts the whole process on LLVM 15 and 16 at the first minimum or maximum: its code generator emits
intrinsics that the x86 back end of those versions cannot select. The version is therefore read first, which runs no
kernel.
"""

from __future__ import annotations

import contextlib
import functools
import logging
import os
import subprocess
import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, get_args

from .._parallel import threads
from ..errors import BackendError, InputError, did_you_mean

__all__ = ["Backend", "BackendChoice", "Status", "backend_status", "choose_backend", "use_backend"]

Backend = Literal["cuda", "llvm", "scalar"]
BackendChoice = Literal["auto", "cuda", "llvm", "scalar"]

_VARIANT: dict[Backend, str] = {"cuda": "cuda_ad_rgb", "llvm": "llvm_ad_rgb", "scalar": "scalar_rgb"}
#: Oldest LLVM that is not known to abort; 17 and 18 are probed in a process of their own first.
_OLDEST_LLVM, _TESTED_LLVM = 17, 19
FIX_LLVM = (
    "install LLVM 19 (apt-get install libllvm19) or point DRJIT_LIBLLVM_PATH at a libLLVM.so of version 19 or newer"
)

#: Without one of these a driver (Linux, or Windows' subsystem for it) is not there, and its variant need not be loaded.
_CUDA_DEVICES = ("/dev/nvidiactl", "/dev/dxg")

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Status:
    """What one backend can do here: ``usable``, and in words why or why not."""

    backend: Backend
    usable: bool
    detail: str


@functools.cache
def backend_status(backend: Backend) -> Status:
    """Find out, without running a kernel in this process, whether a backend is usable."""
    if backend == "cuda" and not any(Path(device).exists() for device in _CUDA_DEVICES):
        return Status(backend, False, "no CUDA device or driver")
    with _quiet_stderr(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            import mitsuba as mi

            if _VARIANT[backend] not in mi.variants():
                return Status(backend, False, f"this Mitsuba build has no variant {_VARIANT[backend]}")
            with _variant(_VARIANT[backend]):
                return _CHECKS[backend]()
        except (ImportError, RuntimeError, AttributeError) as error:
            reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
            hint = f"; to fix it: {FIX_LLVM}" if backend == "llvm" else ""
            return Status(backend, False, f"not available ({reason}){hint}")


def _check_llvm() -> Status:
    import drjit

    found: tuple[int, ...] = tuple(drjit.detail.llvm_version())
    shown = ".".join(str(v) for v in found)
    if found[0] < _OLDEST_LLVM:
        return Status("llvm", False, f"LLVM {shown} aborts in Dr.Jit {version('drjit')}; to fix it: {FIX_LLVM}")
    if found[0] < _TESTED_LLVM and not _probe_in_subprocess():
        return Status("llvm", False, f"LLVM {shown} failed a trial kernel; to fix it: {FIX_LLVM}")
    return Status("llvm", True, f"LLVM {shown}, Dr.Jit {version('drjit')}")


def _check_cuda() -> Status:
    import drjit

    if not drjit.has_backend(drjit.JitBackend.CUDA):
        return Status("cuda", False, "no CUDA device or driver")
    return Status("cuda", True, f"CUDA device, Dr.Jit {version('drjit')}")


def _check_scalar() -> Status:
    return Status("scalar", True, f"Mitsuba {version('mitsuba')}, one ray at a time (slow)")


_CHECKS = {"llvm": _check_llvm, "cuda": _check_cuda, "scalar": _check_scalar}

_PROBE = (
    "import mitsuba as mi; mi.set_variant('llvm_ad_rgb'); import drjit as dr; "
    "dr.eval(dr.maximum(mi.Float([1, 2]), mi.Float([2, 1])))"
)


def _probe_in_subprocess() -> bool:
    done = subprocess.run([sys.executable, "-c", _PROBE], capture_output=True, timeout=120, check=False)
    return done.returncode == 0


def choose_backend(wanted: str = "auto") -> Backend:
    """Return the backend to use.

    Parameters
    ----------
    wanted : str
        ``"auto"`` is CUDA, then LLVM, then scalar; a named one is used or refused.

    Raises
    ------
    InputError
        An unknown name.
    BackendError
        The named backend is not usable here; says how to fix it.
    """
    if wanted not in get_args(BackendChoice):
        raise InputError(f"unknown backend {wanted!r}; {did_you_mean(wanted, get_args(BackendChoice))}")
    if wanted != "auto":
        named: Backend = next(b for b in get_args(Backend) if b == wanted)
        status = backend_status(named)
        if not status.usable:
            raise BackendError(f"backend {wanted}: {status.detail}")
        return named
    return _auto()


@functools.cache
def _auto() -> Backend:
    for backend in get_args(Backend):
        status = backend_status(backend)
        if status.usable:
            return backend  # type: ignore[no-any-return]
        if backend == "cuda":  # most machines have none, and LLVM serves
            continue
        _log.warning("backend %s: %s. Falling back to a slower one", backend, status.detail)
    return "scalar"


@contextlib.contextmanager
def use_backend(backend: Backend) -> Iterator[Any]:
    """Make ``backend`` Mitsuba's current variant inside a ``with`` block, and give back the module."""
    with _variant(_VARIANT[backend]) as mi:
        yield mi


@contextlib.contextmanager
def _variant(name: str) -> Iterator[Any]:
    import mitsuba as mi

    before = mi.variant()
    if before != name:
        mi.set_variant(name)
        _hold_to_the_threads()
    try:
        yield mi
    finally:
        if before not in (None, name):
            mi.set_variant(before)


def _hold_to_the_threads() -> None:
    """Let Dr.Jit use no more threads than this process may; it starts with one a core."""
    import drjit

    if drjit.thread_count() > threads():
        drjit.set_thread_count(threads())


@contextlib.contextmanager
def _quiet_stderr() -> Iterator[None]:
    """Silence what Dr.Jit's native code prints when it finds no LLVM; our own message says it better."""
    with contextlib.ExitStack() as stack:
        try:
            copy = os.dup(2)
            sink = os.open(os.devnull, os.O_WRONLY)
        except OSError:  # no stderr to silence
            yield
            return
        stack.callback(os.close, copy)
        stack.callback(os.dup2, copy, 2)
        os.dup2(sink, 2)
        os.close(sink)
        yield
