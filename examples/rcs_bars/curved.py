"""Spheres and cylinders: physical optics over the lit part, Mie's series, and two directions at once."""

from __future__ import annotations

import functools
import math

import numpy as np

from shenron_rt._typing import ComplexArray, FloatArray
from shenron_rt.physics import (
    cylinder_amplitude,
    cylinder_rcs,
    sphere_mie_rcs,
    sphere_po_amplitude,
    sphere_scattering_matrix,
)

from .bars import Bar, Cut, Limit, Run, dbsm
from .tables import columns, wavelength

LAM = wavelength(77.0)
#: Aspects at which a sphere is alike; its mesh and the lattice of rays are not.
ASPECTS_DEG = (0.0, 17.0, 41.0, 73.0)
#: Bistatic angles up to which the solver is held to its own theory, and to Mie: physical optics ripples about Mie,
#: since its currents end at the edge of what is lit; the mean stays under the bar to 60 deg, single angles do not.
FURTHEST_DEG, MIE_DEG = 120.0, 60.0


def sphere(run: Run, radius: float, reference: str) -> list[Cut]:
    """Compare a sphere from some aspects, three frequencies, with one value each."""
    ghz = np.array([76.5, 77.0, 79.0])
    got = run.sweep(
        f"sphere:r={radius}", frequency_hz=ghz * 1e9, azimuth_deg=ASPECTS_DEG, elevation_deg=13.0, max_bounces=1
    ).rcs_dbsm[:, 0, :, 0]
    lam = np.array([wavelength(g) for g in ghz])
    exact = sphere_po_amplitude(radius, lam) if reference == "po" else np.sqrt(sphere_mie_rcs(radius, lam))
    return [Cut(row, np.full(len(row), level)) for row, level in zip(got, dbsm(exact), strict=True)]


def bistatic_po(radius: float, lam: float, bistatic: float) -> ComplexArray:
    """Return what the currents on the lit and visible part of a sphere send, V and H (2,) by V and H.

    Both directions lie in the x-y plane, ``bistatic`` [rad] apart and on either side of x. The lit and visible part is
    then bounded by two meridians: Gauss-Legendre over longitude and latitude converges as for a smooth integrand.
    """
    k = 2.0 * math.pi / lam
    half = 0.5 * (math.pi - bistatic)
    x, w = np.polynomial.legendre.leggauss(int(2.5 * k * radius) + 60)
    longitude, latitude = np.meshgrid(half * x, 0.5 * math.pi * x, indexing="ij")
    weight = half * 0.5 * math.pi * np.outer(w, w) * radius**2 * np.cos(latitude)
    n = np.stack(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)], axis=-1
    )

    def leg(angle: float) -> tuple[FloatArray, FloatArray]:
        toward = np.array([math.cos(angle), math.sin(angle), 0.0])
        return toward, np.array([[0.0, 0.0, 1.0], [-math.sin(angle), math.cos(angle), 0.0]])

    (source, transmit), (toward, receive) = leg(-0.5 * bistatic), leg(0.5 * bistatic)
    phasor = weight * np.exp(1j * k * radius * n @ (source + toward))
    current = np.cross(n[:, :, None, :], np.cross(-source, transmit))  # n x (d x E)
    return np.asarray(k / math.sqrt(math.pi) * np.einsum("ab,abti,ri->rt", phasor, current, receive))


def bistatic_sphere(run: Run, radius: float, reference: str) -> list[Cut]:
    """Compare a sphere seen from beside where it is lit, E in the scattering plane and across it."""
    last = FURTHEST_DEG if reference == "po" else MIE_DEG
    angle = np.arange(5.0, last + 0.1, 10.0 if run.quick else 5.0)
    got = run.sweep(
        f"sphere:r={radius}", frequency_hz=77e9, azimuth_deg=angle, bistatic=(0.0, 0.0), max_bounces=1,
        polarization=("VV", "HH"),
    ).rcs_dbsm[0, 0]  # fmt: skip
    if reference == "po":
        matrix = np.array([bistatic_po(radius, LAM, math.radians(a)) for a in angle])
    else:
        matrix = sphere_scattering_matrix(radius, LAM, np.radians(angle), 0.0, (0.0, 0.0))
    return [Cut(got[:, n], dbsm(matrix[:, n, n])) for n in range(2)]


