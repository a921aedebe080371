"""The coherent part of the physical model against closed forms and brute-force physical optics."""

from __future__ import annotations

import csv
import math

import numpy as np
import pytest
from echo_tools import (
    ISO,
    WAVELENGTH,
    WAVENUMBER,
    apparent_rcs,
    db,
    echo_sum,
    isotropic_profile,
    plate_po,
    scene_of,
    unit_power,
)

import shenron_rt as srt
from shenron_rt.frames import rotation_matrix
from shenron_rt.physics import canonical


def plate(side, xyz, ypr=(0, 0, 0), *, aim=None, material="metal", object_id=5):
    shape = f"plate:{side}x{side}"
    return {"id": object_id, "shape": shape, "xyz_m": xyz, "ypr_deg": ypr, "aim": aim, "material": material}


def light(*actors, seed=0, rays=1_000, profile=ISO, **more):
    scene = scene_of(*actors, profile=profile, **more)
    table = more.get("materials")
    return srt.illuminate(srt.trace(scene, seed=seed, rays=rays), profile, materials=table)


@pytest.mark.parametrize("rays", [10_000, 30_000])
@pytest.mark.parametrize("range_m", [3.0, 10.0, 30.0])
def test_large_metal_plate_is_a_mirror(range_m, rays):
    """pi R^2 within 0.3 dB; measured within 0.02 dB on average and 0.1 dB for each of ten positions.

    Rims are at least R/sqrt(2) from the specular point: relative diffraction sqrt(lambda/R)/2, up to 0.2 dB at 3 m.
    """
    side = max(1.5 * range_m, 20.0)
    sigma = []
    for seed in range(10):
        distance = range_m + 0.05 * seed * WAVELENGTH
        returns = light(plate(side, (distance, 0.01 * seed, -0.013 * seed)), seed=seed, rays=rays)
        sigma.append(apparent_rcs(returns, 5, distance) / canonical.infinite_plate_rcs(distance))
    assert abs(db(np.mean(sigma))) < 0.1
    assert np.max(np.abs(db(sigma))) < 0.3


@pytest.mark.parametrize("rays", [10_000, 40_000])
@pytest.mark.parametrize(
    "ypr", [(0, 0, 0), (20, 0, 0), (-35, 10, 0), (45, 5, 0), (30, 30, 0), (90, 30, 0), (130, -60, 0)]
)
def test_mirror_of_any_direction_returns_from_its_nearest_point(ypr, rays):
    """Cells are oblique between the axes of the cube map: pi h^2 within 0.2 dB all the same, measured 0.1 dB."""
    normal = rotation_matrix(ypr)[:, 0]
    for seed in range(3):
        returns = light(plate(30, tuple(12.0 * normal), ypr), seed=seed, rays=rays)
        assert abs(db(apparent_rcs(returns, 5, 12.0) / canonical.infinite_plate_rcs(12.0))) < 0.2


def test_small_plate_in_its_far_field():
    """4 pi A^2/lambda^2 within 0.2 dB: 5000 aimed cells put its edges within 1/140 of its side, 0.12 dB."""
    sigma = [apparent_rcs(light(plate(0.1, (30, 0, 0), aim=5_000), seed=s), 5, 30.0) for s in range(10)]
    assert abs(db(np.mean(sigma) / canonical.plate_rcs(0.1, 0.1, WAVELENGTH))) < 0.2


def test_plates_at_near_range_match_the_reference_table(shared_reference):
    """Spherical waves: 0.1 and 0.3 m plates from 2 to 50 m, away from interference minima; 0.3 dB."""
    with (shared_reference / "rcs" / "near_range_apparent_rcs.csv").open() as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    at_77 = isotropic_profile().model_copy(
        update={"waveform": ISO.waveform.model_copy(update={"carrier_hz": 77e9 - ISO.waveform.bandwidth_hz / 2})}
    )
    assert at_77.center_hz == pytest.approx(77e9)
    checked = 0
    for row in rows:
        size = {"plate_100x100mm": 0.1, "plate_300x300mm": 0.3}.get(row["target"])
        R, expected = float(row["range_m"]), float(row["apparent_dbsm"])
        if size is None or row["freq_ghz"] != "77" or not 2 <= R <= 50:
            continue
        sigma = [
            apparent_rcs(light(plate(size, (R, 0, 0), aim=5_000), seed=s, profile=at_77), 5, R, at_77) for s in range(4)
        ]
        assert abs(db(np.mean(sigma)) - expected) < 0.3, row
        checked += 1
    assert checked == 18


