"""Di- and trihedrals: exact sums of polygon integrals over one, two and three bounces, and full wave."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from shenron_rt._typing import ComplexArray, FloatArray
from shenron_rt.frames import Pose
from shenron_rt.physics import trihedral_scattering_matrix
from shenron_rt.scene.mesh import TaggedMesh
from shenron_rt.scene.shapes import make_shape

from .bars import Bar, Cut, Limit, Run, dbsm
from .tables import columns, rows, wavelength

DIHEDRAL = "dihedral:a=0.1,b=0.1,h=0.1"
TILT_DEG = math.degrees(math.atan(math.sqrt(0.5)))
#: Maps the frame of the shapes (boresight +x) to that of the tables (plates in the coordinate planes).
TO_TABLE = Pose(ypr_deg=(45.0, TILT_DEG, 0.0))
CUTS = {"triangular_100mm_77GHz": 0.1, "triangular_150mm_24GHz": 0.15, "square_50mm_77GHz": 0.05,
        "circular_80mm_77GHz": 0.08}  # fmt: skip
LEGS = {"triangular": 0.1, "square": 0.05, "circular": 0.08}


@functools.cache
def in_table_frame(kind: str, leg: float) -> TaggedMesh:
    """Return a trihedral whose plates lie in the coordinate planes."""
    return make_shape(f"trihedral:{kind},a={leg}").transformed(TO_TABLE)


def exact_matrix(kind: str, leg: float, lam: float, azimuth: FloatArray, elevation: FloatArray) -> ComplexArray:
    """Return the exact scattering matrices (e, a, 2, 2) on a grid of directions [rad] of the tables' frame."""
    el, az = np.meshgrid(elevation, azimuth, indexing="ij")

    def basis(a: FloatArray, e: FloatArray) -> FloatArray:
        v = np.stack([-np.sin(e) * np.cos(a), -np.sin(e) * np.sin(a), np.cos(e)], axis=-1)
        return np.stack([v, np.stack([-np.sin(a), np.cos(a), np.zeros_like(a)], axis=-1)], axis=-2)

    toward = np.stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)], axis=-1) @ TO_TABLE.rotation
    a, e = np.arctan2(toward[..., 1], toward[..., 0]), np.arcsin(np.clip(toward[..., 2], -1.0, 1.0))
    turn = np.einsum("...ai,...bi->...ab", basis(az, el), basis(a, e) @ TO_TABLE.rotation.T)
    return np.asarray(turn @ trihedral_scattering_matrix(kind, leg, lam, a, e) @ np.swapaxes(turn, -1, -2))


def dihedral(run: Run, ghz: float, prefix: str) -> list[Cut]:
    """Compare the cut across the seam, VV and HH, with columns of the table."""
    table = columns(run.shared / f"reference/rcs/dihedral_100x100x100mm_{ghz:g}GHz.csv")
    part = run.thin(6)
    angle = table["phi_deg"][part] - 45.0
    got = run.sweep(DIHEDRAL, frequency_hz=ghz * 1e9, azimuth_deg=angle, polarization=("VV", "HH"))
    middle = int(np.abs(angle).argmin())
    return [
        Cut(got.rcs_dbsm[0, 0, :, n], table[f"{prefix}_{p}_dbsm"][part], middle) for n, p in enumerate(("VV", "HH"))
    ]


def dihedral_sign(run: Run) -> list[Cut]:
    """Compare the phase of VV over HH about 45 degrees with half a turn [deg]."""
    azimuth = np.arange(-5.0, 5.01, 0.5)
    cuts = []
    for ghz in (24.0, 77.0):
        got = run.sweep(DIHEDRAL, frequency_hz=ghz * 1e9, azimuth_deg=azimuth, polarization=("VV", "HH")).amplitude
        phase = np.degrees(np.angle(got[0, 0, :, 0] / got[0, 0, :, 1])) % 360.0
        cuts.append(Cut(phase, np.full(len(azimuth), 180.0)))
    return cuts


