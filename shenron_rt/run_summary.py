"""What ``summary.json`` says of a frame: its strongest detection, and every object with its level."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from .dsp import Detections, RadarCube
    from .returns import Returns
    from .synthesis.adc import AdcCube

__all__ = ["FrameLike", "frame_summary", "objects_summary", "strongest_summary"]


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
