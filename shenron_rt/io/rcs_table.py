"""A sweep of radar cross sections as a table of comma-separated values."""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from pathlib import Path
from typing import IO

import numpy as np

from .._typing import ComplexArray, FloatArray
from .npz import atomic_write

__all__ = ["table_columns", "write_rcs_table"]


def table_columns(polarization: Sequence[str]) -> list[str]:
    """Return the header: three axes, then ``rcs_vv_dbsm`` and ``phase_vv_deg`` for each polarisation."""
    values = [name for p in polarization for name in (f"rcs_{p.lower()}_dbsm", f"phase_{p.lower()}_deg")]
    return ["frequency_hz", "elevation_deg", "azimuth_deg", *values]


def write_rcs_table(
    path: str | os.PathLike[str],
    frequency_hz: FloatArray,
    elevation_deg: FloatArray,
    azimuth_deg: FloatArray,
    polarization: Sequence[str],
    amplitude: ComplexArray,
    floor_dbsm: float,
) -> Path:
    """Write the table, whole or not at all.

    Parameters
    ----------
    path : path
    frequency_hz, elevation_deg, azimuth_deg : (n_freq,), (n_el,), (n_az,) float
    polarization : sequence of str
    amplitude : (n_freq, n_el, n_az, n_pol) complex
        Its modulus squared is the RCS [m].
    floor_dbsm : float
        Least RCS written; the phase there is what it is.

    Returns
    -------
    Path

    Notes
    -----
    Azimuth runs fastest. Axes to twelve digits, levels to 1e-4 dB, phases to 1e-3 degrees in (-180, 180].
    """
    axes = np.stack([a.ravel() for a in np.meshgrid(frequency_hz, elevation_deg, azimuth_deg, indexing="ij")], axis=1)
    level = 10.0 * np.log10(np.maximum(np.abs(amplitude) ** 2, 10.0 ** (floor_dbsm / 10.0)))
    values = np.stack([level, np.degrees(np.angle(amplitude))], axis=-1).reshape(len(axes), -1)
    formats = ["%.12g"] * 3 + ["%.4f", "%.3f"] * len(polarization)
    text = io.StringIO()
    np.savetxt(
        text, np.concatenate([axes, values], axis=1), fmt=formats, delimiter=",", comments="",
        header=",".join(table_columns(polarization)),
    )  # fmt: skip

    def write(file: IO[bytes]) -> None:
        file.write(text.getvalue().encode())

    return atomic_write(path, write)
