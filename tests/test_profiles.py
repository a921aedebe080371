"""The bundled radar profiles against the documents they cite."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shenron_rt.config.loader import read_yaml
from shenron_rt.config.profile import RadarProfile, load_profile
from shenron_rt.constants import BOLTZMANN, FOUR_PI_CUBED, SPEED_OF_LIGHT
from shenron_rt.errors import ConfigError, NotFoundError
from shenron_rt.resources import package_folder

NAMES = (
    "awrl1432", "awrl1432_137mhz", "awrl1432_staggered", "awrl1432boost", "ddm_4x4", "mmwcas", "radarbook",
    "radarbook2", "radarbook_200mhz", "ti_cascade",
)  # fmt: skip


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def _numeric_leaves(data: Any, prefix: str = "") -> list[str]:
    if isinstance(data, dict):
        return [leaf for k, v in data.items() for leaf in _numeric_leaves(v, f"{prefix}.{k}" if prefix else k)]
    if isinstance(data, list):
        return [prefix] if np.asarray(data).dtype.kind in "if" else []
    try:
        float(data)
    except (TypeError, ValueError):
        return []
    return [prefix]


def test_the_bundled_profiles_are_those_promised() -> None:
    assert set(NAMES) <= {p.stem for p in package_folder("profiles").glob("*.yaml")}


@pytest.mark.parametrize("name", NAMES)
def test_every_number_of_a_profile_cites_its_source(name: str) -> None:
    data, _ = read_yaml(package_folder("profiles") / f"{name}.yaml")
    sources = data.pop("sources")
    leaves = _numeric_leaves(data)
    assert len(leaves) >= 15
    uncited = [leaf for leaf in leaves if not any(leaf == s or leaf.startswith(f"{s}.") for s in sources)]
    assert uncited == []
    keys = {leaf.rsplit(".", n)[0] for leaf in leaves for n in (0, 1)} | {"antenna.polarization", "waveform.adc"}
    assert set(sources) <= keys, "a source that belongs to no key"


@pytest.mark.parametrize("name", NAMES)
def test_assumed_and_recalled_numbers_are_marked(name: str) -> None:
    unconfirmed = load_profile(name).unconfirmed
    # No datasheet with the RF table of any of these radars was at hand: levels are never shown as confirmed.
    assert {"receiver.tx_power_dbm", "receiver.noise_figure_db", "antenna.polarization"} <= set(unconfirmed)
    for key in ("antenna.gain_tx_dbi", "antenna.gain_rx_dbi"):
        source = load_profile(name).sources[key].lower()
        assert source.startswith(("assumption", "derived", "unconfirmed"))


@pytest.mark.parametrize("name", NAMES)
def test_half_power_beamwidth_means_minus_3_db_at_half_width(name: str) -> None:
    profile = load_profile(name)
    az, el = profile.antenna.beamwidth_az_deg, profile.antenna.beamwidth_el_deg
    assert az is not None
    assert el is not None
    gain = profile.pattern(np.radians([0.0, az / 2, 0.0]), np.radians([0.0, 0.0, el / 2]))
    np.testing.assert_allclose(gain, [1.0, 0.5, 0.5], rtol=1e-12)


# c-shenron.md section 2: (range resolution, span, v_max, velocity resolution). Its c is 3e8 m/s, 0.07 % high, and its
# wavelength that of the sweep's start: 0.2 % and the rounding of the last digit shown are allowed for.
C_SHENRON = {
    "ti_cascade": (0.5859, 150.0, 3.006, 2.00),
    "radarbook": (0.6, 153.6, 4.167, 0.0651),
    "awrl1432": (0.375, 96.0, 26.76, 0.836),
    "awrl1432_137mhz": (1.093, 279.9, 26.76, 0.418),
}


@pytest.mark.parametrize("name", C_SHENRON)
def test_derived_numbers_agree_with_c_shenron(name: str) -> None:
    profile = load_profile(name)
    derived = (
        profile.range_resolution_m,
        profile.max_range_m,
        profile.max_velocity_mps,
        profile.velocity_resolution_mps,
    )
    # 0.6 %: c (0.07 %), f_c against f0 (0.26 % and 0.52 %)
    np.testing.assert_allclose(derived, C_SHENRON[name], rtol=6e-3)
    assert derived[0] == pytest.approx(SPEED_OF_LIGHT / 2 / profile.waveform.bandwidth_hz, rel=1e-12)
    assert profile.array.multiplex == "simultaneous"


def test_awrl1432boost_runs_the_blind_spot_chirp_of_tidu_f76() -> None:
    profile = load_profile("awrl1432boost")
    w = profile.waveform
    assert profile.slope_hz_per_s == pytest.approx(6.7e12, rel=1e-9)
    assert w.sampled_time_s == pytest.approx(20.48e-6, rel=1e-9)
    assert w.adc == "real"
    # ramp 0 -> ramp 1: 23.4 us + idle 6.9 us; ramp 1 -> next loop: 23.4 us + idle 12.1 us
    starts = profile.raw_chirp_start_s
    np.testing.assert_allclose(np.diff(starts.ravel())[:3], [30.3e-6, 35.5e-6, 30.3e-6], rtol=1e-9)
    assert profile.loop_period_s == pytest.approx(65.8e-6, rel=1e-9)
    # validation.md 5.1: dR = 1.09 m, real-sampling limit 140 m
    assert profile.range_resolution_m == pytest.approx(1.09, abs=0.005)
    assert profile.max_range_m == pytest.approx(140, abs=0.5)


def test_awrl1432boost_has_the_virtual_positions_of_the_board(shared_reference: Path) -> None:
    profile = load_profile("awrl1432boost")
    rows = _rows(shared_reference / "sensors" / "array_awrl1432boost.csv")
    units = profile.positions_m / profile.half_wavelength_m
    for row in rows:
        index = int(row["virtual"])
        assert index == int(row["tx"]) * profile.n_rx + int(row["rx"])
        # column c stands at y = -c, row r at z = +r
        np.testing.assert_allclose(units[index], [0, -int(row["col_az"]), int(row["row_el"])], atol=1e-9)
    assert len(rows) == profile.n_virtual


def test_radarbook2_has_the_virtual_positions_of_the_instrument(shared_reference: Path) -> None:
    profile = load_profile("radarbook2")
    rows = _rows(shared_reference / "sensors" / "array_radarbook2.csv")
    along = np.array([float(row["x_mm"]) for row in rows])
    # the table is rounded to 1 um
    np.testing.assert_allclose(-profile.positions_m[:, 1] * 1e3, along, atol=1e-3)
    assert len(np.unique(np.round(along, 1))) == 15
    assert profile.waveform.sampled_time_s == pytest.approx(256e-6, rel=1e-9)


def test_mmwcas_has_the_antennas_of_the_board_and_86_azimuth_columns(shared_reference: Path) -> None:
    profile = load_profile("mmwcas")
    rows = _rows(shared_reference / "sensors" / "array_mmwcas_physical.csv")
    for kind, placed in (("tx", profile.tx_m), ("rx", profile.rx_m)):
        wanted = np.array([[0, -float(r["az"]), float(r["el"])] for r in rows if r["kind"] == kind])
        half_wavelength = SPEED_OF_LIGHT / 76.8e9 / 2
        np.testing.assert_allclose(placed / half_wavelength, wanted, atol=1e-9)
    units = np.round(profile.positions_m / profile.half_wavelength_m, 6)
    level = units[units[:, 2] == 0]
    assert len(level) == 9 * 16
    # TI TIDUEN5A: 9 azimuth transmitters x 16 receivers fill 86 columns without a gap
    assert sorted(set(-level[:, 1])) == list(range(86))


LINKS = {"awrl1432boost": "awrl1432boost", "mmwcas_awr2243x4": "mmwcas", "radarbook2_24ghz": "radarbook2"}


@pytest.mark.parametrize("sensor", LINKS)
def test_link_budget_of_the_profiles_gives_the_tabulated_snr(sensor: str, shared_reference: Path) -> None:
    profile = load_profile(LINKS[sensor])
    rows = [r for r in _rows(shared_reference / "sensors" / "link_budget.csv") if r["sensor"] == sensor]
    assert len(rows) == 2
    for row in rows:
        sigma, distance = 10 ** (float(row["rcs_dbsm"]) / 10), float(row["range_m"])
        antenna = profile.antenna
        gains = 10 ** ((antenna.gain_tx_dbi + antenna.gain_rx_dbi - antenna.radome_loss_db) / 10)
        power = profile.tx_power_w * gains * profile.wavelength_m**2 * sigma / (FOUR_PI_CUBED * distance**4)
        # 0.1 dB: the table takes lambda at 77.0 GHz sharp, the profile at the middle of its sweep (at most 0.02 dB)
        assert 10 * np.log10(power) + 30 == pytest.approx(float(row["pr_dbm"]), abs=0.1)
        # N samples of noise k T0 F f_s integrate to the noise of one chirp, k T0 F / t_sample
        one = 10 * np.log10(power * profile.waveform.samples / profile.noise_power_w)
        assert one == pytest.approx(float(row["snr_one_chirp_db"]), abs=0.1)
        # the table counts one transmitter a chirp; BPM, with all of them on, has 10 log n_tx more
        frame = one + 10 * np.log10(profile.waveform.chirps)
        assert frame == pytest.approx(float(row["snr_frame_one_channel_db"]), abs=0.1)
        channels = len(np.unique(np.round(profile.positions_m / profile.half_wavelength_m, 1), axis=0))
        if sensor.startswith("mmwcas"):
            channels = profile.n_virtual  # that row adds all 192, the others the different positions
        assert frame + 10 * np.log10(channels) == pytest.approx(float(row["snr_frame_all_channels_db"]), abs=0.1)


def test_noise_power_is_k_t0_f_fs() -> None:
    profile = load_profile("awrl1432")
    assert profile.noise_power_w == pytest.approx(BOLTZMANN * 290 * 10**1.4 * 12.5e6, rel=1e-12)
    assert profile.derived()["noise_power_dbm"] == pytest.approx(-174 + 14 + 10 * np.log10(12.5e6), abs=0.03)


def test_sensor_facts_read_in_documents_stand_in_the_profiles(shared_reference: Path) -> None:
    quoted = {
        (r["sensor"], r["item"]): r["value"]
        for r in _rows(shared_reference / "sensors" / "sensor_specs.csv")
        if r["status"] == "quoted"
    }
    board, cascade, book = (load_profile(n) for n in ("awrl1432boost", "mmwcas", "radarbook2"))
    assert quoted["AWRL1432BOOST", "transmitters / receivers"] == "2 TX; 3 RX; 6 virtual"
    assert (board.n_tx, board.n_rx, board.n_virtual) == (2, 3, 6)
    low, high = (float(v) * 1e9 for v in quoted["AWRL1432BOOST", "band"].split("-"))
    assert low <= board.waveform.carrier_hz
    assert board.waveform.carrier_hz + board.waveform.bandwidth_hz <= high
    assert quoted["MMWCAS-RF-EVM", "channels"].startswith("12 TX 16 RX")
    assert (cascade.n_tx, cascade.n_rx) == (12, 16)
    assert cascade.max_range_m == pytest.approx(150, abs=0.5)
    assert "1024 samples" in quoted["Radarbook2 24 GHz", "band / timing"]
    assert (book.n_tx, book.n_rx, book.waveform.samples) == (2, 8, 1024)
    assert (book.waveform.carrier_hz, book.waveform.carrier_hz + book.waveform.bandwidth_hz) == (24.0e9, 24.25e9)


def test_an_override_replaces_one_number_and_moves_what_derives_from_it() -> None:
    profile = load_profile("awrl1432", {"waveform.bandwidth_hz": "200e6"})
    assert profile.range_resolution_m == pytest.approx(2 * load_profile("awrl1432").range_resolution_m, rel=1e-12)


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"waveform.bandwith_hz": 1e6}, "did you mean 'bandwidth_hz'"),
        ({"waveform.chirp_period_s": 1e-6}, "shorter than"),
        ({"array.line": None}, "exactly one of"),
        ({"receiver.noise_figure_db": -1}, "receiver.noise_figure_db"),
        ({"antenna.beamwidth_az_deg": None}, "beamwidth_az_deg"),
    ],
)
def test_a_profile_that_cannot_be_is_refused_by_key(overrides: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError, match=r"awrl1432\.yaml") as error:
        load_profile("awrl1432", overrides)
    assert words in str(error.value)


def test_an_unknown_profile_lists_those_that_exist() -> None:
    with pytest.raises(NotFoundError, match="did you mean 'radarbook'"):
        load_profile("radarbok")


def test_profiles_are_frozen_and_round_trip_through_json() -> None:
    for name in NAMES:
        profile = load_profile(name)
        assert RadarProfile.model_validate_json(profile.model_dump_json()) == profile
