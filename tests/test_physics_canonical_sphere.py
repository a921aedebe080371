"""Spheres: Mie's series and the lit hemisphere against tables, limits, conservation and 60-digit arithmetic."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from canonical_tools import PRINTED, columns, dbsm, wavelength

from shenron_rt.errors import InputError
from shenron_rt.physics import (
    fresnel,
    sphere_mie_amplitude,
    sphere_mie_rcs,
    sphere_po_amplitude,
    sphere_rcs,
    sphere_scattering_matrix,
)
from shenron_rt.physics.canonical.sphere import _coefficients


def test_metal_spheres_match_the_table_by_mie_and_by_physical_optics(shared_reference: Path) -> None:
    t = columns(shared_reference / "rcs/sphere_mono.csv")
    assert len(t["ka"]) > 30
    for radius, ghz, mie, po in zip(
        t["radius_m"], t["freq_ghz"], t["mie_dbsm"], t["po_lit_hemisphere_dbsm"], strict=True
    ):
        assert 10 * math.log10(float(sphere_mie_rcs(radius, wavelength(ghz)))) == pytest.approx(mie, abs=PRINTED)
        assert dbsm(sphere_po_amplitude(radius, wavelength(ghz))) == pytest.approx(po, abs=PRINTED)


def test_bistatic_metal_sphere_matches_the_table_in_both_planes(shared_reference: Path) -> None:
    t = columns(shared_reference / "rcs/sphere_bistatic_a25mm_77GHz.csv")
    e_plane, h_plane = sphere_mie_amplitude(0.025, wavelength(77), np.radians(t["bistatic_deg"]))
    assert np.max(np.abs(dbsm(e_plane) - t["eplane_dbsm"])) < PRINTED
    assert np.max(np.abs(dbsm(h_plane) - t["hplane_dbsm"])) < PRINTED


def test_lossy_spheres_match_the_table(shared_reference: Path) -> None:
    t = columns(shared_reference / "rcs/sphere_lossy_dielectric.csv")
    for i in range(len(t["radius_m"])):
        eps = complex(t["eps_r"][i], -t["eps_i"][i])
        sigma = float(sphere_mie_rcs(t["radius_m"][i], wavelength(t["freq_ghz"][i]), eps))
        assert 10 * math.log10(sigma) == pytest.approx(t["mie_dbsm"][i], abs=PRINTED)
        optics = float(sphere_rcs(t["radius_m"][i])) * abs(complex(fresnel(eps, 0.0)[0])) ** 2
        assert 10 * math.log10(optics) == pytest.approx(t["go_fresnel_dbsm"][i], abs=PRINTED)


# the same series in 60-digit arithmetic (mpmath); radius 1 m: k a, eps, angle, E plane, H plane
FROZEN: list[tuple[float, complex | None, float, complex, complex]] = [
    (161.3, None, 0.3, (-1.7618608860502758 - 0.1929976078732137j), (-1.7619538360253206 - 0.19274526068649273j)),
    (500.0, 2.25, 0.3, (0.38874495086381605 + 0.343213313795281j), (3.153279921669148 - 1.1557593160469302j)),
    (2000.0, None, 1.7, (1.487262588706765 - 0.9641773610687399j), (1.486320172713104 - 0.9656400891230884j)),
    (
        2000.0,
        (8.81 - 15.9j),
        0.0,
        (-0.5737015805338279 + 1.035437060593852j),
        (-0.5737015805338279 + 1.035437060593852j),
    ),
    (
        2000.0,
        (2.25 - 0.0034j),
        3.0,
        (-0.02488795001349832 + 1.5890604987486079j),
        (0.004798114671029482 - 1.8807343189064853j),
    ),
]


def test_the_series_keeps_its_digits_for_large_spheres() -> None:
    for ka, eps, angle, e_want, h_want in FROZEN:
        e_plane, h_plane = sphere_mie_amplitude(1.0, 2 * math.pi / ka, angle, eps)
        # measured 3e-9 of the optical amplitude at k a = 2000, where the phase k a itself has lost four digits
        assert abs(complex(e_plane) - e_want) < 1e-8
        assert abs(complex(h_plane) - h_want) < 1e-8


@pytest.mark.parametrize("eps", [None, 2.25, 80.0])
def test_spheres_without_loss_scatter_all_that_they_take(eps: complex | None) -> None:
    # for a passive lossless sphere every coefficient obeys |a|^2 = Re a
    for ka in (0.5, 20.0, 300.0):
        for c in _coefficients(ka, eps):
            assert np.allclose(np.abs(c) ** 2, c.real, rtol=0.0, atol=1e-10)


def test_lossy_spheres_scatter_less_than_they_take() -> None:
    for c in _coefficients(100.0, 6.6 - 9.0j):
        assert np.all(np.abs(c) ** 2 <= c.real + 1e-14)


def test_small_spheres_scatter_as_rayleigh() -> None:
    ka = 1e-3
    # metal: 9 pi a^2 (ka)^4; dielectric: 4 pi a^2 (ka)^4 |(eps - 1)/(eps + 2)|^2; the next term is (ka)^2
    assert float(sphere_mie_rcs(1.0, 2 * math.pi / ka)) == pytest.approx(9 * math.pi * ka**4, rel=1e-5)
    eps = 3.0 - 0.5j
    want = 4 * math.pi * ka**4 * abs((eps - 1) / (eps + 2)) ** 2
    assert float(sphere_mie_rcs(1.0, 2 * math.pi / ka, eps)) == pytest.approx(want, rel=1e-5)


def test_large_metal_spheres_are_mirrors_in_amplitude_and_phase() -> None:
    # first term after optics: 1/(2 k a) in quadrature, (2 k a)^-2 in size
    for ka in (200.0, 2000.0):
        lam = 2 * math.pi / ka
        mirror = -1j * math.sqrt(math.pi) * np.exp(2j * ka)
        for amplitude in sphere_mie_amplitude(1.0, lam):
            assert complex(amplitude / mirror) == pytest.approx(1.0 + 0.5j / ka, abs=2.0 / ka**2)
        # the lit hemisphere's rim adds its echo, 1/(2 k a), to the same mirror
        assert complex(sphere_po_amplitude(1.0, lam) / mirror) == pytest.approx(1.0, abs=1.01 / ka)


def test_physical_optics_of_tiny_spheres_has_no_cancellation() -> None:
    # k a -> 0: (2 sqrt(pi)/lambda) pi a^2; the two branches meet
    lam = np.array([4 * math.pi / 0.99e-3, 4 * math.pi / 1.01e-3, 1e7])
    assert np.allclose(sphere_po_amplitude(1.0, lam) * lam, 2 * math.pi**1.5, rtol=1e-3)
    below, above = sphere_po_amplitude(1.0, 4 * math.pi / np.array([1e-3 * (1 - 1e-12), 1e-3 * (1 + 1e-12)]))
    assert below == pytest.approx(above, rel=1e-9)


def test_matrices_are_the_two_planes_and_reciprocal(rng: np.random.Generator) -> None:
    lam = wavelength(24)
    flat = np.radians([0.0, 30.0, 100.0, 180.0])
    matrix = sphere_scattering_matrix(0.03, lam, flat, 0.0, (0.0, 0.0))
    e_plane, h_plane = sphere_mie_amplitude(0.03, lam, flat)
    # receivers in the x-y plane: V is across the scattering plane, H in it
    assert np.allclose(matrix[:, 0, 0], h_plane, atol=1e-12)
    assert np.allclose(matrix[:, 1, 1], e_plane, atol=1e-12)
    assert np.allclose(matrix[:, 0, 1], 0.0, atol=1e-12)
    for one, other in rng.uniform(-1.4, 1.4, size=(10, 2, 2)):
        there = sphere_scattering_matrix(0.03, lam, *other, (one[0], one[1]), 6.6 - 9.0j)
        back = sphere_scattering_matrix(0.03, lam, *one, (other[0], other[1]), 6.6 - 9.0j)
        assert np.allclose(there, back.T, atol=1e-12)
        # turning both about z changes nothing but the directions
        turned = sphere_scattering_matrix(0.03, lam, other[0] + 0.7, other[1], (one[0] + 0.7, one[1]), 6.6 - 9.0j)
        assert np.allclose(there, turned, atol=1e-11)


def test_spheres_out_of_range_are_refused() -> None:
    with pytest.raises(InputError, match="1e-6 to 2000"):
        sphere_mie_amplitude(1.0, 1e-3)
    with pytest.raises(InputError, match="passive"):
        sphere_mie_rcs(0.1, 0.01, 4.0 + 1.0j)
