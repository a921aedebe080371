"""Returns: what arrives at the receiver, one row an echo."""

from __future__ import annotations

import os
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from ._typing import BoolArray, ComplexArray, FloatArray, IntArray, NDArray
from .chains import Chains
from .constants import SPEED_OF_LIGHT
from .errors import InputError
from .io.npz import load_npz, save_npz
from .scatterers import Scatterers, Weather

if TYPE_CHECKING:
    from .config.materials import MaterialTable
    from .config.profile import RadarProfile
    from .echo.shenron import ShenronModel

__all__ = ["Returns", "illuminate"]

#: Columns that only echoes over several surfaces need.
_OPTIONAL = ("departure", "departure_velocity")


@dataclass(frozen=True)
class Returns:
    """Echoes at the input of one receiver, in the radar frame, mid-frame.

    Parameters
    ----------
    amplitude : (n,) complex
        De-chirped amplitude without the carrier phase of the range, sqrt(W) RMS; ``abs(amplitude)**2`` is received
        power.
    position : (n, 3) float
        The point r_c the amplitude refers to [m].
    velocity : (n, 3) float
        Of that point relative to the radar, p(t) = position + velocity t about mid-frame [m/s].
    object_id : (n,) uint32
    tag : (n,) uint8
    coherent : (n,) bool
        True where the phase is that of the geometry, False for speckle.
    bounces : (n,) uint8
        Surfaces met on the way.
    scatterer : (n,) int64
        Row of the :class:`~shenron_rt.scatterers.Scatterers` it came from; -1 - row of their ``paths`` where it came
        over several surfaces.
    center_hz : float
        f_c of the profile, for the phase sum of :meth:`power_by_object` [Hz].
    model : str
        The echo model.
    weather : Weather or None
        Whose attenuation the amplitudes have; ``None`` is none.
    departure : (n, 3) float or None
        Where transmitters see the echo: the image of its source in the mirrors on the way there. Receivers see it in
        the direction of ``position``, over the rest of the way ``2 abs(position)``. ``None``: both at ``position``.
    departure_velocity : (n, 3) float or None
        Of that point, like ``velocity``; ``None``: along its line of sight, as fast as ``position`` goes along its own.
    chains : Chains or None
        The objects that each echo met on its way; ``None``: first surfaces only.
    """

    amplitude: ComplexArray
    position: FloatArray
    velocity: FloatArray
    object_id: IntArray
    tag: IntArray
    coherent: BoolArray
    bounces: IntArray
    scatterer: IntArray
    center_hz: float
    model: str = "physical"
    weather: Weather | None = None
    departure: FloatArray | None = None
    departure_velocity: FloatArray | None = None
    chains: Chains | None = None

    def __post_init__(self) -> None:
        n = len(self.amplitude)
        for name in ("object_id", "tag", "coherent", "bounces", "scatterer"):
            if np.shape(getattr(self, name)) != (n,):
                raise InputError(f"Returns.{name}: shape ({n},) is needed, got {np.shape(getattr(self, name))}")
        optional = [n for n in _OPTIONAL if getattr(self, n) is not None]
        for name in ("position", "velocity", *optional):
            if np.shape(getattr(self, name)) != (n, 3):
                raise InputError(f"Returns.{name}: shape ({n}, 3) is needed, got {np.shape(getattr(self, name))}")
        if self.chains is not None and len(self.chains) != n:
            raise InputError(f"Returns.chains: {n} echoes are needed, got {len(self.chains)}")

    def __len__(self) -> int:
        return len(self.amplitude)

    def __repr__(self) -> str:
        return f"Returns({len(self)} echoes, {int(self.coherent.sum())} coherent, model {self.model!r})"

    @property
    def delay_s(self) -> FloatArray:
        """(n,) two-way delay at mid-frame from the origin of the radar frame, the array's phase reference [s]."""
        delay: FloatArray = 2.0 / SPEED_OF_LIGHT * np.linalg.norm(self.position, axis=1)
        return delay

    @property
    def calibrated(self) -> bool:
        """Whether amplitudes are sqrt(W); ``shenron`` without its switch ``calibrated`` has the released counts."""
        if not self.model.startswith("shenron"):
            return True
        from .echo.shenron import ShenronModel

        return ShenronModel.parse(self.model).calibrated

    @property
    def chain(self) -> NDArray[Any]:
        """(n,) str, the objects met from transmitter to receiver: ``"40>101"`` is radar, 40, 101, radar."""
        if self.chains is not None:
            return np.asarray(self.chains.names[self.chains.row])
        ids, row = np.unique(self.object_id, return_inverse=True)
        return np.asarray(ids.astype(np.str_)[row])

    @property
    def ghost(self) -> BoolArray:
        """(n,) bool, an echo over several surfaces that shows its object more than a cell away from it."""
        return np.zeros(len(self), dtype=bool) if self.chains is None else self.chains.ghost

    def power_by_chain(self) -> dict[str, float]:
        """Return received power of every chain [W]; the sum of :meth:`power_by_object` for each."""
        names, row = np.unique(self.chain, return_inverse=True)
        return {str(name): float(p) for name, p in zip(names, self._power_of(row, len(names)), strict=True)}

    def power_by_object(self) -> dict[int, float]:
        """Return received power of every object [W].

        abs(sum over its coherent echoes of a e^{j 2 pi f_c tau})^2 + sum over its incoherent ones of abs(a)^2, at the
        array's phase reference, mid-frame.
        """
        ids, row = np.unique(self.object_id, return_inverse=True)
        return {int(i): float(p) for i, p in zip(ids, self._power_of(row, len(ids)), strict=True)}

    def _power_of(self, row: IntArray, count: int) -> FloatArray:
        phasor = self.amplitude * np.exp(2j * np.pi * self.center_hz * self.delay_s)
        phasor = np.where(self.coherent, phasor, 0.0)
        re = np.bincount(row, phasor.real, count)
        im = np.bincount(row, phasor.imag, count)
        speckle = np.bincount(row, np.where(self.coherent, 0.0, np.abs(self.amplitude) ** 2), count)
        return np.asarray(re**2 + im**2 + speckle)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Save every field, and ``delay_s``, to an ``.npz`` file."""
        arrays = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "chains"}
        if self.chains is not None:
            arrays |= {f"chains_{f.name}": getattr(self.chains, f.name) for f in fields(self.chains)}
        arrays["weather"] = None if self.weather is None else self.weather.to_array()
        save_npz(path, arrays | {"delay_s": self.delay_s})

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Load what :meth:`save` wrote.

        Raises
        ------
        NotFoundError, InputError
        """
        names = [f.name for f in fields(cls) if f.name not in ("weather", "chains", *_OPTIONAL)]
        arrays: dict[str, Any] = load_npz(path, names)
        values = {name: arrays[name] for name in names}
        values |= {"center_hz": float(values["center_hz"]), "model": str(values["model"])}
        if "weather" in arrays:
            values["weather"] = Weather.from_array(arrays["weather"])
        values |= {name: arrays[name] for name in _OPTIONAL if name in arrays}
        if "chains_row" in arrays:
            values["chains"] = Chains(**{f.name: arrays[f"chains_{f.name}"] for f in fields(Chains)})
        return cls(**values)


