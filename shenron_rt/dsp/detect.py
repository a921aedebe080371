"""From the radar cube to detections: CFAR, grouping, directions, sub-bin estimates, levels, truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from .._typing import BoolArray, ComplexArray, FloatArray, IntArray, NDArray
from ..constants import RCS_FLOOR_DBSM, SPEED_OF_LIGHT
from ..errors import InputError
from ..physics.link_budget import rcs_from_power
from . import angle
from .ambiguity import Look, Unfolding, other_looks, unfold
from .cfar import cfar_threshold, default_window
from .detections import DETECTION_DTYPE, Detections
from .directions import coarse_direction, distinct, second_direction
from .elements import Elements
from .multiplex import strongest_alias
from .refine import Axis, PeakFit, PeakPatch, at_peak, fit_peaks, without
from .spectra import slow_time_offsets
from .tdm_phase import unfold_by_phase
from .truth import Attribution, attribute

if TYPE_CHECKING:
    from .cube import RadarCube

__all__ = ["detect", "local_maxima", "noise_threshold"]

#: One-way pattern level below which the inverted radar equation stops.
_PATTERN_FLOOR = 1e-6
#: Floor of the noise estimate of a cube that carries no noise, relative to the nominal noise: low enough that level
#: tests find weak targets, high enough that rounding and far side lobes are none.
_QUIET_FLOOR = 1e-4
#: Gauss-Newton steps of a continued fit, and turns between two targets.
_SHORT, _TURNS = 2, 2


def noise_threshold(
    cube: RadarCube, *, pfa: float = 1e-3, cfar: str = "ca", power: FloatArray | None = None
) -> FloatArray:
    """Return the CFAR threshold of every range-Doppler cell, (n_range, n_velocity) [W]; arguments as :func:`detect`.

    ``power`` (n_range, n_velocity) takes the place of the cube's own map: what the threshold were over another one [W].
    """
    w = cube.profile.waveform
    windows, lengths = (cube.range_window, cube.doppler_window), (w.samples, w.chirps)
    power = cube.range_doppler if power is None else power
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
    previous: Detections | None = None,
    interval_s: float | None = None,
) -> Detections:
    """Detect targets.

    Parameters
    ----------
    cube : RadarCube
        Of several bursts the first is searched.
    pfa : float
        False alarms per range-Doppler cell on noise, window correlation and the sum over channels included.
    cfar : {"ca", "go", "so", "os"}
    blanking_m : float
        Cells nearer than this are not looked at [m].
    ambiguity : {None, "staggered", "two_frame", "tdm_phase"}
        How to unfold velocities: by the bursts of a frame with ``stagger: burst``, by the range change since the
        ``previous`` frame, or by the phases of transmitters that take turns. A row without a unique answer stays folded
        and is marked ``ambiguous``.
    previous : Detections, optional
        Of an earlier frame of the same radar, for ``two_frame``; without them no row is unfolded.
    interval_s : float, optional
        Time from that frame to this one, for ``two_frame`` [s].

    Returns
    -------
    Detections
        Grouped peaks, strongest first.

    Raises
    ------
    InputError
        A value out of range, an unknown method, or one that this cube or interval does not allow.

    Notes
    -----
    Velocity: the Doppler frequency of an echo is (2 v / c)(f_c - k tau), so v follows with the echo's own delay.
    Range: the beat frequency is k tau + Doppler; the coupling is removed with the reported velocity.
    """
    if not blanking_m >= 0:
        raise InputError(f"detect: blanking_m must be >= 0, got {blanking_m}")
    again = partial(detect, pfa=pfa, cfar=cfar, blanking_m=blanking_m)
    others = None if ambiguity is None else other_looks(cube, ambiguity, previous, interval_s, again)
    cube = cube.bursts[0] if cube.bursts else cube
    power = cube.range_doppler
    threshold = noise_threshold(cube, pfa=pfa, cfar=cfar)
    hits = power > threshold
    hits &= (cube.range_m >= blanking_m)[:, None]
    row, column = np.nonzero(hits & local_maxima(power) & strongest_alias(power, cube.profile.n_subbands))
    peaks = _estimate(cube, row, column, threshold)
    table, chain, ghost = _table(cube, peaks)
    if others is not None:
        if ambiguity == "tdm_phase":
            found = unfold_by_phase(cube, table["velocity"], peaks.cells, partial(_turned, cube))
        else:
            found = unfold(Look(table, cube.profile, 0.0, cube.mid_offset_s), others)
        peaks, resolved = _unfolded(cube, peaks, found, threshold)
        table, chain, ghost = _table(cube, peaks)
        table["ambiguous"] |= ~resolved
    order = np.argsort(-table["power"], kind="stable")
    order = order[table["range"][order] > 0]
    return Detections(table[order], int(hits.sum()), chain[order], ghost[order])


@dataclass(frozen=True)
class _Peaks:
    """Peak cells and what was fitted there; one cell may hold several. ``fold``: multiples of 2 v_max to add."""

    row: IntArray
    column: IntArray
    fit: PeakFit
    fold: IntArray
    cells: ComplexArray  # (n, n_virtual) the peak cells, channels turned to one time


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


def _estimate(
    cube: RadarCube, row: IntArray, column: IntArray, threshold: FloatArray, fold: IntArray | None = None
) -> _Peaks:
    """Fit one point target to every peak cell, and a second one where another direction stands out clearly."""
    p = cube.profile
    fold = np.zeros_like(row) if fold is None else fold
    elements = Elements(p.tx_m, p.rx_m, p.wavelength_m, cube.range_step_m)
    base = row * cube.range_step_m - _coupling_m(cube, column - cube.n_fft[1] // 2 + fold * cube.n_fft[1])
    snapshots = _turned(cube, cube.data[row, column], fold)
    sine, elevation = coarse_direction(cube, snapshots)
    patch = _patch(cube, row, column, fold)
    fit = fit_peaks(patch, elements, base, sine=sine, sine_elevation=elevation)
    if cube.loop_code is not None:
        patch = _patch(cube, row, column, fold, fit.doppler_bin)
        fit = _refit(patch, elements, base, fit)
    rest = snapshots - at_peak(patch, elements, base, fit)
    which, sine, elevation = second_direction(cube, rest, fit, threshold[row, column])
    if not len(which):
        return _Peaks(row, column, fit, fold, snapshots)
    pair = _fit_pair(patch.part(which), elements, base[which], fit.part(which), sine, elevation)
    kept = distinct(cube, *pair)
    which, pair = which[kept], (pair[0].part(kept), pair[1].part(kept))
    every = fit.replaced(which, pair[0]).joined(pair[1])
    row, column, fold, snapshots = (np.concatenate([a, a[which]]) for a in (row, column, fold, snapshots))
    return _Peaks(row, column, every, fold, snapshots)


def _unfolded(cube: RadarCube, peaks: _Peaks, found: Unfolding, threshold: FloatArray) -> tuple[_Peaks, BoolArray]:
    """Give peaks their folds; where chirps of a loop take turns, directions are estimated again with them."""
    if cube.profile.n_chirps_per_loop == 1 or not found.fold.any():
        return replace(peaks, fold=found.fold), found.resolved
    # one answer a cell, that of its first target: the directions that made two of it were those of a fold
    cells = peaks.row * cube.n_fft[1] + peaks.column
    unique, first = np.unique(cells, return_index=True)
    peaks = _estimate(cube, peaks.row[first], peaks.column[first], threshold, found.fold[first])
    cells = peaks.row * cube.n_fft[1] + peaks.column
    return peaks, found.resolved[first[np.searchsorted(unique, cells)]]


def _turn(cube: RadarCube) -> FloatArray:
    """Return the phase of each channel per Doppler bin by its later start, (n_virtual,) [rad]."""
    p = cube.profile
    return 2 * np.pi * slow_time_offsets(p.chirp_start_s) / (cube.n_fft[1] * p.loop_period_s)


def _turned(cube: RadarCube, channels: ComplexArray, fold: IntArray) -> ComplexArray:
    """Return (n, ..., n_virtual) channels compensated for velocities ``fold`` (n,) times 2 v_max farther."""
    if not fold.any():
        return channels
    farther = (fold * cube.n_fft[1]).reshape(-1, *(1,) * (channels.ndim - 1))
    turned = channels * np.exp(-1j * farther * _turn(cube))
    return turned if cube.loop_code is None else cube.loop_code.decode_anew(turned, farther[..., 0])


def _patch(
    cube: RadarCube, row: IntArray, column: IntArray, fold: IntArray, doppler_bin: FloatArray | None = None
) -> PeakPatch:
    """Cut the cells around peaks, compensated for their folds."""
    patch = PeakPatch.cut(cube.data, row, column, _axes(cube), _turn(cube), cube.loop_code, doppler_bin)
    return replace(patch, cells=_turned(cube, patch.cells, fold))


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


def _table(cube: RadarCube, peaks: _Peaks) -> tuple[np.ndarray[tuple[int], np.dtype[np.void]], NDArray[Any], BoolArray]:
    """Turn fitted peaks into rows, with their chains and whether they are ghosts."""
    p = cube.profile
    fit = peaks.fit
    column = peaks.column + (peaks.fold * cube.n_fft[1] - cube.n_fft[1] // 2) + fit.doppler_bin
    doppler_hz = column / (cube.n_fft[1] * p.loop_period_s)
    distance = (peaks.row + fit.range_bin) * cube.range_step_m - _coupling_m(cube, column)
    if p.waveform.adc == "complex":
        # beat frequencies are known modulo f_s; a real ADC folds them instead, and what comes out below 0 is no target
        distance = np.where(distance > 0, distance, distance + cube.range_step_m * cube.n_fft[0])
    tau = 2 * distance / SPEED_OF_LIGHT
    velocity = doppler_hz * SPEED_OF_LIGHT / (2 * (p.center_hz - p.slope_hz_per_s * tau))
    distance = distance - velocity * cube.mid_offset_s
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
        table["ambiguous"] = _folded(cube, truth, velocity)
        return table, truth.chain, truth.ghost
    table["object_id"] = -1
    return table, np.full(len(table), ""), np.zeros(len(table), dtype=bool)


def _folded(cube: RadarCube, truth: Attribution, velocity: FloatArray) -> BoolArray:
    """Tell which reported velocities are a multiple of 2 v_max off the truth."""
    return np.asarray((truth.object_id >= 0) & (np.abs(velocity - truth.velocity) > cube.profile.max_velocity_mps))


def _snr_db(cube: RadarCube, peaks: _Peaks) -> FloatArray:
    """Return the power of the peak cell, beamformed to the fitted direction, over the expected noise in it [dB]."""
    p = cube.profile
    beams = np.einsum("pc,pc->p", peaks.fit.phasor.conj(), peaks.cells) / p.n_virtual
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
