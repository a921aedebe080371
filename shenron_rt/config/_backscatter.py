"""Backscatter entries of a material: which sigma0 model, and its constants."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Annotated, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from ..physics.backscatter import (
    constant_gamma,
    geometric_optics,
    kirchhoff,
    lambertian,
    small_perturbation,
)
from ..physics.fresnel import fresnel_cos
from ._base import ConfigModel

__all__ = ["Backscatter", "Surface"]

FloatArray = NDArray[np.float64]
#: One level, or levels at several frequencies [GHz], between which the logarithm of the frequency interpolates.
LevelDb = float | Mapping[float, float]


def _linear_level(level_db: LevelDb, frequency_hz: float) -> float:
    """Return the linear level at a frequency; beyond the given frequencies the nearest one holds."""
    if not isinstance(level_db, Mapping):
        return float(10.0 ** (0.1 * level_db))
    points = sorted(level_db.items())
    at = np.interp(math.log(frequency_hz / 1e9), [math.log(f) for f, _ in points], [db for _, db in points])
    return float(10.0 ** (0.1 * at))


class Surface(NamedTuple):
    """What the models need to know of the surface they belong to."""

    eps: complex
    roughness_rms_m: float
    frequency_hz: float
    reflectivity: Callable[[FloatArray], tuple[FloatArray, FloatArray]]
    """(|R_TE|^2, |R_TM|^2) of the smooth surface, coating included, at an array of cosines."""


class _Gamma(ConfigModel):
    gamma_db: LevelDb

    @field_validator("gamma_db")
    @classmethod
    def _frequencies_are_positive(cls, value: LevelDb) -> LevelDb:
        if isinstance(value, Mapping) and (not value or min(value) <= 0.0):
            raise ValueError("gamma_db needs a number, or frequencies in GHz (> 0) with a level each")
        return value


class ConstantGamma(_Gamma):
    """sigma0 = gamma cos(theta), the same for both polarisations."""

    model: Literal["constant_gamma"]

    def sigma0(self, surface: Surface, cos: FloatArray, polarization: str) -> FloatArray:
        """Return sigma0 [m^2/m^2]."""
        return constant_gamma(_linear_level(self.gamma_db, surface.frequency_hz), cos)


class Lambertian(_Gamma):
    """sigma0 = gamma cos^2(theta), the same for both polarisations."""

    model: Literal["lambertian"]

    def sigma0(self, surface: Surface, cos: FloatArray, polarization: str) -> FloatArray:
        """Return sigma0 [m^2/m^2]."""
        return lambertian(_linear_level(self.gamma_db, surface.frequency_hz), cos)


class _Surface(ConfigModel):
    """Theory of a random surface with the material's own permittivity and RMS height."""

    correlation_m: Annotated[float, Field(gt=0, lt=1)]
    correlation: Literal["exponential", "gaussian"] = "exponential"


class SmallPerturbation(_Surface):
    """First-order small-perturbation method; a coating is ignored, as its closed form is for a half-space."""

    model: Literal["small_perturbation"]

    def sigma0(self, surface: Surface, cos: FloatArray, polarization: str) -> FloatArray:
        """Return sigma0 [m^2/m^2]."""
        eps, roughness, frequency_hz, _ = surface
        return small_perturbation(eps, roughness, self.correlation_m, self.correlation, frequency_hz, cos, polarization)


class Kirchhoff(_Surface):
    """Scalar Kirchhoff series."""

    model: Literal["kirchhoff"]

    def sigma0(self, surface: Surface, cos: FloatArray, polarization: str) -> FloatArray:
        """Return sigma0 [m^2/m^2]."""
        eps, roughness, frequency_hz, reflectivity = surface
        power = reflectivity(cos)[1 if polarization == "VV" else 0]
        return kirchhoff(
            eps,
            roughness,
            self.correlation_m,
            self.correlation,
            frequency_hz,
            cos,
            polarization,
            reflectivity=power,
        )


class GeometricOptics(ConfigModel):
    """Facets of a surface much rougher than the wavelength."""

    model: Literal["geometric_optics"]
    slope_rms: Annotated[float, Field(gt=0)]

    def sigma0(self, surface: Surface, cos: FloatArray, polarization: str) -> FloatArray:
        """Return sigma0 [m^2/m^2]."""
        coated, bare = surface.reflectivity(np.ones(1))[0][0], np.abs(fresnel_cos(surface.eps, 1.0)[0]) ** 2
        return geometric_optics(surface.eps, self.slope_rms, cos) * (coated / bare if bare > 0.0 else 0.0)


Backscatter = Annotated[
    ConstantGamma | Lambertian | SmallPerturbation | Kirchhoff | GeometricOptics, Field(discriminator="model")
]
