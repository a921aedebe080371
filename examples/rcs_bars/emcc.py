"""Targets of the Austin RCS Benchmark Suite: full wave, range measurements, exact physical optics.

Meshes are built here from the dimensions that the suite publishes; the ducted box comes as a mesh beside the tables.
"""

from __future__ import annotations

import functools
import math
from pathlib import Path
from typing import Any

import numpy as np

from shenron_rt.physics import box_amplitude, plate_amplitude
from shenron_rt.scene.mesh import TaggedMesh, build_mesh
from shenron_rt.scene.shapes import make_shape

from .bars import Bar, Cut, Limit, Run, dbsm
from .tables import columns, rows, wavelength

INCH = 0.0254
#: Closed camera box: corners (x, z) and depth along y, in its length of 0.4 m.
HEXAGON = np.array([(-0.5, -0.4), (0.23, -0.4), (0.5, -0.13), (0.5, 0.13), (0.23, 0.4), (-0.5, 0.4)])
DEPTH, BOX_LENGTH = 0.325, 0.4
ALMOND_LENGTH = 0.252374
#: Below the peak, where the table of scores counts exact physical optics as blind [dB].
NULL_DB = 70.0
TABLES = {"IIA": "plate_IIA_zero_thickness", "IIB": "plate_IIB_thin_measured", "IIISA": "camera_box_IIISA",
          "IIIA": "almond_IIIA", "IIISB": "camera_box_IIISB_cobra"}  # fmt: skip
POLARIZATION = {"V": "VV", "H": "HH"}


def camera_box() -> TaggedMesh:
    """Return the convex polyhedron of problem IIISA: a hexagon in the x-z plane drawn out along y."""
    n = len(HEXAGON)
    near = np.column_stack([HEXAGON[:, 0], np.full(n, -0.5 * DEPTH), HEXAGON[:, 1]])
    vertices = BOX_LENGTH * np.concatenate([near, near + np.array([0.0, DEPTH, 0.0])])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    sides = np.concatenate([np.stack([i, j, j + n], axis=1), np.stack([i, j + n, i + n], axis=1)])
    fan = np.stack([np.zeros(n - 2, dtype=int), np.arange(1, n - 1), np.arange(2, n)], axis=1)
    return build_mesh(vertices, np.concatenate([sides, fan[:, ::-1], fan + n]))


def almond(edge: float) -> TaggedMesh:
    """Return the NASA almond, tip on +x (Woo et al., IEEE Antennas Propag. Mag. 35(1), 1993), cut to ``edge`` [m]."""
    d = ALMOND_LENGTH
    n = math.ceil(d / edge)
    rear = 0.416667 * np.sin(np.linspace(-0.5 * math.pi, 0.0, n)[1:-1])  # closer where it rounds off
    t = np.concatenate([rear, np.linspace(0.0, 0.58333, n)[:-1]])
    body = np.sqrt(np.maximum(1.0 - (t / 0.416667) ** 2, 0.0))
    nose = np.sqrt(1.0 - (t / 2.08335) ** 2) - 0.96
    wide, high = np.where(t < 0.0, 0.193333 * body, 4.83345 * nose), np.where(t < 0.0, 0.064444 * body, 1.61115 * nose)
    m = math.ceil(2.0 * math.pi * 0.193333 * d / edge)
    psi = 2.0 * math.pi * np.arange(m) / m
    x = np.broadcast_to(t[:, None], (len(t), m))
    ring = d * np.stack([x, wide[:, None] * np.cos(psi), high[:, None] * np.sin(psi)], axis=-1).reshape(-1, 3)
    vertices = np.concatenate([ring, d * np.array([[-0.416667, 0.0, 0.0], [0.58333, 0.0, 0.0]])])
    row, column = np.meshgrid(np.arange(len(t) - 1) * m, np.arange(m), indexing="ij")
    following = (column + 1) % m
    a, b = row + column, row + following
    skin = np.stack([np.stack([a, b, b + m], -1), np.stack([a, b + m, a + m], -1)]).reshape(-1, 3)
    k, after = np.arange(m), (np.arange(m) + 1) % m
    last, tail, tip = (len(t) - 1) * m, len(ring), len(ring) + 1
    caps = [np.stack([np.full(m, tail), after, k], -1), np.stack([np.full(m, tip), last + k, last + after], -1)]
    return build_mesh(vertices, np.concatenate([skin, *caps]))


