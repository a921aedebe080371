"""Where an export goes: written whole beside its place and moved there, so that a failure leaves nothing behind."""

from __future__ import annotations

import contextlib
import importlib.util
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from ..errors import InputError, ShenronError

__all__ = ["require", "whole_file", "whole_folder"]


def require(what: str, library: str, extra: str, package: str) -> None:
    """Refuse an export whose optional library is not installed.

    Parameters
    ----------
    what : str
        What needs it, for the message.
    library : str
        Module name.
    extra : str
        Extra of this package that brings it.
    package : str
        Name of the package on PyPI, for the message.

    Raises
    ------
    InputError
        Has the exact command that installs it.
    """
    if importlib.util.find_spec(library) is None:
        raise InputError(f"{what} needs {package}, which is not installed: pip install 'shenron-rt[{extra}]'")


@contextlib.contextmanager
def whole_file(target: Path, *, overwrite: bool) -> Iterator[Path]:
    """Give the path of a file to write, and move it to ``target`` when the ``with`` block ends without an error.

    Raises
    ------
    InputError
        The place is taken, or the disk refuses; whatever stood there is untouched.
    """
    _check_file(target, overwrite)
    with _staged(target) as staged:
        yield staged
        _check_file(target, overwrite)  # it may have come into being meanwhile
        staged.replace(target)


@contextlib.contextmanager
def whole_folder(target: Path, *, overwrite: bool, marker: str) -> Iterator[Path]:
    """Give the path of a folder to make, and move it to ``target`` when the ``with`` block ends without an error.

    Parameters
    ----------
    target : path
    overwrite : bool
        Replace an export that is there.
    marker : str
        Name of a file that every export of this kind has; a folder without it is never replaced.

    Raises
    ------
    InputError
        The place is taken, or the disk refuses; whatever stood there is untouched.
    """
    _check_folder(target, overwrite, marker)
    with _staged(target) as staged:
        yield staged
        _check_folder(target, overwrite, marker)
        if not target.exists():
            staged.replace(target)
            return
        aside = staged.with_name("replaced")  # goes with the staging folder, or back where it was
        target.replace(aside)
        try:
            staged.replace(target)
        except BaseException:
            aside.replace(target)
            raise


@contextlib.contextmanager
def _staged(target: Path) -> Iterator[Path]:
    """Give a path of the target's name in a temporary folder beside it, on the same file system."""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        folder = Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}.partial-"))
        try:
            yield folder / target.name
        finally:
            shutil.rmtree(folder, ignore_errors=True)
    except ShenronError:
        raise
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"{target}: the export could not be written ({reason}); nothing was left there") from error


def _check_file(target: Path, overwrite: bool) -> None:
    if target.is_dir():
        raise InputError(f"-o {target}: is a folder; give the name of a file")
    if target.exists() and not overwrite:
        raise InputError(f"-o {target}: exists; give another name, or --overwrite to replace it")


def _check_folder(target: Path, overwrite: bool, marker: str) -> None:
    if not target.exists():
        return
    if not target.is_dir():
        raise InputError(f"-o {target}: is a file; give the name of a folder")
    if not any(target.iterdir()):
        return
    if not overwrite:
        raise InputError(
            f"-o {target}: the folder is not empty; give another one, or --overwrite to replace the export"
        )
    if not (target / marker).is_file():
        raise InputError(
            f"-o {target}: --overwrite replaces exports of this kind only, and the folder has no {marker}; give another"
        )
