"""Recorded radar data: TI's demo log and CARLA's own radar, in our axes and signs."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from shenron_rt.errors import InputError, NotFoundError
from shenron_rt.io.recorded import PointCloud, read_carla_radar, read_ti_tlv, write_ti_tlv

MAGIC = bytes([2, 1, 4, 3, 6, 5, 8, 7])


def clouds(count: int = 3) -> list[PointCloud]:
    rng = np.random.default_rng(1)
    return [
        PointCloud(
            position=rng.uniform(-20, 20, (n, 3)), velocity=rng.uniform(-10, 10, n), snr_db=rng.uniform(8, 40, n),
            noise_db=rng.uniform(40, 60, n), frame=100 + n,
        )
        for n in range(count)
    ]  # fmt: skip


def packet(
    *items: tuple[int, bytes], frame: int = 5, points: int = 1, cycles: int = 0, total: int | None = None
) -> bytes:
    """Return a packet put together by hand from the published tables."""
    body = b"".join(struct.pack("<II", kind, len(value)) + value for kind, value in items)
    length = -(-(40 + len(body)) // 32) * 32
    head = struct.pack("<8I", 0x03060000, total or length, 0xA1843, frame, cycles, points, len(items), 0)
    return (MAGIC + head + body).ljust(length, b"\0")


# ---- TI
def test_a_packet_made_by_hand_reads_in_our_axes_and_signs(tmp_path: Path) -> None:
    # the device: x right 1, y forward 20, z up 0.5, receding at 3 m/s; 25.3 dB over noise of 41.7 dB
    log = tmp_path / "demo.dat"
    log.write_bytes(packet((1, struct.pack("<4f", 1, 20, 0.5, 3)), (7, struct.pack("<2h", 253, 417))))
    (cloud,) = read_ti_tlv(log).frames
    assert cloud.position.tolist() == [[20.0, -1.0, 0.5]]
    assert cloud.velocity.tolist() == [3.0]
    assert (cloud.snr_db[0], cloud.noise_db[0]) == pytest.approx((25.3, 41.7))
    assert cloud.azimuth[0] == pytest.approx(-np.arctan(1 / 20))  # to the right
    assert cloud.frame == 5


def test_a_log_reads_back_as_it_was_written_with_frames_without_points(tmp_path: Path) -> None:
    written = clouds()
    log = read_ti_tlv(write_ti_tlv(tmp_path / "demo.dat", written))
    assert (len(log), log.damaged, log.skipped_bytes) == (3, 0, 0)
    for ours, read in zip(written, log.frames, strict=True):
        assert read.frame == ours.frame
        # float32 of 20 m: 1e-6 m
        assert read.position == pytest.approx(ours.position, abs=2e-6)
        assert read.velocity == pytest.approx(ours.velocity, abs=1e-6)
        assert read.snr_db == pytest.approx(ours.snr_db, abs=0.05)
        assert read.noise_db == pytest.approx(ours.noise_db, abs=0.05)
    assert (tmp_path / "demo.dat").stat().st_size % 32 == 0


def test_points_without_side_info_have_no_levels_and_other_items_are_skipped(tmp_path: Path) -> None:
    log = tmp_path / "demo.dat"
    log.write_bytes(packet((2, bytes(64)), (1, struct.pack("<4f", 0, 9, 0, 0)), (6, bytes(24))))
    cloud = read_ti_tlv(log)[0]
    assert len(cloud) == 1
    assert np.isnan(cloud.snr_db[0])


def test_the_compressed_points_of_an_xwrl1432_take_their_units(tmp_path: Path) -> None:
    units = struct.pack("<4f2H", 0.01, 0.002, 0.25, 0.5, 1, 0)
    point = struct.pack("<4h2B", -150, 2500, 30, -400, 80, 100)
    log = tmp_path / "demo.dat"
    log.write_bytes(packet((301, units + point)))
    cloud = read_ti_tlv(log)[0]
    assert cloud.position == pytest.approx(np.array([[25.0, 1.5, 0.3]]))
    assert cloud.velocity == pytest.approx([-0.8])
    assert (cloud.snr_db[0], cloud.noise_db[0]) == pytest.approx((20.0, 50.0))


@pytest.mark.parametrize(
    "bad",
    [
        packet((1, bytes(16)))[:50],  # cut off by the next packet
        packet((1, bytes(16)), total=100_000),  # announces more than there is
        packet((1, bytes(16)), total=8),
        packet((1, bytes(15))),
        packet((1, bytes(16)), points=2),
        packet((1, bytes(32)), (7, bytes(4)), points=2),
        packet((1, struct.pack("<4f", float("nan"), 1, 1, 1))),
        packet((1, bytes(16)))[:40] + struct.pack("<II", 1, 5000) + bytes(16),
        packet((301, bytes(25))),
    ],
)
def test_a_damaged_packet_is_skipped_counted_and_warned_of(
    bad: bytes, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    good = [packet((1, struct.pack("<4f", 0, 5, 0, 0)), frame=n) for n in (1, 2)]
    log = tmp_path / "demo.dat"
    log.write_bytes(good[0] + bad + good[1])
    read = read_ti_tlv(log)
    assert [f.frame for f in read.frames] == [1, 2]
    assert read.damaged == 1
    assert read.skipped_bytes == len(bad)
    assert "1 damaged packets skipped, 2 read" in caplog.text


@settings(max_examples=60, deadline=None)
@given(cut=st.integers(0, 700), noise=st.binary(max_size=40))
def test_no_bytes_make_the_reader_fail_otherwise_than_said(
    cut: int, noise: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("log") / "demo.dat"
    write_ti_tlv(path, clouds(6))
    content = path.read_bytes()
    path.write_bytes(content[:cut] + noise + content[cut:])
    read = read_ti_tlv(path)
    # there is no checksum: the packet that the bytes fall into may be lost or changed, every other one is read
    assert len({f.frame for f in read.frames} & set(range(100, 106))) >= 5


def test_time_unwraps_the_cycle_counter(tmp_path: Path) -> None:
    log = tmp_path / "demo.dat"
    step = 40_000_000  # 0.2 s of a 200 MHz counter
    start = 2**32 - step
    log.write_bytes(b"".join(packet((1, bytes(16)), cycles=(start + k * step) % 2**32) for k in range(4)))
    assert [f.time_s for f in read_ti_tlv(log, cpu_hz=200e6).frames] == pytest.approx([0.0, 0.2, 0.4, 0.6])
    with pytest.raises(InputError, match="cpu_hz"):
        read_ti_tlv(log, cpu_hz=0.0)


def test_what_is_no_log_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NotFoundError):
        read_ti_tlv(tmp_path / "none.dat")
    (tmp_path / "text.dat").write_bytes(b"sensorStart")
    with pytest.raises(InputError, match="no TI packet"):
        read_ti_tlv(tmp_path / "text.dat")
    # the area scanner puts two more words into its header; its points are range, azimuth, elevation
    whole = packet((1, struct.pack("<4f", 1, 0.9, 0.3, 0)))
    (tmp_path / "other.dat").write_bytes(whole[:40] + struct.pack("<2I", 0, 1) + whole[40:-8])
    with pytest.raises(InputError, match=r"none of 1 packets .* another demo"):
        read_ti_tlv(tmp_path / "other.dat")


# ---- CARLA
def test_carlas_rows_turn_to_the_left_and_keep_the_sign_of_velocity(tmp_path: Path) -> None:
    rows = np.array([[4.0, 0.2, 0.05, 30.0], [-6.0, -0.1, -0.02, 12.0]], dtype=np.float32)
    np.save(tmp_path / "radar.npy", rows)
    (tmp_path / "radar.bin").write_bytes(rows.tobytes())
    for source in (rows, tmp_path / "radar.npy", tmp_path / "radar.bin"):
        cloud = read_carla_radar(source)
        assert cloud.velocity == pytest.approx([4.0, -6.0])
        assert cloud.azimuth == pytest.approx([-0.2, 0.1], abs=1e-6)
        assert cloud.elevation == pytest.approx([0.05, -0.02], abs=1e-6)
        assert cloud.range == pytest.approx([30.0, 12.0], abs=1e-5)
        assert cloud.position[0, 1] < 0  # 0.2 rad to the right
        assert np.isnan(cloud.snr_db).all()


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (np.zeros((3, 5)), r"got shape \(3, 5\)"),
        (np.array([[1.0, 25.0, 0.0, 10.0]]), "azimuth up to 25"),  # degrees
        (np.array([[1.0, 0.1, 0.0, -10.0]]), "depth from -10"),
        (np.array([[np.nan, 0.1, 0.0, 10.0]]), "1 values are not finite"),
    ],
)
def test_rows_that_are_not_carlas_are_refused(rows: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_carla_radar(rows)


def test_files_that_are_not_carlas_are_refused(tmp_path: Path) -> None:
    with pytest.raises(NotFoundError):
        read_carla_radar(tmp_path / "none.npy")
    (tmp_path / "cut.bin").write_bytes(bytes(20))
    with pytest.raises(InputError, match="20 bytes are not whole rows"):
        read_carla_radar(tmp_path / "cut.bin")
    np.save(tmp_path / "named.npy", np.zeros(2, dtype=[("x", "f4")]))
    with pytest.raises(InputError, match="structured array"):
        read_carla_radar(tmp_path / "named.npy")
    (tmp_path / "text.npy").write_text("no")
    with pytest.raises(InputError, match=r"not a \.npy file"):
        read_carla_radar(tmp_path / "text.npy")


def test_a_cloud_refuses_columns_that_do_not_fit() -> None:
    with pytest.raises(InputError, match=r"PointCloud.snr_db: shape \(2,\)"):
        PointCloud(np.zeros((2, 3)), np.zeros(2), np.zeros(3), np.zeros(2))
    with pytest.raises(InputError, match="finite"):
        PointCloud(np.full((1, 3), np.nan), np.zeros(1), np.zeros(1), np.zeros(1))
