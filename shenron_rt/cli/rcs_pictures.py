"""Which pictures a sweep gives, and what they need."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..plot._style import save
from ..plot.rcs import Cut, cut_of, rcs_cut, rcs_map, rcs_polar

if TYPE_CHECKING:
    from .._typing import FloatArray
    from ..rcs import RcsSweep
    from ..scene.mesh import TaggedMesh
    from ..turntable import AngularStatistics, Convergence, Reference

__all__ = ["draw"]

#: Window of the statistics where none is asked for [deg].
_WINDOW_DEG = 5.0
#: Aspects that a window must hold for a band to mean anything.
_LEAST_IN_WINDOW = 5
#: An image needs so many frequencies and angles, and at most this span [deg].
_LEAST_FOR_IMAGE, _MOST_IMAGE_DEG = 8, 90.0
_POLAR_FROM_DEG = 60.0
#: Side of an image over the target's.
_MARGIN = 1.35


def draw(
    root: Path,
    sweep: RcsSweep,
    mesh: TaggedMesh,
    reference: Reference | None,
    report: Convergence | None,
    window_deg: float | None,
) -> tuple[list[str], list[str]]:
    """Draw what the swept axes allow; return the files' names, and what to know about them."""
    written, notes = [], []
    cut = cut_of(sweep)
    found = _statistics(sweep, cut, window_deg)
    save(rcs_cut(sweep, cut=cut, statistics=found, reference=reference), root / f"rcs_{cut.axis}.png")
    written.append(f"rcs_{cut.axis}.png")
    if cut.axis == "azimuth" and len(cut.x) > 1 and np.ptp(cut.x) >= _POLAR_FROM_DEG:
        save(rcs_polar(sweep, statistics=found), root / "rcs_polar.png")
        written.append("rcs_polar.png")
    if len(sweep.elevation_deg) > 1 and len(sweep.azimuth_deg) > 1:
        save(rcs_map(sweep), root / "rcs_map.png")
        written.append("rcs_map.png")
    if report is not None:
        from ..plot.rcs_convergence import convergence_picture

        save(convergence_picture(report), root / "convergence.png")
        written.append("convergence.png")
    if len(sweep.frequency_hz) > 2:
        images, more = _down_range(root, sweep, mesh)
        written += images
        notes += more
    return written, notes


def _statistics(sweep: RcsSweep, cut: Cut, window_deg: float | None) -> AngularStatistics | None:
    """Return the statistics of a cut over an angle, or None where windows would be all but empty or the whole."""
    from ..turntable import angular_statistics

    if cut.axis == "frequency" or len(cut.x) < _LEAST_IN_WINDOW:
        return None
    span = float(np.ptp(cut.x))
    window = window_deg
    if window is None:
        # wide enough for a band to mean something, narrow enough to follow the lobes
        least = (_LEAST_IN_WINDOW - 1) * float(np.median(np.diff(np.sort(cut.x))))
        window = max(min(_WINDOW_DEG, span / 6.0), least)
        if not 0.0 < window <= span / 3.0:
            return None
    return angular_statistics(cut.x, sweep.rcs_m2[cut.index][:, 0], window)


def _down_range(root: Path, sweep: RcsSweep, mesh: TaggedMesh) -> tuple[list[str], list[str]]:
    from ..plot.rcs_images import range_aspect, range_profile_of_target
    from ..turntable.imaging import equally_spaced, range_profile

    if not equally_spaced(sweep.frequency_hz, 3):
        return [], ["no range profile: it needs equally spaced, ascending frequencies"]
    if sweep.bistatic_deg is not None:
        return [], ["no range profile: the sweep is bistatic"]
    el, az = int(np.abs(sweep.elevation_deg).argmin()), int(np.abs(sweep.azimuth_deg).argmin())
    written, notes = [], []
    profile = range_profile(sweep.amplitude[:, el, :, 0], sweep.frequency_hz)
    depth = _depth(mesh, sweep.elevation_deg[el], sweep.azimuth_deg)
    name = sweep.polarization[0]
    middle = f"{sweep.azimuth_deg[az]:g} deg azimuth, {sweep.elevation_deg[el]:g} deg elevation"
    one = range_profile(sweep.amplitude[:, el, az, 0], sweep.frequency_hz)
    title = f"{sweep.target}: range profile, {_band(sweep)}"
    figure = range_profile_of_target(one, depth_m=tuple(depth[:, az].tolist()), label=f"{name}, {middle}", title=title)
    save(figure, root / "range_profile.png")
    written.append("range_profile.png")
    whole = float(depth[0].min()), float(depth[1].max())
    if profile.extent_m < 2.0 * max(-whole[0], whole[1]):
        notes.append(
            f"range profiles fold: the target reaches {max(-whole[0], whole[1]):.2g} m from its origin, "
            f"{profile.extent_m:.2g} m are unambiguous; take a smaller frequency step"
        )
    if len(sweep.azimuth_deg) >= _LEAST_FOR_IMAGE:
        figure = range_aspect(profile, sweep.azimuth_deg, depth_m=whole, title=f"{title}, {name}")
        save(figure, root / "range_azimuth.png")
        written.append("range_azimuth.png")
        images, more = _image(root, sweep, mesh, el)
        written += images
        notes += more
    return written, notes


