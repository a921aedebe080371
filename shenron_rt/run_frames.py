"""Which parts of a frame a run keeps on disk."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING

from .errors import InputError, did_you_mean
from .io.npz import save_npz

if TYPE_CHECKING:
    from .run_summary import FrameLike

__all__ = ["DEFAULT_PARTS", "PARTS", "parts_of", "write_frame"]

#: Everything a frame's folder can hold beside pictures.
PARTS = ("scatterers", "returns", "adc", "cube", "maps", "detections")
#: ``cube.npz`` has the maps in it.
DEFAULT_PARTS = ("scatterers", "returns", "adc", "cube", "detections")


def parts_of(text: str | None) -> tuple[str, ...]:
    """Return the parts named in a comma-separated text; all that a run keeps by default where there is none.

    Raises
    ------
    InputError
        An unknown part, or none.
    """
    if text is None:
        return DEFAULT_PARTS
    names = [n.strip() for n in text.split(",") if n.strip()]
    unknown = [n for n in names if n not in PARTS]
    if unknown or not names:
        wrong = f"{unknown[0]!r} is not a part of a frame; {did_you_mean(unknown[0], PARTS)}" if unknown else "is empty"
        raise InputError(f"--write: {wrong}; allowed: {','.join(PARTS)}")
    return tuple(p for p in PARTS if p in names)


def write_frame(folder: Path, frame: FrameLike, parts: Collection[str] = DEFAULT_PARTS) -> None:
    """Write arrays and detections of one frame; keys are the attribute names.

    Parameters
    ----------
    folder : path
        Of the frame; made.
    frame : FrameLike
        What it has not is left out.
    parts : collection of str
        Of :data:`PARTS`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("scatterers", "returns", "adc", "cube"):
        stage = getattr(frame, name, None)
        if stage is not None and name in parts:
            stage.save(folder / f"{name}.npz")
    if "maps" in parts:
        names = ("range_doppler", "range_azimuth", "range_m", "velocity_mps", "azimuth_rad")
        save_npz(folder / "maps.npz", {name: getattr(frame.cube, name) for name in names})
    if "detections" in parts:
        table = frame.detections.to_csv(folder / "detections.csv")
        if any(">" in chain for chain in frame.detections.chain):  # else each is its object, as the table says
            frame.detections.save_chains(table)