@functools.cache
def target(name: str, shared: Path) -> Any:
    """Return the mesh or mesh file of a problem."""
    if name == "IIA":
        return make_shape(f"plate:{10.5 * INCH}x{6 * INCH}")
    if name == "IIB":
        return make_shape(f"box:{0.064 * INCH}x{10.5 * INCH}x{6 * INCH}")
    if name == "IIIA":
        return almond(0.003)
    return camera_box() if name == "IIISA" else shared / "reference/emcc/camera_box_IIISB_cobra.ply"


def reference_rows(run: Run, name: str, kind: str, ghz: float, pol: str) -> dict[str, np.ndarray]:
    """Return a curve of the suite's tables, of the plate without what is beyond physical optics.

    Its edge and its nulls, more than 70 dB below the peak, are left out: the table of scores counts no such samples.
    """
    table = columns(run.shared / f"reference/emcc/{TABLES[name]}.csv")
    curve = rows(table, kind=kind, freq_ghz=ghz, pol=pol)
    if name != "IIA":
        return curve
    po = dbsm(plate_amplitude(10.5 * INCH, 6 * INCH, wavelength(ghz), np.radians(curve["phi_deg"])))
    return {key: column[po >= po.max() - NULL_DB] for key, column in curve.items()}


def against(run: Run, name: str, kind: str, ghz: float, pol: str, bounces: int = 1) -> list[Cut]:
    """Compare a cut in the x-y plane with one of the suite's curves."""
    curve = reference_rows(run, name, kind, ghz, pol)
    got = run.sweep(
        target(name, run.shared), frequency_hz=ghz * 1e9, azimuth_deg=curve["phi_deg"], polarization=POLARIZATION[pol],
        max_bounces=bounces,
    ).rcs_dbsm[0, 0, :, 0]  # fmt: skip
    return [Cut(got, curve["rcs_dbsm"])]


def exact_curve(run: Run, name: str, ghz: float) -> list[Cut]:
    """Compare with exact physical optics of the same body."""
    curve = rows(columns(run.shared / "reference/emcc/po_exact_curves.csv"), set=name, freq_ghz=ghz)
    part = run.thin(3)
    got = run.sweep(target(name, run.shared), frequency_hz=ghz * 1e9, azimuth_deg=curve["phi_deg"][part], max_bounces=1)
    return [Cut(got.rcs_dbsm[0, 0, :, 0], curve["po_dbsm"][part])]


def score(name: str, ghz: float, pol: str, shared: Path) -> list[Limit]:
    """Return what exact physical optics scores against full wave, and 0.1 dB."""
    row = rows(columns(shared / "reference/emcc/po_error_vs_fullwave.csv"), set=name, freq_ghz=ghz, pol=pol)
    return [Limit("mean", round(float(row[f"mae_{n}"][0]) + 0.1, 2), float(n)) for n in (10, 20, 30)]


def thin_plate_score(ghz: float, pol: str, shared: Path) -> list[Limit]:
    """Return the same for the plate of finite thickness, which the suite's own table of scores leaves out."""
    curve = reference_rows(Run(shared), "IIB", "ref", ghz, pol)
    size = (0.064 * INCH, 10.5 * INCH, 6 * INCH)
    po = dbsm(box_amplitude(*size, wavelength(ghz), np.radians(curve["phi_deg"])))
    cut = [Cut(po, curve["rcs_dbsm"])]
    return [Limit("mean", round(Limit("mean", None, n).value(cut) + 0.1, 2), n) for n in (10.0, 20.0)]


