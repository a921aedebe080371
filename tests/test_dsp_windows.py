"""Windows: samples, figures of merit."""

from __future__ import annotations

import numpy as np
import pytest
from dsp_tools import table_rows

from shenron_rt.dsp import WINDOWS, window, window_figures
from shenron_rt.errors import InputError

TABLE_NAMES = {"taylor_nbar4_35": "taylor", "chebyshev_80": "chebyshev"}


def test_figures_reproduce_the_reference_table(shared_reference):
    checked = 0
    for row in table_rows(shared_reference / "dsp" / "windows.csv"):
        name = TABLE_NAMES.get(row["window"], row["window"])
        if name not in WINDOWS:
            continue
        figures = window_figures(window(name, int(row["N"]), row["form"] == "periodic"))
        for key in (
            "coherent_gain",
            "enbw_bins",
            "scalloping_db",
            "peak_sidelobe_db",
            "width3db_bins",
            "width6db_bins",
        ):
            assert getattr(figures, key) == pytest.approx(float(row[key]), rel=1e-3), (row["window"], row["N"], key)
        checked += 1
    assert checked == 6 * 4  # six windows, two lengths, two forms


@pytest.mark.parametrize("name", WINDOWS)
@pytest.mark.parametrize("n", [5, 64, 255])
def test_symmetric_form_is_symmetric_and_periodic_form_is_its_beginning(name, n):
    symmetric = window(name, n + 1, periodic=False)
    assert symmetric == pytest.approx(symmetric[::-1], abs=1e-12)
    assert window(name, n, periodic=True) == pytest.approx(symmetric[:-1], abs=1e-12)


@pytest.mark.parametrize("name", ["hann", "hamming", "blackmanharris"])
def test_default_form_of_cosine_sums_has_its_zeros_on_bins(name):
    spectrum = np.abs(np.fft.fft(window(name, 64)))
    terms = {"hann": 2, "hamming": 2, "blackmanharris": 4}[name]
    assert spectrum[terms : 64 - terms + 1].max() < 1e-12 * spectrum[0]


@pytest.mark.parametrize("name", ["taylor", "chebyshev"])
def test_default_form_of_side_lobe_windows_keeps_their_side_lobes(name):
    # Taylor's first side lobes stand within 0.2 dB of the design level, Chebyshev's at it
    level = {"taylor": -35.0, "chebyshev": -80.0}[name]
    assert window_figures(window(name, 128)).peak_sidelobe_db == pytest.approx(level, abs=0.2)


def test_windows_are_shared_read_only():
    with pytest.raises(ValueError, match="read-only"):
        window("hann", 16)[0] = 1.0


def test_unknown_window_and_empty_window_say_what_is_allowed():
    with pytest.raises(InputError, match="did you mean 'hann'"):
        window("han", 16)
    with pytest.raises(InputError, match="n must be >= 1"):
        window("hann", 0)
