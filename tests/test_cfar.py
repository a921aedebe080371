"""CFAR: constants, exact false-alarm rates, two-dimensional detectors."""

from __future__ import annotations

import numpy as np
import pytest
from dsp_tools import noise_adc, table_rows

from shenron_rt.config.profile import load_profile
from shenron_rt.dsp import CfarWindow, cfar_alpha, cfar_pfa, cfar_statistic, cfar_threshold, noise_threshold, process
from shenron_rt.dsp.cfar import default_window
from shenron_rt.dsp.cfar_design import bin_correlation, cfar_multiplier, quadratic_pfa
from shenron_rt.errors import InputError

LINE_16 = CfarWindow((8, 0), (2, 0))


def independent(power, kind, pfa, shape=LINE_16):
    """Return the threshold for independent cells of one channel."""
    n = power.shape
    return cfar_threshold(
        power, pfa=pfa, kind=kind, shape=shape, windows=("rect", "rect"), lengths=n, n_fft=n, channels=1
    )  # fmt: skip


@pytest.mark.parametrize("kind", ["ca", "os", "go", "so"])
def test_constants_reproduce_the_reference_table(shared_reference, kind):
    for row in table_rows(shared_reference / "dsp" / "cfar.csv"):
        # the table prints six digits
        assert cfar_alpha(int(row["N"]), float(row["pfa"]), kind) == pytest.approx(
            float(row[f"alpha_{kind}"]), rel=1e-5
        )


def test_hann_column_follows_from_the_eigenvalues_of_the_training_cells(shared_reference):
    for row in table_rows(shared_reference / "dsp" / "cfar.csv"):
        half = int(row["N"]) // 2
        cells = np.r_[-half - 2 : -2, 3 : half + 3]
        rho = np.asarray(bin_correlation("hann", 256, 256, 2 * half + 5))
        eigenvalues = np.linalg.eigvalsh(rho[np.abs(cells[:, None] - cells)] / len(cells))
        pfa = quadratic_pfa(float(row["alpha_ca"]), eigenvalues, 1)
        assert pfa == pytest.approx(float(row["pfa_ca_hann"]), rel=1e-4)  # alpha has six digits, Pfa its power of 16


def test_hann_bins_are_correlated_as_theory_says():
    assert bin_correlation("hann", 256, 256, 5) == pytest.approx((1, 2 / 3, 1 / 6, 0, 0), abs=1e-12)


def test_channel_sum_of_independent_cells_is_an_f_distribution():
    from scipy.stats import f

    # mean of n channels over mean of N cells times n channels: F with 2 n and 2 n N degrees of freedom
    for channels, cells, alpha in ((1, 16, 5.0), (6, 40, 2.8), (192, 200, 1.25)):
        exact = f.sf(alpha, 2 * channels, 2 * channels * cells)
        assert quadratic_pfa(alpha, np.full(cells, 1 / cells), channels) == pytest.approx(exact, rel=1e-8)


def test_simulated_multipliers_agree_with_the_closed_forms_for_independent_cells():
    white = tuple(np.eye(1, 21)[0])
    for kind in ("go", "so", "os"):
        alpha = cfar_multiplier(kind, LINE_16, 10, 10, white, (1.0,), 1, 1e-3)
        # 6000 simulated training sets of 16 cells leave about 3 % on the rate, 1.5 % for three sigma on alpha
        assert alpha == pytest.approx(cfar_alpha(16, 1e-3, kind), rel=0.015)


@pytest.mark.parametrize(("kind", "maps"), [("ca", 10), ("os", 1)])
def test_false_alarms_of_independent_cells_are_exact(kind, maps, rng):
    _count_independent(kind, maps, rng)


@pytest.mark.slow
def test_false_alarms_of_ordered_statistics_are_exact_over_ten_million_cells(rng):
    _count_independent("os", 10, rng)


def _count_independent(kind, maps, rng):
    pfa, hits, cells = 1e-3, 0, 0
    alpha = cfar_alpha(16, pfa, kind)
    for _ in range(maps):
        power = rng.exponential(size=(1020, 1000))
        inner = (power > alpha * cfar_statistic(power, kind, LINE_16))[10:-10]
        hits, cells = hits + int(inner.sum()), cells + inner.size
    assert abs(hits - pfa * cells) < 3 * np.sqrt(pfa * cells)


def test_false_alarms_of_hann_bins_follow_the_exact_column(rng):
    # threshold for independent cells, CUT and training bins from Hann-windowed spectra: 2.20e-3 instead of 1e-3
    hits = cells = 0
    for _ in range(4):
        noise = rng.standard_normal((1024, 1000, 2)).view(complex)[..., 0]
        power = (
            np.abs(np.fft.fft(noise * (0.5 - 0.5 * np.cos(2 * np.pi * np.arange(1024) / 1024))[:, None], axis=0)) ** 2
        )
        inner = (power > cfar_alpha(16, 1e-3) * cfar_statistic(power, "ca", LINE_16))[10:-10]
        hits, cells = hits + int(inner.sum()), cells + inner.size
    # hits of neighbouring bins come together: 1.6 times the binomial variance
    assert abs(hits - 2.20176e-3 * cells) < 3 * np.sqrt(1.6 * 2.2e-3 * cells)