def sector_medians(run: Run, kind: str, ghz: float, pol: str) -> list[Cut]:
    """Compare medians over sectors of 15 degrees of the ducted box, eight bounces."""
    (cut,) = against(run, "IIISB", kind, ghz, pol, bounces=8)
    phi = reference_rows(run, "IIISB", kind, ghz, pol)["phi_deg"]
    sector = np.floor(phi / 15.0)
    medians = [[np.median(x[sector == s]) for s in np.unique(sector)] for x in (cut.got, cut.want)]
    return [Cut(np.array(medians[0]), np.array(medians[1]))]


SCORED = [("IIA", g, p) for g in (2.56, 5.12, 7.0, 10.2) for p in "VH"]
SCORED += [("IIISA", g, p) for g in (2.56, 5.12, 7.0) for p in "VH"]
NAMES = {"IIA": "plate IIA", "IIISA": "closed camera box IIISA", "IIIA": "almond IIIA"}
BARS = (
    *(Bar(f"{name}-po-{ghz:g}", f"{NAMES[name]}, {ghz:g} GHz", "exact PO",
          functools.partial(exact_curve, name=name, ghz=ghz), (Limit("mean", most, 30.0),))
      for name, ghz, most in (("IIA", 5.12, 0.1), ("IIA", 10.2, 0.1), ("IIISA", 5.12, 0.2), ("IIISA", 7.0, 0.2))),
    *(Bar(f"{name}-{ghz:g}-{pol}", f"{NAMES[name]}, {ghz:g} GHz, {POLARIZATION[pol]}", "full wave (MoM)",
          functools.partial(against, name=name, kind="ref", ghz=ghz, pol=pol),
          functools.partial(score, name, ghz, pol), slow=ghz < 7.0) for name, ghz, pol in SCORED),
    *(Bar(f"IIB-{ghz:g}-{pol}", f"thin plate IIB, {ghz:g} GHz, {POLARIZATION[pol]}", "full wave (MoM)",
          functools.partial(against, name="IIB", kind="ref", ghz=ghz, pol=pol),
          functools.partial(thin_plate_score, ghz, pol), slow=ghz < 8.0) for ghz in (5.12, 7.0, 10.24) for pol in "VH"),
    *(Bar(f"IIB-measured-{ghz:g}-{pol}", f"thin plate IIB, {ghz:g} GHz, {POLARIZATION[pol]}", "measurement",
          functools.partial(against, name="IIB", kind="meas_m1", ghz=ghz, pol=pol), (Limit("mean", None, 20.0),))
      for ghz in (10.24,) for pol in "VH"),
    *(Bar(f"IIISA-measured-{ghz:g}-{pol}", f"closed camera box IIISA, {ghz:g} GHz, {POLARIZATION[pol]}", "measurement",
          functools.partial(against, name="IIISA", kind="meas", ghz=ghz, pol=pol), (Limit("mean", None, 20.0),))
      for ghz in (7.0,) for pol in "VH"),
    Bar("IIIA-po-10.25", "almond IIIA, 10.25 GHz", "exact PO", functools.partial(exact_curve, name="IIIA", ghz=10.25),
        (Limit("mean", None, 20.0),)),
    *(Bar(f"IIIA-measured-{pol}", f"almond IIIA, 10.25 GHz, {POLARIZATION[pol]}", "measurement",
          functools.partial(against, name="IIIA", kind="meas_m1", ghz=10.25, pol=pol), (Limit("mean", None, 20.0),))
      for pol in "VH"),
    *(Bar(f"IIISB-measured-{pol}", f"ducted box IIISB, 10.24 GHz, {POLARIZATION[pol]}, medians of 15 deg",
          "measurement", functools.partial(sector_medians, kind="meas", ghz=10.24, pol=pol), (Limit("mean", None),))
      for pol in "VH"),
)  # fmt: skip