@pytest.mark.parametrize("angle", [0.3, 0.6, 1.0, 1.6])
@pytest.mark.parametrize("turn", ["yaw", "pitch"])
def test_tilted_plate_follows_the_physical_optics_pattern(angle, turn):
    """Complex amplitude within 3 % of the untilted plate's: its edges are known to 1/250 of the side."""
    ypr = (angle, 0, 0) if turn == "yaw" else (0, angle, 0)
    center, R = np.array([30.0, 0, 0]), rotation_matrix(ypr)
    for seed in range(3):
        got = echo_sum(light(plate(0.1, (30, 0, 0), ypr, aim=16_000), seed=seed), 5) / math.sqrt(unit_power(30.0))
        expected = np.conj(plate_po(center, R @ [0, 0.1, 0], R @ [0, 0, 0.1]))
        peak = math.sqrt(canonical.plate_rcs(0.1, 0.1, WAVELENGTH))
        assert abs(got - expected) < 0.03 * peak


def test_amplitude_of_a_metal_plate_has_the_sign_of_a_short():
    """Gamma = -1 and no carrier phase of the range: negative real, up to the bend of the wave over 1 cm at 30 m."""
    returns = light(plate(0.01, (30, 0, 0), aim=400))
    total = np.sum(returns.amplitude) / math.sqrt(unit_power(30.0))
    expected = -2 * math.sqrt(math.pi) / WAVELENGTH * 1e-4
    # cells reach beyond the plate's edge by up to 1/40 of the side
    assert abs(total / expected - 1) < 0.08
    assert abs(np.angle(total / expected)) < 0.01


def test_sphere_of_metal_from_ten_metres():
    """pi a^2 within 0.1 dB, range taken to the specular point: 20 000 aimed rays, mean over five seeds."""
    sphere = {"id": 5, "shape": "sphere:r=0.1", "xyz_m": (10, 0, 0), "aim": 20_000}
    sigma = [apparent_rcs(light(sphere, seed=s), 5, 9.9) for s in range(5)]
    assert abs(db(np.mean(sigma) / canonical.sphere_rcs(0.1))) < 0.1


@pytest.mark.parametrize("gap", [0.3, 0.25, 0.5, 0.0])
def test_two_plates_interfere_as_the_direct_sum(gap):
    """Side by side, one ``gap`` wavelengths further: at a quarter they cancel. Within 3 % of the sum of moduli."""
    far = 12.0 + gap * WAVELENGTH
    near_center, far_center = np.array([12.0, 0.06, 0]), np.array([far, -0.06, 0])
    sides = np.array([0, 0.1, 0]), np.array([0, 0, 0.1])
    parts = [np.conj(plate_po(c, *sides)) * (12.0 / c[0]) ** 2 for c in (near_center, far_center)]
    for seed in range(3):
        returns = light(
            plate(0.1, tuple(near_center), aim=16_000),
            plate(0.1, tuple(far_center), aim=16_000, object_id=6),
            seed=seed,
        )
        got = (echo_sum(returns, 5) + echo_sum(returns, 6)) / math.sqrt(unit_power(12.0))
        scale = sum(abs(p) for p in parts)
        assert abs(got - sum(parts)) < 0.03 * scale


