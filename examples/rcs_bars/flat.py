"""Plates, discs and boxes: physical optics in closed form, and a full-wave solution beside it."""

from __future__ import annotations

import functools

import numpy as np

from shenron_rt._typing import FloatArray, IntArray
from shenron_rt.frames import Pose
from shenron_rt.physics import plate_rcs
from shenron_rt.scene.mesh import TaggedMesh
from shenron_rt.scene.shapes import make_shape

from .bars import Bar, Cut, Limit, Run
from .tables import columns, rows, wavelength

#: Tables of plates: file, sides along y and z [m], GHz, columns of the cuts and their angle from the side along y.
PLATES = {
    "100x100mm_24GHz": (0.1, 0.1, 24.0, {"phi0": 0.0, "phi45": 45.0}),
    "100x100mm_77GHz": (0.1, 0.1, 77.0, {"phi0": 0.0, "phi45": 45.0}),
    "200x150mm_76.5GHz": (0.2, 0.15, 76.5, {"phi0": 0.0, "phi30": 30.0, "phi90": 90.0}),
}
#: From the acceptance table of the references, for the implementation and for the model.
OWN_THEORY = (Limit("at", 0.05), Limit("mean", 0.1, 30.0), Limit("max", 0.5, 30.0))
FULL_WAVE_77 = (Limit("mean", 0.1, 20.0), Limit("mean", 0.2, 30.0), Limit("mean", 1.3, 40.0))


def turned_plate(a: float, b: float, phi_deg: float) -> TaggedMesh:
    """Return a plate that shows, in the horizontal plane, the cut at ``phi_deg`` from its side a."""
    return make_shape(f"plate:{a}x{b}").transformed(Pose(ypr_deg=(0.0, 0.0, -phi_deg)))


def high_samples(run: Run, want: FloatArray, within_db: float, step: int) -> IntArray:
    """Return the samples that a bar counts, every ``step``-th in quick runs."""
    return np.flatnonzero(want >= want.max() - within_db)[run.thin(step)]


def plate_cuts(run: Run, name: str) -> list[Cut]:
    """Compare all cuts of a plate with physical optics."""
    a, b, ghz, angles = PLATES[name]
    table = columns(run.shared / f"reference/rcs/plate_{name}.csv")
    cuts = []
    for column, phi in angles.items():
        want = table[f"po_{column}_dbsm"]
        part = high_samples(run, want, 30.0, 4)
        got = run.sweep(
            turned_plate(a, b, phi), frequency_hz=ghz * 1e9, azimuth_deg=table["theta_deg"][part], max_bounces=1
        )
        cuts.append(Cut(got.rcs_dbsm[0, 0, :, 0], want[part]))
    return cuts


def plate_full_wave(run: Run, ghz: float) -> list[Cut]:
    """Compare the cut along one side with the method of moments, E across and along it."""
    table = columns(run.shared / f"reference/rcs/plate_100x100mm_{ghz:g}GHz.csv")
    cuts = []
    for e in ("Eperp", "Epar"):
        want = table[f"mom2d_phi0_{e}_dbsm"]
        part = high_samples(run, want, 40.0, 5)
        angle = table["theta_deg"][part]
        got = run.sweep("plate:0.1x0.1", frequency_hz=ghz * 1e9, azimuth_deg=angle, max_bounces=1)
        cuts.append(Cut(got.rcs_dbsm[0, 0, :, 0], want[part]))
    return cuts


def nulls(run: Run, shape: str, ghz: float, sine: np.ndarray) -> list[Cut]:
    """Find the minima [deg] near those where sin(angle) is ``sine``, to 0.01 deg."""
    want = np.degrees(np.arcsin(sine[: 3 if run.quick else 8]))
    near = np.arange(-0.15, 0.1501, 0.01)
    angles = want[:, None] + near + 0.003  # no sample on a null itself
    sweep = run.sweep(shape, frequency_hz=ghz * 1e9, azimuth_deg=angles.ravel(), max_bounces=1)
    level = sweep.rcs_dbsm[0, 0, :, 0].reshape(angles.shape)
    return [Cut(angles[np.arange(len(want)), level.argmin(axis=1)], want)]