def theory_holds(run: Run, radius: float) -> list[Cut]:
    """Find the bistatic angle up to which physical optics, without the solver, stays within 0.3 dB of Mie [deg]."""
    angle = np.arange(0.0, 90.0, 4.0 if run.quick else 1.0)
    po = np.array([bistatic_po(radius, LAM, math.radians(a)) for a in angle])
    mie = sphere_scattering_matrix(radius, LAM, np.radians(angle), 0.0, (0.0, 0.0))
    gap = np.abs(dbsm(po) - dbsm(mie))[:, [0, 1], [0, 1]].max(axis=1)
    beyond = np.flatnonzero(gap > 0.3)
    last = angle[beyond[0] - 1] if len(beyond) else angle[-1]
    return [Cut(np.array([last]), np.zeros(1))]


def lossy_sphere(run: Run) -> list[Cut]:
    """Compare water and skin with Mie's series."""
    table = columns(run.shared / "reference/rcs/sphere_lossy_dielectric.csv")
    cuts = []
    for row in range(len(table["radius_m"])):
        got = run.sweep(
            f"sphere:r={table['radius_m'][row]}", frequency_hz=table["freq_ghz"][row] * 1e9, azimuth_deg=ASPECTS_DEG,
            elevation_deg=13.0, max_bounces=1, permittivity=complex(table["eps_r"][row], -table["eps_i"][row]),
        ).rcs_dbsm[0, 0, :, 0]  # fmt: skip
        cuts.append(Cut(got, np.full(len(got), table["mie_dbsm"][row])))
    return cuts


def cylinder(run: Run, reference: str) -> list[Cut]:
    """Compare a cylinder at broadside, round the circle, two frequencies."""
    cuts = []
    for ghz in (76.5, 79.0):
        lam = wavelength(ghz)
        optics = np.sqrt(cylinder_rcs(0.05, 0.3, lam))
        exact = cylinder_amplitude(0.05, 0.3, lam, 0.0) if reference == "po" else optics
        azimuth = np.arange(0.0, 90.0, 7.3)[run.thin(2)]
        got = run.sweep("cylinder:r=0.05,l=0.3", frequency_hz=ghz * 1e9, azimuth_deg=azimuth, max_bounces=1)
        cuts.append(Cut(got.rcs_dbsm[0, 0, :, 0], np.full(len(azimuth), float(dbsm(exact)))))
    return cuts


BARS = (
    *(Bar(f"sphere-{1e3 * r:g}mm", f"sphere r = {1e3 * r:g} mm, 76.5-79 GHz (ka {ka} and more)", "PO of the lit half",
          functools.partial(sphere, radius=r, reference="po"), (Limit("max", 0.1),), needs=None)
      for r, ka in ((0.0625, 100), (0.1, 160))),
    *(Bar(f"sphere-{1e3 * r:g}mm-mie", f"sphere r = {1e3 * r:g} mm, 76.5-79 GHz", "Mie",
          functools.partial(sphere, radius=r, reference="mie"), (Limit("max", 0.3),), needs=None)
      for r in (0.0625, 0.1)),
    Bar("sphere-300mm", "sphere r = 300 mm, 76.5-79 GHz (ka 481)", "PO of the lit half",
        functools.partial(sphere, radius=0.3, reference="po"), (Limit("max", 0.1),), needs=None, slow=True),
    Bar("bistatic-sphere", f"sphere r = 62.5 mm, 77 GHz, bistatic 5 to {FURTHEST_DEG:g} deg", "PO of lit and seen",
        functools.partial(bistatic_sphere, radius=0.0625, reference="po"), (Limit("max", 0.3),), needs=None),
    Bar("bistatic-sphere-mie", f"sphere r = 62.5 mm, 77 GHz, bistatic 5 to {MIE_DEG:g} deg", "Mie",
        functools.partial(bistatic_sphere, radius=0.0625, reference="mie"), (Limit("mean", 0.3),), needs=None),
    *(Bar(f"bistatic-theory-{1e3 * r:g}mm",
          f"PO itself, sphere r = {1e3 * r:g} mm: bistatic angle up to which it is within 0.3 dB", "Mie",
          functools.partial(theory_holds, radius=r), (Limit("highest", None),), unit="deg", rays=False, needs=None)
      for r in (0.025, 0.0625)),
    Bar("sphere-lossy", "spheres of water and skin, 24 and 77 GHz", "Mie", lossy_sphere, (Limit("max", 0.3),)),
    Bar("cylinder", "cylinder 50 x 300 mm, broadside, round the circle", "2 pi a L²/lambda",
        functools.partial(cylinder, reference="optics"), (Limit("max", 0.2),), needs=None),
    Bar("cylinder-po", "cylinder 50 x 300 mm, broadside, round the circle", "exact PO",
        functools.partial(cylinder, reference="po"), (Limit("max", 0.2),), needs=None),
)  # fmt: skip