def error_table(name: str, extra_db: float, shared: Path) -> list[Limit]:
    """Return what exact physical optics scores against full wave, worse polarisation, and a margin [dB]."""
    table = rows(columns(shared / "reference/rcs/po_error_vs_fullwave.csv"), file=name)
    return [Limit("mean", round(float(table[f"mae_{n}"].max()) + extra_db, 2), float(n)) for n in (10, 20, 30)]


def along(
    run: Run, mesh: TaggedMesh, ghz: float, table: dict[str, np.ndarray], polarization: tuple[str, ...]
) -> FloatArray:
    """Return (rows, polarisations) levels in the directions of a cut, one of whose angles is the same throughout."""
    (azimuth, column), (elevation, line) = (np.unique(table[a], return_inverse=True) for a in ("az_deg", "el_deg"))
    got = run.sweep(
        mesh, frequency_hz=ghz * 1e9, azimuth_deg=azimuth, elevation_deg=elevation, polarization=polarization
    )
    return np.asarray(got.rcs_dbsm[0][line, column])


def table_cuts(run: Run, name: str, column_of: Callable[[str], str], cross: bool) -> list[Cut]:
    """Compare both cuts of a trihedral's table, co- or cross-polar."""
    kind, _, ghz = name.split("_")
    cuts = []
    for cut, axis in (("az", "az_deg"), ("el", "el_deg")):
        table = columns(run.shared / f"reference/rcs/trihedral_{name}_{cut}.csv")
        table = {key: column[run.thin(9)] for key, column in table.items()}
        pols = ("VV", "HH", "HV")  # one sweep for the bars of both
        got = along(run, in_table_frame(kind, CUTS[name]), float(ghz[:-3]), table, pols)
        middle = int(np.abs(table[axis] - (45.0 if cut == "az" else TILT_DEG)).argmin())
        cuts += [Cut(got[:, n], table[column_of(p)], middle) for n, p in enumerate(pols) if (p == "HV") == cross]
    return [c for c in cuts if c.want.max() > -110.0]  # the cut through the plane of symmetry has no cross-polar echo


def random_directions(run: Run, kind: str, ghz: float, cross: bool) -> list[Cut]:
    """Compare a trihedral in random directions of the octant with the exact sum; the first sample is boresight."""
    leg, lam = (LEGS[kind], wavelength(ghz)) if ghz > 50.0 else (0.15, wavelength(ghz))
    rng = np.random.default_rng(4)
    count = 4 if run.quick else 9
    azimuth = np.concatenate([[45.0], rng.uniform(2.0, 88.0, count)])
    elevation = np.concatenate([[TILT_DEG], rng.uniform(2.0, 85.0, count)])
    want = exact_matrix(kind, leg, lam, np.radians(azimuth), np.radians(elevation))
    pols = ("VV", "HH", "HV", "VH")  # one sweep for the bars of both
    got = run.sweep(
        in_table_frame(kind, leg), frequency_hz=ghz * 1e9, azimuth_deg=azimuth, elevation_deg=elevation,
        polarization=pols,
    ).rcs_dbsm  # fmt: skip
    pick = {"VV": (0, 0), "HH": (1, 1), "HV": (1, 0), "VH": (0, 1)}
    asked = pols[2:] if cross else pols[:2]
    return [Cut(got[0, :, :, pols.index(p)].ravel(), dbsm(want[(..., *pick[p])]).ravel()) for p in asked]


def full_wave(run: Run, lambdas: int, boresight: bool) -> list[Cut]:
    """Compare a triangular trihedral with the method of moments within 20 deg of boresight [dB re lambda^2]."""
    table = columns(run.shared / f"reference/rcs/trihedral_triangular_{lambdas}lambda_fullwave.csv")
    lam = wavelength(77.0)
    mesh = in_table_frame("triangular", lambdas * lam)
    cuts = []
    for cut, axis, middle in (("az", "az_deg", 45.0), ("el", "el_deg", TILT_DEG)):
        near = rows(table, cut=cut)
        off = np.abs(near[axis] - middle)
        keep = off < (0.3 if boresight else 20.0)
        near = {key: column[keep][run.thin(4)] for key, column in near.items()}
        got = along(run, mesh, 77.0, near, ("VV", "HH")) - 20.0 * math.log10(lam)
        at = int(np.abs(near[axis] - middle).argmin())
        cuts += [Cut(got[:, n], near[f"mom_{p}_db"], at) for n, p in enumerate(("VV", "HH"))]
    return cuts


