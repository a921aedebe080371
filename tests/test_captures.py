"""Plain .npy arrays and DCA1000 captures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shenron_rt.config.profile import RadarProfile, load_profile
from shenron_rt.errors import InputError, NotFoundError
from shenron_rt.io.captures import count_scale, noise_floor_scale, read_dca1000, read_npy, write_dca1000
from shenron_rt.synthesis.adc import AdcCube
from shenron_rt.synthesis.receiver import cube_noise_power


def _small(name: str = "awrl1432", **extra: Any) -> RadarProfile:
    return load_profile(name, {"waveform.samples": 8, "waveform.chirps": 4, **extra})


def _xwr18(adc: str = "complex", multiplex: str = "tdm") -> RadarProfile:
    """Two transmitters and two receivers, four samples, one loop: small enough to write its bytes by hand."""
    return load_profile(
        "awrl1432",
        {
            "waveform.samples": 4, "waveform.chirps": 1, "waveform.adc": adc,
            "array": {"multiplex": multiplex, "tx": [[0, 0, 0], [0, -2, 0]], "rx": [[0, 0, 0], [0, -1, 0]]},
            "receiver.adc_bits": 16, "receiver.full_scale_dbm": 30,
        },
    )  # fmt: skip


def _cubes(profile: RadarProfile, rng: np.random.Generator, frames: int = 2) -> list[AdcCube]:
    """Return cubes whose raw chirps are whole counts, so that nothing is lost in int16."""
    w = profile.waveform
    shape = (w.chirps, profile.n_virtual, w.samples)
    counts = rng.integers(-3000, 3000, (frames, 2, *shape)).astype(np.float64)
    data = counts[:, 0] + (1j * counts[:, 1] if w.adc == "complex" else 0)
    return [AdcCube(data=d.astype(np.complex128), profile=profile, frame=i) for i, d in enumerate(data)]


def test_two_lane_complex_words_are_i_i_q_q_receiver_by_receiver(tmp_path: Path) -> None:
    # SWRA581B, xWR16xx: chirp, then receiver, then groups I(n) I(n+1) Q(n) Q(n+1); value = chirp rx sample as digits
    words = []
    for chirp in (1, 2):
        for rx in (1, 2):
            for n in (0, 2):
                base = chirp * 100 + rx * 10 + n
                words += [base, base + 1, -base, -base - 1]
    file = tmp_path / "adc_data.bin"
    file.write_bytes(np.array(words, dtype="<i2").tobytes())
    (cube,) = read_dca1000(file, _xwr18(), scale=1.0)
    assert cube.data.shape == (1, 4, 4)
    for tx in (0, 1):  # the chirps of a TDM loop are its transmitters in turn
        for rx in (0, 1):
            value = (tx + 1) * 100 + (rx + 1) * 10 + np.arange(4)
            np.testing.assert_array_equal(cube.data[0, tx * 2 + rx], value * (1 - 1j))


def test_a_capture_with_q_first_is_read_with_its_words_swapped(tmp_path: Path) -> None:
    file = tmp_path / "adc_data.bin"
    # one sample pair a receiver and chirp: Q0 Q1 I0 I1
    file.write_bytes(np.array([3, 4, 1, 2] * 8, dtype="<i2").tobytes())
    (cube,) = read_dca1000(file, _xwr18(), scale=1.0, swap_iq=True)
    np.testing.assert_array_equal(cube.data[0, 0], [1 + 3j, 2 + 4j, 1 + 3j, 2 + 4j])


def test_two_lane_real_words_are_the_samples_in_order(tmp_path: Path) -> None:
    file = tmp_path / "adc_data.bin"
    file.write_bytes(np.arange(16, dtype="<i2").tobytes())
    (cube,) = read_dca1000(file, _xwr18("real"), scale=1.0)
    np.testing.assert_array_equal(cube.data[0], np.arange(16).reshape(4, 4))


def test_four_lane_words_have_the_receivers_side_by_side(tmp_path: Path) -> None:
    # SWRA581B, xWR14xx: sample, then I of every receiver, then Q of every receiver
    words = [
        chirp * 100 + rx * 10 + n if part == 0 else -(chirp * 100 + rx * 10 + n)
        for chirp in (1, 2) for n in range(4) for part in (0, 1) for rx in (1, 2)
    ]  # fmt: skip
    file = tmp_path / "adc_data.bin"
    file.write_bytes(np.array(words, dtype="<i2").tobytes())
    (cube,) = read_dca1000(file, _xwr18(), layout="four_lane", scale=1.0)
    for tx in (0, 1):
        for rx in (0, 1):
            value = (tx + 1) * 100 + (rx + 1) * 10 + np.arange(4)
            np.testing.assert_array_equal(cube.data[0, tx * 2 + rx], value * (1 - 1j))


@pytest.mark.parametrize("layout", ["two_lane", "four_lane"])
@pytest.mark.parametrize("adc", ["complex", "real"])
@pytest.mark.parametrize("multiplex", ["tdm", "bpm", "simultaneous"])
def test_a_capture_round_trips_exactly(
    layout: Any, adc: str, multiplex: str, tmp_path: Path, rng: np.random.Generator
) -> None:
    profile = _xwr18(adc, multiplex)
    cubes = _cubes(profile, rng, frames=3)
    file = write_dca1000(tmp_path / "a.bin", cubes, layout=layout, scale=1.0)
    per_frame = profile.n_virtual * 4 * (2 if adc == "complex" else 1) * 2
    assert file.stat().st_size == 3 * per_frame
    back = read_dca1000(file, profile, layout=layout, scale=1.0)
    assert [c.frame for c in back] == [0, 1, 2]
    for a, b in zip(cubes, back, strict=True):
        np.testing.assert_array_equal(a.data, b.data)


@pytest.mark.parametrize("name", ["awrl1432boost", "radarbook2", "mmwcas"])
def test_bundled_boards_round_trip_to_half_a_count(name: str, tmp_path: Path, rng: np.random.Generator) -> None:
    profile = _small(name, **{"receiver.adc_bits": 16, "receiver.full_scale_dbm": -30})
    shape = (4, profile.n_virtual, 8)
    step = count_scale(profile)
    data = 500 * step * rng.standard_normal(shape).astype(np.complex128)
    if profile.waveform.adc == "complex":
        data = data + 500j * step * rng.standard_normal(shape)
    cube = AdcCube(data=data, profile=profile)
    (back,) = read_dca1000(write_dca1000(tmp_path / "a.bin", [cube]), profile)
    # half a count on I and on Q; a BPM block averages n_tx roundings and is no worse
    assert np.max(np.abs((back.data - cube.data).real)) <= 0.5 * step * (1 + 1e-9)
    assert np.max(np.abs((back.data - cube.data).imag)) <= 0.5 * step * (1 + 1e-9)


def test_samples_beyond_full_scale_are_clipped_not_wrapped(tmp_path: Path) -> None:
    profile = _xwr18("real", "simultaneous")
    data = np.full((1, 4, 4), 10.0, dtype=np.complex128)
    (back,) = read_dca1000(write_dca1000(tmp_path / "a.bin", [AdcCube(data=data, profile=profile)]), profile)
    # 30 dBm is 1 W: the real tone's peak is sqrt(2) sqrt(W), and the largest code one step below it
    np.testing.assert_allclose(back.data.real, np.sqrt(2) * (2**15 - 1) / 2**15, rtol=1e-12)


def test_noise_floor_scale_makes_the_floor_nominal_with_a_strong_target_in_it(rng: np.random.Generator) -> None:
    for name in ("awrl1432", "awrl1432boost"):
        profile = load_profile(name)
        w = profile.waveform
        shape = (w.chirps, profile.n_virtual, w.samples)
        gain = 1e7
        noise = np.sqrt(cube_noise_power(profile) / 2) * (rng.standard_normal(shape) + 1j * rng.standard_normal(shape))
        tone = 300 * np.sqrt(cube_noise_power(profile)) * np.exp(2j * np.pi * 0.1317 * np.arange(w.samples))
        data = noise + tone
        if w.adc == "real":
            data = np.sqrt(2) * data.real + 0j
        # the tone fills one Doppler column of 64; 64 x 6 x 256 exponential cells put the median at 0.4 %
        assert noise_floor_scale(gain * data, profile) * gain == pytest.approx(1, abs=0.02)


def test_scale_of_silence_is_one() -> None:
    profile = _small()
    assert noise_floor_scale(np.zeros((4, 6, 8), dtype=complex), profile) == 1.0


def test_npy_of_one_or_several_frames(tmp_path: Path, rng: np.random.Generator) -> None:
    profile = _small()
    data = rng.standard_normal((3, 4, 6, 8)) + 1j * rng.standard_normal((3, 4, 6, 8))
    np.save(tmp_path / "one.npy", data[0].astype(np.complex64))
    np.save(tmp_path / "three.npy", data)
    (one,) = read_npy(tmp_path / "one.npy", profile, scale=2.0)
    assert one.data.dtype == np.complex128
    np.testing.assert_array_equal(one.data, 2.0 * data[0].astype(np.complex64))
    three = read_npy(tmp_path / "three.npy", profile)
    np.testing.assert_array_equal([c.data for c in three], data)


def test_what_is_no_capture_of_the_profile_is_refused(tmp_path: Path, rng: np.random.Generator) -> None:
    profile = _small()
    with pytest.raises(NotFoundError, match="no such file"):
        read_npy(tmp_path / "none.npy", profile)
    with pytest.raises(NotFoundError, match="no such file"):
        read_dca1000(tmp_path / "none.bin", profile, scale=1.0)
    np.save(tmp_path / "shape.npy", np.zeros((4, 8, 8)))
    with pytest.raises(InputError, match=r"needs shape \(4, 6, 8\)"):
        read_npy(tmp_path / "shape.npy", profile)
    np.save(tmp_path / "nan.npy", np.full((4, 6, 8), np.nan))
    with pytest.raises(InputError, match="192 samples are not finite"):
        read_npy(tmp_path / "nan.npy", profile)
    np.save(tmp_path / "text.npy", np.array(["a"]))
    with pytest.raises(InputError, match="real or complex numbers"):
        read_npy(tmp_path / "text.npy", profile)
    np.save(tmp_path / "pickle.npy", np.array([{}], dtype=object))
    with pytest.raises(InputError, match=r"not a \.npy array"):
        read_npy(tmp_path / "pickle.npy", profile)
    np.save(tmp_path / "iq.npy", np.full((4, 6, 8), 1j))
    with pytest.raises(InputError, match="adc: real"):
        read_npy(tmp_path / "iq.npy", _small(**{"waveform.adc": "real"}))
    (tmp_path / "short.bin").write_bytes(bytes(770))
    with pytest.raises(InputError, match="770 bytes are no whole number of frames"):
        read_dca1000(tmp_path / "short.bin", profile, scale=1.0)
    with pytest.raises(InputError, match="full_scale_dbm"):
        read_dca1000(tmp_path / "short.bin", profile)
    with pytest.raises(InputError, match="did you mean 'two_lane'"):
        read_dca1000(tmp_path / "short.bin", profile, layout="two_lanes")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="at least one frame"):
        write_dca1000(tmp_path / "x.bin", [])
    odd = load_profile("awrl1432", {"waveform.samples": 7})
    with pytest.raises(InputError, match="odd number"):
        read_dca1000(tmp_path / "short.bin", odd, scale=1.0)
