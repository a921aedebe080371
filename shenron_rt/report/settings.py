"""Settings of a page: what the radar was given, with sources, and what derives from it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..config.profile import RadarProfile

__all__ = ["profile_record"]

#: Derived numbers in the order of a data sheet: key, words, factor, unit.
_DERIVED = (
    ("center_frequency_hz", "centre frequency", 1e-9, "GHz"),
    ("wavelength_m", "wavelength", 1e3, "mm"),
    ("slope_hz_per_s", "chirp slope", 1e-12, "MHz/µs"),
    ("range_resolution_m", "range resolution c/2B", 1.0, "m"),
    ("max_range_m", "unambiguous range", 1.0, "m"),
    ("loop_period_s", "loop period", 1e6, "µs"),
    ("max_velocity_mps", "unambiguous velocity ±", 1.0, "m/s"),
    ("velocity_resolution_mps", "velocity resolution", 1.0, "m/s"),
    ("n_virtual", "virtual channels", 1.0, ""),
    ("noise_power_dbm", "noise of a sample", 1.0, "dBm"),
)


def profile_record(profile: RadarProfile) -> dict[str, Any]:
    """Return the numbers of a profile as a page shows them: ``derived`` and ``given`` rows, limits, beamwidth."""
    numbers = profile.derived()
    known = [(words, numbers[key] * factor, unit, key) for key, words, factor, unit in _DERIVED if key in numbers]
    told = {row[3] for row in known}
    known += [(key, value, "", key) for key, value in numbers.items() if key not in told]
    given = profile.model_dump(mode="json", exclude={"name", "description", "sources"}, exclude_none=True)
    return {
        "name": profile.name,
        "description": profile.description,
        "derived": [row[:3] for row in known],
        "given": [(key, value, _source(profile.sources, key)) for key, value in _leaves(given)],
        "max_velocity_mps": profile.max_velocity_mps,
        "max_range_m": profile.max_range_m,
        "beamwidth_az_deg": profile.antenna.beamwidth_az_deg,
        "pfa": profile.processing.pfa,
    }


def _leaves(data: Mapping[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    rows: list[tuple[str, str]] = []
    for key, value in data.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            rows += _leaves(value, f"{name}.")
        elif isinstance(value, list) and len(str(value)) > 60:
            rows.append((name, f"{len(value)} entries"))
        else:
            rows.append((name, f"{value:g}" if isinstance(value, float) else str(value)))
    return rows


def _source(sources: Mapping[str, str], key: str) -> str:
    """Return the source of a dotted key, or of the group it stands in."""
    parts = key.split(".")
    return next((sources[k] for n in range(len(parts), 0, -1) if (k := ".".join(parts[:n])) in sources), "")
