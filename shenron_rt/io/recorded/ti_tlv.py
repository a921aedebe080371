"""The UART log of TI's out-of-box demo: one packet a frame, a header and type-length-value items.

All little endian. Header, 40 bytes: magic word (uint16 0x0102 0x0304 0x0506 0x0708), then eight uint32: version, total
packet length (header included, a multiple of 32), platform, frame number, time in CPU cycles, number of points, number
of items, subframe. Item: uint32 type, uint32 length of the value, the value.

==== =====================================================================================================
type value
==== =====================================================================================================
1    points, 16 bytes each: float32 x, y, z [m], Doppler [m/s]
7    side info of the same points, 4 bytes each: int16 SNR, int16 noise [0.1 dB]
301  points of xWRLx432 devices (SDK 5): float32 units of xyz, Doppler, SNR, noise; uint16 numbers of major and minor
     points; then 10 bytes a point: int16 x, y, z, Doppler; uint8 SNR, noise, each in its unit
==== =====================================================================================================

Other types are skipped. The device looks along +y with x to the right and z up; a receding target has positive Doppler.

References
----------
Texas Instruments, "Understanding the Out of Box Demo Data Output" (mmWave Industrial Toolbox 4.10) and
"Understanding UART Data Output Format" (Radar Toolbox 3.00); ``dpif_pointcloud.h`` and ``mmw_output.h`` of mmWave SDK
3.x; type 301: the message structures of the MMWAVE-L-SDK 5 demo.
"""

from __future__ import annotations

import logging
import os
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..._typing import FloatArray
from ...errors import InputError, NotFoundError
from ..npz import atomic_write
from .point_cloud import PointCloud

__all__ = ["TiLog", "read_ti_tlv", "write_ti_tlv"]

_log = logging.getLogger(__name__)

_MAGIC = struct.pack("<4H", 0x0102, 0x0304, 0x0506, 0x0708)
_HEADER = struct.Struct("<8s8I")
_ITEM = struct.Struct("<2I")
_UNITS = struct.Struct("<4f2H")
_SMALL_POINT = np.dtype([("xyz", "<i2", 3), ("doppler", "<i2"), ("snr", "u1"), ("noise", "u1")])
_POINTS, _SIDE_INFO, _SMALL_POINTS = 1, 7, 301
_PAD = 32
#: A UART frame is a few kilobytes; a length beyond this is a damaged header.
_MAX_PACKET = 1 << 20
_TENTH_DB = 0.1


class _DamagedError(ValueError):
    """A packet whose parts do not fit together."""


@dataclass(frozen=True)
class TiLog:
    """Frames of a log, in file order.

    Parameters
    ----------
    frames : tuple of PointCloud
        Frames without points included.
    damaged : int
        Packets that were skipped: truncated, or with lengths that contradict each other.
    skipped_bytes : int
        Bytes that belong to no packet that was read.
    """

    frames: tuple[PointCloud, ...]
    damaged: int
    skipped_bytes: int

    def __len__(self) -> int:
        return len(self.frames)

    def __getitem__(self, index: int) -> PointCloud:
        return self.frames[index]


def read_ti_tlv(path: str | os.PathLike[str], *, cpu_hz: float | None = None) -> TiLog:
    """Read a log of TI's out-of-box demo.

    Parameters
    ----------
    path : path
        The bytes of the data port, as they came; packets are found by their magic word.
    cpu_hz : float, optional
        Clock behind the header's cycle counter; gives ``time_s``, unwrapped over the 32-bit counter [Hz].

    Returns
    -------
    TiLog
        Damaged packets are counted, skipped, and named in one warning.

    Raises
    ------
    NotFoundError
    InputError
        No packet in the file, or none that can be read: other demos have other headers.
    """
    file = Path(path)
    try:
        data = file.read_bytes()
    except FileNotFoundError:
        raise NotFoundError(f"{file}: no such file") from None
    frames: list[PointCloud] = []
    cycles: list[int] = []
    damaged = used = 0
    for start, stop in _packets(data):
        try:
            cloud, ticks, length = _packet(data[start:stop], file.name)
        except _DamagedError as error:
            damaged += 1
            _log.debug("%s: packet at byte %d: %s", file, start, error)
            continue
        frames.append(cloud)
        cycles.append(ticks)
        used += length
    if not frames and not damaged:
        raise InputError(f"{file}: no TI packet in it, the magic word 02 01 04 03 06 05 08 07 does not occur")
    if not frames:
        raise InputError(
            f"{file}: none of {damaged} packets reads as the out-of-box demo's (header of 40 bytes, points of type 1 "
            "or 301); is it the log of another demo?"
        )
    if damaged:
        _log.warning("%s: %d damaged packets skipped, %d read", file, damaged, len(frames))
    if cpu_hz is not None:
        frames = _timed(frames, cycles, cpu_hz)
    return TiLog(tuple(frames), damaged, len(data) - used)


