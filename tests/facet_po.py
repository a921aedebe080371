"""Physical optics on the flat facets of a mesh, written apart from the package: the tests' independent yardstick.

Each triangle's phase is taken as linear about its centroid and integrated in closed form; the wave is spherical from
the radar's position; facets seen from behind or hidden (their centroid is) do not count. e^{+jwt}, metal plate facing
the radar: positive real.
"""

from __future__ import annotations

import numpy as np


def _triangle_transform(u, v):
    """Return integral_0^1 integral_0^(1-a) exp(-j (u a + v b)) db da for arrays u, v."""

    # Symmetric in the three corners up to a phase: divide by the largest phase difference.
    def mean_phasor(x):
        return np.exp(-0.5j * x) * np.sinc(x / (2.0 * np.pi))

    gaps = np.stack([np.abs(v), np.abs(u), np.abs(u - v)])
    pick = np.argmax(gaps, axis=0)
    # corner phases 0, u, v; reorder so that (reference, second, third) has its largest gap between reference and third
    ref = np.where(pick == 2, u, 0.0)
    third = np.where(pick == 1, u, v) - ref
    second = np.where(pick == 0, u, np.where(pick == 1, v, 0.0)) - ref
    small = np.abs(third) < 1e-3
    safe = np.where(small, 1.0, third)
    exact = (1j / safe) * (np.exp(-1j * safe) * mean_phasor(second - safe) - mean_phasor(second))
    mean = (second + third) / 3.0
    series = 0.5 * (1.0 - 1j * mean)
    return np.exp(-1j * ref) * np.where(small, series, exact)


def facet_amplitudes(vertices, faces, radar, frequency_hz, reflectivity=1.0):
    """Return each facet's complex sqrt(m^2) seen from ``radar`` (3,), referred to the origin's range; unoccluded.

    reflectivity: scalar or (f,) amplitude. Facets are two-sided.
    """
    k = 2.0 * np.pi * frequency_hz / 299_792_458.0
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    centre = (a + b + c) / 3.0
    cross = np.cross(b - a, c - a)
    area = 0.5 * np.linalg.norm(cross, axis=1)
    normal = cross / (2.0 * area[:, None])
    path = centre - radar
    r = np.linalg.norm(path, axis=1)
    look = path / r[:, None]
    cosine = np.abs(np.einsum("ij,ij->i", look, normal))
    u = 2.0 * k * np.einsum("ij,ij->i", b - a, look)
    v = 2.0 * k * np.einsum("ij,ij->i", c - a, look)
    to_corner = np.einsum("ij,ij->i", a - centre, look)
    reference = np.linalg.norm(radar)
    phase = np.exp(-2j * k * (r + to_corner - reference))
    spread = (reference / r) ** 2
    wavelength = 2.0 * np.pi / k
    scale = 2.0 * np.sqrt(np.pi) / wavelength
    return scale * reflectivity * cosine * spread * 2.0 * area * phase * _triangle_transform(u, v)


def lit(mesh, radar, cell_rad=1.2e-3):
    """Return (f,) bool: the face is turned to the radar and nothing stands before its centroid. ``mesh``: TaggedMesh.

    A depth buffer of ``cell_rad`` (3 cm at 25 m), into which every face writes seven points. A face may lie as much
    deeper than what else is in its cell as its own slope explains, and 7 mm. Solids are closed, so winding tells the
    front.
    """
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    centre = (a + b + c) / 3.0
    to_radar = radar - centre
    cosine = np.einsum("ij,ij->i", to_radar, mesh.face_normal) / np.linalg.norm(to_radar, axis=1)
    front = cosine > 0
    points = np.stack([centre, a, b, c, (a + b) / 2, (b + c) / 2, (c + a) / 2]) - radar
    distance = np.linalg.norm(points, axis=-1)
    azimuth = np.arctan2(points[..., 1], points[..., 0]) - np.arctan2(-radar[1], -radar[0])
    azimuth = (azimuth + np.pi) % (2 * np.pi) - np.pi
    bins = np.stack([azimuth, np.arcsin(points[..., 2] / distance)], axis=-1)
    bins = np.floor(bins / cell_rad).astype(np.int64)
    bins -= bins.min(axis=(0, 1))
    cell = bins[..., 0] * (bins[..., 1].max() + 1) + bins[..., 1]
    nearest = np.full(cell.max() + 1, np.inf)
    np.minimum.at(nearest, cell.ravel(), distance.ravel())
    steepness = np.sqrt(1.0 - np.minimum(cosine, 1.0) ** 2) / np.maximum(cosine, 1e-3)
    slack = 0.007 + 2.0 * cell_rad * distance[0] * steepness
    return front & (distance[0] < nearest[cell[0]] + slack)


def apparent_rcs(mesh, radar, frequency_hz, reflectivity=1.0):
    """Return sigma [m^2], the radar equation inverted at the range of the origin; hidden faces do not count."""
    radar = np.asarray(radar, dtype=float)
    seen = lit(mesh, radar)
    reflectivity = np.broadcast_to(reflectivity, seen.shape)[seen]
    return abs(facet_amplitudes(mesh.vertices, mesh.faces[seen], radar, frequency_hz, reflectivity).sum()) ** 2
