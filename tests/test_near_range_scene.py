"""Extended targets near the radar, scene to detections: a wall, a pole and the beam of a guard rail, no far field.

The same targets on the turntable: ``test_rcs_near_range.py``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import shenron_rt as srt
from shenron_rt._typing import FloatArray
from shenron_rt.config.scene import Scene
from shenron_rt.physics import infinite_plate_rcs, near_range_cylinder_rcs, near_range_surface_amplitude
from shenron_rt.scene.mesh import TaggedMesh, build_mesh

RADARS = ("radarbook_200mhz", "awrl1432")  # 24.1 and 77.2 GHz
HEIGHT_M, NUMBER = 1.0, 5
RADIUS_M, LENGTH_M = 0.08, 2.0
#: A W-beam: height, depth of its two waves, top edge, length [m].
BEAM_M, DEPTH_M, TOP_M, RAIL_M = 0.312, 0.081, 0.75, 4.0


def isotropic(name: str) -> srt.RadarProfile:
    return srt.load_profile(name, {"antenna.pattern": "isotropic"})


def rendered(profile: srt.RadarProfile, target: dict[str, Any], *, seed: int = 0, rays: int = 1000) -> srt.Frame:
    """Return a frame of a metal target alone."""
    actor = {"id": NUMBER, "tag": "Other", "material": "metal", **target}
    radar = {"name": "r", "profile": profile, "xyz_m": [0, 0, HEIGHT_M]}
    return srt.simulate(Scene.model_validate({"actors": [actor], "radars": [radar]}), rays=rays, seed=seed)


def detected(frame: srt.Frame) -> tuple[float, float]:
    """Return RCS [dBsm] and range [m] of the target's strongest detection."""
    mine = frame.detections.table[frame.detections.object_id == NUMBER][0]
    return float(mine["rcs_dbsm"]), float(mine["range"])


@pytest.mark.parametrize("name", RADARS)
@pytest.mark.parametrize("distance", [5.0, 10.0, 20.0, 50.0])
def test_a_wall_is_a_mirror_and_detected_as_pi_r_squared(name: str, distance: float) -> None:
    wall = {"shape": "box:0.3x30x30", "xyz_m": [distance + 0.15, 0, HEIGHT_M]}
    level, place = detected(rendered(isotropic(name), wall, rays=100_000))
    assert place == pytest.approx(distance, abs=0.02)
    # its rim, 4 edges of 1 / (pi sqrt(2) v) with v = 15 m sqrt(4 / (lambda R)): 0.1 dB at 50 m; the rest is that the
    # wave has the curvature of twice the range across the array, and the tubes on a lattice
    assert level == pytest.approx(10 * np.log10(infinite_plate_rcs(distance)), abs=0.3)


@pytest.mark.parametrize("distance", [5.0, 20.0, 50.0])
@pytest.mark.parametrize(("name", "aim"), [("radarbook_200mhz", 20_000), ("awrl1432", 80_000)])
def test_a_pole_is_detected_with_the_integral_over_its_side(name: str, aim: int, distance: float) -> None:
    profile = isotropic(name)
    pole = {"shape": f"cylinder:r={RADIUS_M},l={LENGTH_M}", "xyz_m": [distance, 0, HEIGHT_M], "aim": aim}
    wanted = near_range_cylinder_rcs(RADIUS_M, LENGTH_M, profile.wavelength_m, distance)
    level, place = np.array([detected(rendered(profile, pole, seed=k)) for k in range(6)]).T
    # what is detected stands at the side that faces the radar, and its level is read there
    nearer = (distance - RADIUS_M) / distance
    np.testing.assert_allclose(place, distance - RADIUS_M, atol=0.05)
    mean = 10 * np.log10(np.mean(10 ** (level / 10)))
    # edges cut tubes that are taken whole or not at all: half a dB in one frame, a third of that in the mean of six
    assert mean == pytest.approx(10 * np.log10(wanted * nearer**4), abs=0.3)


def beam_surface(y: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return points and area vectors of the W-beam that faces -x, s from 0 to 1 up its height, over the ground."""
    turn = 4 * np.pi * s
    zero = np.zeros_like(s)
    points = np.stack([-0.5 * DEPTH_M * (1 - np.cos(turn)), y, TOP_M - BEAM_M * (1 - s)], axis=-1)
    return points, np.stack([zero - BEAM_M, zero, -0.5 * DEPTH_M * 4 * np.pi * np.sin(turn)], axis=-1)


def beam_mesh(rows: int) -> TaggedMesh:
    points, _ = beam_surface(*np.meshgrid([-RAIL_M / 2, RAIL_M / 2], np.linspace(0, 1, rows + 1), indexing="ij"))
    low, high = np.arange(rows), np.arange(rows) + rows + 1
    faces = np.concatenate([np.stack([low, high, high + 1], axis=1), np.stack([low, high + 1, low + 1], axis=1)])
    return build_mesh(points.reshape(-1, 3), faces)


@pytest.mark.parametrize("distance", [5.0, 10.0, 50.0])
def test_a_guard_rail_is_detected_with_the_integral_over_its_beam(distance: float) -> None:
    # waves of 15 mm radius: rays must be much closer than their zones of sqrt(lambda a / 2) = 10 mm, and the mesh so
    # fine that its facets, of lambda / 600 sagitta, are not what glints
    profile = isotropic("radarbook_200mhz")
    rail = {"mesh": beam_mesh(480), "xyz_m": [distance, 0, 0], "aim": 600_000}
    frame = rendered(profile, rail)
    limits = (-RAIL_M / 2, RAIL_M / 2), (0.0, 1.0)
    amplitude = near_range_surface_amplitude(beam_surface, *limits, profile.wavelength_m, (-distance, 0.0, HEIGHT_M))
    wanted = 20 * np.log10(abs(amplitude))
    antenna = profile.antenna
    gain = 10 ** ((antenna.gain_tx_dbi + antenna.gain_rx_dbi - antenna.radome_loss_db) / 10)
    unit = profile.tx_power_w * gain * profile.wavelength_m**2 / (4 * np.pi) ** 3 / np.hypot(distance, HEIGHT_M) ** 4
    received = 10 * np.log10(frame.returns.power_by_object()[NUMBER] / unit)
    # rays 1.4 mm apart over zones of 10 mm: 0.3 dB from lattice to lattice
    assert received == pytest.approx(wanted, abs=0.3)
    # crests, valley and edges are several glints, up to 0.15 m apart in range, and are fitted as one point
    level, _ = detected(frame)
    assert level == pytest.approx(wanted, abs=0.75)
