"""A street with everything that moves and turns, and powers behind the two doors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import shenron_rt as srt
from shenron_rt.config.scene import LidarMount

ROOF = LidarMount(
    name="roof", xyz_m=(0.3, 0.1, 2.5), ypr_deg=(3, -2, 1), channels=32, upper_deg=10, lower_deg=-40, range_m=60,
    points_per_second=32 * 360 * 10,
)  # fmt: skip


def street(**changes: Any) -> srt.Scene:
    """Return an ego vehicle in a bend, an oncoming car that turns, and a post, a wall and a road that stand."""
    content: dict[str, Any] = {
        "name": "bend",
        "seed": 3,
        "ego": {"xyz_m": (5, -2, 0), "ypr_deg": (20, 0, 0), "velocity_mps": (9, 3, 0), "yaw_rate_deg_s": 30},
        "static": [
            {"shape": "ground:80x80", "xyz_m": (20, 0, 0), "tag": "Roads", "material": "asphalt"},
            {"id": 40, "shape": "box:20x0.3x3", "xyz_m": (25, 12, 1.5), "tag": "Walls", "material": "concrete"},
            {"id": 41, "name": "post", "shape": "cylinder:r=0.15,l=4", "xyz_m": (17, -2, 2), "tag": "Poles"},
        ],
        "actors": [
            {
                "id": 101, "name": "oncoming", "shape": "car", "xyz_m": (22, 5, 0), "ypr_deg": (200, 0, 0),
                "velocity_mps": (-7, -2, 0), "yaw_rate_deg_s": -20, "aim": 3_000,
            },
        ],
        "radars": [{"name": "front", "profile": "awrl1432", "xyz_m": (2.0, 0.2, 1.0), "ypr_deg": (10, -3, 2)}],
        "lidars": [ROOF],
    }  # fmt: skip
    return srt.Scene(**{**content, **changes})


def incoherent_power(scatterers: srt.Scatterers, profile: srt.RadarProfile) -> dict[int, float]:
    """Return the sum of |a|^2 over the incoherent echoes of every object [W]."""
    returns = srt.illuminate(scatterers, profile)
    power = np.where(returns.coherent, 0.0, np.abs(returns.amplitude) ** 2)
    return {int(i): float(power[returns.object_id == i].sum()) for i in np.unique(scatterers.object_id)}


def mean_power(power: Callable[[int], dict[int, float]], seeds: int = 20) -> dict[int, float]:
    """Return linear means over seeds."""
    drawn = [power(seed) for seed in range(seeds)]
    return {i: float(np.mean([d.get(i, 0.0) for d in drawn])) for i in drawn[0]}


def decibels(power: dict[int, float], reference: dict[int, float]) -> dict[int, float]:
    """Return power over reference of every object [dB]."""
    return {i: float(10 * np.log10(power[i] / reference[i])) for i in reference}
