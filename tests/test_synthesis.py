"""The ADC cube: exact sum, fast sum, multiplexing."""

from __future__ import annotations

import csv
import subprocess
import sys

import numpy as np
import pytest
from synthesis_cases import LINE, C, draw_returns, make_profile, make_returns, relative_error, tones

from shenron_rt.errors import InputError
from shenron_rt.synthesis import blocks, synthesize
from shenron_rt.synthesis.nufft import nufft_field
from shenron_rt.synthesis.signal import Points, hadamard, transmitted

TDM = {"multiplex": "tdm", "tx": [[0, 0, 0], [0, -3, 1]], "rx": LINE}
BPM = TDM | {"multiplex": "bpm"}
# 12 x 16 elements, 0.17 m and more across: at 0.5 m the wavefront over the array bends by cycles
CASCADE_TX = [[0, -0.0155 * i, 0.002 * (i % 3)] for i in range(12)]
CASCADE_RX = [[0, -0.00195 * i - 0.02 * (i // 4), 0] for i in range(16)]
PROFILES = {
    "awrl1432": make_profile(),
    "awrl1432_137mhz": make_profile(bandwidth_hz=137.2e6, chirps=128, array={"line": 2}),
    "tdm": make_profile(array=TDM, chirps=32),
    "bpm_unequal": make_profile(array=BPM, chirps=16, chirp_period_s=(40e-6, 55e-6), adc_start_s=3e-6),
    "radarbook": make_profile(
        carrier_hz=24e9, bandwidth_hz=250e6, samples=64, sample_rate_hz=0.25e6, chirps=128, chirp_period_s=0.75e-3,
        array={"rx": [[0, 0, 0], [0, -7, 0]], "tx": [[0, 0, 0]]},
    ),
    "cascade_86": make_profile(
        array={"line": 86}, chirps=3, bandwidth_hz=1e9, samples=128, sample_rate_hz=8e6, chirp_period_s=60e-6
    ),
    "mmwcas": make_profile(
        array={"multiplex": "tdm", "tx_m": CASCADE_TX[::4], "rx_m": CASCADE_RX[::3]},
        chirps=8, samples=64, bandwidth_hz=300e6, sample_rate_hz=8e6, chirp_period_s=160e-6,
    ),
}  # fmt: skip


@pytest.fixture
def only_nufft(monkeypatch):
    """Forbid the exact sum that few or near echoes would otherwise get, so that the NUFFT itself is measured."""
    monkeypatch.setattr(blocks, "COST_EXACT", np.inf)


@pytest.mark.parametrize("method", ["direct", "nufft"])
@pytest.mark.parametrize("multiplex", ["simultaneous", "tdm", "bpm"])
def test_cube_is_the_formula_in_every_mode(method, multiplex, rng):
    profile = make_profile(
        array=TDM | {"multiplex": multiplex}, chirps=6, samples=32, chirp_period_s=(30e-6, 41e-6), adc_start_s=2e-6
    )
    returns = draw_returns(rng, 5, profile)
    starts = profile.raw_chirp_start_s
    if multiplex == "bpm":
        # each chirp of a pair carries both transmitters with the signs of (1, 1), (1, -1)
        sent = [tones(profile, returns, i, starts.ravel()).reshape(6, 2, 3, 32) for i in range(2)]
        plus, minus = (sent[0] + sent[1])[:, 0], (sent[0] - sent[1])[:, 1]
        exact = np.concatenate([(plus + minus) / 2, (plus - minus) / 2], axis=1)
    else:
        columns = (0, 1) if multiplex == "tdm" else (0, 0)
        exact = np.concatenate([tones(profile, returns, i, starts[:, columns[i]]) for i in range(2)], axis=1)
    cube = synthesize(returns, profile, noise=None, method=method, accuracy=1e-9)
    # 1e5 cycles of carrier phase in double precision: 1e-10 rad
    assert relative_error(cube.data, exact) < (1e-9 if method == "nufft" else 2e-10)


@pytest.mark.parametrize("accuracy", [1e-4, 1e-6])
@pytest.mark.parametrize("name", PROFILES)
def test_nufft_reaches_the_accuracy_for_every_profile(name, accuracy, only_nufft):
    profile = PROFILES[name]
    returns = draw_returns(np.random.default_rng(hash_of(name)), 40, profile)
    exact = synthesize(returns, profile, noise=None, method="direct").data
    found = synthesize(returns, profile, noise=None, accuracy=accuracy).data
    assert relative_error(found, exact) <= accuracy
    # and for every element pair by itself
    worst = max(relative_error(found[:, v], exact[:, v]) for v in range(profile.n_virtual))
    assert worst <= 2 * accuracy


def test_wide_grids_are_not_summed_in_single_precision(only_nufft):
    # a thousand Doppler cells: rounding of a coordinate to single precision alone would be 1e-4
    profile = PROFILES["radarbook"]
    returns = draw_returns(np.random.default_rng(hash_of("radarbook") + 2), 60, profile)
    exact = synthesize(returns, profile, noise=None, method="direct").data
    assert relative_error(synthesize(returns, profile, noise=None, accuracy=1e-4).data, exact) <= 1e-4


def hash_of(name: str) -> int:
    return sum(name.encode())


def test_nufft_reaches_1e_minus_9(only_nufft, rng):
    profile = make_profile(chirps=24, samples=64, array={"line": 2})
    returns = draw_returns(rng, 60, profile)
    exact = synthesize(returns, profile, noise=None, method="direct").data
    assert relative_error(synthesize(returns, profile, noise=None, accuracy=1e-9).data, exact) <= 1e-9


def test_blocks_of_fewer_samples_than_terms_are_summed(only_nufft):
    # slow chirps cut the frame into blocks of one, where the form has more monomials than samples to fit them at
    profile = PROFILES["radarbook"]
    returns = draw_returns(np.random.default_rng(hash_of("radarbook")), 40, profile)
    exact = synthesize(returns, profile, noise=None, method="direct").data
    assert relative_error(synthesize(returns, profile, noise=None, accuracy=1e-8).data, exact) <= 1e-8


def test_nufft_holds_for_many_echoes_in_shared_groups(only_nufft, rng):
    # more echoes than are sampled for the low-rank form
    profile = make_profile(chirps=16, samples=32, array={"line": 2})
    returns = draw_returns(rng, 3000, profile)
    exact = synthesize(returns, profile, noise=None, method="direct").data
    for accuracy in (1e-3, 1e-6):
        found = synthesize(returns, profile, noise=None, accuracy=accuracy).data
        assert relative_error(found, exact) <= accuracy


@pytest.mark.parametrize("accuracy", [1e-4, 1e-6])
def test_many_echoes_at_rest_have_no_curvature_to_be_scaled_by(accuracy, only_nufft, rng):
    profile = make_profile(chirps=4)
    position = rng.uniform([5, -20, -1], [80, 20, 2], (400, 3))
    returns = make_returns(position, amplitude=rng.normal(size=400) + 1j * rng.normal(size=400))
    exact = synthesize(returns, profile, noise=None, method="direct").data
    assert relative_error(synthesize(returns, profile, noise=None, accuracy=accuracy).data, exact) <= accuracy


def test_accuracy_holds_relative_to_a_cube_that_cancels(only_nufft, rng):
    profile = make_profile(chirps=16, samples=64, array={"line": 2})
    one = draw_returns(rng, 60, profile, near=False)
    # every echo beside one of opposite sign a fiftieth of a wavelength behind: |1 - e^{j 2 pi 2/50}| = 0.25
    shifted = one.position * (1 + profile.wavelength_m / 50 / np.linalg.norm(one.position, axis=1, keepdims=True))
    both = make_returns(
        np.concatenate([one.position, shifted]),
        np.concatenate([one.velocity, one.velocity]),
        np.concatenate([one.amplitude, -one.amplitude]),
    )
    exact = synthesize(both, profile, noise=None, method="direct").data
    assert np.sqrt(np.mean(np.abs(exact) ** 2)) < 0.3 * np.sqrt(np.sum(np.abs(both.amplitude) ** 2))
    assert relative_error(synthesize(both, profile, noise=None, accuracy=1e-6).data, exact) <= 1e-6


def test_the_exact_sum_serves_few_and_near_echoes():
    # a path through the array itself has no smooth delay
    profile = make_profile(chirps=8, samples=16, array={"line": 2})
    returns = make_returns([[0.001, 0.0, 0.0], [20.0, 3.0, 0.0]], [[30.0, 0, 0], [0, 9.0, 0]])
    exact = synthesize(returns, profile, noise=None, method="direct").data
    assert relative_error(synthesize(returns, profile, noise=None, accuracy=1e-6).data, exact) <= 1e-6


def test_bytes_do_not_depend_on_the_number_of_threads(rng, only_nufft):
    profile = make_profile(chirps=16, samples=64, array={"line": 3})
    points = Points.from_returns(draw_returns(rng, 5000, profile))
    cubes = [transmitted(profile, points, nufft_field(1e-6, workers=n)) for n in (1, 2, 3)]
    assert cubes[0].tobytes() == cubes[1].tobytes() == cubes[2].tobytes()


def test_bytes_do_not_depend_on_the_threads_of_the_process():
    script = (
        "import hashlib, numpy as np, sys; sys.path.insert(0, sys.argv[1]); sys.path.insert(0, sys.argv[2])\n"
        "from synthesis_cases import draw_returns, make_profile\n"
        "from shenron_rt.synthesis import synthesize\n"
        "p = make_profile(chirps=32, array={'line': 3})\n"
        "r = draw_returns(np.random.default_rng(5), 20000, p, near=False)\n"
        "for a in (1e-4, 1e-6): print(hashlib.sha256(synthesize(r, p, accuracy=a, seed=3).data.tobytes()).hexdigest())"
    )
    root = __file__.rpartition("/tests/")[0]
    outputs = []
    for threads in ("1", "2"):
        env = {"OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads, "PATH": "/usr/bin:/bin"}
        run = subprocess.run(
            [sys.executable, "-c", script, root, f"{root}/tests"], env=env, capture_output=True, text=True, check=True
        )
        outputs.append(run.stdout)
    assert outputs[0] == outputs[1]
    assert len(set(outputs[0].split())) == 2


def test_importing_the_package_does_not_import_finufft():
    script = "import sys; import shenron_rt.synthesis; sys.exit('finufft' in sys.modules)"
    subprocess.run([sys.executable, "-c", script], cwd=__file__.rpartition("/tests/")[0], check=True)


# ---- reference table
def reference_profiles(folder):
    """Rows of the table by profile name, each with the waveform its columns imply."""

    def read(name):
        with (folder / "dsp" / name).open() as file:
            return list(csv.DictReader(line for line in file if not line.startswith("#")))

    limits = {row["profile"]: row for row in read("crlb.csv")}
    groups: dict[str, list[dict[str, float]]] = {}
    for row in read("fmcw_point_targets.csv"):
        numbers = {k: float(v) for k, v in row.items() if k != "profile"}
        groups.setdefault(row["profile"], []).append(numbers)
    for name, rows in groups.items():
        still, moving = rows[0], rows[-1]
        slope = still["beat_khz"] * 1e3 * C / (2 * still["range_m"])
        window = still["range_bin"] / (still["beat_khz"] * 1e3)
        bandwidth = C / (2 * float(limits[name]["range_res_m"]))
        centre = moving["doppler_hz"] * C / (2 * moving["v_mps"])
        # the table's mid sweep is the mean sample time, half a sample before the middle of the window
        carrier = centre - slope * window * (1 - 1 / 256) / 2
        wavelength = C / (carrier + slope * window / 2)
        loop = wavelength / (4 * float(limits[name]["vmax_mps"]))
        chirps = round(wavelength / (2 * float(limits[name]["vel_res_mps"]) * loop))
        folded = [(r["range_bin"], r["range_bin_folded"]) for r in rows if r["range_bin"] != r["range_bin_folded"]]
        samples = 256
        assert all(abs(wrapped(a - b, samples)) < 1e-2 for a, b in folded)
        assert bandwidth == pytest.approx(slope * window, rel=1e-5)
        n_tx = next(
            n for n in range(1, 17)
            if all(abs((r["doppler_hz"] * loop / n * 360 - r["tdm_step_deg"] + 180) % 360 - 180) < 0.05 for r in rows)
        )  # fmt: skip
        waveform = {
            "carrier_hz": carrier, "bandwidth_hz": slope * window, "samples": samples,
            "sample_rate_hz": samples / window, "chirps": chirps, "chirp_period_s": loop / n_tx,
        }  # fmt: skip
        yield name, rows, waveform, n_tx


def wrapped(x, period):
    return (x + period / 2) % period - period / 2


def test_point_targets_fall_on_the_bins_of_the_reference_table(shared_reference):
    seen = 0
    for name, rows, waveform, n_tx in reference_profiles(shared_reference):
        array = {"multiplex": "tdm", "tx": [[0, 0, 0]] * n_tx, "rx": [[0, 0, 0], [0, -1, 0]]}
        # two loops are enough, and the bins are those of the full frame
        profile = make_profile(array=array, **(waveform | {"chirps": 2}))
        n, half = waveform["samples"], waveform["samples"] // 2
        for row in rows:
            azimuth = np.radians(row["az_deg"])
            u = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
            # the table's range holds at the start of the chirp, ours in mid-frame
            r = row["range_m"] + row["v_mps"] * profile.frame_mid_s
            data = synthesize(make_returns(r * u, row["v_mps"] * u), profile, noise=None, method="direct").data
            middle = data[:, :, half - 1 : half + 1]
            beat = np.angle(middle[0, 0, 1] / middle[0, 0, 0]) / (2 * np.pi) * n
            # a thousandth of a bin, and the six digits of the column that the slope is read from
            digits = 2e-6 * row["range_bin"]
            assert wrapped(beat - row["range_bin"], n) == pytest.approx(0, abs=1e-3 + digits), name
            # the table's Doppler is 2 v f_c / c; -k tau^2 / 2 lowers the frequency by k tau
            lower = profile.slope_hz_per_s * 2 * row["range_m"] / C / profile.center_hz
            # carrier and loop period come from columns of six digits: 3e-6 each of the unfolded Doppler bins
            unfolded = row["doppler_hz"] * profile.loop_period_s * waveform["chirps"]
            step = np.angle(middle[1, 0] / middle[0, 0]).mean() / (2 * np.pi) * waveform["chirps"]
            off = wrapped(step + lower * unfolded - row["doppler_bin"], waveform["chirps"])
            assert off == pytest.approx(0, abs=1e-3 + 6e-6 * abs(unfolded)), name
            if n_tx > 1:
                slot = np.degrees(np.angle(middle[0, 2] / middle[0, 0]).mean())
                slots = 360 * row["doppler_hz"] * profile.loop_period_s / n_tx
                assert wrapped(slot + lower * slots - row["tdm_step_deg"], 360) == pytest.approx(0, abs=0.01), name
            # the table has a plane wave; (lambda / 2)^2 / (2 R) of curvature is 45 lambda / R degrees at boresight
            between = np.degrees(np.angle(middle[0, 1] / middle[0, 0]).mean())
            curved = 45 * profile.wavelength_m / row["range_m"]
            expected = row["array_step_deg"] * (1 - lower)
            assert wrapped(between - expected, 360) == pytest.approx(0, abs=1.1 * curved + 0.015), name
            seen += 1
    assert seen == 20


# ---- multiplexing
def test_bpm_of_a_static_target_equals_tdm(rng):
    returns = make_returns([[12.0, 3.0, 0.5], [40.0, -9.0, 1.0]], amplitude=[1 + 1j, 0.5])
    tdm, bpm = (
        synthesize(returns, make_profile(array=array, chirps=4, samples=64), noise=None, method="direct").data
        for array in (TDM, BPM)
    )
    # rounding of 1e4 cycles of carrier phase
    assert relative_error(bpm, tdm) < 1e-10


def test_hadamard_rows_are_orthogonal():
    for n in (1, 2, 4, 8, 16):
        assert np.array_equal(hadamard(n) @ hadamard(n).T, n * np.eye(n))


def test_bpm_refuses_three_transmitters():
    array = {"multiplex": "bpm", "tx": [[0, 0, 0]] * 3, "rx": LINE}
    with pytest.raises(InputError, match="power of two"):
        synthesize(make_returns([10.0, 0, 0]), make_profile(array=array), noise=None)


def test_static_target_power_is_amplitude_squared():
    cube = synthesize(make_returns([25.0, 2.0, 0.0], amplitude=3e-6j), make_profile(chirps=4), noise=None)
    # a single tone of constant modulus; single precision is not used at the default accuracy
    assert np.abs(cube.data) == pytest.approx(3e-6, rel=1e-5)


def test_receding_target_lies_on_positive_bins_and_left_on_rising_columns():
    profile = make_profile()
    u = np.array([np.cos(0.3), np.sin(0.3), 0.0])
    data = synthesize(make_returns(30 * u, 5.0 * u), profile, noise=None).data
    half = profile.waveform.samples // 2
    assert np.angle(data[32, 0, half + 1] / data[32, 0, half]) > 0
    assert np.angle(data[33, 0, half] / data[32, 0, half]) > 0
    step = np.angle(data[32, 1, half] / data[32, 0, half])
    assert step == pytest.approx(np.pi * np.sin(0.3), abs=5e-3)


# ---- input
def test_no_echoes_give_noise_alone_or_zero():
    profile = make_profile(chirps=4)
    nothing = make_returns(np.zeros((0, 3)))
    assert not synthesize(nothing, profile, noise=None).data.any()
    assert synthesize(nothing, profile).data.any()
    assert synthesize(nothing, profile).data.shape == (4, 6, 256)


@pytest.mark.parametrize("name", ["amplitude", "position", "velocity"])
def test_nan_is_refused_with_its_row(name):
    returns = make_returns([[10.0, 0, 0], [20.0, 0, 0]])
    getattr(returns, name)[1] = np.nan
    with pytest.raises(InputError, match=rf"{name}.*row 1"):
        synthesize(returns, make_profile(chirps=2))


@pytest.mark.parametrize(
    ("argument", "word"),
    [
        ({"noise": "pink"}, "thermal"),
        ({"method": "fft"}, "nufft"),
        ({"accuracy": 0.5}, "0.1"),
        ({"accuracy": 0}, "1e-09"),
    ],
)
def test_unknown_options_are_refused_with_those_allowed(argument, word):
    with pytest.raises(InputError, match=word):
        synthesize(make_returns([10.0, 0, 0]), make_profile(chirps=2), **argument)
