"""Materials: what a surface does to a radar wave, one YAML entry each, every number with its source.

A material is a half-space or a free-standing sheet (``thickness_m``), with an optional coating, a roughness and
backscatter models. A second table says which material a semantic tag is made of, a third what rain turns it into.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, PrivateAttr, field_validator, model_validator

from ..constants import SPEED_OF_LIGHT
from ..errors import InputError, did_you_mean
from ..physics.energy import diffuse_albedo, diffuse_budget, limit_sigma0
from ..physics.fresnel import POLARIZATIONS, fresnel_cos, layered
from ..physics.roughness import coherent_factor
from ..resources import find
from ..tags import SemanticTag, parse_tag
from ._backscatter import Backscatter, Surface
from ._base import ConfigModel
from ._permittivity import Permittivity
from .loader import parse_model

__all__ = ["Layer", "Material", "MaterialTable", "load_materials"]

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

# sigma0 is looked up over the angle of incidence: 0.02 degree steps follow a lobe of one degree to 0.01 dB
_TABLE_ANGLE = np.linspace(0.0, np.arccos(1e-6), 4501)
_SMALLEST = 1e-300


class Layer(ConfigModel):
    """A homogeneous layer of a coating."""

    permittivity: Permittivity
    thickness_m: Annotated[float, Field(gt=0, lt=1)]


class Material(ConfigModel):
    """One material.

    Parameters
    ----------
    permittivity : Permittivity
        Of the bulk.
    thickness_m : float, optional
        A sheet of this thickness with air behind it; absent: so thick that nothing comes back from behind. [m]
    coating : tuple of Layer
        On top of the bulk, the outermost first.
    roughness_rms_m : float
        RMS height of the small-scale roughness. [m]
    volume_albedo : float
        Share of the power that enters and is scattered out again; part of the budget of the backscatter. [-]
    cross_polar_db : float, optional
        Cross-polarised over co-polarised backscatter; absent: none. [dB]
    backscatter : tuple of Backscatter
        Models whose sigma0 add up.
    sources : mapping
        Citation of each number: a key such as ``permittivity`` covers everything below it.
    """

    permittivity: Permittivity
    thickness_m: Annotated[float, Field(gt=0, lt=10)] | None = None
    coating: tuple[Layer, ...] = ()
    roughness_rms_m: Annotated[float, Field(ge=0, lt=1)] = 0.0
    volume_albedo: Annotated[float, Field(ge=0, le=1)] = 0.0
    cross_polar_db: Annotated[float, Field(le=0)] | None = None
    backscatter: tuple[Backscatter, ...] = ()
    sources: Mapping[str, str] = {}

    _tables: dict[tuple[float, str], FloatArray] = PrivateAttr(default_factory=dict)

    @field_validator("backscatter", mode="before")
    @classmethod
    def _one_or_many(cls, value: Any) -> Any:  # YAML: a mapping, or a list of them
        return (value,) if isinstance(value, Mapping) else value

    @model_validator(mode="after")
    def _every_number_has_a_source(self) -> Self:
        given = self.model_dump(exclude={"sources"}, exclude_unset=True)
        missing = [path for path in _number_paths(given) if not self._is_covered(path)]
        if missing:
            raise ValueError(f"sources lacks {', '.join(missing)}; cite it, or write 'unconfirmed: why this value'")
        empty = [key for key, text in self.sources.items() if not text.strip()]
        if empty:
            raise ValueError(f"sources of {', '.join(empty)} is empty")
        return self

    def _is_covered(self, path: str) -> bool:
        parts = path.split(".")
        return any(".".join(parts[:n]) in self.sources for n in range(1, len(parts) + 1))

    @property
    def unconfirmed(self) -> dict[str, str]:
        """Keys whose value no retrievable document gives, with what is said of them."""
        return {k: v for k, v in self.sources.items() if v.lower().startswith("unconfirmed")}

    @property
    def cross_ratio(self) -> float:
        """Cross-polarised over co-polarised backscatter, linear."""
        return 0.0 if self.cross_polar_db is None else float(10.0 ** (0.1 * self.cross_polar_db))

    def permittivity_at(self, frequency_hz: float) -> complex:
        """Return the relative permittivity eps' - j eps'' of the bulk.

        Raises
        ------
        InputError
            The frequency lies outside the range of the values and the entry does not say ``extrapolate: true``.
        """
        return self.permittivity.at(frequency_hz)

    def reflection(self, frequency_hz: float, cos_incidence: ArrayLike) -> tuple[ComplexArray, ComplexArray]:
        """Return the reflection coefficients of the smooth surface, coating and thickness included.

        Parameters
        ----------
        frequency_hz : float
            Frequency. [Hz]
        cos_incidence : array_like
            Cosine of the angle of incidence, 0 to 1. [-]

        Returns
        -------
        te, tm : complex arrays of the shape of cos_incidence
            Without roughness, e^{+jwt}; phase referred to the outer face.
        """
        bulk = self.permittivity_at(frequency_hz)
        layers: list[tuple[ArrayLike, float]] = [
            (layer.permittivity.at(frequency_hz), layer.thickness_m) for layer in self.coating
        ]
        cos = np.asarray(cos_incidence, dtype=np.float64)
        if self.thickness_m is None and not layers:
            return fresnel_cos(bulk, cos)
        if self.thickness_m is not None:
            layers, bulk = [*layers, (bulk, self.thickness_m)], 1.0 + 0.0j
        return layered(layers, bulk, np.arccos(np.clip(cos, 0.0, 1.0)), frequency_hz)

    def coherent_factor(self, frequency_hz: float, cos_incidence: ArrayLike) -> FloatArray:
        """Return exp(-2 (k s cos)^2), by which roughness reduces the coherent amplitude."""
        return coherent_factor(2.0 * np.pi * frequency_hz / SPEED_OF_LIGHT, self.roughness_rms_m, cos_incidence)

    def sigma0(self, frequency_hz: float, cos_incidence: ArrayLike, polarization: str = "VV") -> FloatArray:
        """Return the incoherent backscatter per area, already limited by the energy that is there.

        Parameters
        ----------
        frequency_hz : float
            Frequency. [Hz]
        cos_incidence : array_like
            Cosine of the angle of incidence, 0 to 1. [-]
        polarization : {"VV", "HH", "HV", "VH"}
            V is TM and H is TE in the local plane of incidence, as on a road; cross channels are
            ``cross_polar_db`` relative to the mean of the two.

        Returns
        -------
        array of the shape of cos_incidence [m^2/m^2]

        Notes
        -----
        Read from a table over the angle that is made once per frequency and polarisation.
        """
        if polarization not in POLARIZATIONS:
            raise InputError(f"unknown polarization {polarization!r}; {did_you_mean(polarization, POLARIZATIONS)}")
        cos = np.asarray(cos_incidence, dtype=np.float64)
        if not self.backscatter or (polarization in ("HV", "VH") and self.cross_ratio == 0.0):
            return np.zeros_like(cos)
        if polarization in ("HV", "VH"):
            pair = self.sigma0(frequency_hz, cos, "VV") + self.sigma0(frequency_hz, cos, "HH")
            return np.asarray(0.5 * self.cross_ratio * pair)
        key = (float(frequency_hz), polarization)
        if key not in self._tables:
            limited = self._limited(frequency_hz, np.cos(_TABLE_ANGLE), polarization)
            self._tables[key] = np.log(np.maximum(limited, _SMALLEST))
        angle = np.arccos(np.clip(cos, 0.0, 1.0))
        return np.asarray(np.exp(np.interp(angle, _TABLE_ANGLE, self._tables[key])))

    def _limited(self, frequency_hz: float, cos: FloatArray, polarization: str) -> FloatArray:
        wavenumber = 2.0 * np.pi * frequency_hz / SPEED_OF_LIGHT

        def reflectivity(c: FloatArray) -> tuple[FloatArray, FloatArray]:
            te, tm = self.reflection(frequency_hz, c)
            return np.abs(te) ** 2, np.abs(tm) ** 2

        surface = Surface(self.permittivity_at(frequency_hz), self.roughness_rms_m, frequency_hz, reflectivity)

        def plain(c: FloatArray) -> FloatArray:
            return np.asarray(sum(m.sigma0(surface, c, polarization) for m in self.backscatter))

        def budget(c: FloatArray) -> FloatArray:
            return diffuse_budget(*reflectivity(c), wavenumber, self.roughness_rms_m, self.volume_albedo, c)

        return limit_sigma0(plain, budget, cos, cross_ratio=self.cross_ratio)

    def energy(self, frequency_hz: float, cos_incidence: ArrayLike, polarization: str = "VV") -> FloatArray:
        """Return the share of the incident power that leaves the surface upwards, coherent and incoherent together.

        Parameters
        ----------
        frequency_hz : float
            Frequency. [Hz]
        cos_incidence : array_like
            Cosine of the angle of incidence, > 0. [-]
        polarization : {"VV", "HH"}
            Of the incident wave and its sigma0.

        Returns
        -------
        array of the shape of cos_incidence, at most 1
            The larger of |R_TE|^2 and |R_TM|^2 after roughness, plus the albedo of the backscatter in the separable
            model of :func:`shenron_rt.physics.diffuse_albedo`.
        """
        te, tm = self.reflection(frequency_hz, cos_incidence)
        coherent = np.maximum(np.abs(te), np.abs(tm)) ** 2 * self.coherent_factor(frequency_hz, cos_incidence) ** 2
        diffuse = diffuse_albedo(lambda c: self.sigma0(frequency_hz, c, polarization), cos_incidence)
        return np.asarray(coherent + (1.0 + self.cross_ratio) * diffuse)


def _number_paths(value: Any, path: str = "") -> Iterator[str]:
    """Yield the dotted path of every number below a value; list positions are left out."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            if key not in ("extrapolate", "valid_ghz"):
                yield from _number_paths(item, f"{path}.{key}" if path and isinstance(key, str) else path or str(key))
    elif isinstance(value, list | tuple):
        for item in value:
            yield from _number_paths(item, path)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


