"""One-way antenna patterns: relative power gain against azimuth and elevation, 1 at the peak.

A half-power beamwidth means what the word says: at half the full width the one-way gain is exactly 1/2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError

__all__ = ["AntennaPattern", "CosinePattern", "GaussianPattern", "IsotropicPattern", "TabulatedPattern"]

FloatArray = NDArray[np.float64]


@runtime_checkable
class AntennaPattern(Protocol):
    """A one-way pattern: call it with azimuth and elevation [rad], get linear power gain relative to the peak."""

    def __call__(self, azimuth: ArrayLike, elevation: ArrayLike) -> FloatArray:
        """Return the relative power gain, 0 to 1, of the broadcast shape."""
        ...


def _check_width(name: str, width: float, largest: float) -> None:
    if not (math.isfinite(width) and 0.0 < width <= largest):
        raise InputError(f"{name} is {width} rad; allowed: above 0, at most {largest:.4g} (full half-power width)")


@dataclass(frozen=True)
class IsotropicPattern:
    """The same gain in every direction."""

    def __call__(self, azimuth: ArrayLike, elevation: ArrayLike) -> FloatArray:
        """Return ones of the broadcast shape."""
        return np.ones(np.broadcast_shapes(np.shape(azimuth), np.shape(elevation)))


@dataclass(frozen=True)
class GaussianPattern:
    """Gaussian in azimuth times Gaussian in elevation: 2^-((2 az/width_az)^2 + (2 el/width_el)^2).

    Parameters
    ----------
    beamwidth_az, beamwidth_el : float
        Full half-power widths, above 0, at most 2 pi. [rad]
    """

    beamwidth_az: float
    beamwidth_el: float

    def __post_init__(self) -> None:
        _check_width("beamwidth_az", self.beamwidth_az, 2.0 * math.pi)
        _check_width("beamwidth_el", self.beamwidth_el, 2.0 * math.pi)

    def __call__(self, azimuth: ArrayLike, elevation: ArrayLike) -> FloatArray:
        """Return the relative power gain; azimuth in (-pi, pi]."""
        az, el = np.asarray(azimuth, dtype=np.float64), np.asarray(elevation, dtype=np.float64)
        return np.asarray(np.exp2(-((2.0 * az / self.beamwidth_az) ** 2) - (2.0 * el / self.beamwidth_el) ** 2))


@dataclass(frozen=True)
class CosinePattern:
    """cos^n(az) cos^m(el), the exponents from the half-power widths; zero behind the antenna.

    Parameters
    ----------
    beamwidth_az, beamwidth_el : float
        Full half-power widths, above 0, below pi. [rad]
    """

    beamwidth_az: float
    beamwidth_el: float

    def __post_init__(self) -> None:
        _check_width("beamwidth_az", self.beamwidth_az, math.nextafter(math.pi, 0.0))
        _check_width("beamwidth_el", self.beamwidth_el, math.nextafter(math.pi, 0.0))

    @property
    def exponents(self) -> tuple[float, float]:
        """Powers n and m of the two cosines [-]."""
        n, m = (-math.log(2.0) / math.log(math.cos(0.5 * w)) for w in (self.beamwidth_az, self.beamwidth_el))
        return n, m

    def __call__(self, azimuth: ArrayLike, elevation: ArrayLike) -> FloatArray:
        """Return the relative power gain; azimuth in (-pi, pi]."""
        n, m = self.exponents
        az = np.maximum(np.cos(np.asarray(azimuth, dtype=np.float64)), 0.0)
        el = np.maximum(np.cos(np.asarray(elevation, dtype=np.float64)), 0.0)
        return np.asarray(az**n * el**m)


@dataclass(frozen=True)
class TabulatedPattern:
    """Two measured cuts, multiplied: linear interpolation of the level in dB over the angle.

    Outside the table the level of the nearest end holds: a measured cut that stops at +-60 degrees says nothing about
    90, and silence there would be an invention. Each cut is normalised to its own maximum.

    Parameters
    ----------
    azimuth, elevation : (n,), (m,) array_like
        Angles of the cuts, strictly increasing. [rad]
    azimuth_db, elevation_db : (n,), (m,) array_like
        One-way levels, any common reference. [dB]
    """

    azimuth: tuple[float, ...] = field(repr=False)
    azimuth_db: tuple[float, ...] = field(repr=False)
    elevation: tuple[float, ...] = field(repr=False)
    elevation_db: tuple[float, ...] = field(repr=False)

    def __post_init__(self) -> None:
        for name in ("azimuth", "elevation"):
            angles = np.asarray(getattr(self, name), dtype=np.float64)
            levels = np.asarray(getattr(self, f"{name}_db"), dtype=np.float64)
            if angles.ndim != 1 or angles.size < 2 or angles.shape != levels.shape:
                raise InputError(
                    f"{name} cut needs two or more angles and as many levels, got {angles.size} and {levels.size}"
                )
            if not (np.all(np.isfinite(angles)) and np.all(np.isfinite(levels)) and np.all(np.diff(angles) > 0.0)):
                raise InputError(f"{name} cut needs finite levels over strictly increasing, finite angles")
            object.__setattr__(self, name, tuple(angles.tolist()))
            object.__setattr__(self, f"{name}_db", tuple((levels - levels.max()).tolist()))

    @classmethod
    def from_deg(cls, cut_az: Sequence[tuple[float, float]], cut_el: Sequence[tuple[float, float]]) -> Self:
        """Return the pattern of two cuts given as (angle [deg], one-way level [dB]) pairs."""
        (az, az_db), (el, el_db) = (
            np.reshape(np.asarray(cut, dtype=np.float64), (-1, 2)).T for cut in (cut_az, cut_el)
        )
        return cls(tuple(np.radians(az).tolist()), tuple(az_db), tuple(np.radians(el).tolist()), tuple(el_db))

    def __call__(self, azimuth: ArrayLike, elevation: ArrayLike) -> FloatArray:
        """Return the relative power gain; azimuth in (-pi, pi]."""
        az_db = np.interp(np.asarray(azimuth, dtype=np.float64), self.azimuth, self.azimuth_db)
        el_db = np.interp(np.asarray(elevation, dtype=np.float64), self.elevation, self.elevation_db)
        return np.asarray(10.0 ** (0.1 * (az_db + el_db)))