def _packets(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield where each packet starts, and where the next one does."""
    start = data.find(_MAGIC)
    while start >= 0:
        after = data.find(_MAGIC, start + len(_MAGIC))
        yield start, len(data) if after < 0 else after
        start = after


def _packet(data: bytes, source: str) -> tuple[PointCloud, int, int]:
    """Return the points, the cycle counter and the length of the packet at the beginning of ``data``."""
    if len(data) < _HEADER.size:
        raise _DamagedError("header cut off")
    _, _, total, _, frame, ticks, n_points, n_items, _ = _HEADER.unpack_from(data)
    if not _HEADER.size <= total <= _MAX_PACKET:
        raise _DamagedError(f"length {total}")
    if total > len(data):
        raise _DamagedError(f"{total} bytes announced, {len(data)} there")
    values = _items(data[:total], n_items)
    if _SMALL_POINTS in values:
        table = _small_points(values[_SMALL_POINTS])
    else:
        table = _points(values.get(_POINTS, b""), values.get(_SIDE_INFO))
    if len(table) != n_points:
        raise _DamagedError(f"{n_points} points announced, {len(table)} there")
    if not np.all(np.isfinite(table[:, :4])):
        raise _DamagedError("coordinates that are not finite")
    x_right, y_forward, z_up, doppler, snr, noise = table.T
    position = np.column_stack([y_forward, -x_right, z_up])
    return PointCloud(position, doppler, snr, noise, frame=frame, source=f"TI {source}"), ticks, total


def _items(packet: bytes, count: int) -> dict[int, bytes]:
    """Return the values by type."""
    values: dict[int, bytes] = {}
    at = _HEADER.size
    for _ in range(count):
        if at + _ITEM.size > len(packet):
            raise _DamagedError("an item's header is cut off")
        kind, length = _ITEM.unpack_from(packet, at)
        at += _ITEM.size
        if at + length > len(packet):
            raise _DamagedError(f"item of type {kind} is longer than the packet")
        values[kind] = packet[at : at + length]
        at += length
    return values


def _points(value: bytes, side: bytes | None) -> FloatArray:
    """Return (n, 6) x y z Doppler SNR noise in the device's axes; NaN levels without side info."""
    if len(value) % 16:
        raise _DamagedError(f"{len(value)} bytes of points")
    table = np.full((len(value) // 16, 6), np.nan)
    table[:, :4] = np.frombuffer(value, dtype="<f4").reshape(-1, 4)
    if side is not None:
        if len(side) != 4 * len(table):
            raise _DamagedError(f"{len(side)} bytes of side info for {len(table)} points")
        table[:, 4:] = np.frombuffer(side, dtype="<i2").reshape(-1, 2) * _TENTH_DB
    return table


def _small_points(value: bytes) -> FloatArray:
    """Return the same of a type 301 value."""
    body = len(value) - _UNITS.size
    if body < 0 or body % _SMALL_POINT.itemsize:
        raise _DamagedError(f"{len(value)} bytes of compressed points")
    xyz, doppler, snr, noise, _, _ = _UNITS.unpack_from(value)
    rows = np.frombuffer(value, dtype=_SMALL_POINT, offset=_UNITS.size)
    columns = (rows["xyz"] * xyz, rows["doppler"] * doppler, rows["snr"] * snr, rows["noise"] * noise)
    return np.column_stack([np.asarray(c, dtype=np.float64) for c in columns])


def _timed(frames: Sequence[PointCloud], cycles: Sequence[int], cpu_hz: float) -> list[PointCloud]:
    if cpu_hz <= 0:
        raise InputError(f"cpu_hz={cpu_hz:g}: a positive frequency is needed")
    # the counter has 32 bits: each step is the smallest one forward
    counter = np.asarray(cycles, dtype=np.int64)
    steps = np.mod(np.diff(counter, prepend=counter[:1]), 1 << 32)
    time = np.cumsum(steps) / cpu_hz
    return [replace(f, time_s=float(t)) for f, t in zip(frames, time, strict=True)]


def write_ti_tlv(path: str | os.PathLike[str], frames: Sequence[PointCloud], *, version: int = 0x03060000) -> Path:
    """Write clouds as the demo would: types 1 and, where levels are known, 7; for tests and for TI's own viewers.

    Parameters
    ----------
    path : path
    frames : sequence of PointCloud
        Coordinates are rounded to float32, levels to 0.1 dB.
    version : int
        SDK version in the header.
    """
    return atomic_write(path, lambda file: file.writelines(_written(f, version) for f in frames) or None)


def _written(cloud: PointCloud, version: int) -> bytes:
    x, y, z = cloud.position.T
    items = [(_POINTS, np.column_stack([-y, x, z, cloud.velocity]).astype("<f4").tobytes())] if len(cloud) else []
    levels = np.column_stack([cloud.snr_db, cloud.noise_db])
    if len(cloud) and np.all(np.isfinite(levels)):
        items.append((_SIDE_INFO, np.round(levels / _TENTH_DB).astype("<i2").tobytes()))
    body = b"".join(_ITEM.pack(kind, len(value)) + value for kind, value in items)
    total = -(-(_HEADER.size + len(body)) // _PAD) * _PAD
    header = _HEADER.pack(_MAGIC, version, total, 0xA1843, cloud.frame, 0, len(cloud), len(items), 0)
    return (header + body).ljust(total, b"\x00")