MATERIALS = """
description: for tests
materials:
  lossy:
    permittivity: {model: constant, real: 5.0, imag: 3.0}
    sources: {permittivity: "made up"}
  coated:
    permittivity: {model: metal}
    coating: [{permittivity: {model: constant, real: 3.0, imag: 0.3}, thickness_m: 4.0e-4}]
    sources: {permittivity: "made up", coating: "made up"}
  sheet:
    permittivity: {model: constant, real: 2.5, imag: 0.05}
    thickness_m: 0.0017
    sources: {permittivity: "made up", thickness_m: "made up"}
  rough:
    permittivity: {model: metal}
    roughness_rms_m: 0.0002
    sources: {permittivity: "made up", roughness_rms_m: "made up"}
tags: {"0.9.14": {Other: lossy}}
"""


@pytest.fixture
def own_materials(tmp_path):
    file = tmp_path / "own.yaml"
    file.write_text(MATERIALS)
    return str(file)


def normal_reflection(name):
    """Return Gamma at normal incidence by the textbook formulas, e^{+jwt}."""
    if name == "lossy":
        n = np.sqrt(5 - 3j)
        return (1 - n) / (1 + n)
    eps, depth, r_back = (3 - 0.3j, 4.0e-4, -1.0) if name == "coated" else (2.5 - 0.05j, 0.0017, None)
    n = np.sqrt(eps)
    front = (1 - n) / (1 + n)
    back = -front if r_back is None else r_back
    turn = back * np.exp(-2j * WAVENUMBER * n * depth)
    return (front + turn) / (1 + front * turn)


@pytest.mark.parametrize("polarization", ["VV", "HH"])
@pytest.mark.parametrize("name", ["lossy", "coated", "sheet"])
def test_plate_of_complex_reflectivity_keeps_its_phase(name, polarization, own_materials):
    """Amplitude 2 % and phase 0.02 rad of the direct sum with conj(Gamma): the edges' 1/250 of the side, twice."""
    profile = isotropic_profile(polarization=polarization)
    gamma = normal_reflection(name)
    expected = np.conj(plate_po(np.array([20.0, 0, 0]), np.array([0, 0.1, 0]), np.array([0, 0, 0.1]), gamma))
    target = plate(0.1, (20, 0, 0), aim=16_000, material=name)
    returns = light(target, profile=profile, materials=own_materials)
    got = echo_sum(returns, 5) / math.sqrt(unit_power(20.0))
    assert abs(abs(got / expected) - 1) < 0.02
    assert abs(np.angle(got / expected)) < 0.02
    assert abs(np.angle(gamma)) > 0.05
    assert abs(abs(np.angle(gamma)) - math.pi) > 0.05


def test_roughness_weakens_the_coherent_amplitude(own_materials):
    """exp(-2 (k s)^2) at normal incidence, exactly, against the smooth twin seen through the same cells."""
    rough = light(plate(0.1, (20, 0, 0), aim=1_000, material="rough"), materials=own_materials)
    sheet = light(plate(0.1, (20, 0, 0), aim=1_000, material="metal"))
    ratio = abs(echo_sum(rough, 5)) / abs(echo_sum(sheet, 5))
    # metal of 1e7 S/m reflects 0.9995
    assert ratio == pytest.approx(math.exp(-2 * (WAVENUMBER * 2e-4) ** 2), rel=1e-3)


def test_cross_polarised_radar_sees_no_flat_plate():
    profile = isotropic_profile(polarization="HV")
    cross = light(plate(0.1, (20, 0, 0), aim=1_000), profile=profile)
    level = 0.0 if len(cross) == 0 else apparent_rcs(cross, 5, 20.0)
    assert level < 1e-9 * float(canonical.plate_rcs(0.1, 0.1, WAVELENGTH))


def test_phase_moves_by_two_cycles_a_wavelength_of_range():
    near = echo_sum(light(plate(0.1, (20, 0, 0), aim=1_000)), 5)
    for shift in (0.1, 0.37):
        far = echo_sum(light(plate(0.1, (20 + shift * WAVELENGTH, 0, 0), aim=1_000)), 5)
        # the same seed gives the same cells on the plate, so only the range changes
        assert np.angle(far / near * np.exp(-4j * math.pi * shift)) == pytest.approx(0, abs=1e-3)
