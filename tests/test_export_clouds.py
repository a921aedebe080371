"""PCD, PLY and CSV clouds, read back by pypcd4, trimesh and NumPy."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from export_tools import columns_of

import shenron_rt as srt
from shenron_rt.cli import main
from shenron_rt.errors import InputError
from shenron_rt.export.pcd import pcd_bytes
from shenron_rt.export.ply import ply_bytes
from shenron_rt.export.points import DETECTION_POINT, detection_points

FIELDS = ("x", "y", "z", "velocity", "snr_db", "rcs_dbsm", "object_id", "tag", "ghost")


def _export(run: Path, folder: Path, form: str, *options: str) -> list[tuple[Path, dict[str, np.ndarray]]]:
    """Return each file with the table it was made of."""
    assert main(["export", str(run), "--to", form, "-o", str(folder), *options]) == 0
    index = json.loads((folder / "export.json").read_text())
    assert index["format"] == form
    pairs = []
    for record in index["frames"]:
        table = columns_of(run / f"radars/front/frame_{record['frame']:06d}/detections.csv")
        assert record["points"] == len(table["x"]) > 0
        pairs.append((folder / record["file"], table))
    return pairs


@pytest.mark.parametrize("text", [False, True])
def test_pcd_files_read_back_with_pypcd4(text: bool, street_run: Path, tmp_path: Path) -> None:
    pypcd4 = pytest.importorskip("pypcd4", reason="pypcd4 is not installed (extra test)")
    pairs = _export(street_run, tmp_path / "pcd", "pcd", *(["--text"] if text else []))
    assert len(pairs) == 3
    for file, table in pairs:
        cloud = pypcd4.PointCloud.from_path(file)
        assert cloud.fields == FIELDS
        assert cloud.metadata.data == ("ascii" if text else "binary")
        for name in FIELDS:
            wanted = table[name].astype(DETECTION_POINT[name])
            np.testing.assert_array_equal(cloud.pc_data[name], wanted, err_msg=name)


@pytest.mark.parametrize("text", [False, True])
def test_ply_files_read_back_with_trimesh(text: bool, street_run: Path, tmp_path: Path) -> None:
    import trimesh

    for file, table in _export(street_run, tmp_path / "ply", "ply", *(["--text"] if text else [])):
        cloud = trimesh.load(file)
        xyz = np.column_stack([table[a] for a in "xyz"]).astype(np.float32)
        np.testing.assert_array_equal(cloud.vertices, xyz)
        raw = cloud.metadata["_ply_raw"]["vertex"]["data"]
        for name in FIELDS:
            column = np.asarray(raw[name]).ravel()
            np.testing.assert_array_equal(column, table[name].astype(DETECTION_POINT[name]), err_msg=name)


def test_csv_files_are_the_runs_tables(street_run: Path, tmp_path: Path) -> None:
    for file, table in _export(street_run, tmp_path / "csv", "csv"):
        read = np.genfromtxt(file, delimiter=",", names=True)
        assert [*read.dtype.names, "ghost"] == list(table)
        for name in read.dtype.names:
            np.testing.assert_array_equal(np.atleast_1d(read[name]), table[name].astype(float), err_msg=name)


def test_the_index_says_when_and_from_where(street_run: Path, tmp_path: Path) -> None:
    _export(street_run, tmp_path / "csv", "csv", "--frames", "1:3")
    frames = json.loads((tmp_path / "csv/export.json").read_text())["frames"]
    mid = srt.load_profile("awrl1432").frame_mid_s
    assert [f["frame"] for f in frames] == [1, 2]
    for f in frames:
        assert f["time_s"] == pytest.approx(0.1 * f["frame"] + mid, abs=1e-12)
        np.testing.assert_allclose(f["sensor_in_world"]["xyz_m"], [15 * f["time_s"] + 2, 0, 1], atol=1e-9)
        assert f["sensor_in_world"]["quaternion_xyzw"] == [0, 0, 0, 1]


@pytest.mark.parametrize("binary", [True, False])
def test_no_points_are_a_file_of_no_points(binary: bool, tmp_path: Path) -> None:
    import trimesh

    pypcd4 = pytest.importorskip("pypcd4", reason="pypcd4 is not installed (extra test)")
    nothing = np.zeros(0, dtype=DETECTION_POINT)
    (tmp_path / "a.pcd").write_bytes(pcd_bytes(nothing, binary=binary))
    assert pypcd4.PointCloud.from_path(tmp_path / "a.pcd").points == 0
    (tmp_path / "a.ply").write_bytes(ply_bytes(nothing, binary=binary))
    with (tmp_path / "a.ply").open("rb") as file:
        header = trimesh.exchange.ply._parse_header(file)[0]
    assert header["vertex"]["length"] == 0


def test_object_ids_beyond_31_bits_are_refused_rather_than_wrapped() -> None:
    from shenron_rt.dsp import DETECTION_DTYPE, Detections

    table = np.zeros(2, dtype=DETECTION_DTYPE)
    table["object_id"] = [2**31 - 1, -1]
    assert detection_points(Detections(table))["object_id"].tolist() == [2**31 - 1, -1]
    table["object_id"][0] = 2**31
    with pytest.raises(InputError, match=r"object id 2147483648: .* up to 2147483647"):
        detection_points(Detections(table))
