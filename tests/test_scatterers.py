"""The table of scatterers: round trips and refusals."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from echo_tools import scene_of

import shenron_rt as srt
from shenron_rt.errors import InputError, NotFoundError


@pytest.fixture(scope="module")
def traced():
    point = {"id": 4_000_000_000, "xyz_m": (30, 5, 0), "rcs_dbsm": 20.0}
    weather = {"rain_mm_h": 3.0, "fog_visibility_m": 150.0, "temperature_c": -4.0}
    target = {"id": 5, "shape": "box:2x2x2", "xyz_m": (12, 0, 0), "aim": 300, "velocity_mps": (3, 0, 0)}
    return srt.trace(scene_of(target, point_targets=[point], weather=weather), seed=9, frame=2, rays=500)


def assert_equal(a, b):
    for f in fields(a):
        first, second = getattr(a, f.name), getattr(b, f.name)
        if isinstance(first, np.ndarray):
            assert second.dtype == first.dtype, f.name
            np.testing.assert_array_equal(first, second, err_msg=f.name)
        else:
            assert first == second, f.name


def test_save_and_load_keep_every_field(traced, tmp_path):
    traced.save(tmp_path / "s.npz")
    assert_equal(traced, srt.Scatterers.load(tmp_path / "s.npz"))
    lit = [srt.illuminate(s, srt.load_profile("awrl1432")) for s in (traced, srt.Scatterers.load(tmp_path / "s.npz"))]
    assert lit[0].amplitude.tobytes() == lit[1].amplitude.tobytes()


def test_npz_keys_are_the_attribute_names(traced, tmp_path):
    traced.save(tmp_path / "s.npz")
    with np.load(tmp_path / "s.npz", allow_pickle=False) as data:
        assert set(data.files) <= {f.name for f in fields(traced)}
        assert {"position", "range_rate", "cos_incidence", "object_id", "tag", "area"} <= set(data.files)


def test_clear_weather_and_none_survive(tmp_path):
    scat = srt.Scatterers.from_table([[1.0, 2, 3, 4, 0.5, 6, 7]], area=[0.1])
    scat.save(tmp_path / "s.npz")
    back = srt.Scatterers.load(tmp_path / "s.npz")
    assert back.weather is None
    assert back.normal is None
    assert back.door == "lidar"
    assert_equal(scat, back)


def test_table_round_trip(traced):
    table = traced.table()
    assert table.shape == (len(traced), 7)
    assert table.dtype == np.float64
    back = srt.Scatterers.from_table(table, area=traced.area, door="mesh")
    for name in ("position", "range_rate", "cos_incidence", "object_id", "tag", "area"):
        np.testing.assert_array_equal(getattr(back, name), getattr(traced, name))
    assert back.object_id.dtype == np.uint32
    assert back.tag.dtype == np.uint8
    assert 4_000_000_000 in back.object_id


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        (6, 14.5, "column tag holds whole numbers"),
        (6, 256, "column tag"),
        (6, -1, "column tag"),
        (5, 1.4e-45, r"column id holds whole numbers.*cast to float"),
        (5, 2.0**32, "column id"),
        (4, 1.0001, "cosine in"),
        (4, -0.1, "cosine in"),
        (0, np.nan, "finite"),
        (3, np.inf, "finite"),
    ],
)
def test_impossible_tables_are_refused(column, value, message):
    table = np.tile([10.0, 0, 0, 0, 0.5, 3, 14], (4, 1))
    table[2, column] = value
    with pytest.raises(InputError, match=message):
        srt.Scatterers.from_table(table)


@pytest.mark.parametrize("shape", [(7,), (3, 6), (3, 8), (2, 3, 7)])
def test_wrong_shapes_are_refused(shape):
    with pytest.raises(InputError, match="columns"):
        srt.Scatterers.from_table(np.zeros(shape))


def test_columns_must_have_one_length(traced):
    with pytest.raises(InputError, match=r"Scatterers\.area: shape"):
        srt.Scatterers.from_table(np.tile([10.0, 0, 0, 0, 0.5, 3, 14], (4, 1)), area=np.ones(3))


def test_no_rows_are_allowed(tmp_path):
    empty = srt.Scatterers.from_table(np.zeros((0, 7)), area=np.zeros(0))
    assert len(empty) == 0
    assert empty.table().shape == (0, 7)
    empty.save(tmp_path / "e.npz")
    assert len(srt.Scatterers.load(tmp_path / "e.npz")) == 0


def test_select_takes_rows_of_every_column(traced):
    mask = traced.object_id == 5
    own = traced.select(mask)
    assert len(own) == mask.sum()
    np.testing.assert_array_equal(own.speckle, traced.speckle[mask])
    np.testing.assert_array_equal(own.footprint, traced.footprint[mask])
    assert own.material_names == traced.material_names


def test_unreadable_files_are_refused(tmp_path):
    with pytest.raises(NotFoundError):
        srt.Scatterers.load(tmp_path / "gone.npz")
    (tmp_path / "bad.npz").write_bytes(b"not a zip")
    with pytest.raises(InputError, match="not an npz"):
        srt.Scatterers.load(tmp_path / "bad.npz")
    np.savez(tmp_path / "less.npz", position=np.zeros((1, 3)))
    with pytest.raises(InputError, match="missing"):
        srt.Scatterers.load(tmp_path / "less.npz")
    np.savez(tmp_path / "pickle.npz", position=np.array([{}], dtype=object))
    with pytest.raises(InputError):
        srt.Scatterers.load(tmp_path / "pickle.npz")
