"""From the radar cube to detections: CFAR, grouping, directions, sub-bin estimates, levels, truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from .._typing import BoolArray, ComplexArray, FloatArray, IntArray, NDArray
from ..constants import RCS_FLOOR_DBSM, SPEED_OF_LIGHT
from ..errors import InputError
from ..physics.link_budget import rcs_from_power
from . import angle
from .cfar import cfar_threshold, default_window
from .detections import DETECTION_DTYPE, Detections
from .elements import Elements
from .refine import Axis, PeakFit, PeakPatch, at_peak, fit_peaks, without
from .spectra import slow_time_offsets
from .truth import Attribution, attribute

if TYPE_CHECKING:
    from .cube import RadarCube

__all__ = ["detect", "local_maxima", "noise_threshold"]

#: Elevation beams tried before the fit, across the visible sines.
_ELEVATION_BEAMS = 33
#: One-way pattern level below which the inverted radar equation stops.
_PATTERN_FLOOR = 1e-6
#: A second target in one range-Doppler cell: weakest power relative to the first, channels it takes to tell two.
_SECOND_PART, _CHANNELS_FOR_TWO = 10**-1.2, 4
#: Floor of the noise estimate of a cube that carries no noise, relative to the nominal noise: low enough that level
#: tests find weak targets, high enough that rounding and far side lobes are none.
_QUIET_FLOOR = 1e-4
#: Gauss-Newton steps of a continued fit, and turns between two targets.
_SHORT, _TURNS = 2, 2


def noise_threshold(cube: RadarCube, *, pfa: float = 1e-3, cfar: str = "ca") -> FloatArray:
    """Return the CFAR threshold of every range-Doppler cell, (n_range, n_velocity) [W]; arguments as :func:`detect`."""
    w = cube.profile.waveform
    windows, lengths = (cube.range_window, cube.doppler_window), (w.samples, w.chirps)
    power = cube.range_doppler
    shape = default_window((power.shape[0], power.shape[1]), windows, lengths, cube.n_fft)
    return cfar_threshold(
        power,
        pfa=pfa,
        kind=cfar,
        shape=shape,
        windows=windows,
        lengths=lengths,
        n_fft=cube.n_fft,
        channels=cube.data.shape[2],
        floor=0.0 if cube.noise_added else _QUIET_FLOOR * cube.noise_power_w,
    )


def local_maxima(power: FloatArray) -> BoolArray:
    """Mark cells not below any of their eight neighbours; Doppler wraps, of equal neighbours the first counts."""
    n_range, n_velocity = power.shape
    wrapped = np.take(power, np.arange(-1, n_velocity + 1), axis=1, mode="wrap")
    if n_velocity < 3:  # wrapping round would make a cell its own neighbour, or the other one its neighbour twice
        wrapped[:, [0, -1]] = -1
    box = np.pad(wrapped, ((1, 1), (0, 0)), constant_values=-1)
    peak = np.ones(power.shape, dtype=bool)
    for i in range(3):
        for j in range(3):
            other = box[i : i + n_range, j : j + n_velocity]
            if (i, j) < (1, 1):
                peak &= power > other
            elif (i, j) > (1, 1):
                peak &= power >= other
    return peak


def detect(
    cube: RadarCube,
    *,
    pfa: float = 1e-3,
    cfar: str = "ca",
    blanking_m: float = 0.0,
    ambiguity: str | None = None,
) -> Detections:
    """Detect targets.

    Parameters
    ----------
    cube : RadarCube
    pfa : float
        False alarms per range-Doppler cell on noise, window correlation and the sum over channels included.
    cfar : {"ca", "go", "so", "os"}
    blanking_m : float
        Cells nearer than this are not looked at [m].
    ambiguity : None
        Doppler unfolding; none is built in.

    Returns
    -------
    Detections
        Grouped peaks, strongest first.

    Raises
    ------
    InputError
        A value out of range, or an unknown method.

    Notes
    -----
    Velocity: the Doppler frequency of an echo is (2 v / c)(f_c - k tau), so v follows with the echo's own delay.
    Range: the beat frequency is k tau + Doppler; the coupling is removed with the reported velocity.
    """
    if ambiguity is not None:
        raise InputError(f"detect: unknown ambiguity {ambiguity!r}; allowed: None")
    if not blanking_m >= 0:
        raise InputError(f"detect: blanking_m must be >= 0, got {blanking_m}")
    power = cube.range_doppler
    threshold = noise_threshold(cube, pfa=pfa, cfar=cfar)
    hits = power > threshold
    hits &= (cube.range_m >= blanking_m)[:, None]
    row, column = np.nonzero(hits & local_maxima(power))
    peaks = _estimate(cube, row, column, threshold)
    table, chain, ghost = _table(cube, peaks)
    order = np.argsort(-table["power"], kind="stable")
    order = order[table["range"][order] > 0]
    return Detections(table[order], int(hits.sum()), chain[order], ghost[order])


@dataclass(frozen=True)
class _Peaks:
    """Peak cells and what was fitted there; one cell may hold several."""

    row: IntArray
    column: IntArray
    fit: PeakFit


def _axes(cube: RadarCube) -> tuple[Axis, Axis]:
    w = cube.profile.waveform
    shape = cube.data.shape
    wide = ("blackmanharris", "chebyshev")
    axes = []
    for name, n, n_fft, size in zip(
        (cube.range_window, cube.doppler_window), (w.samples, w.chirps), cube.n_fft, shape, strict=False
    ):
        half = min(3 if name in wide else 2, (size - 1) // 2 // max(1, n_fft // n))
        axes.append(Axis(name, n, n_fft, half))
    return axes[0], axes[1]


def _estimate(cube: RadarCube, row: IntArray, column: IntArray, threshold: FloatArray) -> _Peaks:
    """Fit one point target to every peak cell, and a second one where another direction stands out clearly."""
    p = cube.profile
    elements = Elements(p.tx_m, p.rx_m, p.wavelength_m, cube.range_step_m)
    base = row * cube.range_step_m - _coupling_m(cube, column - cube.n_fft[1] // 2)
    turn = 2 * np.pi * slow_time_offsets(p.chirp_start_s) / (cube.n_fft[1] * p.loop_period_s)
    code = cube.loop_code
    sine, elevation = _coarse_direction(cube, cube.data[row, column])
    axes = _axes(cube)
    patch = PeakPatch.cut(cube.data, row, column, axes, turn, code)
    fit = fit_peaks(patch, elements, base, sine=sine, sine_elevation=elevation)
    if code is not None:
        patch = PeakPatch.cut(cube.data, row, column, axes, turn, code, fit.doppler_bin)
        fit = _refit(patch, elements, base, fit)
    rest = cube.data[row, column] - at_peak(patch, elements, base, fit)
    which, sine, elevation = _second_direction(cube, rest, fit, threshold[row, column])
    if not len(which):
        return _Peaks(row, column, fit)
    pair = _fit_pair(patch.part(which), elements, base[which], fit.part(which), sine, elevation)
    kept = _distinct(cube, *pair)
    which, pair = which[kept], (pair[0].part(kept), pair[1].part(kept))
    every = fit.replaced(which, pair[0]).joined(pair[1])
    return _Peaks(np.concatenate([row, row[which]]), np.concatenate([column, column[which]]), every)


def _coupling_m(cube: RadarCube, doppler_bin: FloatArray | IntArray) -> FloatArray:
    """Return the apparent range that a Doppler shift of so many bins adds, c f_D / 2k [m]."""
    p = cube.profile
    doppler_hz = doppler_bin / (cube.n_fft[1] * p.loop_period_s)
    return np.asarray(doppler_hz * SPEED_OF_LIGHT / (2 * p.slope_hz_per_s), dtype=np.float64)


def _refit(patch: PeakPatch, elements: Elements, base_m: FloatArray, fit: PeakFit) -> PeakFit:
    """Continue a fit on other cells."""
    return fit_peaks(
        patch,
        elements,
        base_m,
        sine=fit.sine,
        sine_elevation=fit.sine_elevation,
        start=(fit.range_bin, fit.doppler_bin),
        iterations=_SHORT,
    )


def _fit_pair(
    patch: PeakPatch, elements: Elements, base_m: FloatArray, first: PeakFit, sine: FloatArray, elevation: FloatArray
) -> tuple[PeakFit, PeakFit]:
    """Fit two targets in turn, each to the cells without the other."""
    second = fit_peaks(without(patch, elements, base_m, first), elements, base_m, sine=sine, sine_elevation=elevation)
    for _ in range(_TURNS):
        first = _refit(without(patch, elements, base_m, second), elements, base_m, first)
        second = _refit(without(patch, elements, base_m, first), elements, base_m, second)
    return first, second


def _coarse_direction(cube: RadarCube, snapshots: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Return the direction cosines of the strongest beam: azimuth by the widest row, then elevation by all channels."""
    p = cube.profile
    vectors = angle.steering(p.positions_m[cube.azimuth_channels], p.wavelength_m, cube.azimuth_sine)
    sine = cube.azimuth_sine[np.argmax(angle.bartlett(snapshots[:, cube.azimuth_channels], vectors), axis=1)]
    elevation = np.zeros(len(sine))
    if angle.has_elevation(p.positions_m, p.wavelength_m) and len(sine):
        tried = np.linspace(-1, 1, _ELEVATION_BEAMS) * np.sqrt(1 - sine**2)[:, None]
        steered = angle.steering(p.positions_m, p.wavelength_m, sine[:, None], tried)
        beams = np.abs(np.einsum("pkc,pc->pk", steered.conj(), snapshots))
        elevation = tried[np.arange(len(sine)), np.argmax(beams, axis=1)]
    return sine, elevation


