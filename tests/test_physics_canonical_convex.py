"""Complex amplitudes of plate, disc, box and cylinder: tables, phases, both bases, and integrals taken numerically."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from canonical_tools import PRINTED, angles, basis, columns, dbsm, wavelength

from shenron_rt.physics import (
    box_amplitude,
    box_scattering_matrix,
    cylinder_amplitude,
    cylinder_rcs,
    disc_amplitude,
    disc_rcs,
    disc_scattering_matrix,
    plate_amplitude,
    plate_rcs,
    plate_scattering_matrix,
)

LAM = wavelength(77)
PEAK = 2.0 * math.sqrt(math.pi) / LAM


def off_normal(theta: np.ndarray, phi: float) -> tuple[np.ndarray, np.ndarray]:
    """Return azimuth and elevation of directions ``theta`` off +x, ``phi`` from y toward z."""
    u = np.stack([np.cos(theta), np.sin(theta) * math.cos(phi), np.sin(theta) * math.sin(phi)], axis=-1)
    return angles(u)


@pytest.mark.parametrize("name", ["100x100mm_24GHz", "100x100mm_77GHz", "200x150mm_76.5GHz"])
def test_plate_cuts_match_the_tables(name: str, shared_reference: Path) -> None:
    t = columns(shared_reference / f"rcs/plate_{name}.csv")
    size, ghz = name.split("_")
    a, b = (float(x) * 1e-3 for x in size.removesuffix("mm").split("x"))
    cuts = [key for key in t if key.startswith("po_phi")]
    assert len(cuts) >= 2
    for cut in cuts:
        phi = math.radians(float(cut.split("_")[1].removeprefix("phi")))
        got = dbsm(plate_amplitude(a, b, wavelength(ghz[:-3]), *off_normal(np.radians(t["theta_deg"]), phi)))
        # below -80 dBsm the table's nulls hang on the last digit of the angle: 0.001 dB
        assert np.max(np.abs(got - t[cut])) < 1e-3
        assert np.max(np.abs(got - t[cut])[t[cut] > -80.0]) < PRINTED


def test_disc_and_box_match_the_tables(shared_reference: Path) -> None:
    t = columns(shared_reference / "rcs/disc_r50mm_77GHz.csv")
    assert np.max(np.abs(dbsm(disc_amplitude(0.05, LAM, np.radians(t["theta_deg"]))) - t["po_dbsm"])) < PRINTED
    t = columns(shared_reference / "rcs/box_300x200x100mm_77GHz.csv")
    got = dbsm(box_amplitude(0.3, 0.2, 0.1, LAM, np.radians(t["az_deg"]), np.radians(t["el_deg"])))
    assert np.max(np.abs(got - t["po_dbsm"])) < 1e-3  # the deepest row is -107 dBsm


def test_metal_facing_the_radar_is_positive_and_real_and_phase_follows_the_face() -> None:
    assert complex(plate_amplitude(0.1, 0.2, LAM, 0.0)) == pytest.approx(PEAK * 0.02, rel=1e-12)
    assert complex(disc_amplitude(0.1, LAM, 0.0)) == pytest.approx(PEAK * math.pi * 0.01, rel=1e-12)
    # a box' face is half a length nearer to the radar: e^{-j 2 k r}, r = -length/2
    face = PEAK * 0.06 * np.exp(1j * 2.0 * math.pi / LAM * 0.1)
    assert complex(box_amplitude(0.1, 0.2, 0.3, LAM, math.pi)) == pytest.approx(face, rel=1e-9)


def test_powers_are_those_of_the_closed_forms() -> None:
    theta = np.radians(np.linspace(-60.0, 60.0, 241))
    assert np.allclose(np.abs(plate_amplitude(0.1, 0.2, LAM, theta)) ** 2, plate_rcs(0.1, 0.2, LAM, theta), rtol=1e-9)
    assert np.allclose(np.abs(disc_amplitude(0.1, LAM, 0.0, theta)) ** 2, disc_rcs(0.1, LAM, theta), rtol=1e-9)


def test_cylinder_broadside_matches_the_exact_series_of_the_table() -> None:
    # "exact 2-D series x 2 L^2/lambda" of the table's note, dBsm at 77 GHz, mean of VV and HH; k a = 20 to 161
    for radius, length, series in ((0.05, 0.3, 8.611), (0.1, 0.5, 16.058), (0.0125, 1.0, 13.060)):
        x = 4.0 * math.pi * radius / LAM
        ripple = 8.686 * 2.0 / math.sqrt(2.0 * math.pi) * x**-1.5  # dB, the echo of the shadow boundary
        assert dbsm(cylinder_amplitude(radius, length, LAM, 0.0)) == pytest.approx(series, abs=ripple + 0.015)
        bright = 10 * math.log10(float(cylinder_rcs(radius, length, LAM)))
        assert dbsm(cylinder_amplitude(radius, length, LAM, 0.0)) == pytest.approx(bright, abs=1.2 * ripple + 0.001)


def test_cylinder_is_the_integral_over_its_lit_side_and_cap() -> None:
    radius, length, k = 0.02, 0.05, 2.0 * math.pi / LAM
    x, weight = np.polynomial.legendre.leggauss(300)
    phi, z, ring = 0.5 * math.pi * x, 0.5 * length * x, 0.5 * radius * (x + 1.0)
    for el in (0.0, 0.02, -0.3, 1.2, -1.5):
        ce, se = math.cos(el), math.sin(el)
        round_ = np.sum(weight * 0.5 * math.pi * np.cos(phi) * np.exp(2j * k * radius * ce * np.cos(phi)))
        side = radius * ce * round_ * np.sum(weight * 0.5 * length * np.exp(2j * k * z * se))
        assert complex(cylinder_amplitude(radius, length, LAM, el, caps=False)) == pytest.approx(PEAK * side, rel=1e-9)
        # disc by rings, each the mean of its phasor over the angle
        turn = np.linspace(0.0, 2.0 * math.pi, 400, endpoint=False)
        mean = np.mean(np.exp(2j * k * ce * ring[:, None] * np.cos(turn)), axis=1)
        cap = 2.0 * math.pi * np.sum(weight * 0.5 * radius * ring * mean) * abs(se) * np.exp(1j * k * length * abs(se))
        assert complex(cylinder_amplitude(radius, length, LAM, el)) == pytest.approx(PEAK * (side + cap), rel=1e-9)


def test_bistatic_matrices_meet_the_monostatic_amplitudes(rng: np.random.Generator) -> None:
    az, el = rng.uniform(-3.0, 3.0, 50), rng.uniform(-1.5, 1.5, 50)
    pairs = [
        (plate_scattering_matrix(0.05, 0.08, LAM, az, el, (az, el)), plate_amplitude(0.05, 0.08, LAM, az, el)),
        (disc_scattering_matrix(0.05, LAM, az, el, (az, el)), disc_amplitude(0.05, LAM, az, el)),
        (
            box_scattering_matrix(0.05, 0.08, 0.03, LAM, az, el, (az, el)),
            box_amplitude(0.05, 0.08, 0.03, LAM, az, el),
        ),
    ]
    for matrix, amplitude in pairs:
        assert np.allclose(matrix, amplitude[:, None, None] * np.eye(2), atol=1e-12)


def test_bistatic_plate_is_the_integral_of_its_current(rng: np.random.Generator) -> None:
    a, b, k = 0.03, 0.02, 2.0 * math.pi / LAM
    x, weight = np.polynomial.legendre.leggauss(80)
    y, z = np.meshgrid(0.5 * a * x, 0.5 * b * x, indexing="ij")
    area = 0.25 * a * b * weight[:, None] * weight
    for side in (1.0, -1.0):
        t_az, r_az = rng.uniform(-1.5, 1.5, 2) + (0.0 if side > 0 else math.pi)
        t_el, r_el = rng.uniform(-1.4, 1.4, 2)
        (u, receive), (s, transmit) = basis(r_az, r_el), basis(t_az, t_el)
        points = np.stack([np.zeros_like(y), y, z], axis=-1)
        integral = np.sum(area * np.exp(1j * k * points @ (u + s)))
        # J = 2 n x H, H = d x E; the plate at the origin facing the radar is positive
        current = np.cross(np.array([side, 0.0, 0.0]), np.cross(-s, transmit))
        want = PEAK * integral * np.einsum("ri,ti->rt", receive, current)
        got = plate_scattering_matrix(a, b, LAM, r_az, r_el, (t_az, t_el))
        assert np.allclose(got, want, rtol=1e-9, atol=1e-9 * PEAK * a * b)


def test_no_echo_goes_through_metal() -> None:
    behind = plate_scattering_matrix(0.1, 0.1, LAM, math.pi, 0.1, (0.0, 0.1))
    assert np.array_equal(behind, np.zeros((2, 2)))
    # transmitter on +x, receiver on -x: no face of the box is seen by both
    assert np.array_equal(box_scattering_matrix(0.1, 0.1, 0.1, LAM, math.pi, 0.0, (0.0, 0.0)), np.zeros((2, 2)))


def test_a_mirror_throws_its_lobe_to_the_specular_direction_of_both_bases() -> None:
    # transmitter 40 deg left, receiver 40 deg right: PO keeps the transmitter's cosine in VV and HH alike
    matrix = plate_scattering_matrix(0.1, 0.1, LAM, math.radians(-40.0), 0.0, (math.radians(40.0), 0.0))
    want = PEAK * 0.01 * math.cos(math.radians(40.0))
    assert matrix[0, 0] == pytest.approx(want, rel=1e-12)
    assert matrix[1, 1] == pytest.approx(want, rel=1e-12)
    assert abs(matrix[0, 1]) < 1e-12
