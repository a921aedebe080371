"""The JSON files of a run folder, and among them the manifest: size and SHA-256 of every other file."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .errors import InputError, NotFoundError

__all__ = ["MANIFEST", "plain", "verify_manifest", "write_json", "write_manifest"]

#: Name of the file; a folder without it is no run.
MANIFEST = "manifest.json"


def write_json(path: Path, value: Any) -> None:
    """Write JSON; numbers that are not finite become null, which JSON has no other word for."""
    path.write_text(json.dumps(plain(value), indent=2, allow_nan=False) + "\n", encoding="utf-8")


def plain(value: Any) -> Any:
    """Return a value made of JSON's types only."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_manifest(root: Path, known: Mapping[str, Mapping[str, Any]] | None = None) -> None:
    """Write size and SHA-256 of every file below ``root``; ``known`` has records of files that need not be read."""
    files = {p.relative_to(root).as_posix(): p for p in sorted(root.rglob("*")) if p.is_file() and p != root / MANIFEST}
    records = {
        name: (known or {}).get(name) or {"size": file.stat().st_size, "sha256": _sha256(file)}
        for name, file in files.items()
    }
    write_json(root / MANIFEST, {"version": 1, "files": records})


def verify_manifest(root: Path) -> list[str]:
    """Return what differs from ``manifest.json``: files missing or changed, one phrase each."""
    try:
        manifest = json.loads((root / MANIFEST).read_text(encoding="utf-8"))
        listed = manifest["files"].items()
    except (FileNotFoundError, NotADirectoryError):
        raise NotFoundError(f"{root}: not a run folder, it has no {MANIFEST}") from None
    except (ValueError, KeyError, AttributeError, TypeError):
        raise InputError(f"{root / MANIFEST}: not a manifest of a run") from None
    problems = []
    for name, record in listed:
        file = root / name
        if not file.is_file():
            problems.append(f"{name}: missing")
        elif file.stat().st_size != record["size"] or _sha256(file) != record["sha256"]:
            problems.append(f"{name}: changed since the run")
    return problems
