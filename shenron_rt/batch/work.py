"""One piece of work: renders a block of frames into a folder that appears whole or not at all. Runs in any process."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import functools
import logging
import os
import threading
import traceback
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from .. import runs
from .._parallel import limit_threads
from ..config.scene import Scene, load_scene
from ..errors import InputError, ShenronError
from ..rendering import rendered
from ..run_frames import parts_of
from ..run_setup import merge_options
from .expansion import Unit

__all__ = ["WORK", "Outcome", "failed", "is_disk_full", "render_unit", "work_folder"]

#: Folder of a batch, below its root, where pieces of work wait until their run is complete.
WORK = ".work"
#: Mitsuba's variant and the kept scene are of the process, and a Dask worker may have several threads.
_one_at_a_time = threading.Lock()
#: Parameters of glibc's mallopt(3).
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3


@dataclass(frozen=True)
class Outcome:
    """What became of a piece of work.

    Parameters
    ----------
    kind : str
        ``"done"``; ``"input"``: what it was told cannot be done, now or later; ``"disk"``: no space is left, for any
        work; ``"other"``: may go well when tried again.
    error, detail : str
        One line, and all that is known.
    warnings : tuple of str
        What the package had to say.
    """

    kind: Literal["done", "input", "disk", "other"]
    error: str = ""
    detail: str = ""
    warnings: tuple[str, ...] = ()


def work_folder(root: str | Path, run: str) -> Path:
    """Return where the pieces of a run wait, beside the configuration they are made from."""
    return Path(root) / WORK / run


def render_unit(unit: Unit) -> Outcome:
    """Render a block of frames, unless it is there already; never raises, so that any error comes back in words."""
    limit_threads(unit.threads)
    _reuse_memory()
    with _one_at_a_time, _heard() as warnings:
        try:
            _render(unit)
            outcome = Outcome("done")
        except Exception as error:
            outcome = failed(error)
    return replace(outcome, warnings=tuple(dict.fromkeys(warnings)))


@functools.cache
def _reuse_memory() -> None:
    """Let this process keep freed memory for its next arrays.

    Dask gives its workers MALLOC_TRIM_THRESHOLD_, with which the C library hands every array beyond 128 kB back to the
    system at once: half of a worker's time then goes into fresh pages. A frame frees what the next one needs.
    """
    with contextlib.suppress(OSError, AttributeError, TypeError):  # another C library
        libc = ctypes.CDLL(None)
        for parameter, size in ((_M_TRIM_THRESHOLD, 1 << 28), (_M_MMAP_THRESHOLD, 1 << 25)):
            libc.mallopt(parameter, size)


@contextlib.contextmanager
def _heard() -> Iterator[list[str]]:
    """Keep the warnings of the package for the driver, which has the terminal, instead of printing them here."""
    messages: list[str] = []

    class Keeping(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            messages.append(record.getMessage())

    logger = logging.getLogger("shenron_rt")
    before = logger.handlers, logger.propagate
    logger.handlers, logger.propagate = [Keeping(logging.WARNING)], False
    try:
        yield messages
    finally:
        logger.handlers, logger.propagate = before


def failed(error: BaseException) -> Outcome:
    """Return the outcome that an error is."""
    detail = "".join(traceback.format_exception(error)).strip()
    if is_disk_full(error):
        return Outcome("disk", f"no space left on the disk ({error})", detail)
    if isinstance(error, ShenronError):
        return Outcome("input", str(error), str(error))
    return Outcome("other", f"{type(error).__name__}: {error}", detail)


def is_disk_full(error: BaseException) -> bool:
    """Tell whether an error says that the disk, or the share of it that is ours, is full."""
    return isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT)


def _render(unit: Unit) -> None:
    home = work_folder(unit.root, unit.run)
    config = home / "config.yaml"
    if not config.is_file():
        raise InputError(
            f"{config}: not seen from {os.uname().nodename}; workers need the batch folder and the files that its "
            "scenes name under the same paths"
        )
    folder = home / unit.block
    if folder.is_dir():
        return
    scene = _scene(config, config.stat().st_mtime_ns)
    options = merge_options(scene.run, {})
    keep = parts_of(unit.write)
    names = scene.object_names()
    records: dict[str, dict[str, Any]] = {
        r.name: {"name": r.name, "profile": scene.profile_of(r).name, "frames": []} for r in scene.radars
    }
    backend = ""
    try:
        with runs.write_run(folder) as place:
            for mount, frame in rendered(scene, options, range(unit.first, unit.stop)):
                runs.write_frame(runs.frame_folder(place.partial, mount.name, frame.frame), frame, keep)
                records[mount.name]["frames"].append(runs.frame_summary(frame, names))
                backend = frame.backend
            runs.write_json(place.partial / "records.json", {"backend": backend, "radars": list(records.values())})
    except InputError:
        if not folder.is_dir():  # else another worker was quicker with the same bytes
            raise


@functools.lru_cache(maxsize=2)
def _scene(config: Path, stamp: int) -> Scene:
    """Return the scene of a run; the same object for all its blocks, so that what was prepared for it is kept."""
    return load_scene(config)
