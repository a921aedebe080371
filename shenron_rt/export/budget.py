"""The link budget of every object of a frame, term by term, so that a person can add it up."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..config.profile import RadarProfile
from ..constants import FOUR_PI_CUBED
from ..frames import spherical
from ..returns import Returns
from ..run_source import RunFrame, RunRadar

__all__ = ["ObjectBudget", "budget_text", "object_budgets"]

#: Behind a pattern's null no cross section can be told.
_PATTERN_FLOOR = 1e-12


@dataclass(frozen=True)
class ObjectBudget:
    """What one object sends back: power_dbm is the sum of the terms before it.

    Parameters
    ----------
    id : int
    name, tag : str
    range_m, azimuth_deg, elevation_deg, velocity_mps : float
        Means over its echoes but for ghosts, weighted by their power; velocity positive = receding.
    tx_power_dbm : float
    gain_db : float
        Both antennas on boresight.
    pattern_db : float
        Both patterns in the object's direction, <= 0.
    spreading_db : float
        lambda^2/((4 pi)^3 R^4) for R in metres.
    loss_db : float
        Radome and weather, both ways, <= 0.
    rcs_dbsm : float
        The cross section that closes the budget.
    power_dbm : float
        Received, coherent sum of the object.
    snr_db : float or None
        Of a point with this power, all channels added; as ``summary.json`` has it.
    detected : bool
    """

    id: int
    name: str
    tag: str
    range_m: float
    azimuth_deg: float
    elevation_deg: float
    velocity_mps: float
    tx_power_dbm: float
    gain_db: float
    pattern_db: float
    spreading_db: float
    loss_db: float
    rcs_dbsm: float
    power_dbm: float
    snr_db: float | None
    detected: bool

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers by name."""
        return asdict(self)

    def line(self) -> str:
        """Return the budget as one line."""
        snr = "unknown" if self.snr_db is None else f"{self.snr_db:.1f} dB"
        return (
            f"{self.name} ({self.id}, {self.tag}) at {self.range_m:.2f} m, {self.azimuth_deg:+.1f} deg, "
            f"{self.velocity_mps:+.2f} m/s: {self.tx_power_dbm:.1f} dBm {self.gain_db:+.1f} gain "
            f"{self.pattern_db:+.1f} pattern {self.spreading_db:+.1f} spreading {self.loss_db:+.1f} loss "
            f"{self.rcs_dbsm:+.1f} dBsm = {self.power_dbm:.1f} dBm; SNR {snr}, "
            f"{'detected' if self.detected else 'not detected'}"
        )


def object_budgets(radar: RunRadar, frame: RunFrame, returns: Returns | None) -> list[ObjectBudget]:
    """Return the budgets of the objects with an id of their own, strongest first.

    Parameters
    ----------
    radar : RunRadar
    frame : RunFrame
        Its record has names, SNR and what was detected.
    returns : Returns or None
        The echoes of the frame; without them, or where they are no watts, there is no budget.
    """
    if returns is None or len(returns) == 0 or not returns.calibrated:
        return []
    power, placed = returns.power_by_object(), set(returns.object_id[~returns.ghost].tolist())
    records = {int(o["id"]): o for o in frame.record.get("objects", ())}
    ordered = sorted((i for i, p in power.items() if i in placed - {0} and p > 0), key=lambda i: -power[i])
    return [_budget(radar.profile, returns, i, power[i], records.get(i, {})) for i in ordered]


def _budget(
    profile: RadarProfile, returns: Returns, number: int, power: float, record: Mapping[str, Any]
) -> ObjectBudget:
    rows = (returns.object_id == number) & ~returns.ghost
    weight = np.abs(returns.amplitude[rows]) ** 2
    position = weight @ returns.position[rows] / weight.sum()
    each, _, _ = spherical(returns.position[rows])
    rate = np.einsum("ij,ij->i", returns.position[rows], returns.velocity[rows]) / np.maximum(each, 1e-9)
    distance, azimuth, elevation = (float(v) for v in spherical(position))
    antenna = profile.antenna
    seen = max(float(profile.pattern(azimuth, elevation)), _PATTERN_FLOOR)
    weather = 1.0
    if returns.weather is not None:
        weather = float(returns.weather.two_way_loss(distance, profile.center_hz, antenna.polarization))
    terms = {
        "tx_power_dbm": profile.receiver.tx_power_dbm,
        "gain_db": antenna.gain_tx_dbi + antenna.gain_rx_dbi,
        "pattern_db": 20 * math.log10(seen),
        "spreading_db": 10 * math.log10(profile.wavelength_m**2 / FOUR_PI_CUBED) - 40 * math.log10(max(distance, 1e-9)),
        "loss_db": 0.0 - antenna.radome_loss_db - 10 * math.log10(weather),  # 0 - 0, not -0
    }
    received = 10 * math.log10(power) + 30
    return ObjectBudget(
        id=number,
        name=str(record.get("name") or f"object {number}"),
        tag=str(record.get("tag") or "untagged"),
        range_m=distance,
        azimuth_deg=math.degrees(azimuth),
        elevation_deg=math.degrees(elevation),
        velocity_mps=float(weight @ rate / weight.sum()),
        **terms,
        rcs_dbsm=received - sum(terms.values()),
        power_dbm=received,
        snr_db=record.get("snr_db"),
        detected=bool(record.get("detected", False)),
    )


def budget_text(radar: RunRadar, frame: RunFrame, budgets: list[ObjectBudget]) -> str:
    """Return the frame's text: its strongest detection, then a line for every object."""
    found = int(frame.record.get("detections", 0))
    head = f"{radar.name} ({radar.profile.name}), frame {frame.index}, {frame.mid_s:.4f} s: {found} detections"
    top = frame.record.get("strongest")
    if top is not None:
        head += (
            f", strongest at {top['range_m']:.2f} m, {top['azimuth_deg']:+.1f} deg, {top['velocity_mps']:+.2f} m/s, "
            f"SNR {top['snr_db']:.1f} dB, object {top['object_id']}"
        )
        if top.get("ghost"):
            head += f", a ghost by way of {top.get('chain')}"
    told = {b.id for b in budgets} | {0}
    missing = [
        f"{o['name']} ({o['id']}): {'no echo' if o.get('power_dbw') is None else 'no echo from where it is'}"
        for o in frame.record.get("objects", ())
        if o["id"] not in told
    ]
    return "\n".join([head, *(b.line() for b in budgets), *missing])
