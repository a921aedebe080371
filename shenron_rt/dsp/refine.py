"""Sub-bin estimates: maximum likelihood on the few cells around a peak, with the exact shape of the windows.

Model of the cells (i range bins, j Doppler bins off the peak, channel c) of one point target:
y = A W_r(f + shift_c - i) W_d(d - j) e^{j 2 pi d dt_c} e^{j phi_c(direction)}, W the transform of the window about its
middle, shift_c the range shift of channel c seen under that direction, dt_c its later start in frames of Doppler bins.
Noise in neighbouring cells is correlated by the window: cells are whitened first (a part of the cell power is added to
their covariance, so that the weight stays on the main lobe, where a second target disturbs least). Gauss-Newton on
(f, d, direction) with the complex A projected out.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import lru_cache

import numpy as np

from .._typing import ComplexArray, FloatArray, IntArray
from .cfar_design import bin_correlation
from .elements import Elements
from .multiplex import LoopCode
from .windows import window

__all__ = ["Axis", "PeakFit", "PeakPatch", "at_peak", "fit_peaks", "without"]

#: Points of the response table per bin; cubic Hermite between them errs by 1e-8.
_TABLE_STEP = 64
#: White part added to the noise covariance of the patch before whitening.
_REGULAR = 0.05
#: Largest change of one Gauss-Newton step [bins] and [beams].
_STEP_BINS, _STEP_BEAMS = 0.35, 0.25
#: Estimates stay this close to the peak cell [bins].
_LIMIT_BINS = 0.75
_ITERATIONS = 5


@dataclass(frozen=True)
class Axis:
    """One transformed axis: window, samples, transform length, and the half size of the patch along it."""

    name: str
    n: int
    n_fft: int
    half: int

    @property
    def stride(self) -> int:
        """Bins between independent cells of a zero-padded transform."""
        return max(1, self.n_fft // self.n)

    @property
    def offsets(self) -> IntArray:
        """(2 half + 1,) bins of the patch relative to its middle."""
        return np.arange(-self.half, self.half + 1) * self.stride

    @property
    def centre(self) -> float:
        """Middle of the window [samples]."""
        w2 = window(self.name, self.n) ** 2
        return float(np.sum(w2 * np.arange(self.n)) / np.sum(w2))


@lru_cache(maxsize=32)
def _response_table(axis: Axis, reach: int) -> tuple[FloatArray, FloatArray]:
    """Return the transform of the window and its derivative per bin, at -reach..reach bins in steps of 1/64."""
    w = window(axis.name, axis.n)
    x = np.arange(-reach * _TABLE_STEP, reach * _TABLE_STEP + 1) / _TABLE_STEP
    turn = 2 * np.pi * (np.arange(axis.n) - axis.centre) / axis.n_fft
    angle = x[:, None] * turn
    return np.cos(angle) @ w / w.sum(), -np.sin(angle) @ (w * turn) / w.sum()


@lru_cache(maxsize=32)
def _whitener(axis: Axis) -> FloatArray:
    """Return the symmetric inverse root of the patch's noise covariance along one axis."""
    rho = np.asarray(bin_correlation(axis.name, axis.n, axis.n_fft, 2 * axis.half * axis.stride + 1))
    index = np.abs(axis.offsets[:, None] - axis.offsets[None])
    values, vectors = np.linalg.eigh(rho[index] + _REGULAR * np.eye(len(index)))
    return np.asarray(vectors / np.sqrt(values) @ vectors.T, dtype=np.float64)


def _response(axis: Axis, x: FloatArray, reach: int) -> tuple[FloatArray, FloatArray]:
    """Interpolate window response and derivative at ``x`` bins (cubic Hermite on the table)."""
    value, slope = _response_table(axis, reach)
    position = (np.clip(x, -reach + 1e-9, reach - 1e-9) + reach) * _TABLE_STEP
    i = position.astype(np.int64)
    t = position - i
    h = 1.0 / _TABLE_STEP
    v0, v1, s0, s1 = value[i], value[i + 1], slope[i] * h, slope[i + 1] * h
    a, b = 2 * (v0 - v1) + s0 + s1, 3 * (v1 - v0) - 2 * s0 - s1
    return v0 + t * (s0 + t * (b + t * a)), (s0 + t * (2 * b + 3 * a * t)) / h