def _image(root: Path, sweep: RcsSweep, mesh: TaggedMesh, el: int) -> tuple[list[str], list[str]]:
    from ..plot.rcs_images import isar_picture
    from ..turntable.imaging import equally_spaced, isar_image

    if not equally_spaced(sweep.azimuth_deg, _LEAST_FOR_IMAGE) or len(sweep.frequency_hz) < _LEAST_FOR_IMAGE:
        return [], ["no image: it needs 8 or more equally spaced frequencies and azimuths"]
    if np.ptp(sweep.azimuth_deg) > _MOST_IMAGE_DEG:
        return [], [f"no image: azimuth spans more than {_MOST_IMAGE_DEG:g} deg; sweep a part for one"]
    if sweep.distance_m is not None:
        return [], ["no image: the sweep is in the near range, the image is for plane waves"]
    data, elevation = sweep.amplitude[:, el, :, 0], float(sweep.elevation_deg[el])
    outline = _outline(mesh)
    reach = _MARGIN * 2.0 * float(np.abs(outline).max())
    image = isar_image(data, sweep.frequency_hz, sweep.azimuth_deg, elevation_deg=elevation)
    extent = min(image.down_extent_m, image.cross_extent_m)
    if reach < extent:
        image = isar_image(data, sweep.frequency_hz, sweep.azimuth_deg, elevation_deg=elevation, size_m=reach)
    span = f"{sweep.azimuth_deg[0]:g} to {sweep.azimuth_deg[-1]:g} deg"
    title = f"{sweep.target}: ISAR, {_band(sweep)}, azimuth {span}"
    save(isar_picture(image, outline=outline, polarization=sweep.polarization[0], title=title), root / "isar.png")
    folds = [f"the image folds beyond {extent:.3g} m; the target needs {reach:.3g} m"] if reach > extent else []
    return ["isar.png"], folds


def _depth(mesh: TaggedMesh, elevation_deg: float, azimuth_deg: FloatArray) -> FloatArray:
    """Return (2, n_az) where the target begins and ends, down range from its origin [m]."""
    az, el = np.radians(azimuth_deg), np.radians(elevation_deg)
    toward = np.stack([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.full(len(az), np.sin(el))])
    points = _corners(mesh)
    ends = [(-(points @ toward[:, i : i + 64])) for i in range(0, len(az), 64)]
    return np.stack([np.concatenate([f(e, axis=0) for e in ends]) for f in (np.min, np.max)])


def _corners(mesh: TaggedMesh) -> FloatArray:
    return np.asarray(mesh.vertices[np.unique(mesh.faces)], dtype=np.float64)


def _outline(mesh: TaggedMesh) -> FloatArray:
    """Return (n, 2) the convex outline seen from above, closed; a flat target is a line."""
    from scipy.spatial import ConvexHull, QhullError

    points = _corners(mesh)[:, :2]
    try:
        order = ConvexHull(points).vertices
    except QhullError:
        along = points - points.mean(axis=0)
        place = along @ np.linalg.svd(along, full_matrices=False)[2][0]
        order = np.array([place.argmin(), place.argmax()])
    return np.asarray(points[np.append(order, order[0])])


def _band(sweep: RcsSweep) -> str:
    f = sweep.frequency_hz / 1e9
    return f"{f[0]:g} to {f[-1]:g} GHz at {len(f)} frequencies"
