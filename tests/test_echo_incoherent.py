"""The incoherent part of the physical model: the integral of sigma0 over the surface, and its statistics."""

from __future__ import annotations

import numpy as np
import pytest
from echo_tools import FOUR_PI_CUBED, ISO, db, scene_of

import shenron_rt as srt
from shenron_rt.frames import rotation_matrix

MATERIALS = """
description: for tests; 3 mm of roughness leave no coherent echo at 77 GHz
materials:
  volume:
    permittivity: {model: constant, real: 4.0, imag: 0.1}
    roughness_rms_m: 0.003
    volume_albedo: 0.5
    backscatter: {model: constant_gamma, gamma_db: -18}
    sources: {permittivity: x, roughness_rms_m: x, volume_albedo: x, backscatter: x}
  lobe:
    permittivity: {model: constant, real: 4.0, imag: 0.1}
    roughness_rms_m: 0.003
    backscatter: {model: geometric_optics, slope_rms: 0.1}
    sources: {permittivity: x, roughness_rms_m: x, backscatter: x}
tags: {"0.9.14": {Other: volume}}
"""


@pytest.fixture(scope="module")
def materials(tmp_path_factory):
    file = tmp_path_factory.mktemp("materials") / "rough.yaml"
    file.write_text(MATERIALS)
    return str(file)


