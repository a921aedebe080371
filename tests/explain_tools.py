"""Two point targets, for tests of attribution."""

from __future__ import annotations

from typing import Any

import shenron_rt as srt


def two_points(profile: srt.RadarProfile, first: dict[str, Any], second: dict[str, Any]) -> srt.Scene:
    """Return a scene of two point targets, ids 1 and 2, 28 m ahead of the radar unless they say otherwise."""
    base = {"xyz_m": (30, 0, 1), "rcs_dbsm": 0}
    points = [base | {"id": 1, "name": "one"} | first, base | {"id": 2, "name": "two"} | second]
    return srt.Scene(seed=1, point_targets=points, radars=[{"profile": profile, "xyz_m": (2, 0, 1)}])
