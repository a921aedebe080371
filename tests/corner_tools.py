"""What the tests of corner reflectors in scenes share: the scene, and what theory says a radar reads off the corner."""

from __future__ import annotations

from typing import Any

import numpy as np

import shenron_rt as srt
from shenron_rt.config.profile import RadarProfile
from shenron_rt.config.scene import Scene
from shenron_rt.physics import four_path_factor

LEG_M = 0.247  # 4 pi a^4 / (3 lambda^2) is 20 dBsm at 24.1 GHz
CORNER = f"trihedral:triangular,a={LEG_M}"
HEIGHT_M = 1.0


def corner_scene(
    distance: float,
    *,
    road: bool = False,
    velocity: tuple[float, float, float] = (0, 0, 0),
    profile: str | RadarProfile = "radarbook",
) -> Scene:
    """A corner reflector that faces the radar, both 1 m up."""
    static: list[dict[str, Any]] = []
    if road:
        static = [{"name": "road", "shape": "ground:400x40", "xyz_m": [190, 0, 0], "material": "asphalt"}]
    corner = {
        "id": 5, "name": "corner", "shape": CORNER, "xyz_m": [distance, 0, HEIGHT_M], "ypr_deg": [180, 0, 0],
        "tag": "Other", "velocity_mps": list(velocity), "aim": 10_000,
    }  # fmt: skip
    radar = {"name": "r", "profile": profile, "xyz_m": [0, 0, HEIGHT_M]}
    return Scene.model_validate({"static": static, "actors": [corner], "radars": [radar]})


def turntable_corner(profile: RadarProfile, distance: float, elevation: float, **more: Any) -> complex:
    """Return the corner's scattering amplitude by ``sweep_rcs`` [m]."""
    sweep = srt.sweep_rcs(
        CORNER, frequency_hz=profile.center_hz, azimuth_deg=0, elevation_deg=elevation, distance_m=distance, **more
    )
    return complex(sweep.amplitude.ravel()[0])


def four_path_corner(profile: RadarProfile, distance: float) -> complex:
    """Return the scattering amplitude that the corner and the road below it stand for at a distance [m].

    The corner's echo between the direct direction and the one from below the road is narrow: each way has its own.
    """
    below = -float(np.degrees(np.arctan(2.0 * HEIGHT_M / distance)))
    indirect = float(np.hypot(distance, 2.0 * HEIGHT_M))
    direct = turntable_corner(profile, distance, 0.0)
    reflected = turntable_corner(profile, indirect, below)
    mixed = turntable_corner(profile, indirect, below, bistatic=(0.0, 0.0))
    axis = np.zeros(1)
    pattern = float(profile.pattern(axis, np.radians([below]))[0] / profile.pattern(axis, axis)[0])
    asphalt = srt.load_materials()["asphalt"]
    factor = four_path_factor(
        asphalt.permittivity_at(profile.center_hz), HEIGHT_M, HEIGHT_M, distance, profile.center_hz, "VV",
        roughness_rms_m=asphalt.roughness_rms_m,
        mixed=mixed / direct * np.sqrt(pattern), reflected=reflected / direct * pattern,
    )  # fmt: skip
    return complex(direct * factor)
