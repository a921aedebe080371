"""Five objects that a radar does not see, each for another reason: ``python examples/explain_reasons.py``.

Prints why, with the change that would make each visible, and draws the waterfall of the one that a side lobe masks
(``--out docs/images/explain.png``).
"""

from __future__ import annotations

import argparse
from pathlib import Path
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


def main() -> None:
    """Render, explain, print, draw."""
    from shenron_rt.plot import explain_waterfall
    from shenron_rt.plot._style import save

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("explain.png"), help="picture")
    asked = parser.parse_args()
    scene = made_scene()
    (frame,) = srt.explain(srt.simulate(scene, **FAST), scene=scene)
    for item in frame.objects:
        print(f"{item.name}: {item.verdict.text}")
        if item.verdict.change:
            print(f"    {item.verdict.change}")
    save(explain_waterfall(frame.of(BIKE), title="five reasons"), asked.out)


if __name__ == "__main__":
    main()
