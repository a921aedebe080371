"""From the radar cube to detections: CFAR, grouping, directions, sub-bin estimates, levels, truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .._typing import BoolArray, ComplexArray, FloatArray, IntArray
from ..constants import FOUR_PI_CUBED, RCS_FLOOR_DBSM, SPEED_OF_LIGHT
from ..errors import InputError
from . import angle
from .cfar import cfar_threshold, default_window
from .detections import DETECTION_DTYPE, Detections
from .refine import Axis, PeakFit, PeakPatch, fit_peaks
from .spectra import slow_time_offsets
from .truth import Attribution, attribute

if TYPE_CHECKING:
    from .cube import RadarCube

__all__ = ["detect", "local_maxima", "noise_threshold"]

#: Elevation beams tried before the fit, across the visible sines.
_ELEVATION_BEAMS = 33


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
        floor=0.0 if cube.noise_added else cube.noise_power_w,
    )


def local_maxima(power: FloatArray) -> BoolArray:
    """Mark cells not below any of their eight neighbours; Doppler wraps, of equal neighbours the first counts."""
    n_range, n_velocity = power.shape
    box = np.pad(
        np.take(power, np.arange(-1, n_velocity + 1), axis=1, mode="wrap"), ((1, 1), (0, 0)), constant_values=-1
    )
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
    hits = power > noise_threshold(cube, pfa=pfa, cfar=cfar)
    hits &= (cube.range_m >= blanking_m)[:, None]
    row, column = np.nonzero(hits & local_maxima(power))
    peaks = _estimate(cube, row, column)
    table = _table(cube, peaks)
    table = table[table["range"] > 0]
    return Detections(table[np.argsort(-table["power"], kind="stable")], int(hits.sum()))


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


def _estimate(cube: RadarCube, row: IntArray, column: IntArray) -> _Peaks:
    """Fit one point target to every peak cell."""
    p = cube.profile
    sine, elevation = _coarse_direction(cube, cube.data[row, column])
    turn = 2 * np.pi * slow_time_offsets(p.chirp_start_s) / (cube.n_fft[1] * p.loop_period_s)
    patch = PeakPatch.cut(cube.data, row, column, *_axes(cube), turn)
    fit = fit_peaks(
        patch,
        positions_m=p.positions_m,
        wavelength_m=p.wavelength_m,
        range_step_m=cube.range_step_m,
        sine=sine,
        sine_elevation=elevation,
    )
    return _Peaks(row, column, fit)


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


def _table(cube: RadarCube, peaks: _Peaks) -> np.ndarray[tuple[int], np.dtype[np.void]]:
    """Turn fitted peaks into rows."""
    p = cube.profile
    fit = peaks.fit
    column = peaks.column - cube.n_fft[1] // 2 + fit.doppler_bin
    doppler_hz = column / (cube.n_fft[1] * p.loop_period_s)
    distance = (peaks.row + fit.range_bin) * cube.range_step_m - doppler_hz * SPEED_OF_LIGHT / (2 * p.slope_hz_per_s)
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
    else:
        table["object_id"] = -1
    return table


def _folded(cube: RadarCube, truth: Attribution) -> BoolArray:
    v_max = cube.profile.max_velocity_mps
    return np.asarray((truth.object_id >= 0) & ((truth.velocity < -v_max) | (truth.velocity >= v_max)))


def _snr_db(cube: RadarCube, peaks: _Peaks) -> FloatArray:
    """Return the power of the peak cell, beamformed to the fitted direction, over the expected noise in it [dB]."""
    p = cube.profile
    vectors = angle.steering(p.positions_m, p.wavelength_m, peaks.fit.sine, peaks.fit.sine_elevation)
    beams = np.einsum("pc,pc->p", vectors.conj(), cube.data[peaks.row, peaks.column]) / p.n_virtual
    with np.errstate(divide="ignore"):
        return np.asarray(10 * np.log10(np.abs(beams) ** 2 / (cube.noise_power_w / p.n_virtual)))


def _rcs_dbsm(
    cube: RadarCube, power: FloatArray, distance: FloatArray, azimuth: FloatArray, elevation: FloatArray
) -> FloatArray:
    """Invert the radar equation: P (4 pi)^3 R^4 / (Pt Gt Gr lambda^2 D^2) with the pattern D and the radome loss."""
    p = cube.profile
    gain = 10 ** ((p.antenna.gain_tx_dbi + p.antenna.gain_rx_dbi - p.antenna.radome_loss_db) / 10)
    pattern = np.asarray(p.pattern(azimuth, elevation), dtype=np.float64) ** 2
    per_unit = p.tx_power_w * gain * pattern * p.wavelength_m**2 / (FOUR_PI_CUBED * distance**4)
    with np.errstate(divide="ignore"):
        return np.maximum(10 * np.log10(power / np.maximum(per_unit, 1e-300)), RCS_FLOOR_DBSM)
