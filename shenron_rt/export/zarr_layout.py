"""Names, dimensions, types and attributes of the arrays of a Zarr store."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .._typing import IntArray, NDArray
from ..dsp import DETECTION_DTYPE, RadarCube
from ..run_source import RunRadar
from .labels import NOTHING

__all__ = ["ArraySpec", "Sizes", "axes_of", "detection_arrays", "frame_arrays"]

#: Columns of detections: unit and meaning.
_COLUMNS = {
    "x": ("m", "forward"), "y": ("m", "left"), "z": ("m", "up, 0 without elevation"),
    "velocity": ("m/s", "range rate, positive = receding"), "snr_db": ("dB", "power of the peak over its noise"),
    "rcs_dbsm": ("dBsm", "radar cross section"), "range": ("m", "range"),
    "azimuth": ("rad", "azimuth, positive = left"), "elevation": ("rad", "elevation, positive = up"),
    "power": ("W", "received power a channel"), "object_id": ("1", "object with the most power in the cell, -1 none"),
    "tag": ("1", "semantic tag, CARLA 0.9.14 numbering"), "ambiguous": ("1", "the velocity is known to be folded"),
    "elevation_valid": ("1", "the array measures elevation"),
}  # fmt: skip


@dataclass(frozen=True)
class Sizes:
    """Lengths of the dimensions that no axis has."""

    frames: int
    detections: int
    objects: int


@dataclass(frozen=True)
class ArraySpec:
    """One array over all frames; ``dims`` and ``shape`` begin with the frame."""

    dims: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: str
    fill: float
    attributes: dict[str, str] = field(default_factory=dict)


def _about(units: str, long_name: str) -> dict[str, str]:
    return {"units": units, "long_name": long_name}


def axes_of(
    radar: RunRadar, cube: RadarCube | None, ids: IntArray, names: list[str]
) -> dict[str, tuple[tuple[str, ...], NDArray[Any], dict[str, Any]]]:
    """Return the coordinates: name to (dimensions, values, attributes)."""
    p, frames = radar.profile, radar.frames
    sample = np.arange(p.waveform.samples) / p.waveform.sample_rate_hz + p.waveform.adc_start_s
    # xarray takes a one-dimensional array of a dimension's name for its coordinate
    axes: dict[str, tuple[tuple[str, ...], NDArray[Any], dict[str, Any]]] = {
        "frame": (("frame",), np.array([f.index for f in frames], dtype=np.int64), _about("1", "frame number")),
        "time_s": (("frame",), np.array([f.mid_s for f in frames]), _about("s", "scene time of mid-frame")),
        "chirp_start_s": (("chirp", "antenna"), p.chirp_start_s, _about("s", "chirp start from the frame's start")),
        "sample_time_s": (("sample",), sample, _about("s", "sample time from the start of the sweep")),
        "antenna_position_m": (("antenna", "xyz"), p.positions_m, _about("m", "tx + rx position, two-way sum")),
        # names as an attribute: Zarr 3 has no settled type of text arrays
        "object": (("object",), ids, {**_about("1", "object id"), "names": names}),
    }
    if cube is not None:
        axes |= {
            "range": (("range",), cube.range_m, _about("m", "range")),
            "velocity": (("velocity",), cube.velocity_mps, _about("m/s", "range rate, positive = receding")),
            "azimuth": (("azimuth",), cube.azimuth_rad, _about("rad", "azimuth, positive = left")),
        }
    return axes


def frame_arrays(
    radar: RunRadar, sizes: Sizes, *, adc: bool, cube: RadarCube | None, truth: bool
) -> dict[str, ArraySpec]:
    """Return the cubes, maps and labels that the run has."""
    p, n = radar.profile, sizes.frames
    specs: dict[str, ArraySpec] = {}
    if adc:
        shape = (n, p.waveform.chirps, p.n_virtual, p.waveform.samples)
        about = _about("sqrt(W)", "ADC samples, RMS at the receiver input")
        specs["adc"] = ArraySpec(("frame", "chirp", "antenna", "sample"), shape, "complex64", 0.0, about)
    if cube is not None:
        maps = {
            "range_doppler": (("range", "velocity"), cube.data.shape[:2], "power, mean of channels"),
            "range_azimuth": (("range", "azimuth"), (cube.data.shape[0], len(cube.azimuth_sine)), "beamformed power"),
        }
        for name, (dims, size, text) in maps.items():
            specs[name] = ArraySpec(("frame", *dims), (n, *size), "float32", float("nan"), _about("W", text))
            if truth:
                about = _about("1", "object with the most echo power in the cell, -1 none")
                specs[f"label_{name}"] = ArraySpec(("frame", *dims), (n, *size), "int64", NOTHING, about)
    return specs | (_object_arrays(sizes) if truth else {})


def _object_arrays(sizes: Sizes) -> dict[str, ArraySpec]:
    dims, shape, nan = ("frame", "object"), (sizes.frames, sizes.objects), float("nan")
    numbers = {
        "range_m": ("m", "range of the power-weighted mean position"),
        "azimuth_rad": ("rad", "its azimuth, positive = left"),
        "elevation_rad": ("rad", "its elevation, positive = up"),
        "velocity_mps": ("m/s", "power-weighted range rate, positive = receding"),
        "power_w": ("W", "received power"),
        "snr_db": ("dB", "of a point with this power"),
    }
    specs = {
        f"object_{name}": ArraySpec(dims, shape, "float64", nan, _about(unit, text))
        for name, (unit, text) in numbers.items()
    }
    specs["object_detected"] = ArraySpec(dims, shape, "bool", 0, _about("1", "has a detection"))
    specs["object_tag"] = ArraySpec(dims, shape, "uint8", 0, _about("1", "semantic tag, CARLA 0.9.14 numbering"))
    return specs


def detection_arrays(sizes: Sizes) -> dict[str, ArraySpec]:
    """Return the columns of detections, padded to the longest frame's."""
    specs = {
        "n_detections": ArraySpec(
            ("frame",), (sizes.frames,), "int32", 0, _about("1", "detections that are no padding")
        )
    }
    for name in DETECTION_DTYPE.names or ():
        kind = DETECTION_DTYPE[name]
        fill = float("nan") if kind.kind == "f" else NOTHING if kind.kind == "i" else 0
        unit, text = _COLUMNS[name]
        specs[f"detection_{name}"] = ArraySpec(
            ("frame", "detection"), (sizes.frames, sizes.detections), kind.name, fill, _about(unit, text)
        )
    about = _about("1", "shows its object where it is not")
    specs["detection_ghost"] = ArraySpec(("frame", "detection"), (sizes.frames, sizes.detections), "bool", 0, about)
    return specs
