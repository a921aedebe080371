"""The link budget as a waterfall: every step from transmit power to the signal-to-noise ratio of a cell."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .._typing import FloatArray
from ..config.profile import RadarProfile
from ..constants import FOUR_PI_CUBED
from ..dsp import RadarCube, window
from ..frames import spherical
from ..scatterers import Weather
from .cells import Look
from .contributions import Contributions
from .records import Stage, Waterfall

__all__ = ["Link", "db", "link_of", "waterfall"]

#: Exponential noise power passes this many times its mean once in 1e4 cells: ln(1e4).
_NOISE_LIMIT = math.log(1e4)


def db(ratio: float) -> float:
    """Return 10 log10; nothing at all is -inf."""
    return 10 * math.log10(ratio) if ratio > 0 else -math.inf


class Link(NamedTuple):
    """The radar equation towards one point, in dB: patterns both ways, radome and weather as negative gains."""

    distance_m: float
    pattern_db: float
    radome_db: float
    weather_db: float
    #: Received power of 1 m^2 there [dBm].
    unit_dbm: float


def link_of(profile: RadarProfile, position: FloatArray, weather: Weather | None) -> Link:
    """Return the radar equation towards a point (3,) of the radar frame [m]."""
    distance, azimuth, elevation = (float(v) for v in spherical(position))
    distance = max(distance, 1e-3)
    antenna = profile.antenna
    pattern = 2 * db(float(profile.pattern(np.asarray(azimuth), np.asarray(elevation))))
    loss = 1.0
    if weather is not None:
        loss = float(weather.two_way_loss(distance, profile.center_hz, antenna.polarization))
    spread = db(profile.wavelength_m**2 / FOUR_PI_CUBED) - 40 * math.log10(distance)
    gains = antenna.gain_tx_dbi + antenna.gain_rx_dbi - antenna.radome_loss_db - db(loss)
    unit = profile.receiver.tx_power_dbm + gains + pattern + spread
    return Link(distance, pattern, -antenna.radome_loss_db, -db(loss), unit)


class _Ledger:
    """Stages under way: every gain is added to the level before it."""

    def __init__(self) -> None:
        self.stages: list[Stage] = []
        self.level = 0.0

    def add(self, name: str, gain_db: float, unit: str, note: str = "") -> None:
        self.level += gain_db
        self.stages.append(Stage(name, gain_db, self.level, "dBm" if unit == "dBm" else "dB", note))


def waterfall(contributions: Contributions, object_id: int, look: Look, centre: FloatArray) -> Waterfall:
    """Return the budget of one object in one cell.

    Parameters
    ----------
    contributions : Contributions
    object_id : int
    look : Look
    centre : (3,) float
        The object's middle by power, radar frame; the range, pattern and weather of the radar equation hold there [m].

    Notes
    -----
    Power a channel is the mean over the object's noise-free samples; the cross section is what the radar equation makes
    of it. Each transform adds its nominal gain, loses the noise bandwidth of its window, and what of the object falls
    into other cells; the last is measured on the object's own noise-free cube.
    """
    cube, profile = contributions.cube, contributions.cube.profile
    own = contributions.of(object_id)
    power, ranges = contributions.levels(object_id)
    ledger = _Ledger()
    _link_stages(ledger, profile, link_of(profile, centre, cube.weather), power)
    received = ledger.level
    noise = profile.noise_power_w
    ledger.add("noise of a sample", -(db(noise) + 30), "dB", f"-k T F f_s, {db(noise) + 30:.1f} dBm")
    sample_snr = ledger.level
    _processing_stages(ledger, cube, own, look, (power, float(ranges[look.row])))
    alone = ledger.level
    amplitude = look.beamformed(own)
    beside = look.beamformed(contributions.whole) - amplitude
    measured = look.beamformed(cube)
    ledger.add("others in the cell", 2 * db(abs(amplitude + beside) / abs(amplitude)), "dB", "added as phasors")
    draw = 2 * db(abs(measured) / abs(amplitude + beside)) if abs(amplitude + beside) > 0 else math.inf
    ledger.add("noise in the cell", draw, "dB", "this frame's draw")
    in_beam = cube.noise_power_w / profile.n_virtual
    rest = db(abs(measured - amplitude - beside) ** 2 / in_beam)
    return Waterfall(
        stages=tuple(ledger.stages),
        received_dbm=received,
        sample_snr_db=sample_snr,
        object_snr_db=alone,
        measured_snr_db=db(abs(measured) ** 2 / in_beam),
        rest_db=rest,
        closes=rest <= db(_NOISE_LIMIT),
        limit_db=db(_NOISE_LIMIT),
    )


def _link_stages(ledger: _Ledger, profile: RadarProfile, link: Link, power: float) -> None:
    antenna, wavelength = profile.antenna, profile.wavelength_m
    constant = db(wavelength**2 / FOUR_PI_CUBED)
    ledger.add("transmit power", profile.receiver.tx_power_dbm, "dBm", "Pt")
    ledger.add("transmit gain", antenna.gain_tx_dbi, "dBm", "Gt")
    ledger.add("receive gain", antenna.gain_rx_dbi, "dBm", "Gr")
    ledger.add("antenna pattern, both ways", link.pattern_db, "dBm", "towards the object")
    ledger.add("wavelength^2 / (4 pi)^3", constant, "dBm", f"{wavelength * 1e3:.3f} mm")
    ledger.add("distance^-4", -40 * math.log10(link.distance_m), "dBm", f"{link.distance_m:.2f} m")
    ledger.add("apparent cross section", db(power) + 30 - link.unit_dbm, "dBm", "dBsm, of the received power")
    ledger.add("radome, both ways", link.radome_db, "dBm")
    ledger.add("weather, both ways", link.weather_db, "dBm")


def _processing_stages(
    ledger: _Ledger, cube: RadarCube, own: RadarCube, look: Look, levels: tuple[float, float]
) -> None:
    """Add the transforms; ``levels`` are the object's power in the samples, and in the cell's range bin [W]."""
    profile, w = cube.profile, cube.profile.waveform
    if profile.array.multiplex == "bpm":
        ledger.add("BPM decoding", db(profile.n_tx), "dB", f"{profile.n_tx} chirps averaged")
    power, in_row = levels
    in_cell = float(own.range_doppler[look.row, look.column])
    in_beam = abs(look.beamformed(own)) ** 2
    for axis, name, count, before, after in (
        ("range", cube.range_window, w.samples, power, in_row),
        ("Doppler", cube.doppler_window, w.chirps, in_row, in_cell),
    ):
        what = "samples" if axis == "range" else "loops"
        ledger.add(f"{axis} FFT", db(count), "dB", f"{count} {what}")
        ledger.add(f"{axis} window", -db(_noise_bandwidth(name, count)), "dB", f"{name}, its noise bandwidth")
        ledger.add(f"{axis} spread and straddling", db(after / before), "dB", "what falls into other cells")
    ledger.add("array", db(profile.n_virtual), "dB", f"{profile.n_virtual} channels in phase")
    ledger.add("array mismatch", db(in_beam / in_cell), "dB", "other directions, folded TDM phase")


def _noise_bandwidth(name: str, count: int) -> float:
    """Return the equivalent noise bandwidth of a window [bins]."""
    taper = window(name, count)
    return float(count * np.sum(taper**2) / taper.sum() ** 2)