@dataclass(frozen=True)
class PeakPatch:
    """Whitened cells around the peaks, (n_peak, rows, columns, n_virtual), and the bins they stand on."""

    cells: ComplexArray
    row_offset: IntArray  # (n_peak, rows) bins relative to the peak cell
    column_offset: IntArray  # (columns,)
    range_axis: Axis
    doppler_axis: Axis
    turn: FloatArray  # (n_virtual,) phase per Doppler bin by the later start of the channel [rad]

    @classmethod
    def cut(
        cls,
        data: ComplexArray,
        row: IntArray,
        column: IntArray,
        axes: tuple[Axis, Axis],
        turn: FloatArray,
        code: LoopCode | None = None,
        doppler_bin: FloatArray | None = None,
    ) -> PeakPatch:
        """Cut the cells around peaks out of a cube; at the ends of range the patch moves inside, Doppler wraps.

        ``turn`` undoes the compensation of each Doppler bin by its own velocity: the cells of one peak then share the
        time reference of its middle bin. Under BPM ``code`` decodes them anew for the Doppler of the peak itself,
        ``doppler_bin`` from its middle bin.
        """
        range_axis, doppler_axis = axes
        n_range, n_velocity, _ = data.shape
        half = range_axis.half * range_axis.stride
        middle = np.clip(row, half, n_range - 1 - half)
        rows = middle[:, None] + range_axis.offsets
        j = doppler_axis.offsets
        columns = (column[:, None] + j) % n_velocity
        cells = data[rows[:, :, None], columns[:, None, :]]
        row_offset = rows - row[:, None]
        # phases as seen from the middle of each window
        phase_r = np.exp(2j * np.pi * range_axis.centre / range_axis.n_fft * row_offset)
        phase_d = np.exp(2j * np.pi * doppler_axis.centre / doppler_axis.n_fft * j)
        # beyond the end of the Doppler axis the compensation was that of the wrapped bin
        own = (columns - column[:, None]).astype(np.float64)
        cells = cells * phase_r[:, :, None, None] * (phase_d[:, None] * np.exp(1j * own[:, :, None] * turn))[:, None]
        if code is not None:
            wanted = np.zeros(len(row)) if doppler_bin is None else doppler_bin
            cells = code.decode_anew(cells, (wanted[:, None] - own)[:, None])
        cells = np.einsum("ik,pkjc,jl->pilc", _whitener(range_axis), cells, _whitener(doppler_axis), optimize=True)
        return cls(cells, row_offset, j, range_axis, doppler_axis, turn)

    def part(self, which: IntArray) -> PeakPatch:
        """Return the patches of some peaks."""
        return PeakPatch(
            self.cells[which], self.row_offset[which], self.column_offset, self.range_axis, self.doppler_axis, self.turn
        )


@dataclass(frozen=True)
class PeakFit:
    """Estimates: offsets from the peak cell [bins], direction cosines (y, z), complex amplitude per channel, steering.

    ``phasor`` (n_peak, n_virtual) is what a target there leaves on the channels, wave front curvature included.
    """

    range_bin: FloatArray
    doppler_bin: FloatArray
    sine: FloatArray
    sine_elevation: FloatArray
    amplitude: ComplexArray
    phasor: ComplexArray

    def part(self, which: IntArray) -> PeakFit:
        """Return the fits of some peaks."""
        return PeakFit(*(getattr(self, f.name)[which] for f in fields(self)))

    def joined(self, other: PeakFit) -> PeakFit:
        """Return these fits followed by others."""
        return PeakFit(*(np.concatenate([getattr(v, f.name) for v in (self, other)]) for f in fields(self)))

    def replaced(self, which: IntArray, new: PeakFit) -> PeakFit:
        """Return these fits with some of them exchanged."""
        columns = {f.name: getattr(self, f.name).copy() for f in fields(self)}
        for name, column in columns.items():
            column[which] = getattr(new, name)
        return PeakFit(**columns)