@pytest.mark.parametrize("kind", ["ca", "os"])
def test_cells_at_the_ends_of_range_keep_the_rate(kind, rng):
    pfa, hits, cells = 1e-2, 0, 0
    for _ in range(4):
        power = rng.exponential(size=(28, 4000))
        edge = np.r_[0:10, 18:28]
        found = (power > independent(power, kind, pfa))[edge]
        hits, cells = hits + int(found.sum()), cells + found.size
    # five sigma of the count, plus what the simulated multiplier of os leaves
    assert abs(hits / cells - pfa) < 5 * np.sqrt(pfa / cells) + (0.03 * pfa if kind == "os" else 0)


@pytest.mark.parametrize(("kind", "frames"), [("ca", 150), ("go", 12), ("so", 12), ("os", 8)])  # 16384 cells a frame
def test_user_gets_the_pfa_asked_for_with_the_default_windows(kind, frames, rng):
    _count_default(kind, frames, rng)


@pytest.mark.slow
def test_user_gets_the_pfa_asked_for_over_ten_million_cells(rng):
    _count_default("ca", 611, rng)


def _count_default(kind, frames, rng):
    profile, pfa, hits, cells = load_profile("awrl1432"), 1e-3, 0, 0
    for _ in range(frames):
        cube = process(noise_adc(profile, rng))
        found = cube.range_doppler > noise_threshold(cube, pfa=pfa, cfar=kind)
        hits, cells = hits + int(found.sum()), cells + found.size
    sigma = np.sqrt(1.6 / (pfa * cells))
    assert abs(hits / cells / pfa - 1) < max(0.1, 3 * sigma), f"{hits / cells:.3e} over {cells} cells"


@pytest.mark.parametrize("window", ["rect", "taylor", "blackmanharris", "chebyshev"])
def test_other_windows_keep_the_pfa(window, rng):
    profile, hits, cells = load_profile("awrl1432"), 0, 0
    for _ in range(25):
        cube = process(noise_adc(profile, rng), range_window=window, doppler_window=window)
        found = cube.range_doppler > noise_threshold(cube, pfa=1e-2)
        hits, cells = hits + int(found.sum()), cells + found.size
    # 4e5 cells, 4000 hits; Blackman-Harris bins stay alike over three bins: variance 3 times the binomial one
    assert hits / cells == pytest.approx(1e-2, rel=3 * np.sqrt(3 / (1e-2 * cells)) + 0.02)


@pytest.mark.parametrize("kind", ["ca", "go", "so", "os"])
def test_statistic_equals_the_sum_written_out(kind, rng):
    power = rng.exponential(size=(24, 20))
    shape = CfarWindow((4, 3), (1, 2))
    statistic = cfar_statistic(power, kind, shape)
    for r, v in ((0, 0), (3, 19), (12, 7), (23, 1)):
        rows, columns = np.meshgrid(np.arange(r - 5, r + 6), np.arange(v - 5, v + 6), indexing="ij")
        exists = (rows >= 0) & (rows < 24)
        ring = exists & ((np.abs(rows - r) > 1) | (np.abs(columns - v) > 2))
        before, after = exists & (rows < r - 1), exists & (rows > r + 1)
        cells = power[rows % 24, columns % 20]
        if kind == "ca":
            expected = cells[ring].mean()
        elif kind == "os":
            expected = np.sort(cells[ring])[round(0.75 * ring.sum()) - 1]
        else:
            means = [cells[half].mean() for half in (before, after) if half.any()]
            expected = max(means) if kind == "go" else min(means)
        assert statistic[r, v] == pytest.approx(expected, rel=1e-12), (r, v)


def test_a_strong_cell_does_not_disturb_the_noise_estimate_beside_it():
    # 160 dB above its surroundings: a difference of running sums would leave nothing of them
    power = np.ones((64, 64))
    power[30, 30] = 1e16
    statistic = cfar_statistic(power, "ca", CfarWindow())
    assert statistic[30, 30] == pytest.approx(1.0, abs=1e-12)
    assert statistic[60, 60] == pytest.approx(1.0, abs=1e-12)


def test_training_ring_fits_small_maps():
    shape = default_window((8, 4), ("hann", "hann"), (8, 4), (8, 4))
    assert max(2 * shape.reach[0] + 1 - 8, 2 * shape.reach[1] + 1 - 4) <= 0


def test_wrong_arguments_say_what_is_allowed():
    with pytest.raises(InputError, match="known: ca, go, os, so"):
        cfar_alpha(16, 1e-3, "cb")
    with pytest.raises(InputError, match="between 0 and 1"):
        cfar_alpha(16, 0.0)
    with pytest.raises(InputError, match="even for go and so"):
        cfar_pfa(15, 5.0, "go")
    with pytest.raises(InputError, match="does not fit"):
        cfar_statistic(np.ones((8, 8)), "ca", CfarWindow())