class MaterialTable(ConfigModel):
    """Materials by name, which material each tag is made of, and what rain turns a material into.

    Parameters
    ----------
    materials : mapping of str to Material
        The entries.
    tags : mapping of str to mapping
        Tag table name -> tag name -> material name.
    wet : mapping of str to str
        Dry material -> its wet twin; used where the scene has ``rain_mm_h > 0``.
    """

    description: str = ""
    materials: Mapping[str, Material]
    tags: Mapping[str, Mapping[str, str]] = {}
    wet: Mapping[str, str] = {}

    _by_tag: dict[str, dict[SemanticTag, str]] = PrivateAttr(default_factory=dict)

    @model_validator(mode="after")
    def _names_exist(self) -> Self:
        for where, name in self._references():
            if name not in self.materials:
                raise ValueError(f"{where}: unknown material {name!r}; {did_you_mean(name, self.materials)}")
        for table, entries in self.tags.items():
            self._by_tag[table] = {parse_tag(tag): material for tag, material in entries.items()}
        return self

    def _references(self) -> Iterator[tuple[str, str]]:
        for table, entries in self.tags.items():
            for tag, name in entries.items():
                yield f"tags.{table}.{tag}", name
        for dry, wet in self.wet.items():
            yield "wet", dry
            yield f"wet.{dry}", wet

    def __getitem__(self, name: str) -> Material:
        """Return a material by name."""
        if name not in self.materials:
            raise InputError(f"unknown material {name!r}; {did_you_mean(name, self.materials)}")
        return self.materials[name]

    def for_tag(self, tag: str | int, tag_table: str = "0.9.14") -> str:
        """Return the name of the material that a tag is made of.

        Parameters
        ----------
        tag : str or int
            A tag name of the table, or a canonical tag (its name or number in CARLA's numbering since 0.9.14).
        tag_table : str
            ``"0.9.14"``, ``"0.9.13"``, ``"ue5"`` or another table of the file.

        Raises
        ------
        InputError
            An unknown table or tag, or a tag the table does not list.
        """
        if tag_table not in self._by_tag:
            raise InputError(f"unknown tag table {tag_table!r}; {did_you_mean(tag_table, self._by_tag)}")
        known = self._by_tag[tag_table]
        semantic = parse_tag(tag)
        if semantic not in known:
            listed = ", ".join(t.name for t in known)
            raise InputError(f"tag {semantic.name} has no material in tag table {tag_table!r}; it lists: {listed}")
        return known[semantic]

    def in_weather(self, name: str, rain_mm_h: float) -> str:
        """Return the name of the material to use: its wet twin in rain, else the material itself."""
        return self.wet.get(name, name) if rain_mm_h > 0.0 else name

    @property
    def unconfirmed(self) -> dict[str, str]:
        """``material.key`` -> note, of every number without a retrievable source."""
        return {f"{n}.{k}": text for n, m in self.materials.items() for k, text in m.unconfirmed.items()}


@lru_cache(maxsize=16)
def _load(path: Path, _modified_ns: int) -> MaterialTable:
    return parse_model(MaterialTable, path)


def load_materials(name_or_path: str | os.PathLike[str] = "automotive") -> MaterialTable:
    """Return a material table.

    Parameters
    ----------
    name_or_path : str or path
        A table that ships with the package or lies in ``SHENRON_RT_PATH``, or a path that ends in .yaml.

    Raises
    ------
    ConfigError, NotFoundError

    Examples
    --------
    >>> load_materials().for_tag("Roads")
    'asphalt'
    """
    path = find("materials", name_or_path).resolve()
    return _load(path, path.stat().st_mtime_ns)
