"""Run folders: written whole beside their place and moved into it, so that a reader never sees half a run.

::

    config.yaml     the resolved scene, profiles included; can be run again
    summary.json    strongest return and every object, frame by frame
    manifest.json   size and SHA-256 of every other file
    radars/<name>/frame_000000/{scatterers,returns,adc,cube}.npz, detections.csv, detections.chains.csv, *.png
"""

from __future__ import annotations

import contextlib
import errno
import itertools
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .errors import InputError, NotFoundError
from .run_frames import write_frame
from .run_manifest import MANIFEST, plain, verify_manifest, write_json, write_manifest
from .run_summary import FrameLike, frame_summary, objects_summary, strongest_summary

__all__ = [
    "FrameLike", "Place", "Run", "check_target", "default_folder", "frame_folder", "frame_summary", "load_run",
    "objects_summary", "plain", "strongest_summary", "verify_manifest", "write_frame", "write_json", "write_manifest",
    "write_run",
]  # fmt: skip


def default_folder(stem: str, profile: str, parent: Path = Path("out")) -> Path:
    """Return the first of ``parent/stem-profile``, ``-2``, ``-3`` ... that does not exist."""
    base = parent / f"{stem}-{profile}"
    for number in itertools.count(2):
        if not base.exists():
            return base
        base = parent / f"{stem}-{profile}-{number}"
    raise AssertionError("unreachable")


def check_target(folder: Path, overwrite: bool) -> None:
    """Refuse an output folder that holds something which may not be replaced.

    Raises
    ------
    InputError
        A file of that name; a folder with content and no ``overwrite``; with it, a folder that is no run.
    """
    if not folder.exists():
        return
    if not folder.is_dir():
        raise InputError(f"-o {folder}: is a file; give a folder")
    if not any(folder.iterdir()):
        return
    if not overwrite:
        raise InputError(
            f"-o {folder}: the folder is not empty; give another one, or --overwrite to replace the run in it"
        )
    if not (folder / MANIFEST).is_file():
        raise InputError(f"-o {folder}: --overwrite replaces runs only, and the folder has no {MANIFEST}; give another")


@dataclass
class Place:
    """Where a run is being written: ``partial`` is filled, ``folder`` is where it stands after the ``with`` block.

    ``known`` may hold manifest records of files that need not be read again.
    """

    partial: Path
    folder: Path
    known: dict[str, dict[str, Any]] = field(default_factory=dict)


@contextlib.contextmanager
def write_run(folder: Path, *, overwrite: bool = False, another: Callable[[], Path] | None = None) -> Iterator[Place]:
    """Give a temporary folder to fill, and move it to ``folder`` when the ``with`` block ends without an error.

    Parameters
    ----------
    folder : path
        Where the run shall stand. What stands there stays as it is until the new run is complete.
    overwrite : bool
        Replace a run that is there.
    another : callable, optional
        Names another folder if ``folder`` was taken while the run was written, so that its work is not lost.

    Raises
    ------
    InputError
        The place is taken; raised before anything is written.
    """
    check_target(folder, overwrite)
    folder.parent.mkdir(parents=True, exist_ok=True)
    place = Place(Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}.partial-")), folder)
    try:
        umask = os.umask(0)
        os.umask(umask)
        place.partial.chmod(0o777 & ~umask)  # mkdtemp gives 0700, which others on the team could not read
        yield place
        write_manifest(place.partial, place.known)
        while not _move_into_place(place.partial, place.folder, overwrite):
            if another is None:
                check_target(place.folder, overwrite)
                raise InputError(f"-o {place.folder}: was taken while the run was written; nothing was replaced")
            place.folder = another()
    finally:
        if place.partial.exists():
            shutil.rmtree(place.partial, ignore_errors=True)


def _move_into_place(partial: Path, folder: Path, overwrite: bool) -> bool:
    """Move the new run to its place; return False, with all left as it was, where another run has ended there."""
    if not folder.exists() or not any(folder.iterdir()):
        try:
            partial.replace(folder)
        except OSError as error:
            if error.errno in (errno.ENOTEMPTY, errno.EEXIST):
                return False
            raise
        return True
    if not overwrite:
        return False
    check_target(folder, overwrite)
    aside = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}.old-"))
    folder.replace(aside)
    try:
        partial.replace(folder)
    except BaseException:
        aside.replace(folder)
        raise
    shutil.rmtree(aside, ignore_errors=True)
    return True


def frame_folder(root: Path, radar: str, frame: int) -> Path:
    """Return ``root/radars/<radar>/frame_000000``."""
    return root / "radars" / radar / f"frame_{frame:06d}"


@dataclass(frozen=True)
class Run:
    """A run folder that was read.

    Parameters
    ----------
    root : Path
    summary : dict
        ``summary.json``.
    frames : dict of str to list of Path
        The folder of every frame, by radar name.
    """

    root: Path
    summary: dict[str, Any]
    frames: dict[str, list[Path]] = field(repr=False)

    @property
    def radars(self) -> list[str]:
        """Names of the radars, in the order of the summary."""
        return list(self.frames)

    @property
    def config(self) -> Path:
        """``config.yaml``."""
        return self.root / "config.yaml"


def load_run(path: str | os.PathLike[str]) -> Run:
    """Read a run folder.

    Raises
    ------
    NotFoundError
        No such folder, or not a run.
    InputError
        The summary cannot be read, or a frame it lists is missing.
    """
    root = Path(path)
    try:
        summary = json.loads((root / "summary.json").read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        raise NotFoundError(f"{root}: not a run folder, it has no summary.json") from None
    except ValueError as error:
        raise InputError(f"{root / 'summary.json'}: not valid JSON ({error})") from None
    try:
        frames = {
            str(r["name"]): [frame_folder(root, r["name"], int(f["frame"])) for f in r["frames"]]
            for r in summary.get("radars", [])
        }
    except (AttributeError, LookupError, TypeError, ValueError) as error:
        what = f"{type(error).__name__}: {error}"
        raise InputError(f"{root / 'summary.json'}: not the summary of a run ({what})") from None
    missing = [str(f) for folders in frames.values() for f in folders if not f.is_dir()]
    if missing:
        raise InputError(f"{root}: frame folders listed in summary.json are missing: {missing[0]}")
    return Run(root, summary, frames)