def illuminate(
    scatterers: Scatterers,
    profile: RadarProfile,
    *,
    model: str | ShenronModel = "physical",
    materials: MaterialTable | str | os.PathLike[str] | None = None,
) -> Returns:
    """Light scatterers with a radar, by an echo model and the radar equation.

    Parameters
    ----------
    scatterers : Scatterers
        In the frame of that radar.
    profile : RadarProfile
    model : str or ShenronModel
        ``"physical"``; ``"shenron"``, the formulas of C-Shenron corrected; ``"shenron:as_released"``, as they were; or
        any mixture, see :meth:`shenron_rt.echo.shenron.ShenronModel.parse`.
    materials : MaterialTable, name or path, optional
        Default ``"automotive"``. The ``shenron`` model has its own five.

    Returns
    -------
    echoes : Returns

    Raises
    ------
    InputError
        An unknown model or material.
    """
    if not isinstance(model, str) or model.partition(":")[0] == "shenron":
        from .echo.shenron import ShenronModel, shenron_returns

        return shenron_returns(scatterers, profile, ShenronModel.parse(model) if isinstance(model, str) else model)
    if model != "physical":
        raise InputError(f"unknown echo model {model!r}; known: physical, shenron, shenron:as_released")
    from .config.materials import MaterialTable, load_materials
    from .echo.physical import physical_returns

    table = materials if isinstance(materials, MaterialTable) else load_materials(materials or "automotive")
    return physical_returns(scatterers, profile, table)