def _second_direction(
    cube: RadarCube, rest: ComplexArray, fit: PeakFit, threshold: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return peaks whose cell holds another direction when the fitted target is taken out, and that direction.

    It must stand a beam away, above the threshold, and no more than 12 dB below the first: what a line of six leaves
    of an extended or mismodelled target is weaker.
    """
    empty = np.zeros(0)
    if len(cube.azimuth_channels) < _CHANNELS_FOR_TWO or not len(rest):
        return np.zeros(0, dtype=np.int64), empty, empty
    sine, elevation = _coarse_direction(cube, rest)
    vectors = angle.steering(cube.profile.positions_m, cube.profile.wavelength_m, sine, elevation)
    power = np.abs(np.einsum("pc,pc->p", vectors.conj(), rest) / rest.shape[1]) ** 2
    clear = power > np.maximum(threshold, _SECOND_PART * np.abs(fit.amplitude) ** 2)
    clear &= np.abs(sine - fit.sine) > _beam(cube)
    which = np.flatnonzero(clear)
    return which, sine[which], elevation[which]


def _beam(cube: RadarCube) -> float:
    """Return the resolution of the azimuth aperture in sine: 2/M of a half-wavelength line of M columns."""
    aperture = float(np.ptp(cube.profile.positions_m[cube.azimuth_channels, 1]))
    return 2 / (2 * aperture / cube.profile.wavelength_m + 1)


def _distinct(cube: RadarCube, first: PeakFit, second: PeakFit) -> IntArray:
    """Return the pairs that stayed a beam apart and did not blow up against each other."""
    strong, weak = np.abs(first.amplitude) ** 2, np.abs(second.amplitude) ** 2
    apart = np.abs(first.sine - second.sine) > 0.8 * _beam(cube)
    return np.flatnonzero(apart & (weak > _SECOND_PART * strong) & (weak < 2 * strong))


def _table(cube: RadarCube, peaks: _Peaks) -> tuple[np.ndarray[tuple[int], np.dtype[np.void]], NDArray[Any], BoolArray]:
    """Turn fitted peaks into rows, with their chains and whether they are ghosts."""
    p = cube.profile
    fit = peaks.fit
    column = peaks.column - cube.n_fft[1] // 2 + fit.doppler_bin
    doppler_hz = column / (cube.n_fft[1] * p.loop_period_s)
    distance = (peaks.row + fit.range_bin) * cube.range_step_m - _coupling_m(cube, column)
    if p.waveform.adc == "complex":
        # beat frequencies are known modulo f_s; a real ADC folds them instead, and what comes out below 0 is no target
        distance = np.where(distance > 0, distance, distance + cube.range_step_m * cube.n_fft[0])
    tau = 2 * distance / SPEED_OF_LIGHT
    velocity = doppler_hz * SPEED_OF_LIGHT / (2 * (p.center_hz - p.slope_hz_per_s * tau))
    elevation = np.arcsin(fit.sine_elevation)
    azimuth = np.arcsin(np.clip(fit.sine / np.maximum(np.cos(elevation), 1e-9), -1, 1))
    valid = angle.has_elevation(p.positions_m, p.wavelength_m)
    table = np.zeros(len(distance), dtype=DETECTION_DTYPE)
    table["range"], table["velocity"], table["azimuth"] = distance, velocity, azimuth
    table["elevation"], table["elevation_valid"] = (elevation if valid else np.nan), valid
    table["x"] = distance * np.cos(azimuth) * np.cos(elevation)
    table["y"] = distance * fit.sine
    table["z"] = distance * fit.sine_elevation
    table["power"] = np.abs(fit.amplitude) ** 2
    table["snr_db"] = _snr_db(cube, peaks)
    table["rcs_dbsm"] = _rcs_dbsm(cube, table["power"], distance, azimuth, elevation)
    if cube.returns is not None:
        truth = attribute(cube, cube.returns, peaks.row, peaks.column, fit.sine, fit.sine_elevation)
        table["object_id"], table["tag"] = truth.object_id, truth.tag
        table["ambiguous"] = _folded(cube, truth)
        return table, truth.chain, truth.ghost
    table["object_id"] = -1
    return table, np.full(len(table), ""), np.zeros(len(table), dtype=bool)


def _folded(cube: RadarCube, truth: Attribution) -> BoolArray:
    v_max = cube.profile.max_velocity_mps
    return np.asarray((truth.object_id >= 0) & ((truth.velocity < -v_max) | (truth.velocity >= v_max)))


def _snr_db(cube: RadarCube, peaks: _Peaks) -> FloatArray:
    """Return the power of the peak cell, beamformed to the fitted direction, over the expected noise in it [dB]."""
    p = cube.profile
    beams = np.einsum("pc,pc->p", peaks.fit.phasor.conj(), cube.data[peaks.row, peaks.column]) / p.n_virtual
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10(np.abs(beams) ** 2 / (cube.noise_power_w / p.n_virtual)))


def _rcs_dbsm(
    cube: RadarCube, power: FloatArray, distance: FloatArray, azimuth: FloatArray, elevation: FloatArray
) -> FloatArray:
    """Invert the radar equation at the estimated range and direction, without pattern, radome and weather loss."""
    p = cube.profile
    pattern = np.asarray(p.pattern(azimuth, elevation), dtype=np.float64)
    gain_tx, gain_rx, loss = (
        10 ** (level / 10) for level in (p.antenna.gain_tx_dbi, p.antenna.gain_rx_dbi, p.antenna.radome_loss_db)
    )
    weather = 1.0 if cube.weather is None else cube.weather.two_way_loss(distance, p.center_hz, p.antenna.polarization)
    # behind a pattern's null no cross section can be told: keep the ratio finite
    seen = np.maximum(pattern, _PATTERN_FLOOR)
    area = rcs_from_power(power, distance, p.wavelength_m, p.tx_power_w, gain_tx * seen, gain_rx * seen, loss * weather)
    with np.errstate(divide="ignore"):
        return np.asarray(np.maximum(10 * np.log10(area), RCS_FLOOR_DBSM), dtype=np.float64)
