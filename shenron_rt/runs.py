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
import hashlib
import itertools
import json
import math
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from .errors import InputError, NotFoundError
from .run_frames import write_frame

if TYPE_CHECKING:
    from .dsp import Detections, RadarCube
    from .returns import Returns
    from .synthesis.adc import AdcCube

__all__ = [
    "FrameLike", "Place", "Run", "check_target", "default_folder", "frame_folder", "frame_summary", "load_run",
    "objects_summary", "plain", "strongest_summary", "verify_manifest", "write_frame", "write_json", "write_manifest",
    "write_run",
]  # fmt: skip

_MANIFEST = "manifest.json"


class FrameLike(Protocol):
    """What a run folder needs of a frame: :class:`shenron_rt.Frame`, or a processed capture."""

    @property
    def adc(self) -> AdcCube: ...  # noqa: D102
    @property
    def cube(self) -> RadarCube: ...  # noqa: D102
    @property
    def detections(self) -> Detections: ...  # noqa: D102
    @property
    def frame(self) -> int: ...  # noqa: D102
    @property
    def time(self) -> float: ...  # noqa: D102


# ---- where
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
    if not (folder / _MANIFEST).is_file():
        raise InputError(
            f"-o {folder}: --overwrite replaces runs only, and the folder has no {_MANIFEST}; give another"
        )


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


# ---- what
def frame_folder(root: Path, radar: str, frame: int) -> Path:
    """Return ``root/radars/<radar>/frame_000000``."""
    return root / "radars" / radar / f"frame_{frame:06d}"


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


def strongest_summary(detections: Detections, *, chains: bool = False) -> dict[str, Any] | None:
    """Return the strongest detection with the keys of ``summary.json``; None where nothing was detected.

    ``chains`` adds the objects that its wave met, and whether it is a ghost.
    """
    if len(detections) == 0:
        return None
    row = detections.table[0]
    several = {"chain": str(detections.chain[0]), "ghost": bool(detections.ghost[0])} if chains else {}
    return {
        "range_m": float(row["range"]),
        "azimuth_deg": math.degrees(float(row["azimuth"])),
        "velocity_mps": float(row["velocity"]),
        "snr_db": float(row["snr_db"]),
        "object_id": int(row["object_id"]),
        **several,
    }


def objects_summary(
    returns: Returns, cube: RadarCube, detections: Detections, names: Mapping[int, str] | None = None
) -> list[dict[str, Any]]:
    """Return one record an object: id, tag, power_dbw, snr_db, detected, name; by falling power.

    Parameters
    ----------
    returns, cube, detections
        Of one frame.
    names : mapping of int to str, optional
        Objects of the scene; those without a return are listed with a null power.

    Notes
    -----
    ``snr_db`` is that of a point with the object's whole power on the centre of its cells:
    P n_channels / (k T0 F f_s ENBW / n_samples / n_loops). An object wider than a cell stands lower than this.
    """
    from .tags import SemanticTag

    power = returns.power_by_object()
    noise = cube.noise_power_w / cube.profile.n_virtual
    seen = {int(i) for i in np.unique(detections.object_id[~detections.ghost])}
    ids, first = np.unique(returns.object_id, return_index=True)
    tags = dict(zip((int(i) for i in ids), (int(t) for t in returns.tag[first]), strict=True))
    records: list[dict[str, Any]] = []
    for number in sorted(set(power) | set(names or {}), key=lambda i: -power.get(i, -1.0)):
        watts = power.get(number, 0.0)
        if watts == 0 and number == 0:
            continue  # a scene without static parts
        level = 10 * math.log10(watts) if watts > 0 else None
        records.append(
            {
                "id": number,
                "name": (names or {}).get(number, f"object {number}" if number else "static"),
                "tag": SemanticTag(tags[number]).name if number in tags else None,
                "power_dbw": level,
                "snr_db": None if level is None else level - 10 * math.log10(noise),
                "detected": number in seen,
            }
        )
        if returns.chains is not None:
            records[-1]["ghosts"] = int(np.sum(detections.ghost & (detections.object_id == number)))
    return records


def frame_summary(frame: FrameLike, names: Mapping[int, str] | None = None) -> dict[str, Any]:
    """Return the record of one frame in ``summary.json``."""
    returns = getattr(frame, "returns", None)
    return {
        "frame": frame.frame,
        "time_s": frame.time,
        "detections": len(frame.detections),
        "strongest": strongest_summary(frame.detections, chains=getattr(returns, "chains", None) is not None),
        "objects": [] if returns is None else objects_summary(returns, frame.cube, frame.detections, names),
    }


# ---- the manifest
def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_manifest(root: Path, known: Mapping[str, Mapping[str, Any]] | None = None) -> None:
    """Write size and SHA-256 of every file below ``root``; ``known`` has records of files that need not be read."""
    files = {
        p.relative_to(root).as_posix(): p for p in sorted(root.rglob("*")) if p.is_file() and p != root / _MANIFEST
    }
    records = {
        name: (known or {}).get(name) or {"size": file.stat().st_size, "sha256": _sha256(file)}
        for name, file in files.items()
    }
    write_json(root / _MANIFEST, {"version": 1, "files": records})


def verify_manifest(root: Path) -> list[str]:
    """Return what differs from ``manifest.json``: files missing or changed, one phrase each."""
    try:
        manifest = json.loads((root / _MANIFEST).read_text(encoding="utf-8"))
        listed = manifest["files"].items()
    except (FileNotFoundError, NotADirectoryError):
        raise NotFoundError(f"{root}: not a run folder, it has no {_MANIFEST}") from None
    except (ValueError, KeyError, AttributeError, TypeError):
        raise InputError(f"{root / _MANIFEST}: not a manifest of a run") from None
    problems = []
    for name, record in listed:
        file = root / name
        if not file.is_file():
            problems.append(f"{name}: missing")
        elif file.stat().st_size != record["size"] or _sha256(file) != record["sha256"]:
            problems.append(f"{name}: changed since the run")
    return problems


# ---- reading
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
    frames = {
        r["name"]: [frame_folder(root, r["name"], f["frame"]) for f in r["frames"]] for r in summary.get("radars", [])
    }
    missing = [str(f) for folders in frames.values() for f in folders if not f.is_dir()]
    if missing:
        raise InputError(f"{root}: frame folders listed in summary.json are missing: {missing[0]}")
    return Run(root, summary, frames)
