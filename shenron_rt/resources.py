"""Find a profile, a material table or a scene by name or path.

Look-up order: the path as given, ``<name>.yaml`` in the current folder, each folder of ``SHENRON_RT_PATH`` (and its
``profiles/``, ``materials/``, ``scenes/``), then what ships with the package.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal

from .errors import NotFoundError, did_you_mean

__all__ = ["Kind", "available", "find", "package_folder"]

Kind = Literal["profiles", "materials", "scenes"]
_SUFFIXES = (".yaml", ".yml")


def package_folder(kind: Kind) -> Path:
    """Return the folder with the files of that kind which ship with the package (wheel or checkout)."""
    here = Path(__file__).resolve().parent
    installed = here / "_data" / kind
    return installed if installed.is_dir() else here.parent / kind


def _folders(kind: Kind) -> list[Path]:
    extra = [Path(p) for p in os.environ.get("SHENRON_RT_PATH", "").split(os.pathsep) if p]
    return [Path.cwd(), *(f for p in extra for f in (p, p / kind)), package_folder(kind)]


def available(kind: Kind) -> dict[str, Path]:
    """Return name -> file of everything of that kind in ``SHENRON_RT_PATH`` and in the package."""
    found: dict[str, Path] = {}
    for folder in reversed(_folders(kind)[1:]):
        if folder.is_dir():
            found |= {p.stem: p for p in sorted(folder.iterdir()) if p.suffix in _SUFFIXES}
    return dict(sorted(found.items()))


def find(kind: Kind, name_or_path: str | os.PathLike[str]) -> Path:
    """Return the file for a name or a path.

    Raises
    ------
    NotFoundError
        With the names that exist and the folders that were searched.
    """
    given = Path(name_or_path)
    if given.suffix in _SUFFIXES or given.parent != Path():
        if given.is_file():
            return given
        raise NotFoundError(f"{kind[:-1]} file {str(given)!r} does not exist")
    for folder in _folders(kind):
        for suffix in _SUFFIXES:
            candidate = folder / f"{given.name}{suffix}"
            if candidate.is_file():
                return candidate
    raise NotFoundError(
        f"unknown {kind[:-1]} {given.name!r}; {did_you_mean(given.name, available(kind))}. "
        "Give a name, or a path that ends in .yaml"
    )