def _model(
    patch: PeakPatch, elements: Elements, base_m: FloatArray, f: FloatArray, d: FloatArray, s: FloatArray, e: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, ComplexArray]:
    """Return whitened range response and slope (p, i, c), Doppler response and slope (p, j), channel phasor (p, c)."""
    phasor, shift = elements.phasor(base_m + f * elements.range_step_m, s, e)
    reach_r = 2 * patch.range_axis.half * patch.range_axis.stride + 4
    reach_d = 2 * patch.doppler_axis.half * patch.doppler_axis.stride + 4
    x_r = (f[:, None] + shift)[:, None, :] - patch.row_offset[:, :, None]
    white_r, white_d = _whitener(patch.range_axis), _whitener(patch.doppler_axis)
    m_r, dm_r = _response(patch.range_axis, x_r, reach_r)
    m_d, dm_d = _response(patch.doppler_axis, d[:, None] - patch.column_offset, reach_d)
    turned = np.asarray(phasor * np.exp(1j * d[:, None] * patch.turn), dtype=np.complex128)
    return np.matmul(white_r, m_r), np.matmul(white_r, dm_r), m_d @ white_d, dm_d @ white_d, turned


def _step(
    patch: PeakPatch, elements: Elements, base_m: FloatArray, f: FloatArray, d: FloatArray, s: FloatArray, e: FloatArray
) -> tuple[FloatArray, ComplexArray]:
    """Return the Gauss-Newton step (n_peak, n_parameter) and the amplitude at the present estimate."""
    m_r, dm_r, m_d, dm_d, phasor = _model(patch, elements, base_m, f, d, s, e)
    by_doppler = np.einsum("pijc,pj->pic", patch.cells, m_d)
    z = phasor.conj() * np.einsum("pic,pic->pc", m_r, by_doppler)
    z_r = phasor.conj() * np.einsum("pic,pic->pc", dm_r, by_doppler)
    z_d = phasor.conj() * np.einsum("pic,pic->pc", m_r, np.einsum("pijc,pj->pic", patch.cells, dm_d))
    alpha, beta, gamma = (np.einsum("pic,pic->pc", a, b) for a, b in ((m_r, m_r), (m_r, dm_r), (dm_r, dm_r)))
    a, b, g = ((u * v).sum(axis=1, keepdims=True) for u, v in ((m_d, m_d), (m_d, dm_d), (dm_d, dm_d)))
    slopes = elements.slopes(s, e)
    # every derivative of the model is (real factor along range or Doppler) or (j lever) times the model
    lever = [np.broadcast_to(patch.turn, z.shape), *slopes]
    projections = [z_r, z_d - 1j * lever[0] * z, *(-1j * h * z for h in slopes)]
    # inner products <d_i m, d_j m> and <m, d_i m>, summed over channels
    norm = (alpha * a).sum(axis=1)
    on_model = [beta * a, alpha * (b + 1j * lever[0] * a), *(1j * h * alpha * a for h in slopes)]
    gram = [[gamma * a, beta * (b + 1j * lever[0] * a), *(1j * h * beta * a for h in slopes)]]
    gram.append([alpha * (g + lever[0] ** 2 * a), *(alpha * (1j * h * b + lever[0] * h * a) for h in slopes)])
    gram += [[alpha * a * h * k for k in slopes[i:]] for i, h in enumerate(slopes)]
    amplitude = z.sum(axis=1) / norm
    count = len(projections)
    matrix = np.zeros((len(f), count, count))
    vector = np.zeros((len(f), count))
    cross = [term.sum(axis=1) for term in on_model]
    for i in range(count):
        rest = projections[i].sum(axis=1) - cross[i].conj() * amplitude
        vector[:, i] = (amplitude.conj() * rest).real
        for j in range(i, count):
            inner = gram[i][j - i].sum(axis=1) - cross[i].conj() * cross[j] / norm
            matrix[:, i, j] = matrix[:, j, i] = np.abs(amplitude) ** 2 * inner.real
    # a trace of damping keeps an empty patch solvable
    scale = np.trace(matrix, axis1=1, axis2=2) + np.finfo(float).tiny
    matrix += (1e-12 * scale)[:, None, None] * np.eye(count)
    return np.asarray(np.linalg.solve(matrix, vector[:, :, None])[:, :, 0], dtype=np.float64), amplitude


