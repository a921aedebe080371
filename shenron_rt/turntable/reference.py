"""Closed forms to lay beside a sweep of a canonical shape."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .._typing import ComplexArray, FloatArray
from ..constants import SPEED_OF_LIGHT
from ..errors import InputError
from ..physics import canonical
from ..rcs import RcsSweep

__all__ = ["Reference", "reference_of"]

#: Samples further below the peak than this do not enter the mean deviation [dB].
_WITHIN_DB = 20.0
#: Samples beyond which the closed form of a circular trihedral, some 200 directions a second, is not waited for.
_MOST_CIRCULAR = 4_000


@dataclass(frozen=True, eq=False)
class Reference:
    """A closed form over the axes of a sweep.

    Parameters
    ----------
    rcs_m2 : (n_freq, n_el, n_az, n_pol) float
        RCS, NaN where the formula does not hold [m^2].
    formula : str
        What it is, in words.
    """

    rcs_m2: FloatArray
    formula: str

    def deviation_db(self, sweep: RcsSweep) -> FloatArray:
        """Return (n,) decibels by which a sweep is above the closed form, where that is within 20 dB of its peak."""
        strong = self.rcs_m2 >= 10.0 ** (-_WITHIN_DB / 10.0) * np.nanmax(self.rcs_m2)
        floor = np.finfo(np.float64).tiny
        return np.asarray(10.0 * np.log10(np.maximum(sweep.rcs_m2[strong], floor) / self.rcs_m2[strong]))


def reference_of(sweep: RcsSweep, target: str | None = None) -> Reference | None:
    """Return the closed form of a canonical metal shape over the axes of a sweep.

    Parameters
    ----------
    sweep : RcsSweep
    target : str, optional
        Text of the shape; default ``sweep.target``.

    Returns
    -------
    Reference or None
        None where there is none: another target, a near-range or a bistatic sweep, a corner seen from where
        its formula does not hold at all, a circular trihedral over thousands of samples.

    Notes
    -----
    All are physical optics: ``plate``, ``disc`` and ``box`` exact in every direction, ``cylinder`` in every direction,
    ``dihedral`` and ``trihedral`` with their bounces up to ``max_bounces`` inside the opening. ``sphere`` is Mie's
    series where it can be summed, else pi a^2. The target must be metal; the sweep does not know.
    """
    from ..scene.shapes import SHAPES
    from ..scene.shapes._text import parse

    text = sweep.target if target is None else target
    if sweep.distance_m is not None or sweep.bistatic_deg is not None:
        return None
    try:
        name, size = parse(text, SHAPES)
    except InputError:
        return None
    if name not in _FORMS or (size.get("form") == "circular" and sweep.amplitude.size > _MOST_CIRCULAR):
        return None
    words, form = _FORMS[name]
    azimuth, elevation = np.meshgrid(np.radians(sweep.azimuth_deg), np.radians(sweep.elevation_deg))
    pick = [("VH".index(p[0]), "VH".index(p[1])) for p in sweep.polarization]
    rows = []
    for frequency in sweep.frequency_hz.tolist():
        matrix = form(size, SPEED_OF_LIGHT / frequency, azimuth, elevation, sweep.max_bounces)
        rows.append(np.stack([matrix[..., r, t] for r, t in pick], axis=-1))
    power = np.abs(np.stack(rows)) ** 2
    return Reference(power, words) if np.isfinite(power).any() and np.nanmax(power) > 0.0 else None


Sizes = dict[str, float | str]
#: (sizes, wavelength, azimuth, elevation, max_bounces) -> (n_el, n_az, 2, 2) complex amplitudes [m].
_Form = Callable[[Sizes, float, FloatArray, FloatArray, int], ComplexArray]


def _alike(amplitude: ComplexArray) -> ComplexArray:
    """Return matrices with VV = HH and nothing crossed."""
    return np.asarray(amplitude[..., None, None] * np.eye(2))


def _plate(size: Sizes, wavelength: float, az: FloatArray, el: FloatArray, _: int) -> ComplexArray:
    return _alike(canonical.plate_amplitude(float(size["a"]), float(size["b"]), wavelength, az, el))


def _disc(size: Sizes, wavelength: float, az: FloatArray, el: FloatArray, _: int) -> ComplexArray:
    return _alike(canonical.disc_amplitude(float(size["r"]), wavelength, az, el))


def _box(size: Sizes, wavelength: float, az: FloatArray, el: FloatArray, _: int) -> ComplexArray:
    length, width, height = (float(size[k]) for k in "lwh")
    return _alike(canonical.box_amplitude(length, width, height, wavelength, az, el))


def _cylinder(size: Sizes, wavelength: float, _az: FloatArray, el: FloatArray, _: int) -> ComplexArray:
    return _alike(canonical.cylinder_amplitude(float(size["r"]), float(size["l"]), wavelength, el))


def _sphere(size: Sizes, wavelength: float, az: FloatArray, _el: FloatArray, _: int) -> ComplexArray:
    radius = float(size["r"])
    try:
        power = float(canonical.sphere_mie_rcs(radius, wavelength))
    except InputError:  # larger than the series can be summed for, where it has long become pi a^2
        power = float(np.pi * radius**2)
    return _alike(np.full(az.shape, np.sqrt(power), dtype=np.complex128))


def _dihedral(size: Sizes, wavelength: float, az: FloatArray, el: FloatArray, bounces: int) -> ComplexArray:
    a, b, h = (float(size[k]) for k in "abh")
    orders = tuple(range(1, min(bounces, 2) + 1))
    return canonical.dihedral_scattering_matrix(a, b, h, wavelength, az, el, bounces=orders)


def _trihedral(size: Sizes, wavelength: float, az: FloatArray, el: FloatArray, bounces: int) -> ComplexArray:
    orders = tuple(range(1, min(bounces, 3) + 1))
    kind, leg = str(size["form"]), float(size["a"])
    return canonical.trihedral_scattering_matrix(kind, leg, wavelength, az, el, bounces=orders)


_FORMS: dict[str, tuple[str, _Form]] = {
    "plate": ("physical optics, exact", _plate),
    "disc": ("physical optics, exact", _disc),
    "box": ("physical optics, exact", _box),
    "cylinder": ("physical optics, exact", _cylinder),
    "sphere": ("Mie series", _sphere),
    "dihedral": ("optics and physical optics, exact, 1 + 2 bounces", _dihedral),
    "trihedral": ("optics and physical optics, exact, 1 + 2 + 3 bounces", _trihedral),
}