def integral(table, material, center, side_y, side_z, nodes=400):
    """Return Pt lambda^2/(4 pi)^3 x integral of sigma0/R^4 dA over a parallelogram [W], by Gauss-Legendre."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    u, v = np.meshgrid(x / 2, x / 2, indexing="ij")
    p = np.asarray(center) + u[..., None] * side_y + v[..., None] * side_z
    area = np.cross(side_y, side_z)
    r = np.linalg.norm(p, axis=-1)
    cos = np.abs(p @ area) / r / np.linalg.norm(area)
    sigma0 = table[material].sigma0(ISO.center_hz, cos, "VV")
    surface = np.einsum("i,j,ij->", w / 2, w / 2, sigma0 / r**4) * np.linalg.norm(area)
    return ISO.tx_power_w * ISO.wavelength_m**2 / FOUR_PI_CUBED * surface


# shape, pose, full sides in the shape's frame
PATCHES = {
    "ground": ("ground:20x6", (20, 0, -1.2), (0, 0, 0), (20, 0, 0), (0, 6, 0)),
    "wall": ("plate:12x4", (15, 2, 0.5), (10, 0, 0), (0, 12, 0), (0, 0, 4)),
    "slanted": ("plate:12x4", (15, 2, 0.5), (65, 20, 5), (0, 12, 0), (0, 0, 4)),
    "face": ("plate:4x4", (10, 0, 0), (0, 0, 0), (0, 4, 0), (0, 0, 4)),
}


@pytest.mark.parametrize("material", ["volume", "lobe"])
@pytest.mark.parametrize("patch", PATCHES)
def test_mean_power_is_the_integral_of_sigma0(patch, material, materials):
    """0.2 dB. The speckle of each row is divided out, so that only the sampling by cells is left; 10 grids of
    3000 aimed cells."""
    shape, xyz, ypr, a, b = PATCHES[patch]
    R = rotation_matrix(ypr)
    expected = integral(srt.load_materials(materials), material, xyz, R @ a, R @ b)
    scene = scene_of(
        {"id": 5, "shape": shape, "xyz_m": xyz, "ypr_deg": ypr, "material": material, "aim": 3_000}, materials=materials
    )
    powers = []
    for seed in range(10):
        scat = srt.trace(scene, seed=seed, rays=100)
        returns = srt.illuminate(scat, ISO, materials=materials)
        rough = ~returns.coherent
        speckle = np.abs(scat.speckle[returns.scatterer[rough]]) ** 2
        powers.append(np.sum(np.abs(returns.amplitude[rough]) ** 2 / speckle))
    if expected < 1e-40:  # far outside the lobe there is nothing to compare
        assert np.mean(powers) < 1e-38
    else:
        assert abs(db(np.mean(powers) / expected)) < 0.2


def test_speckle_is_fully_developed(materials):
    """Power over its local mean is exponential: mean and standard deviation 1 within 3 %, phase uniform.

    2e4 samples give the mean to 0.7 % and the standard deviation to 1.4 % (one sigma).
    """
    scene = scene_of({"id": 5, "shape": "plate:20x20", "xyz_m": (10, 0, 0), "material": "volume"}, materials=materials)
    values = []
    for seed in range(4):
        scat = srt.trace(scene, seed=seed, rays=40_000)
        returns = srt.illuminate(scat, ISO, materials=materials)
        rough = ~returns.coherent
        row = returns.scatterer[rough]
        sigma0 = srt.load_materials(materials)["volume"].sigma0(ISO.center_hz, scat.cos_incidence[row], "VV")
        mean = ISO.tx_power_w * ISO.wavelength_m**2 / FOUR_PI_CUBED * sigma0 * scat.area[row] / scat.range[row] ** 4
        values.append(returns.amplitude[rough] / np.sqrt(mean))
    z = np.concatenate(values)
    power = np.abs(z) ** 2
    assert len(z) > 10_000
    assert power.mean() == pytest.approx(1, abs=0.03)
    assert power.std() == pytest.approx(1, abs=0.03)
    assert abs(np.mean(z)) < 3 / np.sqrt(len(z))
    assert abs(np.mean(z**2)) < 4 / np.sqrt(len(z))
    # the share above 3 of an exponential is e^-3
    assert np.mean(power > 3) == pytest.approx(np.exp(-3), rel=0.1)


def test_speckle_changes_with_seed_and_frame_but_not_its_mean(materials):
    scene = scene_of({"id": 5, "shape": "plate:8x8", "xyz_m": (10, 0, 0), "material": "volume"}, materials=materials)

    def level(**how):
        return srt.illuminate(srt.trace(scene, rays=2_000, **how), ISO, materials=materials).power_by_object()[5]

    powers = np.array([level(seed=s) for s in range(12)] + [level(frame=f) for f in range(1, 13)])
    assert len(np.unique(powers)) == 24
    # about 200 cells each: 7 % of spread by speckle, a little more by cells at the rim
    assert 0.02 < powers.std() / powers.mean() < 0.25


def test_incoherent_echoes_lie_on_the_surface_within_their_cell(materials):
    scene = scene_of(
        {"id": 5, "shape": "ground:40x20", "xyz_m": (20, 0, -1.2), "material": "volume"}, materials=materials
    )
    scat = srt.trace(scene, rays=20_000)
    returns = srt.illuminate(scat, ISO, materials=materials)
    rough = ~returns.coherent
    p, center = returns.position[rough], scat.position[returns.scatterer[rough]]
    np.testing.assert_allclose(p[:, 2], -1.2, atol=1e-9)
    d_echo = p / np.linalg.norm(p, axis=1, keepdims=True)
    d_center = center / np.linalg.norm(center, axis=1, keepdims=True)
    spacing = np.sqrt(4 * np.pi / 20_000)
    assert np.max(np.linalg.norm(d_echo - d_center, axis=1)) < 1.2 * spacing
    assert np.median(np.linalg.norm(p - center, axis=1)) > 0.01


def test_without_speckle_of_the_tracer_the_model_draws_its_own(materials):
    """LiDAR points: no footprint, no normal, no speckle; the same numbers for the same seed."""
    rows = np.column_stack([np.full(5_000, 20.0), np.zeros((5_000, 3)), np.full(5_000, 0.5), np.full((5_000, 2), 3.0)])
    rows[:, 6] = 22
    scat = srt.Scatterers.from_table(rows, area=np.full(5_000, 0.01))
    first, again = (srt.illuminate(scat, ISO, materials=materials) for _ in range(2))
    assert first.amplitude.tobytes() == again.amplitude.tobytes()
    assert not first.coherent.any()
    gamma = 10**-1.8 * 0.5
    expected = ISO.tx_power_w * ISO.wavelength_m**2 / FOUR_PI_CUBED * gamma * 5_000 * 0.01 / 20.0**4
    # 5000 independent exponentials: 1.4 % at one sigma
    assert first.power_by_object()[3] == pytest.approx(expected, rel=0.06)
