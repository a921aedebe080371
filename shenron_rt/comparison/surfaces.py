"""What the surfaces of a side are made of, and what they scatter."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .._typing import FloatArray, IntArray
from ..echo.glint import points_sigma0
from ..echo.plane import swapped
from .sides import Side

__all__ = ["COSINES", "Palette", "material_index", "mirror_sigma0", "used_materials"]

#: Cosines over which sigma0 is tabulated.
COSINES = np.linspace(0.0, 1.0, 1025)


@dataclass(frozen=True)
class Palette:
    """The materials of both sides, so that either side's can be looked at from the other's angles.

    Parameters
    ----------
    curves : dict of str to (2, k) float
        sigma0 over a grid of cosines, with the antenna's polarisation in the plane of incidence, and across it.
    of_a, of_b : dict of str to str
        Material name -> key of ``curves``.
    """

    curves: dict[str, FloatArray]
    of_a: dict[str, str]
    of_b: dict[str, str]

    def sigma0(self, key: str, cosine: FloatArray, across: FloatArray) -> FloatArray:
        """Return (n,) sigma0 of a material at some cosines; ``across`` is the share of V across the plane."""
        in_plane, other = (np.interp(cosine, COSINES, curve) for curve in self.curves[key])
        return np.asarray(in_plane + across * (other - in_plane), dtype=np.float64)

    @classmethod
    def of(cls, a: Side, b: Side, used: tuple[set[str], set[str]] | None = None) -> Palette:
        """Return the materials that lie on either side's rows; one name with two meanings gets two keys.

        Parameters
        ----------
        a, b : Side
        used : (set of str, set of str), optional
            Names of the materials of either side, where those of further frames count too.
        """
        names = used or (used_materials(a), used_materials(b))
        curves_a = {name: _sigma0_grid(a, name) for name in sorted(names[0])}
        curves = dict(curves_a)
        of_b = {}
        for name in sorted(names[1]):
            grid = _sigma0_grid(b, name)
            same = name not in curves_a or np.array_equal(curves_a[name], grid)
            of_b[name] = name if same else f"{name} (B)"
            curves[of_b[name]] = grid
        return cls(curves, {name: name for name in curves_a}, of_b)


def mirror_sigma0(side: Side) -> FloatArray:
    """Return (n,) sigma0 of the mirror-like part of points with normals; 0 where footprints give a coherent echo."""
    s, profile = side.scatterers, side.profile
    assert s is not None
    assert profile is not None
    assert side.materials is not None
    if s.footprint is not None or s.normal is None:
        return np.zeros(len(s))
    names, number = material_index(side)
    te, tm = np.zeros(len(s), dtype=np.complex128), np.zeros(len(s), dtype=np.complex128)
    height = np.zeros(len(s))
    for i in np.unique(number):
        here = number == i
        material = side.materials[_in_weather(side, names[i])]
        te[here], tm[here] = material.reflection(profile.center_hz, np.maximum(s.cos_incidence[here], 1e-6))
        height[here] = 2 * math.pi / profile.wavelength_m * material.roughness_rms_m
    return points_sigma0(s, np.arange(len(s)), te, tm, height, profile.antenna.polarization)


def _in_weather(side: Side, name: str) -> str:
    assert side.materials is not None
    weather = None if side.scatterers is None else side.scatterers.weather
    return side.materials.in_weather(name, 0.0 if weather is None else weather.rain_mm_h)


def used_materials(side: Side) -> set[str]:
    """Return the names of the materials that lie on a side's rows."""
    names, number = material_index(side)
    return {names[i] for i in np.unique(number)}


def _sigma0_grid(side: Side, name: str) -> FloatArray:
    """Return (2, k) sigma0 of a material of a side over the grid of cosines, in and across the plane."""
    assert side.materials is not None
    assert side.profile is not None
    material = side.materials[_in_weather(side, name)]
    cosine = np.maximum(COSINES, 1e-6)
    own = side.profile.antenna.polarization
    return np.stack([material.sigma0(side.profile.center_hz, cosine, p) for p in (own, swapped(own))])


def material_index(side: Side) -> tuple[tuple[str, ...], IntArray]:
    """Return the names of the materials and the index of every row; without materials the tag decides."""
    from ..tags import SemanticTag

    s = side.scatterers
    assert s is not None
    assert side.materials is not None
    if s.material is not None:
        return s.material_names, s.material.astype(np.int64)
    names = tuple(side.materials.materials)
    by_tag = np.zeros(256, dtype=np.int64)
    for value in np.unique(s.tag):
        by_tag[value] = names.index(side.materials.for_tag(SemanticTag(int(value)).name))
    return names, by_tag[s.tag]
