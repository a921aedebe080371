"""Curved surfaces and corners at a finite range: tables, far-field limits, optics, a tracer of single rays."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from canonical_tools import PRINTED, basis, columns, dbsm, wavelength

from shenron_rt.errors import InputError
from shenron_rt.physics import (
    cylinder_amplitude,
    dihedral_scattering_matrix,
    near_range_cylinder_rcs,
    near_range_dihedral_matrix,
    near_range_plate_rcs,
    near_range_surface_amplitude,
    near_range_trihedral_matrix,
    near_range_trihedral_rcs,
    plate_amplitude,
    sphere_po_amplitude,
    trihedral_rcs,
    trihedral_scattering_matrix,
)
from shenron_rt.physics.canonical.corner import trihedral_corner

LAM = wavelength(77)


def flat(y: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points and area vectors of the y-z plane."""
    zero = np.zeros_like(y)
    return np.stack([zero, y, z], axis=-1), np.stack([zero + 1.0, zero, zero], axis=-1)


def ball(theta: np.ndarray, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return points and area vectors of a sphere of 30 mm, theta from the x axis."""
    out = np.stack([np.cos(theta), np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)], axis=-1)
    return 0.03 * out, 0.03**2 * np.sin(theta)[..., None] * out


def test_surface_integral_of_a_flat_patch_is_the_plate_s() -> None:
    for distance in (1.0, 5.0, 10.0):
        got = near_range_surface_amplitude(flat, (-0.15, 0.15), (-0.15, 0.15), LAM, (distance, 0.0, 0.0))
        assert abs(got) ** 2 == pytest.approx(near_range_plate_rcs(0.3, 0.3, LAM, distance), rel=1e-9)
    # far away, off its normal, in amplitude and phase: the wave bends by k D^2/R = 8e-5 of the peak at 2e5 m at most
    u, _ = basis(0.01, 0.02)
    got = near_range_surface_amplitude(flat, (-0.05, 0.05), (-0.05, 0.05), LAM, 2e5 * u)
    peak = float(plate_amplitude(0.1, 0.1, LAM, 0.0).real)
    assert abs(got - complex(plate_amplitude(0.1, 0.1, LAM, 0.01, 0.02))) < 8e-5 * peak


def test_surface_integral_of_a_sphere_far_away_is_the_lit_hemisphere() -> None:
    got = near_range_surface_amplitude(ball, (0.0, math.pi / 2), (0.0, 2.0 * math.pi), LAM, (1e4, 0.0, 0.0))
    # the lit part ends 3e-6 rad before the patch does
    assert got == pytest.approx(complex(sphere_po_amplitude(0.03, LAM)), rel=1e-5)
    # the side that looks away adds nothing but the quadrature's error at the kink where the light ends: 1.1e-3
    whole = near_range_surface_amplitude(ball, (0.0, math.pi), (0.0, 2.0 * math.pi), LAM, (1e4, 0.0, 0.0))
    assert abs(whole - got) < 2e-3 * abs(got)


def test_cylinder_far_away_is_the_far_field_s() -> None:
    far = dbsm(cylinder_amplitude(0.05, 0.3, LAM, 0.0))
    assert 10 * math.log10(near_range_cylinder_rcs(0.05, 0.3, LAM, 1e5)) == pytest.approx(far, abs=1e-3)
    # from a height: elevation atan(h/R), past the first null
    height = 1e5 * math.tan(0.009)
    far = dbsm(cylinder_amplitude(0.05, 0.3, LAM, 0.009, caps=False))
    assert 10 * math.log10(near_range_cylinder_rcs(0.05, 0.3, LAM, 1e5, height)) == pytest.approx(far, abs=2e-3)


def test_a_long_pole_swings_about_the_optics_of_an_endless_one() -> None:
    # Fresnel ripple of its two ends: mean amplitude over lengths of many zones is that of the endless pole
    distance, radius, lam = 5.0, 0.08, wavelength(24)
    optics = math.pi * distance**3 * radius / (distance - radius) ** 2
    lengths = np.linspace(1.5, 3.0, 41)
    ratio = np.sqrt([near_range_cylinder_rcs(radius, float(x), lam, distance) / optics for x in lengths])
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.02)
    assert np.max(np.abs(ratio - 1.0)) < 0.2  # the plane wave's 2 pi a L^2/lambda is 20 dB and more above
    assert near_range_cylinder_rcs(radius, 3.0, lam, distance) < 0.01 * 2.0 * math.pi * radius * 9.0 / lam


def test_trihedral_aperture_matches_the_table_and_the_chains_approach_it(shared_reference: Path) -> None:
    t = columns(shared_reference / "rcs/near_range_apparent_rcs.csv")
    compared = 0
    for name, ghz, distance, want in zip(t["target"], t["freq_ghz"], t["range_m"], t["apparent_dbsm"], strict=True):
        if not name.startswith("trihedral"):
            continue
        compared += 1
        leg, lam = float(name.split("_")[2].removesuffix("mm")) * 1e-3, wavelength(ghz)
        aperture = 10 * math.log10(near_range_trihedral_rcs(leg, lam, distance))
        assert aperture == pytest.approx(want, abs=PRINTED)
        if distance in (10.0, 50.0) and leg == 0.1:
            chains = near_range_trihedral_matrix("triangular", leg, lam, distance, bounces=(3,))
            # 8.8 leg/R dB: the rays go on diverging to their last plate
            assert dbsm(chains[0, 0]) - aperture == pytest.approx(8.78 * leg / distance, rel=0.02)
    assert compared == 44


@pytest.mark.parametrize("kind", ["triangular", "square", "circular"])
def test_corners_far_away_are_the_far_field_s(kind: str) -> None:
    far = trihedral_scattering_matrix(kind, 0.02, LAM, 0.1, -0.2)
    gaps = []
    for distance in (1e3, 1e4):
        near = near_range_trihedral_matrix(kind, 0.02, LAM, distance, 0.1, -0.2)
        gaps.append(np.max(np.abs(near - far)) / np.max(np.abs(far)))
    assert gaps[1] < 6e-5  # k leg^2/R
    assert gaps[1] == pytest.approx(0.1 * gaps[0], rel=0.1)


def test_dihedral_far_away_is_the_far_field_s() -> None:
    far = dihedral_scattering_matrix(0.03, 0.04, 0.02, LAM, 0.1, 0.02)
    near = near_range_dihedral_matrix(0.03, 0.04, 0.02, LAM, 1e4, 0.1, 0.02)
    # a double bounce turns its phase at 2 k out to the plates' ends: k (b^2 + h^2)/R = 3e-4
    assert np.max(np.abs(near - far)) < 3e-4 * np.max(np.abs(far))


def transverse(field: np.ndarray, ray: np.ndarray) -> np.ndarray:
    """Return unit vectors (n, 3) along the part of ``field`` (3,) across ``ray`` (n, 3)."""
    part = field - (ray @ field)[:, None] * ray
    return part / np.linalg.norm(part, axis=1, keepdims=True)


def traced(leg: float, lam: float, radar: np.ndarray, fields: np.ndarray, count: int) -> np.ndarray:
    """Return the matrix of a square corner by tracing single rays from the radar, in the plates' frame."""
    k, distance = 2.0 * math.pi / lam, float(np.linalg.norm(radar))
    half = 1.05 * leg * math.sqrt(2.0) / distance
    s = ((np.arange(count) + 0.5) / count * 2.0 - 1.0) * half
    slope = np.stack(np.meshgrid(s, s, indexing="ij"), axis=-1).reshape(-1, 2)
    d = -radar / distance + slope @ fields
    stretch = np.linalg.norm(d, axis=1)
    d, solid = d / stretch[:, None], (2.0 * half / count) ** 2 / stretch**3
    e = np.stack([transverse(f, d) for f in fields], axis=1)
    x, length, total = np.broadcast_to(radar, d.shape).copy(), np.zeros(len(d)), np.zeros((2, 2), dtype=complex)
    for _ in range(3):
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where(d < 0.0, -x / d, np.inf)
        t[t < 1e-9] = np.inf
        hit = x[:, None, :] + np.where(np.isfinite(t), t, 1e9)[..., None] * d[:, None, :]
        on = np.ones(t.shape, dtype=bool)
        for plate in range(3):
            others = hit[:, plate, [(plate + 1) % 3, (plate + 2) % 3]]
            on[:, plate] = np.isfinite(t[:, plate]) & np.all((others >= 0.0) & (others <= leg), axis=1)
        t = np.where(on, t, np.inf)
        plate = np.argmin(t, axis=1)
        go = np.isfinite(t[np.arange(len(t)), plate])
        t, plate, d, e, solid = t[go, plate[go]], plate[go], d[go], e[go], solid[go]
        x, length = x[go] + t[:, None] * d, length[go] + t
        n = np.eye(3)[plate]
        back = radar - x
        way = np.linalg.norm(back, axis=1)
        receive = np.stack([transverse(f, back / way[:, None]) for f in fields], axis=1)
        current = np.cross(n[:, None], np.cross(d[:, None], e))
        weight = solid * length / (-np.sum(d * n, axis=1) * way) * np.exp(-1j * k * (length + way - 2.0 * distance))
        total += np.einsum("m,mri,mti->rt", weight, receive, current)
        d = d - 2.0 * np.sum(d * n, axis=1)[:, None] * n
        e = -e + 2.0 * np.einsum("mti,mi->mt", e, n)[..., None] * n[:, None]
    return 2.0 * math.sqrt(math.pi) / lam * distance**2 * total


def test_corner_at_five_legs_is_what_single_rays_add_up_to() -> None:
    leg, lam = 0.1, wavelength(24)
    azimuth, elevation = 0.1, 0.15
    axes = trihedral_corner("square", leg, lam).axes
    u, fields = basis(azimuth, elevation)
    want = traced(leg, lam, 0.5 * axes @ u, fields @ axes.T, 600)
    got = near_range_trihedral_matrix("square", leg, lam, 0.5, azimuth, elevation)
    # 600 x 600 rays: the rims are known to half a ray of 0.5 mm, two of them of some 300 rays' width at random
    assert np.max(np.abs(got - want)) < 5e-3 * np.max(np.abs(want))


def test_far_corners_are_the_textbook_s_in_the_aperture_estimate() -> None:
    assert near_range_trihedral_rcs(0.1, LAM, 1e4) == pytest.approx(
        float(trihedral_rcs("triangular", 0.1, LAM)), rel=1e-5
    )


def test_a_radar_inside_the_target_is_refused() -> None:
    with pytest.raises(InputError, match="in front of a plate"):
        near_range_trihedral_matrix("square", 0.1, LAM, 0.15)
    with pytest.raises(InputError, match="range above 0"):
        near_range_surface_amplitude(flat, (-1.0, 1.0), (-1.0, 1.0), LAM, (0.0, 0.0, 0.0))
    with pytest.raises(InputError, match="stand outside"):
        near_range_cylinder_rcs(0.1, 1.0, LAM, 0.1)
