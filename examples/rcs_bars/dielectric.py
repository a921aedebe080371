"""What is not a perfect conductor: coefficients against tables, and plates that reflect by them."""

from __future__ import annotations

import functools
import math

import numpy as np

from shenron_rt.physics import fresnel, layered, p2040_permittivity, plate_amplitude, slab, water_permittivity

from .bars import Bar, Cut, Limit, Run, dbsm
from .tables import columns, wavelength

LAM = wavelength(77.0)
#: eps' - j eps'' at 77 GHz: the references' concrete, glass and asphalt.
OPAQUE = {"concrete": 5.24 - 0.3225j, "glass": 6.31 - 0.283j, "asphalt": 5.2 - 0.21j}


def half_space(run: Run) -> list[Cut]:
    """Compare |R| of half-spaces."""
    t = columns(run.shared / "reference/materials/fresnel_halfspace.csv")
    got = fresnel(t["epsr"] - 1j * t["epsi"], np.radians(t["theta_deg"]))
    return [Cut(np.abs(r), t[f"abs{p}"]) for r, p in zip(got, ("TE", "TM"), strict=True)]


def slabs(run: Run) -> list[Cut]:
    """Compare |R| and |T| of slabs."""
    t = columns(run.shared / "reference/materials/slab.csv")
    names = zip(t["material"], t["freq_ghz"], strict=True)
    bumper = 2.25 - 0.0034j  # the table's polypropylene
    eps = np.array([bumper if n.startswith("poly") else p2040_permittivity(n, f * 1e9)[0] for n, f in names])
    got = slab(eps, t["thickness_m"], np.radians(t["theta_deg"]), t["freq_ghz"] * 1e9)
    wanted = ("R_TE_db", "R_TM_db", "T_TE_db", "T_TM_db")
    return [Cut(np.abs(x), 10.0 ** (t[column] / 20.0)) for x, column in zip(got, wanted, strict=True)]


def plate_cut(run: Run, material: str) -> list[Cut]:
    """Compare an opaque plate with the metal one's physical optics times |R| at each angle: V is TE, H is TM.

    Of J = n x H and M = -n x E with both waves, what goes straight back is -R times the metal's in either polarisation.
    """
    azimuth = np.arange(0.0, 40.0, 0.8 if run.quick else 0.1)
    eps = OPAQUE[material]
    got = run.sweep(
        "plate:0.1x0.1", frequency_hz=77e9, azimuth_deg=azimuth, max_bounces=1, permittivity=eps,
        polarization=("VV", "HH"),
    ).rcs_dbsm[0, 0]  # fmt: skip
    metal = plate_amplitude(0.1, 0.1, LAM, np.radians(azimuth))
    return [Cut(got[:, n], dbsm(metal * r)) for n, r in enumerate(fresnel(eps, np.radians(azimuth)))]


def mirror(run: Run, material: str) -> list[Cut]:
    """Compare the mirror direction of a plate, 5 to 75 degrees of incidence: (2 sqrt(pi)/lambda) A cos |R|."""
    angle = np.arange(5.0, 76.0, 20.0 if run.quick else 10.0)
    eps = OPAQUE[material]
    got = np.array(
        [
            run.sweep(
                "plate:0.1x0.1", frequency_hz=77e9, azimuth_deg=a, bistatic=(-a, 0.0), max_bounces=1, permittivity=eps,
                polarization=("VV", "HH"),
            ).rcs_dbsm[0, 0, 0]
            for a in angle
        ]
    )  # fmt: skip
    metal = 2.0 * math.sqrt(math.pi) / LAM * 0.01 * np.cos(np.radians(angle))
    return [Cut(got[:, n], dbsm(metal * r)) for n, r in enumerate(fresnel(eps, np.radians(angle)))]


def layers(run: Run) -> list[Cut]:
    """Compare |R| of water films on asphalt and of a coated metal."""
    t = columns(run.shared / "reference/materials/layered.csv")
    cuts = []
    for stack in np.unique(t["stack"]):
        for ghz in np.unique(t["freq_ghz"]):
            here = (t["stack"] == stack) & (t["freq_ghz"] == ghz)
            frequency = float(ghz) * 1e9
            if stack.startswith("water"):
                layer, base = (water_permittivity(frequency), float(stack.split("_")[1][:-2]) * 1e-3), OPAQUE["asphalt"]
            else:  # its plastic, fitted to the table's complex rows (residual 1e-5)
                layer, base = (2.6 - 0.02j, 3e-3), complex(p2040_permittivity("metal", frequency)[0])
            got = layered([layer], base, np.radians(t["theta_deg"][here]), frequency)
            wanted = ("R_TE_db", "R_TM_db")
            cuts += [Cut(np.abs(r), 10.0 ** (t[c][here] / 20.0)) for r, c in zip(got, wanted, strict=True)]
    return cuts


TABLES = "own table, exact"
BARS = (
    Bar("fresnel", "half-spaces, |R| TE and TM", TABLES, half_space, (Limit("max", 1e-4),), unit="", rays=False),
    Bar("slab", "slabs, |R| and |T| TE and TM", TABLES, slabs, (Limit("max", 1e-4),), unit="", rays=False),
    Bar("layers", "water films on asphalt, coated metal, |R| TE and TM", TABLES, layers, (Limit("max", 1e-4),), unit="",
        rays=False),
    *(Bar(f"opaque-{m}", f"plate 0.1 m of opaque {m}, 77 GHz, VV and HH", "PO x |R(angle)|",
          functools.partial(plate_cut, material=m), (Limit("at", 0.1), Limit("mean", 0.1, 30.0)), needs=None)
      for m in OPAQUE),
    *(Bar(f"mirror-{m}", "the same, bistatic, mirror direction at 5 to 75 deg", "2 sqrt(pi) A cos |R|/lambda",
          functools.partial(mirror, material=m), (Limit("max", 0.1),), needs=None) for m in ("concrete", "glass")),
)  # fmt: skip
