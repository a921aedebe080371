"""Detections: the point list that a radar hands on."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Self

import numpy as np

from .._typing import BoolArray, FloatArray, IntArray
from ..errors import InputError, NotFoundError
from ..io.npz import atomic_write

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["DETECTION_DTYPE", "Detections"]

#: Columns of the table; lengths in m, velocity (range rate, + receding) in m/s, angles in rad, power in W.
DETECTION_DTYPE = np.dtype(
    [
        ("x", np.float64),
        ("y", np.float64),
        ("z", np.float64),
        ("velocity", np.float64),
        ("snr_db", np.float64),
        ("rcs_dbsm", np.float64),
        ("range", np.float64),
        ("azimuth", np.float64),
        ("elevation", np.float64),
        ("power", np.float64),
        ("object_id", np.int64),
        ("tag", np.uint8),
        ("ambiguous", np.bool_),
        ("elevation_valid", np.bool_),
    ]
)


#: Columns of the file beside the table.
_CHAIN_COLUMNS = ["chain", "ghost"]


def _not_given() -> NDArray[Any]:
    return np.array(0)


@dataclass(frozen=True)
class Detections:
    """Grouped peaks of one frame, strongest first, in the radar frame at mid-frame.

    Parameters
    ----------
    table : (n,) structured array of :data:`DETECTION_DTYPE`
        ``object_id`` -1 is noise or a side lobe; ``elevation`` is NaN where ``elevation_valid`` is false.
    n_cfar_hits : int
        Cells of the range-Doppler map above the threshold, before grouping.
    chain : (n,) str
        The objects that the wave met, from transmitter to receiver: ``"40>101"`` is radar, 40, 101, radar; ``""`` where
        ``object_id`` is -1. Default: the object alone.
    ghost : (n,) bool
        True where the echo met several surfaces and shows its object at a place that is not on it. Default: nowhere.
    """

    table: NDArray[Any]
    n_cfar_hits: int = 0
    chain: NDArray[Any] = field(default_factory=_not_given)
    ghost: BoolArray = field(default_factory=_not_given)

    def __post_init__(self) -> None:
        if self.table.dtype != DETECTION_DTYPE or self.table.ndim != 1:
            raise InputError(f"Detections.table: a line of {DETECTION_DTYPE.names} is needed, got {self.table.dtype}")
        ids = self.table["object_id"]
        if self.chain.ndim == 0:
            object.__setattr__(self, "chain", np.where(ids >= 0, ids.astype(np.str_), ""))
        if self.ghost.ndim == 0:
            object.__setattr__(self, "ghost", np.zeros(len(ids), dtype=bool))
        for name in ("chain", "ghost"):
            if getattr(self, name).shape != ids.shape:
                raise InputError(f"Detections.{name}: {len(ids)} rows are needed, got {getattr(self, name).shape}")

    def __len__(self) -> int:
        return len(self.table)

    def __repr__(self) -> str:
        if not len(self):
            return f"Detections(none, {self.n_cfar_hits} cells above the threshold)"
        top = self.table[0]
        return (
            f"Detections({len(self)} from {self.n_cfar_hits} cells, strongest {top['range']:.2f} m, "
            f"{np.degrees(top['azimuth']):.1f} deg, {top['velocity']:.2f} m/s, SNR {top['snr_db']:.1f} dB)"
        )

    @property
    def x(self) -> FloatArray:
        """(n,) forward [m]."""
        return self._column("x")

    @property
    def y(self) -> FloatArray:
        """(n,) left [m]."""
        return self._column("y")

    @property
    def z(self) -> FloatArray:
        """(n,) up [m]; 0 without elevation."""
        return self._column("z")

    @property
    def velocity(self) -> FloatArray:
        """(n,) range rate, positive = receding [m/s]."""
        return self._column("velocity")

    @property
    def snr_db(self) -> FloatArray:
        """(n,) power of the beamformed peak cell over the expected noise in it [dB]."""
        return self._column("snr_db")

    @property
    def rcs_dbsm(self) -> FloatArray:
        """(n,) radar cross section by the inverted radar equation [dBsm]."""
        return self._column("rcs_dbsm")

    @property
    def range(self) -> FloatArray:
        """(n,) range, corrected for range-Doppler coupling with the reported velocity [m]."""
        return self._column("range")

    @property
    def azimuth(self) -> FloatArray:
        """(n,) azimuth, positive = left [rad]."""
        return self._column("azimuth")

    @property
    def elevation(self) -> FloatArray:
        """(n,) elevation, positive = up; NaN without elevation aperture [rad]."""
        return self._column("elevation")

    @property
    def power(self) -> FloatArray:
        """(n,) received power a channel at the interpolated peak [W]."""
        return self._column("power")

    @property
    def object_id(self) -> IntArray:
        """(n,) int64, object with the most power in the cell; -1 where noise or no echo is in it."""
        return np.asarray(self.table["object_id"])

    @property
    def tag(self) -> IntArray:
        """(n,) uint8 semantic tag of that object's strongest part."""
        return np.asarray(self.table["tag"])

    @property
    def ambiguous(self) -> BoolArray:
        """(n,) bool, velocity known to be folded and range off by its coupling, or unfolding found no answer."""
        return np.asarray(self.table["ambiguous"])

    @property
    def elevation_valid(self) -> BoolArray:
        """(n,) bool, the array has an elevation aperture."""
        return np.asarray(self.table["elevation_valid"])

    def _column(self, name: str) -> FloatArray:
        return np.asarray(self.table[name], dtype=np.float64)

    # ---- files
    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the table with its column names as header; numbers in full precision, flags as 0 and 1."""
        rows = ([int(v) if isinstance(v, bool) else repr(v) for v in row] for row in self.table.tolist())
        return _write(path, [list(DETECTION_DTYPE.names or ()), *rows])

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the table; the same as :meth:`to_csv`."""
        return self.to_csv(path)

    def save_chains(self, path: str | os.PathLike[str]) -> Path:
        """Write ``chain`` and ``ghost``, row by row, beside a table written to ``path``: ``detections.chains.csv``."""
        flags = zip(self.chain.tolist(), self.ghost.tolist(), strict=True)
        return _write(_beside(path), [_CHAIN_COLUMNS, *([name, int(ghost)] for name, ghost in flags)])

    @classmethod
    def from_csv(cls, path: str | os.PathLike[str]) -> Self:
        """Read what :meth:`to_csv` wrote, with the chains where :meth:`save_chains` did; ``n_cfar_hits`` reads 0.

        Raises
        ------
        NotFoundError, InputError
        """
        file = Path(path)
        names = list(DETECTION_DTYPE.names or ())
        rows = _read(file, names)
        table = np.zeros(len(rows), dtype=DETECTION_DTYPE)
        for i, row in enumerate(rows):
            try:
                table[i] = tuple(
                    float(v) if DETECTION_DTYPE[k].kind == "f" else int(v) for k, v in zip(names, row, strict=True)
                )
            except ValueError as error:
                raise InputError(f"{file}:{i + 2}: {len(names)} numbers are needed, got {row} ({error})") from None
        side = _beside(file)
        if not side.is_file():
            return cls(table)
        labels = _read(side, _CHAIN_COLUMNS)
        if len(labels) != len(table) or any(len(r) != 2 or r[1] not in ("0", "1") for r in labels):
            raise InputError(f"{side}: {len(table)} rows of a chain and 0 or 1 are needed, as many as in {file.name}")
        chain = np.array([r[0] for r in labels] or [""][:0], dtype=np.str_)
        return cls(table, chain=chain, ghost=np.array([r[1] == "1" for r in labels], dtype=bool))


def _beside(path: str | os.PathLike[str]) -> Path:
    file = Path(path)
    return file.with_name(f"{file.stem}.chains.csv")


def _write(path: str | os.PathLike[str], rows: Sequence[Sequence[Any]]) -> Path:
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows(rows)

    def write(file: IO[bytes]) -> None:
        file.write(text.getvalue().encode())

    return atomic_write(path, write)


def _read(file: Path, names: list[str]) -> list[list[str]]:
    """Return the rows below a header that must be ``names``."""
    try:
        rows = list(csv.reader(file.read_text().splitlines()))
    except FileNotFoundError:
        raise NotFoundError(f"{file}: no such file") from None
    if not rows or rows[0] != names:
        raise InputError(f"{file}:1: the header must be {','.join(names)}, got {','.join(rows[0]) if rows else ''!r}")
    return rows[1:]
