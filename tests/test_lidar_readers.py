"""Layouts of semantic LiDAR frames: all give the same points, told by content; what cannot be one is refused."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from lidar_tools import CAR_ID, GRID, ply_text, street, write_bin

import shenron_rt as srt
from shenron_rt._typing import NDArray
from shenron_rt.errors import InputError, NotFoundError
from shenron_rt.lidar import suggest_tag_table
from shenron_rt.lidar.readers import read_points

RECORDS = street()
Writer = Callable[[Path, NDArray[np.void]], None]


def _floats(records: NDArray[np.void]) -> NDArray[np.float32]:
    return np.frombuffer(records.tobytes(), np.float32).reshape(-1, 6)


def _cast(records: NDArray[np.void]) -> NDArray[np.float64]:
    return np.stack([records[name].astype(np.float64) for name in records.dtype.names or ()], axis=1)


def _npy(array: Callable[[NDArray[np.void]], NDArray[np.generic]]) -> Writer:
    def write(path: Path, records: NDArray[np.void]) -> None:
        with path.open("wb") as file:  # numpy would add its suffix
            np.save(file, array(records))

    return write


def _ply_binary(order: str) -> Writer:
    def write(path: Path, records: NDArray[np.void]) -> None:
        head = ply_text(records[:0], kinds=("float", "uint")).replace(b"vertex 0", b"vertex %d" % len(records))
        head = head.replace(b"ascii", b"binary_little_endian" if order == "<" else b"binary_big_endian")
        path.write_bytes(head + records.astype(records.dtype.newbyteorder(order)).tobytes())

    return write


def _npz(path: Path, records: NDArray[np.void]) -> None:
    mirrored = records.copy()
    mirrored["y"] *= -1  # as SimBEV stores it
    with path.open("wb") as file:
        np.savez(file, data=mirrored)


def _seven(records: NDArray[np.void]) -> NDArray[np.float64]:
    return np.insert(_cast(records), 3, 1.25, axis=1)


def _text_seven(path: Path, records: NDArray[np.void]) -> None:
    np.savetxt(path, _seven(records), fmt="%.9g", delimiter=",", header="x,y,z,v,cos_inc,id,tag", comments="")


def _ros_names(records: NDArray[np.void]) -> NDArray[np.void]:
    return records.astype([("x", "f4"), ("y", "f4"), ("z", "f4"), ("cos_inc_angle", "f4"), ("object_idx", "u4"),
                           ("object_tag", "u4")])  # fmt: skip


LAYOUTS: dict[str, tuple[Writer, float]] = {  # writer, largest error of a coordinate [m]
    "ply": (lambda p, r: p.write_bytes(ply_text(r)), 5.1e-5),  # four decimals
    "ply_crlf": (lambda p, r: p.write_bytes(ply_text(r, newline="\r\n")), 5.1e-5),
    "ply_short_type_names": (lambda p, r: p.write_bytes(ply_text(r, kinds=("float", "uint"))), 5.1e-5),
    "ply_binary": (_ply_binary("<"), 0.0),
    "ply_binary_big_endian": (_ply_binary(">"), 0.0),
    "raw": (lambda p, r: p.write_bytes(r.tobytes()), 0.0),
    "structured": (_npy(lambda r: r), 0.0),
    "ros_bridge_names": (_npy(_ros_names), 0.0),
    "denormal_float32": (_npy(_floats), 0.0),
    "denormal_flat": (_npy(lambda r: _floats(r).reshape(-1)), 0.0),
    "denormal_widened": (_npy(lambda r: _floats(r).astype(np.float64)), 0.0),
    "raw_bytes_npy": (_npy(lambda r: np.frombuffer(r.tobytes(), np.uint8)), 0.0),
    "value_cast": (_npy(_cast), 0.0),
    "value_cast_float32": (_npy(lambda r: _cast(r).astype(np.float32)), 0.0),
    "simbev": (_npz, 0.0),
    "seven_columns": (_npy(_seven), 0.0),
    "seven_columns_text": (_text_seven, 1e-7),
}


def _file(folder: Path, layout: str, records: NDArray[np.void] = RECORDS) -> Path:
    path = folder / "frame.data"  # a name that tells nothing: the content has to
    LAYOUTS[layout][0](path, records)
    return path


@pytest.mark.parametrize("layout", sorted(LAYOUTS))
def test_every_layout_gives_the_same_points_ids_and_tags(layout: str, tmp_path: Path) -> None:
    path = _file(tmp_path, layout)
    frame = srt.read_semantic_lidar(path, tag_table="0.9.14", frame="ros" if layout == "simbev" else "carla")
    truth = np.stack([RECORDS["x"], -RECORDS["y"].astype(np.float64), RECORDS["z"]], axis=1)
    tolerance = LAYOUTS[layout][1]
    assert np.abs(frame.position - truth).max() <= tolerance
    assert np.abs(frame.cos_incidence - RECORDS["CosAngle"]).max() <= tolerance
    assert frame.object_id.dtype == np.uint32
    assert frame.tag.dtype == np.uint8
    assert np.array_equal(frame.object_id, RECORDS["ObjIdx"])
    assert np.array_equal(frame.tag, RECORDS["ObjTag"])
    assert (frame.range_rate is not None) == layout.startswith("seven")


def test_the_recorded_velocity_column_is_kept(tmp_path: Path) -> None:
    frame = srt.read_semantic_lidar(_file(tmp_path, "seven_columns"), tag_table="0.9.14", frame="carla")
    assert frame.range_rate is not None
    assert np.all(frame.range_rate == 1.25)


def test_denormals_are_viewed_whatever_the_id(tmp_path: Path) -> None:
    records = RECORDS.copy()
    records["ObjIdx"][records["ObjIdx"] > 0] = 70_001
    raw = read_points(_file(tmp_path, "denormal_float32", records))
    assert np.array_equal(raw.object_id, records["ObjIdx"])
    assert raw.object_id.max() == 70_001
    assert "bits" in raw.notes[0]


def test_laz_of_c_shenron_is_read(tmp_path: Path) -> None:
    laspy = pytest.importorskip("laspy", reason="pip install 'shenron-rt[io]'")
    path = tmp_path / "frame.data"
    header = laspy.LasHeader(point_format=0, version="1.2")
    header.scales, header.offsets = [0.001] * 3, [float(RECORDS[a].min()) for a in "xyz"]
    for name, kind in (("cosine", np.float64), ("index", np.int32), ("sem_tag", np.int32)):
        header.add_extra_dim(laspy.ExtraBytesParams(name, kind))
    cloud = laspy.LasData(header)
    for axis in "xyz":
        setattr(cloud, axis, RECORDS[axis].astype(np.float64))
    cloud.cosine, cloud.index, cloud.sem_tag = RECORDS["CosAngle"], RECORDS["ObjIdx"], RECORDS["ObjTag"]
    with path.open("wb") as file:
        cloud.write(file, do_compress=False)
    raw = read_points(path)
    assert np.abs(raw.xyz[:, 0] - RECORDS["x"]).max() <= 0.5e-3 + 1e-9  # half of the scale
    assert np.array_equal(raw.tag, RECORDS["ObjTag"])
    assert set(np.unique(raw.object_id)) == {0, CAR_ID}
    path.write_bytes(path.read_bytes()[: -len(RECORDS)])
    with pytest.raises(InputError, match="cut short"):
        read_points(path)


def test_missing_laz_libraries_are_named_with_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "frame.laz"
    path.write_bytes(b"LASF" + bytes(400))
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'shenron-rt\[io\]'"):
        read_points(path)


# ---- refusals
def _read(path: Path, table: str = "0.9.14", frame: str = "carla", **options: object) -> srt.LidarFrame:
    return srt.read_semantic_lidar(path, tag_table=table, frame=frame, **options)  # type: ignore[arg-type]


def _changed(folder: Path, column: str, rows: slice, value: float) -> Path:
    records = RECORDS.copy()
    records[column][rows] = value
    return write_bin(folder / "frame.bin", records)


def test_all_zero_tags_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"all \d+ tags are 0"):
        _read(_changed(tmp_path, "ObjTag", slice(None), 0))


def test_tags_flushed_to_zero_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "frame.npy"
    flushed = _floats(RECORDS).copy()
    flushed[:, 4:] = 0.0
    np.save(path, flushed)
    with pytest.raises(InputError, match="flushed to zero"):
        _read(path)


def test_fractional_tags_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "frame.npy"
    table = _cast(RECORDS)
    table[7, 5] = 7.5
    np.save(path, table)
    with pytest.raises(InputError, match=r"ObjTag is fractional in 1 rows \(first 7\.5\)"):
        _read(path)


def test_fractional_ids_in_a_ply_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "frame.ply"
    path.write_bytes(ply_text(RECORDS[:9]).replace(b" 0 3\n", b" 0.25 3\n", 1))
    with pytest.raises(InputError, match="ObjIdx is fractional"):
        _read(path)


@pytest.mark.parametrize(("value", "said"), [(1.2, "angle"), (-1.5, "angle"), (40.0, "reaches 40")])
def test_cosines_beyond_one_are_refused(value: float, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said):
        _read(_changed(tmp_path, "CosAngle", slice(3, 9), value))


def test_cosines_just_beyond_one_are_clipped_and_negative_ones_turned_and_counted(tmp_path: Path) -> None:
    records = RECORDS.copy()
    records["CosAngle"][:5] = 1.0002
    records["CosAngle"][5:8] *= -1
    frame = _read(write_bin(tmp_path / "frame.bin", records))
    assert frame.cos_incidence.min() >= 0
    assert frame.cos_incidence.max() == 1
    assert frame.n_clipped == 8
    assert frame.summary()["cosines_clipped"] == 8


@pytest.mark.parametrize("last", ["I", ""])
def test_plain_lidar_ply_is_refused(last: str, tmp_path: Path) -> None:
    names = ["x", "y", "z", *([last] if last else [])]
    head = "\n".join(["ply", "format ascii 1.0", "element vertex 2", *(f"property float32 {n}" for n in names)])
    path = tmp_path / "frame.ply"
    path.write_text(head + "\nend_header\n" + ("1 2 3" + " 0.5" * bool(last) + "\n") * 2)
    with pytest.raises(InputError, match=r"CosAngle, ObjIdx, ObjTag missing.*plain LiDAR"):
        _read(path)


def test_plain_lidar_in_other_containers_is_refused(tmp_path: Path) -> None:
    plain = np.random.default_rng(1).normal(size=(600, 4)).astype(np.float32)
    np.save(tmp_path / "frame.npy", plain)
    with pytest.raises(InputError, match=r"\(600, 4\).*no tags"):
        _read(tmp_path / "frame.npy")
    (tmp_path / "frame.bin").write_bytes(plain.tobytes())  # 9600 bytes: a whole number of 24-byte records as well
    with pytest.raises(InputError, match="plain LiDAR"):
        _read(tmp_path / "frame.bin")


@pytest.mark.parametrize("layout", ["ply", "raw", "structured", "value_cast", "ply_binary", "simbev"])
def test_an_empty_cloud_is_refused(layout: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no points"):
        _read(_file(tmp_path, layout, RECORDS[:0]))


@pytest.mark.parametrize("layout", sorted(set(LAYOUTS) - {"seven_columns_text"}))
def test_a_truncated_file_is_refused(layout: str, tmp_path: Path) -> None:
    path = _file(tmp_path, layout)
    content = path.read_bytes()
    path.write_bytes(content[: int(0.7 * len(content)) - 11])
    with pytest.raises(InputError, match=r"cut short|no whole number"):
        _read(path)


@pytest.mark.parametrize("change", [-1, 1])
def test_a_wrong_element_count_is_refused(change: int, tmp_path: Path) -> None:
    path = tmp_path / "frame.ply"
    path.write_bytes(ply_text(RECORDS).replace(b"vertex %d" % len(RECORDS), b"vertex %d" % (len(RECORDS) + change)))
    with pytest.raises(InputError, match=rf"promises {len(RECORDS) + change} points.*holds {len(RECORDS)}"):
        _read(path)


@pytest.mark.parametrize("column", ["x", "CosAngle"])
def test_nan_is_refused_with_its_count(column: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"NaN or infinite in 4 of"):
        _read(_changed(tmp_path, column, slice(0, 4), np.nan))


def test_nan_ids_are_refused(tmp_path: Path) -> None:
    table = _cast(RECORDS)
    table[2, 4] = np.nan
    np.save(tmp_path / "frame.npy", table)
    with pytest.raises(InputError, match="ObjIdx has 1 values that are not finite"):
        _read(tmp_path / "frame.npy")


def test_unknown_tag_numbers_are_refused_with_their_count(tmp_path: Path) -> None:
    path = _changed(tmp_path, "ObjTag", slice(0, 6), 31)
    with pytest.raises(InputError, match=r"does not list 31 \(6 times\)"):
        _read(path)
    table = tmp_path / "fork.yaml"
    table.write_text("base: '0.9.14'\ntags: {31: GuardRail}\n")
    assert _read(path, str(table)).summary()["tags"]["GuardRail"] == 6


def test_a_table_under_which_cars_are_flat_and_huge_is_refused(tmp_path: Path) -> None:
    lawn = _changed(tmp_path, "ObjTag", slice(None), 1)
    records = RECORDS.copy()
    # half of the ground is terrain, 10 since 0.9.14; before it, 10 is every vehicle
    records["ObjTag"][(records["ObjTag"] == 1) & (records["y"] > 0)] = 10
    records["ObjTag"][records["ObjTag"] == 1] = 7  # leaves the ground itself as the old table has it
    with pytest.raises(InputError, match=r"Car points are .* flat and huge"):
        _read(write_bin(lawn, records), "0.9.13")


@pytest.mark.parametrize(("wrong", "right"), [("0.9.13", "0.9.14"), ("0.9.14", "0.9.13")])
def test_a_table_under_which_the_road_is_no_road_is_refused_and_the_other_suggested(
    wrong: str, right: str, tmp_path: Path
) -> None:
    records = RECORDS.copy()
    if right == "0.9.13":  # roads 7, buildings 1, vehicles 10
        records["ObjTag"] = np.choose(np.searchsorted((1, 3, 14), RECORDS["ObjTag"]), [7, 1, 10])
    path = write_bin(tmp_path / "frame.bin", records)
    with pytest.raises(InputError, match=rf"contradicts.*suggest '{right}'"):
        _read(path, wrong)
    assert len(_read(path, right)) == len(records)
    assert suggest_tag_table(path).table == right


def test_auto_only_suggests_and_shows_its_evidence(tmp_path: Path) -> None:
    path = write_bin(tmp_path / "frame.bin", RECORDS)
    with pytest.raises(InputError, match=r"suggest '0\.9\.14' \(\d+ of \d+ level points .* have tag 1, Buildings in"):
        _read(path, "auto")
    for top, table in ((28, "0.9.14"), (29, "ue5")):
        assert suggest_tag_table(_changed(tmp_path, "ObjTag", slice(0, 3), top)).table == table
    assert suggest_tag_table(_changed(tmp_path, "ObjTag", slice(0, 3), 41)).table is None


def test_frame_and_origin_are_named_or_refused(tmp_path: Path) -> None:
    path = write_bin(tmp_path / "frame.bin", RECORDS)
    with pytest.raises(InputError, match="frame 'enu'"):
        _read(path, frame="enu")
    with pytest.raises(InputError, match="origin 'map'"):
        _read(path, origin="map")
    with pytest.raises(InputError, match="origin 'ego' needs sensor_pose"):
        _read(path, origin="ego")
    with pytest.raises(InputError, match="origin 'world' needs a side_file"):
        _read(path, origin="world")
    with pytest.raises(NotFoundError):
        _read(tmp_path / "none.ply")


def test_a_frame_against_the_scan_order_is_warned_of(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = write_bin(tmp_path / "frame.bin", RECORDS)
    assert _read(path).notes == ()
    assert not caplog.records
    assert "is it 'carla'?" in _read(path, frame="ros").notes[0]
    assert "y pointed right" in caplog.text


@pytest.mark.parametrize(
    "grid", [(64, 10, -30), (0, 10, -30, 0.5), (64, -30, 10, 0.5), (63.5, 10, -30, 0.5), (64, 10, -30, 0)]
)
def test_a_grid_that_is_none_is_refused(grid: tuple[float, ...], tmp_path: Path) -> None:
    with pytest.raises(InputError, match="grid"):
        _read(write_bin(tmp_path / "frame.bin", RECORDS), grid=grid)


def test_a_cloud_on_no_grid_needs_one_given(tmp_path: Path, rng: np.random.Generator) -> None:
    records = RECORDS.copy()
    for axis in "xyz":  # as a resampled or merged cloud
        records[axis] += rng.normal(0, 0.3, len(records)).astype(np.float32)
    path = write_bin(tmp_path / "frame.bin", records)
    with pytest.raises(InputError, match="no angular grid"):
        _read(path)
    assert not _read(path, grid=GRID).grid.estimated
