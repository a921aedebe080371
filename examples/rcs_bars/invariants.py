"""What must not matter: which way the wave goes, how a surface is cut into triangles, how dense the rays are."""

from __future__ import annotations

import functools

import numpy as np

from shenron_rt.physics import plate_scattering_matrix
from shenron_rt.scene.mesh import TaggedMesh, build_mesh
from shenron_rt.scene.shapes import make_shape

from .bars import Bar, Cut, Limit, Run, dbsm
from .corners import LEGS
from .tables import wavelength

#: Two directions [deg] that see a plate under different angles, both in its main fan.
LIT_DEG, SEEN_DEG = (4.0, 0.0), (25.0, 8.0)


def cross_channels(run: Run, kind: str, ghz: float) -> list[Cut]:
    """Return the worst difference of HV and VH in random directions, below the strongest echo [dB]."""
    rng = np.random.default_rng(9)
    count = 4 if run.quick else 10
    got = run.sweep(
        f"trihedral:{kind},a={LEGS[kind] if ghz > 50.0 else 0.15}", frequency_hz=ghz * 1e9,
        azimuth_deg=np.append(0.0, rng.uniform(-40.0, 40.0, count)),
        elevation_deg=np.append(0.0, rng.uniform(-30.0, 45.0, count)), polarization=("VV", "HH", "HV", "VH"),
    ).amplitude  # fmt: skip
    gap = np.abs(got[..., 2] - got[..., 3]).max() / np.abs(got).max()
    return [Cut(dbsm(np.atleast_1d(gap)), np.zeros(1))]


def exchange(run: Run, reference: str) -> list[Cut]:
    """Swap transmitter and receiver of a bistatic plate, off its mirror direction.

    Physical optics is not reciprocal there: what it radiates carries the cosine of incidence, not that of departure.
    The two results differ by what the exact integral says they do.
    """
    ways = ((LIT_DEG, SEEN_DEG), (SEEN_DEG, LIT_DEG))
    got, want = [], []
    for lit, seen in ways:
        got.append(
            run.sweep(
                "plate:0.1x0.1", frequency_hz=77e9, azimuth_deg=seen[0], elevation_deg=seen[1], bistatic=lit,
                max_bounces=1, polarization=("VV", "HH"),
            ).rcs_dbsm[0, 0, 0]
        )  # fmt: skip
        exact = plate_scattering_matrix(0.1, 0.1, wavelength(77.0), *np.radians(seen), tuple(np.radians(lit)))
        want.append(dbsm(np.diagonal(exact)))
    if reference == "exact":
        return [Cut(np.ravel(got), np.ravel(want))]
    return [Cut(got[0], got[1])]


def split_in_four(mesh: TaggedMesh) -> TaggedMesh:
    """Return the mesh with every triangle cut in four at the middles of its edges."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    triangles = np.stack([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))], axis=1)
    faces = np.arange(12 * mesh.n_faces).reshape(-1, 3)
    return build_mesh(triangles.reshape(-1, 3), faces, mesh.parts, np.repeat(mesh.part, 4))


def split(run: Run, shape: str, ghz: float) -> list[Cut]:
    """Compare a shape with the same one cut finer."""
    mesh = make_shape(shape)
    azimuth = np.arange(-40.0, 41.0, 16.0 if run.quick else 4.0)
    options = {"frequency_hz": ghz * 1e9, "azimuth_deg": azimuth, "elevation_deg": 7.0}
    got, want = (run.sweep(m, **options).rcs_dbsm[0, 0, :, 0] for m in (split_in_four(mesh), mesh))
    return [Cut(got, want)]


BARS = (
    *(Bar(f"cross-{kind}-{ghz:g}", f"{kind} trihedral, {ghz:g} GHz: HV less VH below the peak", "reciprocity",
          functools.partial(cross_channels, kind=kind, ghz=ghz), (Limit("highest", -30.0, steady=False),), needs=None)
      for kind in LEGS for ghz in (24.0, 77.0)),
    Bar("exchange-exact", "plate 0.1 m, 77 GHz, bistatic, both ways", "exact PO, not reciprocal",
        functools.partial(exchange, reference="exact"), (Limit("max", 0.1),), needs=None),
    Bar("exchange", "the same: one way against the other, the asymmetry of PO", "reciprocity",
        functools.partial(exchange, reference="other way"), (Limit("max", None),), needs=None),
    *(Bar(f"split-{shape.split(':')[0]}", f"{shape}, {ghz:g} GHz, each triangle cut in four", "uncut mesh",
          functools.partial(split, shape=shape, ghz=ghz), (Limit("max", 0.1, steady=False),), needs=None)
      for shape, ghz in (("trihedral:square,a=0.05", 77.0), ("dihedral:a=0.1,b=0.1,h=0.1", 24.0),
                         ("box:0.3x0.2x0.1", 24.0), ("cylinder:r=0.05,l=0.1", 77.0))),
)  # fmt: skip