def co(p: str) -> str:
    """Return the table's column of a co-polar echo."""
    return f"gopo_{p}_dbsm"


def cross(_: str) -> str:
    """Return the table's column of the cross-polar echo."""
    return "gopo_cross_HV_dbsm"


OWN_DIHEDRAL = (Limit("at", 0.1), Limit("mean", 0.15, 20.0))
OWN_TRIHEDRAL = (Limit("at", 0.05), Limit("mean", 0.1, 15.0))
BARS = (
    *(Bar(f"dihedral-{ghz:g}", f"dihedral 0.1 m, {ghz:g} GHz, VV and HH", "exact 1+2 bounces",
          functools.partial(dihedral, ghz=ghz, prefix="gopo"), OWN_DIHEDRAL) for ghz in (24.0, 77.0)),
    # E comes back from two plates upright along the seam, reversed across it; what single bounces add at 45 deg is at
    # most 2/(k w sin 45 deg) of it: 3 deg at 24 GHz, and the sum keeps the sign within 5
    Bar("dihedral-sign", "dihedral 0.1 m, 24 and 77 GHz, phase of VV over HH about 45 deg", "180 deg", dihedral_sign,
        (Limit("max", 5.0),), unit="deg", needs=None),
    Bar("dihedral-full-wave-77", "dihedral 0.1 m, 77 GHz, VV and HH, all angles", "full wave (2-D EFIE)",
        functools.partial(dihedral, ghz=77.0, prefix="mom2d"), (Limit("mean", 0.4),)),
    Bar("dihedral-full-wave-24", "dihedral 0.1 m, 24 GHz, VV and HH", "full wave (2-D EFIE)",
        functools.partial(dihedral, ghz=24.0, prefix="mom2d"),
        functools.partial(error_table, "dihedral_100x100x100mm_24GHz", 0.1)),
    *(Bar(f"trihedral-{name}", f"trihedral {name.replace('_', ', ')}, both cuts, VV and HH", "exact 1+2+3 bounces",
          functools.partial(table_cuts, name=name, column_of=co, cross=False), OWN_TRIHEDRAL) for name in CUTS),
    *(Bar(f"trihedral-cross-{name}", f"trihedral {name.replace('_', ', ')}, HV", "exact 1+2+3 bounces",
          functools.partial(table_cuts, name=name, column_of=cross, cross=True), (Limit("mean", 0.1, 15.0),))
      for name in CUTS),
    *(Bar(f"octant-{kind}-{ghz:g}", f"{kind} trihedral, {ghz:g} GHz, boresight and random directions, VV and HH",
          "exact 1+2+3 bounces", functools.partial(random_directions, kind=kind, ghz=ghz, cross=False), OWN_TRIHEDRAL,
          needs=None) for kind in LEGS for ghz in (24.0, 77.0)),
    *(Bar(f"octant-cross-{kind}-{ghz:g}", f"{kind} trihedral, {ghz:g} GHz, random directions, HV and VH",
          "exact 1+2+3 bounces", functools.partial(random_directions, kind=kind, ghz=ghz, cross=True),
          (Limit("mean", 0.1, 15.0),), needs=None) for kind in LEGS for ghz in (24.0, 77.0)),
    Bar("trihedral-full-wave-boresight", "triangular trihedral, 10 lambda, boresight", "full wave (3-D EFIE)",
        functools.partial(full_wave, lambdas=10, boresight=True), (Limit("at", 0.3),)),
    Bar("trihedral-full-wave", "triangular trihedral, 10 lambda, within 20 deg of boresight", "full wave (3-D EFIE)",
        functools.partial(full_wave, lambdas=10, boresight=False), (Limit("mean", 0.3),)),
)  # fmt: skip