def plate_nulls(run: Run, ghz: float) -> list[Cut]:
    """Nulls of a 0.1 m plate: sin = n lambda/(2 a)."""
    return nulls(run, "plate:0.1x0.1", ghz, np.arange(1, 9) * wavelength(ghz) / 0.2)


def disc_nulls(run: Run) -> list[Cut]:
    """Nulls of a 50 mm disc: the zeros of J1(2 k r sin)."""
    from scipy.special import jn_zeros

    return nulls(run, "disc:r=0.05", 77.0, jn_zeros(1, 8) * wavelength(77.0) / (4.0 * np.pi * 0.05))


def disc_cut(run: Run) -> list[Cut]:
    """Compare a disc with its Airy pattern."""
    table = columns(run.shared / "reference/rcs/disc_r50mm_77GHz.csv")
    part = high_samples(run, table["po_dbsm"], 30.0, 3)
    got = run.sweep("disc:r=0.05", frequency_hz=77e9, azimuth_deg=table["theta_deg"][part], max_bounces=1)
    return [Cut(got.rcs_dbsm[0, 0, :, 0], table["po_dbsm"][part])]


def box_cuts(run: Run) -> list[Cut]:
    """Compare a closed box, round the circle at two elevations."""
    table = columns(run.shared / "reference/rcs/box_300x200x100mm_77GHz.csv")
    cuts = []
    for elevation in (0.0, 10.0):
        cut = rows(table, el_deg=elevation)
        part = high_samples(run, cut["po_dbsm"], 30.0, 2)
        cut = {key: column[part] for key, column in cut.items()}
        got = run.sweep(
            "box:0.3x0.2x0.1", frequency_hz=77e9, azimuth_deg=cut["az_deg"], elevation_deg=elevation, max_bounces=1
        )
        cuts.append(Cut(got.rcs_dbsm[0, 0, :, 0], cut["po_dbsm"]))
    return cuts


def normal_incidence(run: Run) -> list[Cut]:
    """4 pi A^2/lambda^2 at three frequencies in one sweep."""
    frequency = np.array([24e9, 76.5e9, 77e9])
    got = run.sweep("plate:0.1x0.1", frequency_hz=frequency, azimuth_deg=0.0, max_bounces=1).rcs_dbsm[:, 0, 0, 0]
    want = [10.0 * np.log10(float(plate_rcs(0.1, 0.1, wavelength(f / 1e9)))) for f in frequency]
    return [Cut(got, np.array(want))]


BARS = (
    Bar("plate-normal", "plate 0.1 m, normal, 24/76.5/77 GHz", "4 pi A²/lambda²", normal_incidence,
        (Limit("max", 0.05),), needs=None),
    *(Bar(f"plate-{name}", f"plate {name.replace('_', ', ')}, cuts {', '.join(PLATES[name][3])}", "exact PO",
          functools.partial(plate_cuts, name=name), OWN_THEORY) for name in PLATES),
    *(Bar(f"plate-nulls-{ghz:g}", f"plate 0.1 m, {ghz:g} GHz, nulls", "n lambda/2a",
          functools.partial(plate_nulls, ghz=ghz), (Limit("max", 0.05),), unit="deg", needs=None)
      for ghz in (24.0, 77.0)),
    Bar("disc", "disc r = 50 mm, 77 GHz, cut", "exact PO", disc_cut, OWN_THEORY),
    Bar("disc-nulls", "disc r = 50 mm, 77 GHz, nulls", "zeros of J1", disc_nulls, (Limit("max", 0.05),), unit="deg",
        needs=None),
    Bar("box", "box 0.3 x 0.2 x 0.1 m, 77 GHz, 0 and 10 deg", "exact PO", box_cuts, (Limit("mean", 0.2, 30.0),)),
    Bar("plate-full-wave-77", "plate 0.1 m, 77 GHz, E across and along the cut", "full wave (2-D EFIE)",
        functools.partial(plate_full_wave, ghz=77.0), FULL_WAVE_77),
    Bar("plate-full-wave-24", "plate 0.1 m, 24 GHz, E across and along the cut", "full wave (2-D EFIE)",
        functools.partial(plate_full_wave, ghz=24.0), (Limit("mean", 0.25, 20.0),)),
)  # fmt: skip