def fit_peaks(
    patch: PeakPatch,
    elements: Elements,
    base_m: FloatArray,
    *,
    sine: FloatArray,
    sine_elevation: FloatArray,
    start: tuple[FloatArray, FloatArray] | None = None,
    iterations: int = _ITERATIONS,
) -> PeakFit:
    """Fit one point target to every patch.

    Parameters
    ----------
    patch : PeakPatch
    elements : Elements
    base_m : (n_peak,) float
        Distance of the peak cell, its range-Doppler coupling removed [m]; sets the curvature of the wave front.
    sine, sine_elevation : (n_peak,) float
        Direction cosines to start from.
    start : pair of (n_peak,) float, optional
        Offsets in range and Doppler to start from [bins]; the peak cell by default.
    iterations : int
        Gauss-Newton steps.
    """
    spans = np.ptp(elements.positions, axis=0)
    # a single cell along an axis says nothing about the position in it
    limits = [_STEP_BINS * axis.stride * (axis.half > 0) for axis in (patch.range_axis, patch.doppler_axis)]
    limits += [_STEP_BEAMS * elements.wavelength_m / spans[k] for k in (1, 2) if elements.free[k - 1]]
    bound = np.array([_LIMIT_BINS * patch.range_axis.stride, _LIMIT_BINS * patch.doppler_axis.stride])
    s, e = sine.copy(), sine_elevation.copy()
    middle = elements.phasor(base_m, s, e)[1].mean(axis=1)
    f, d = (-middle, np.zeros(len(s))) if start is None else start
    amplitude = np.zeros(len(s), dtype=np.complex128)
    for _ in range(iterations):
        # the amplitude is that before the step: a step delta from the maximum changes it by O(delta^2) only
        step, amplitude = _step(patch, elements, base_m, f, d, s, e)
        step = np.clip(step, -np.asarray(limits), np.asarray(limits))
        # f refers to the origin of the array, the peak to its middle: the limit is about the peak
        f = np.clip(f + step[:, 0], -bound[0] - middle, bound[0] - middle)
        d = np.clip(d + step[:, 1], -bound[1], bound[1])
        if elements.free[0]:
            s = np.clip(s + step[:, 2], -1.0, 1.0)
        if elements.free[1]:
            top = np.sqrt(1 - s**2)
            e = np.clip(e + step[:, -1], -top, top)
    phasor, _ = elements.phasor(base_m + f * elements.range_step_m, s, e)
    return PeakFit(f, d, s, e, amplitude, phasor)


def without(patch: PeakPatch, elements: Elements, base_m: FloatArray, fit: PeakFit) -> PeakPatch:
    """Return the patches with the fitted targets taken out."""
    m_r, _, m_d, _, phasor = _model(
        patch, elements, base_m, fit.range_bin, fit.doppler_bin, fit.sine, fit.sine_elevation
    )
    model = (fit.amplitude[:, None] * phasor)[:, None, None] * m_r[:, :, None] * m_d[:, None, :, None]
    return replace(patch, cells=patch.cells - model)


def at_peak(patch: PeakPatch, elements: Elements, base_m: FloatArray, fit: PeakFit) -> ComplexArray:
    """Return what the fitted targets leave in their peak cells, (n_peak, n_virtual) [sqrt(W)]."""
    _, shift = elements.phasor(base_m + fit.range_bin * elements.range_step_m, fit.sine, fit.sine_elevation)
    gain_r, _ = _response(patch.range_axis, fit.range_bin[:, None] + shift, 4)
    gain_d, _ = _response(patch.doppler_axis, fit.doppler_bin, 4)
    turned = fit.phasor * np.exp(1j * fit.doppler_bin[:, None] * patch.turn)
    return np.asarray((fit.amplitude * gain_d)[:, None] * gain_r * turned, dtype=np.complex128)
