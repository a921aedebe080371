"""A made scene in which five objects are invisible, each for another reason, beside two that are seen."""

from __future__ import annotations

from typing import Any

import shenron_rt as srt
from shenron_rt.config.profile import load_profile

TRUCK, VAN = 11, 10
SPECK, BIKE, GANTRY, WALKER, PLATE = 1, 2, 3, 4, 5
#: The plate is turned out of the radar's direction about both axes: no edge of it mirrors either.
PLATE_YPR = (215.0, 25.0, 0.0)
#: Enough for objects with rays of their own.
FAST: dict[str, Any] = {"rays": 20_000, "accuracy": 1e-5}


def made_scene(without: tuple[int, ...] = (), **changes: Any) -> srt.Scene:
    """Return the scene; keys of ``changes`` are ``plate_ypr``, ``speck_x``, ``radar_ypr``, ``range_window``.

    A rectangular range window leaves the truck side lobes as they fall off with 1/distance: 35 dB below its peak where
    the bike stands, which would be 17 dB over its noise threshold alone.
    """
    profile = load_profile("awrl1432", {"processing.range_window": changes.get("range_window", "rect")})
    actors = [
        {"id": VAN, "name": "van", "shape": "box:4x2x2", "xyz_m": (13, -5, 1), "ypr_deg": (-24.4, 0, 0),
         "velocity_mps": (-3, 0, 0), "material": "metal", "tag": "Truck", "aim": 5000},
        {"id": WALKER, "name": "walker", "shape": "pedestrian", "xyz_m": (18, -6.6, 0), "velocity_mps": (2, 0, 0),
         "aim": 2000},
        {"id": PLATE, "name": "plate", "shape": "plate:1x1", "xyz_m": (20, 0.5, 1),
         "ypr_deg": changes.get("plate_ypr", PLATE_YPR), "velocity_mps": (6, 0, 0), "material": "metal",
         "tag": "Other", "aim": 5000},
    ]  # fmt: skip
    points = [
        {"id": TRUCK, "name": "truck", "xyz_m": (22.1, 4, 1), "rcs_dbsm": 48, "velocity_mps": (-8, 0, 0)},
        {"id": BIKE, "name": "bike", "xyz_m": (28.3, 4.5, 1), "rcs_dbsm": 2, "velocity_mps": (-8, 0, 0)},
        {"id": SPECK, "name": "speck", "xyz_m": (changes.get("speck_x", 80), 0, 1), "rcs_dbsm": -25,
         "velocity_mps": (12, 0, 0)},
        {"id": GANTRY, "name": "gantry", "xyz_m": (12, 0, 11), "rcs_dbsm": 0, "velocity_mps": (-14, 0, 0)},
    ]  # fmt: skip
    return srt.Scene(
        seed=3,
        actors=[a for a in actors if a["id"] not in without],
        point_targets=[p for p in points if p["id"] not in without],
        radars=[
            {"name": "front", "profile": profile, "xyz_m": (2, 0, 1), "ypr_deg": changes.get("radar_ypr", (0, 0, 0))}
        ],
    )


def two_points(profile: srt.RadarProfile, first: dict[str, Any], second: dict[str, Any]) -> srt.Scene:
    """Return a scene of two point targets, ids 1 and 2, 28 m ahead of the radar unless they say otherwise."""
    base = {"xyz_m": (30, 0, 1), "rcs_dbsm": 0}
    points = [base | {"id": 1, "name": "one"} | first, base | {"id": 2, "name": "two"} | second]
    return srt.Scene(seed=1, point_targets=points, radars=[{"profile": profile, "xyz_m": (2, 0, 1)}])
