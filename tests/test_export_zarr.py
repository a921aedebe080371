"""Zarr stores, read back with zarr and xarray."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from export_tools import run_scene
from run_tools import hand_made_frame

import shenron_rt as srt
from shenron_rt.cli import main
from shenron_rt.errors import InputError, NotFoundError
from shenron_rt.export import open_dataset
from shenron_rt.export.labels import NOTHING, azimuth_label, doppler_label, object_means

zarr = pytest.importorskip("zarr", reason="zarr is not installed (extra data)")
xarray = pytest.importorskip("xarray", reason="xarray is not installed (extra data)")

#: Half a unit in the last place of float32 numbers.
ULP = 2.0**-24


@pytest.fixture(scope="module")
def store(street_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("zarr") / "street.zarr"
    assert main(["export", str(street_run), "--to", "zarr", "-o", str(path)]) == 0
    return path


def _folder(run: Path, k: int) -> Path:
    return run / f"radars/front/frame_{k:06d}"


def test_cubes_and_maps_are_those_of_the_run_with_named_dimensions(street_run: Path, store: Path) -> None:
    with open_dataset(store) as data:
        assert data["adc"].dims == ("frame", *srt.AdcCube.dims)
        assert data["range_doppler"].dims == ("frame", "range", "velocity")
        assert data["range_azimuth"].dims == ("frame", "range", "azimuth")
        assert data["frame"].values.tolist() == [0, 1, 2]
        for k in range(3):
            adc, cube = (
                c.load(_folder(street_run, k) / f) for c, f in ((srt.AdcCube, "adc.npz"), (srt.RadarCube, "cube.npz"))
            )
            stored = data["adc"].sel(frame=k).values
            assert stored.dtype == np.complex64
            # rounding the real and the imaginary part to float32
            assert np.abs(stored - adc.data).max() <= ULP * np.abs(adc.data).max() * np.sqrt(2)
            for name in ("range_doppler", "range_azimuth"):
                np.testing.assert_allclose(data[name].sel(frame=k), getattr(cube, name), rtol=ULP)
        np.testing.assert_array_equal(data["range"], cube.range_m)
        np.testing.assert_array_equal(data["velocity"], cube.velocity_mps)
        np.testing.assert_array_equal(data["azimuth"], cube.azimuth_rad)
        np.testing.assert_array_equal(data["chirp_start_s"], adc.chirp_start_s)
        np.testing.assert_array_equal(data["antenna_position_m"], adc.positions_m)
        np.testing.assert_allclose(data["time_s"], 0.1 * np.arange(3) + adc.profile.frame_mid_s, rtol=1e-15)


def test_a_chunk_is_a_frame_and_the_attributes_carry_the_profile(street_run: Path, store: Path) -> None:
    group = zarr.open_group(store, mode="r")["front"]
    assert group["adc"].chunks == (1, *group["adc"].shape[1:])
    assert group["adc"].metadata.dimension_names == ("frame", "chirp", "antenna", "sample")
    assert group["range_doppler"].attrs["units"] == "W"
    profile = srt.RadarProfile.model_validate(group.attrs["profile"])
    assert profile == srt.AdcCube.load(_folder(street_run, 0) / "adc.npz").profile
    assert group.attrs["mount_xyz_m"] == [2.0, 0.0, 1.0]


def test_detections_are_padded_to_the_longest_frame(street_run: Path, store: Path) -> None:
    with open_dataset(store) as data:
        tables = [srt.Detections.from_csv(_folder(street_run, k) / "detections.csv").table for k in range(3)]
        assert data["n_detections"].values.tolist() == [len(t) for t in tables]
        assert data.sizes["detection"] == max(len(t) for t in tables)
        for k, table in enumerate(tables):
            for name in table.dtype.names:
                column = data[f"detection_{name}"].sel(frame=k).values
                np.testing.assert_array_equal(column[: len(table)], table[name], err_msg=name)
        shortest = min(range(3), key=lambda k: len(tables[k]))
        padding = data.isel(frame=shortest, detection=slice(len(tables[shortest]), None))
        assert np.isnan(padding["detection_x"]).all()
        assert (padding["detection_object_id"] == -1).all()


def test_objects_are_those_of_the_summary(street_run: Path, store: Path) -> None:
    frames = json.loads((street_run / "summary.json").read_text())["radars"][0]["frames"]
    with open_dataset(store) as data:
        assert dict(zip(data["object"].values.tolist(), data["object_name"].values.tolist(), strict=True)) == {
            0: "static", 40: "left_wall", 41: "right_wall", 101: "lead",
        }  # fmt: skip
        for record in frames:
            for told in record["objects"]:
                seen = data.sel(frame=record["frame"], object=told["id"])
                assert float(seen["object_power_w"]) == pytest.approx(10 ** (told["power_dbw"] / 10), rel=1e-9)
                assert float(seen["object_snr_db"]) == told["snr_db"]
                assert bool(seen["object_detected"]) == told["detected"]
                assert srt.SemanticTag(int(seen["object_tag"])).name == told["tag"]
        car = data.sel(object=101)
        # it drives 5 m/s slower; its echo wanders over its rear by less than a range cell
        np.testing.assert_allclose(car["object_range_m"], 25.0 - 0.5 * np.arange(3), atol=0.375)
        np.testing.assert_allclose(car["object_velocity_mps"], -5.0, atol=0.01)


def test_labels_name_the_car_in_the_cell_of_its_detection(store: Path) -> None:
    with open_dataset(store) as data:
        for k in range(3):
            found = data.sel(frame=k)
            row = int(np.flatnonzero(found["detection_object_id"] == 101)[0])
            i, j = (
                int(np.abs(data[axis].values - float(found[f"detection_{axis}"][row])).argmin())
                for axis in ("range", "velocity")
            )
            near = found["label_range_doppler"][i - 1 : i + 2, j - 1 : j + 2].values
            assert 101 in near
            assert NOTHING in found["label_range_doppler"].values
            assert set(np.unique(found["label_range_azimuth"])) == {-1, 0, 40, 41, 101}


def test_labels_fall_into_the_cells_of_the_closed_form() -> None:
    frame = hand_made_frame()
    cube, returns = frame.cube, frame.returns
    p = cube.profile
    label, beams = doppler_label(returns, cube), azimuth_label(returns, cube)
    for number, xyz, rate in ((7, (20.0, 4.0, 0.0), 0.0), (8, (30.0, -3.0, 0.0), -5.0 * 30 / np.hypot(30, 3))):
        distance = float(np.linalg.norm(xyz))
        i = round((distance + rate * p.center_hz / p.slope_hz_per_s) / p.range_resolution_m)
        j = 16 + round(rate / p.velocity_resolution_mps)
        assert label[i, j] == number
        b = int(np.abs(cube.azimuth_sine - xyz[1] / distance).argmin())
        assert beams[i, b] == number
    assert (label >= 0).sum() == 4  # two objects and two static echoes, each in a cell of its own
    means = object_means(returns, np.array([7, 8, 9]))
    np.testing.assert_allclose(means["range_m"], [np.hypot(20, 4), np.hypot(30, 3), np.nan])
    np.testing.assert_allclose(means["azimuth_rad"], [np.arctan2(4, 20), np.arctan2(-3, 30), np.nan])


def test_ghosts_count_for_the_power_of_an_object_and_not_for_its_place() -> None:
    from dataclasses import replace

    from shenron_rt.chains import Chains

    returns = hand_made_frame().returns
    # the static echo at 12 m is the car's, by way of the post
    ids = returns.object_id.copy()
    ids[3] = 8
    direct = replace(returns, object_id=ids)
    chains = Chains(np.array([[7, -1], [8, -1], [0, -1], [7, 8]]), np.arange(4, dtype=np.int32), np.arange(4) == 3)
    without, with_ghost = (object_means(r, np.array([8])) for r in (direct, replace(direct, chains=chains)))
    assert with_ghost["power_w"] == without["power_w"]
    np.testing.assert_allclose(with_ghost["range_m"], np.hypot(30, 3))
    assert without["range_m"] < 30


def test_folded_velocities_are_labelled_where_the_map_shows_them() -> None:
    from dataclasses import replace

    frame = hand_made_frame()
    fast = frame.returns.velocity.copy()
    fast[0] = -1.1 * frame.profile.max_velocity_mps * frame.returns.position[0] / np.hypot(20, 4)
    label = doppler_label(replace(frame.returns, velocity=fast), frame.cube)
    (column,) = np.unique(np.nonzero(label == 7)[1])
    # -1.1 v_max folds to +0.9 v_max; bins are v_max/16 apart
    assert column == 16 + round(0.9 * 16)


def test_several_radars_are_groups_and_one_must_be_named(tmp_path: Path) -> None:
    run = run_scene(tmp_path / "run", "clear_road", "--profile", "awrl1432", "--profile", "awrl1432_137mhz", rays=2_000)
    assert main(["export", str(run), "--to", "zarr"]) == 0
    store = tmp_path / "run.zarr"
    with pytest.raises(
        InputError, match=r"2 radars, say which: radar= one of \['front_awrl1432', 'front_awrl1432_137mhz'\]"
    ):
        open_dataset(store)
    with pytest.raises(InputError, match="no radar 'rear'"):
        open_dataset(store, "rear")
    with open_dataset(store, "front_awrl1432_137mhz") as data:
        p = srt.load_profile("awrl1432_137mhz")
        assert data["adc"].shape == (1, p.waveform.chirps, p.n_virtual, p.waveform.samples)
    with pytest.raises(NotFoundError, match="not a Zarr store"):
        open_dataset(run)
    zarr.open_group(tmp_path / "other.zarr", mode="w")
    with pytest.raises(InputError, match="its root names no radars"):
        open_dataset(tmp_path / "other.zarr")


def test_a_run_of_adc_data_has_no_truth(street_run: Path, tmp_path: Path) -> None:
    adc: Any = np.load(_folder(street_run, 0) / "adc.npz")["data"]
    np.save(tmp_path / "cubes.npy", np.stack([adc, adc]))
    words = [
        "process",
        str(tmp_path / "cubes.npy"),
        "--profile",
        "awrl1432",
        "-o",
        str(tmp_path / "run"),
        "--no-pictures",
    ]
    assert main(words) == 0
    assert main(["export", str(tmp_path / "run"), "--to", "zarr"]) == 0
    with open_dataset(tmp_path / "run.zarr") as data:
        assert not [name for name in data if name.startswith(("label_", "object_"))]
        mid = srt.load_profile("awrl1432").frame_mid_s
        # such runs do not say when their frames were: a tenth of a second apart
        np.testing.assert_allclose(data["time_s"], [mid, 0.1 + mid], rtol=1e-12)
        np.testing.assert_array_equal(data["adc"][0], data["adc"][1])


def test_python_of_the_export_page_runs(
    street_run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = (Path(__file__).resolve().parents[1] / "docs/export.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"^```python\n(.*?)^```$", page, flags=re.MULTILINE | re.DOTALL)
    (tmp_path / "out").mkdir()
    (tmp_path / "out/braking-awrl1432").symlink_to(street_run)
    monkeypatch.chdir(tmp_path)
    exec(compile(example, "export.md", "exec"), {})
    assert capsys.readouterr().out.rstrip().endswith("('frame', 'range', 'velocity')")
