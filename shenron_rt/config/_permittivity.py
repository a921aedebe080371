"""Permittivity entries of a material: where the number comes from and over which frequencies it holds."""

from __future__ import annotations

import logging
from functools import lru_cache
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from ..errors import InputError, did_you_mean
from ..physics.permittivity import (
    P2040,
    cole_cole_permittivity,
    conductor_permittivity,
    p2040_permittivity,
    water_permittivity,
)
from ._base import ConfigModel

__all__ = ["Permittivity"]

_log = logging.getLogger(__name__)


@lru_cache(maxsize=256)
def _note_once(message: str) -> None:
    _log.info(message)


class _Ranged(ConfigModel):
    """What the entries share: the range in which the values hold, and leave to go beyond it."""

    extrapolate: bool = False
    valid_ghz: tuple[Annotated[float, Field(gt=0)], Annotated[float, Field(gt=0)]] | None = None

    def _check(self, what: str, frequency_hz: float, valid_hz: tuple[float, float] | None) -> None:
        if valid_hz is None or valid_hz[0] <= frequency_hz <= valid_hz[1]:
            return
        span = f"{valid_hz[0] / 1e9:g} to {valid_hz[1] / 1e9:g} GHz"
        if not self.extrapolate:
            raise InputError(
                f"permittivity of {what} is known for {span}, asked for {frequency_hz / 1e9:g} GHz; "
                "give a value for that band or allow it with extrapolate: true"
            )
        _note_once(f"permittivity of {what} extrapolated to {frequency_hz / 1e9:g} GHz; its values hold for {span}")

    @property
    def _valid_hz(self) -> tuple[float, float] | None:
        return None if self.valid_ghz is None else (self.valid_ghz[0] * 1e9, self.valid_ghz[1] * 1e9)


class P2040Permittivity(_Ranged):
    """A material of ITU-R P.2040-3; the range of the fit is the recommendation's."""

    model: Literal["p2040"]
    name: str

    @model_validator(mode="after")
    def _known(self) -> Self:
        if self.name not in P2040:
            raise ValueError(f"unknown P.2040 material {self.name!r}; {did_you_mean(self.name, P2040)}")
        return self

    def at(self, frequency_hz: float) -> complex:
        """Return eps' - j eps''."""
        self._check(f"{self.name} (ITU-R P.2040-3)", frequency_hz, P2040[self.name].valid_hz)
        return complex(p2040_permittivity(self.name, frequency_hz)[0])


class ConstantPermittivity(_Ranged):
    """One measured value, eps = real - j imag."""

    model: Literal["constant"]
    real: Annotated[float, Field(ge=1)]
    imag: Annotated[float, Field(ge=0)] = 0.0

    def at(self, frequency_hz: float) -> complex:
        """Return eps' - j eps''."""
        self._check(f"{self.real:g} - j{self.imag:g}", frequency_hz, self._valid_hz)
        return complex(self.real, -self.imag)


class MetalPermittivity(_Ranged):
    """A good conductor."""

    model: Literal["metal"]
    conductivity_s_per_m: Annotated[float, Field(gt=1e3)] = 1e7

    def at(self, frequency_hz: float) -> complex:
        """Return eps' - j eps''."""
        return complex(conductor_permittivity(self.conductivity_s_per_m, frequency_hz))


class WaterPermittivity(_Ranged):
    """Pure liquid water, double-Debye model of ITU-R P.840-4."""

    model: Literal["water"]
    temperature_c: Annotated[float, Field(ge=-20, le=60)] = 15.0

    def at(self, frequency_hz: float) -> complex:
        """Return eps' - j eps''."""
        self._check("water", frequency_hz, (1e9, 1000e9))
        return complex(water_permittivity(frequency_hz, self.temperature_c))


class Relaxation(ConfigModel):
    """One Cole-Cole dispersion."""

    delta: Annotated[float, Field(gt=0)]
    relaxation_s: Annotated[float, Field(gt=0)]
    alpha: Annotated[float, Field(ge=0, lt=1)] = 0.0


class ColeColePermittivity(_Ranged):
    """A sum of Cole-Cole dispersions, as published for tissues."""

    model: Literal["cole_cole"]
    eps_inf: Annotated[float, Field(ge=1)]
    terms: tuple[Relaxation, ...]
    conductivity_s_per_m: Annotated[float, Field(ge=0)] = 0.0

    def at(self, frequency_hz: float) -> complex:
        """Return eps' - j eps''."""
        self._check("the Cole-Cole fit", frequency_hz, self._valid_hz)
        terms = [(t.delta, t.relaxation_s, t.alpha) for t in self.terms]
        return complex(cole_cole_permittivity(frequency_hz, self.eps_inf, terms, self.conductivity_s_per_m))


Permittivity = Annotated[
    P2040Permittivity | ConstantPermittivity | MetalPermittivity | WaterPermittivity | ColeColePermittivity,
    Field(discriminator="model"),
]
