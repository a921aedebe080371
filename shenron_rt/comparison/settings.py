"""What two runs were told differently, and the figures they came to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .record import Record
from .sides import Side

__all__ = ["changed_settings", "pool_results", "results"]


def changed_settings(a: Side, b: Side) -> list[Record]:
    """Return the keys whose values differ, dotted; list items are known by their id or name where they have one.

    The profiles are compared as they were used, wherever the runs' files hold them; a block that one side has alone,
    as a mesh scene has its actors, is one entry.
    """
    one, two = _settings(a), _settings(b)
    records = [
        Record(key=k, a=_brief(one.get(k)), b=_brief(two.get(k)))
        for k in [*one, *(k for k in two if k not in one)]
        if not (k in one and k in two)
    ]
    flat_a, flat_b = (_flat({k: v for k, v in side.items() if k in one and k in two}) for side in (one, two))
    return records + [
        Record(key=k, a=flat_a.get(k), b=flat_b.get(k))
        for k in [*flat_a, *(k for k in flat_b if k not in flat_a)]
        if k not in flat_a or k not in flat_b or flat_a[k] != flat_b[k]
    ]


def _settings(side: Side) -> dict[str, Any]:
    """Return the run's configuration with the one profile that was used in place of all that are listed."""
    settings = {k: v for k, v in side.settings.items() if k not in ("profile", "profiles")}
    if "radars" in settings:
        settings["radars"] = [
            {k: v for k, v in radar.items() if k != "profile"} if isinstance(radar, Mapping) else radar
            for radar in settings["radars"]
        ]
    if side.profile is not None:
        settings["profile"] = side.profile.model_dump(mode="json", exclude_none=True)
    return settings


def _brief(value: Any) -> Any:
    if isinstance(value, Mapping | list):
        return f"{len(value)} entries"
    return value


def _flat(value: Any, prefix: str = "") -> dict[str, Any]:
    if isinstance(value, Mapping) and value:
        items = [(str(k), v) for k, v in value.items()]
    elif isinstance(value, Sequence) and not isinstance(value, str) and any(isinstance(v, Mapping) for v in value):
        items = [(_label(i, v), v) for i, v in enumerate(value)]
    else:
        return {prefix: value}
    flat: dict[str, Any] = {}
    for key, item in items:
        flat |= _flat(item, f"{prefix}.{key}" if prefix else key)
    return flat


def _label(index: int, item: Any) -> str:
    if isinstance(item, Mapping):
        for key in ("name", "id"):
            if key in item:
                return str(item[key])
    return str(index)


def results(side: Side) -> Record:
    """Return what a side came to: counts, levels, its strongest detection."""
    found = side.detections
    strongest = int(np.nanargmax(found.snr_db)) if len(found) and np.any(np.isfinite(found.snr_db)) else None
    s, r, cube = side.scatterers, side.returns, side.cube
    power = None if r is None or not len(r) else float(sum(r.power_by_object().values()))
    return Record(
        profile=None if side.profile is None else side.profile.name,
        door=None if s is None else s.door,
        backend=None if s is None else s.backend,
        model=None if r is None else r.model,
        scatterers=None if s is None else len(s),
        returns=None if r is None else len(r),
        received_dbw=None if not power else float(10 * np.log10(power)),
        noise_dbw=None if cube is None else float(10 * np.log10(cube.noise_power_w)),
        detections=len(found),
        strongest_range_m=None if strongest is None else float(found.range[strongest]),
        strongest_azimuth_deg=None if strongest is None else float(np.degrees(found.azimuth[strongest])),
        strongest_velocity_mps=None if strongest is None else float(found.velocity[strongest]),
        strongest_snr_db=None if strongest is None else float(found.snr_db[strongest]),
    )


def pool_results(frames: Sequence[Record]) -> Record:
    """Return counts of all frames, mean received power, and the strongest detection of any."""
    best = max(frames, key=lambda r: -np.inf if r["strongest_snr_db"] is None else r["strongest_snr_db"])
    pooled = Record(best)
    for name in ("scatterers", "returns", "detections"):
        counts = [r[name] for r in frames if r[name] is not None]
        pooled[name] = sum(counts) if counts else None
    if any(r["received_dbw"] is not None for r in frames):
        watts = [0.0 if r["received_dbw"] is None else 10 ** (r["received_dbw"] / 10) for r in frames]
        pooled["received_dbw"] = float(10 * np.log10(np.mean(watts)))
    return pooled
