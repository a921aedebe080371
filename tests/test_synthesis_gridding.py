"""The type-3 transform in its three steps against the sum written out."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shenron_rt.synthesis.gridding import SPACING, Kernel, series

# some 150 and 30 radians: hundreds of cells one way, tens the other
HALF = np.array([150.0, 30.0])
DOUBLE = [10.0 ** (-d / 2) for d in range(2, 21)]
# 180 rad in single precision round to 5e-6
SINGLE = [x for x in DOUBLE if x > 2e-5]


def error_of(kernel: Kernel, rng: np.random.Generator) -> float:
    """RMS error over targets of a sum over random points, relative to the root sum of the squared strengths."""
    points = rng.uniform(-1, 1, (2, 400)) * HALF[:, None]
    strength = rng.normal(size=400) + 1j * rng.normal(size=400)
    s, t = rng.uniform(-1, 1, (2, 1000))
    s[:4], t[:4] = (-1, -1, 1, 1), (-1, 1, -1, 1)
    exact = np.exp(1j * (np.outer(s, points[0]) + np.outer(t, points[1]))) @ strength
    sizes = [2 * math.ceil(h / SPACING + kernel.width) for h in HALF]
    x, y = (2 * np.pi / (SPACING * n) * p for n, p in zip(sizes, points, strict=True))
    shape = sizes[0], sizes[1]
    at_targets, grid = series(kernel.tolerance, kernel.single, shape, s, t), np.empty(shape, dtype=kernel.dtype)
    kernel.spread(x, y, strength, grid)
    found = at_targets(grid) * kernel.correction(SPACING * s) * kernel.correction(SPACING * t)
    return float(np.sqrt(np.mean(np.abs(found - exact) ** 2) / np.sum(np.abs(strength) ** 2)))


@pytest.mark.parametrize(("asked", "single"), [(x, False) for x in DOUBLE] + [(x, True) for x in SINGLE])
def test_the_sum_reaches_the_error_asked_for(asked, single, rng):
    assert error_of(Kernel.reaching(asked, single), rng) <= asked


@pytest.mark.parametrize("asked", [1e-3, 1e-6, 1e-9])
def test_a_narrower_kernel_would_not_do(asked, rng):
    # a cell of width is a decade: the error of the kernel a decade looser is within that decade of the one asked for
    assert error_of(Kernel.reaching(11 * asked, False), rng) > asked


@pytest.mark.parametrize("asked", [1e-2, 1e-5, 1e-8])
def test_the_error_a_kernel_states_is_the_one_it_makes(asked, rng):
    # 2000 values of one draw scatter by some per cent; the interpolation of the series adds at most its share of 0.3
    kernel = Kernel.reaching(asked, False)
    assert error_of(kernel, rng) == pytest.approx(kernel.error, rel=0.3)


def test_a_decade_of_error_is_a_cell_of_width():
    widths = [Kernel.reaching(10.0**-d, False).width for d in range(1, 11)]
    assert np.array_equal(np.diff(widths), np.ones(9))
