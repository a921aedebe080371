"""Returns: power of an object, delay, round trip."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from echo_tools import ISO, scene_of

import shenron_rt as srt
from shenron_rt.errors import InputError


def returns_of(amplitude, distance, object_id, coherent):
    n = len(amplitude)
    position = np.zeros((n, 3))
    position[:, 0] = distance
    return srt.Returns(
        amplitude=np.asarray(amplitude, dtype=np.complex128),
        position=position,
        velocity=np.zeros((n, 3)),
        object_id=np.asarray(object_id, dtype=np.uint32),
        tag=np.zeros(n, dtype=np.uint8),
        coherent=np.asarray(coherent, dtype=bool),
        bounces=np.ones(n, dtype=np.uint8),
        scatterer=np.arange(n),
        center_hz=77e9,
    )


QUARTER = 299_792_458.0 / 77e9 / 4


def test_coherent_echoes_add_as_phasors_and_speckle_as_power():
    """A quarter wavelength apart two equal echoes cancel, half a wavelength apart they double."""
    r = returns_of(
        [1, 1, 1, 1, 2, 3j],
        [10, 10 + QUARTER, 20, 20 + 2 * QUARTER, 5, 6],
        [1, 1, 2, 2, 3, 3],
        [True] * 4 + [False] * 2,
    )
    power = r.power_by_object()
    assert power[1] == pytest.approx(0, abs=1e-9)
    assert power[2] == pytest.approx(4, rel=1e-9)
    assert power[3] == pytest.approx(13, rel=1e-12)


def test_coherent_and_incoherent_parts_of_one_object_add_in_power():
    r = returns_of([1, 1j, 0.5], [10, 10, 11], [7, 7, 7], [True, True, False])
    assert r.power_by_object() == {7: pytest.approx(2.25)}


def test_delay_is_two_way_from_the_origin():
    r = returns_of([1], [149.896229], [1], [True])
    assert r.delay_s[0] == pytest.approx(1e-6, rel=1e-12)


def test_save_and_load_keep_every_field(tmp_path):
    target = {"id": 5, "shape": "box:2x2x2", "xyz_m": (12, 0, 0), "material": "concrete"}
    first = srt.illuminate(srt.trace(scene_of(target), rays=5_000), ISO)
    assert len(first) > 20
    first.save(tmp_path / "r.npz")
    back = srt.Returns.load(tmp_path / "r.npz")
    for f in fields(first):
        a, b = getattr(first, f.name), getattr(back, f.name)
        if isinstance(a, np.ndarray):
            assert a.dtype == b.dtype
            np.testing.assert_array_equal(a, b)
        else:
            assert a == b
    with np.load(tmp_path / "r.npz") as data:
        np.testing.assert_array_equal(data["delay_s"], first.delay_s)


def test_echoes_inherit_the_columns_of_their_scatterer():
    target = {"id": 5, "shape": "box:2x2x2", "xyz_m": (12, 0, 0), "material": "concrete", "velocity_mps": (1, 2, 3)}
    scat = srt.trace(scene_of(target), rays=5_000)
    r = srt.illuminate(scat, ISO)
    for name in ("object_id", "tag", "velocity"):
        np.testing.assert_array_equal(getattr(r, name), getattr(scat, name)[r.scatterer])
    np.testing.assert_array_equal(r.position[r.coherent], scat.position[r.scatterer[r.coherent]])


def test_lengths_must_agree():
    with pytest.raises(InputError, match=r"Returns\.object_id: shape \(2,\) is needed, got \(1,\)"):
        returns_of([1, 1], [1, 2], [1], [True, True])
