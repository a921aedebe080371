"""A Zarr store of ADC cubes, maps, detections and labels for training: a group a radar, a chunk a frame."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .._typing import IntArray, NDArray
from ..dsp import Detections, RadarCube
from ..returns import Returns
from ..run_source import RunFrame, RunRadar, RunSource, open_run
from ..runs import Run, plain
from ..tags import SemanticTag
from .labels import NOTHING, azimuth_label, doppler_label, object_means
from .target import require, whole_folder
from .zarr_layout import ArraySpec, Sizes, axes_of, detection_arrays, frame_arrays

__all__ = ["export_zarr"]

#: Every store has it.
_MARKER = "zarr.json"


def export_zarr(
    run: RunSource | Run | str | os.PathLike[str],
    path: str | os.PathLike[str],
    *,
    radars: Sequence[str] | None = None,
    frames: Collection[int] | None = None,
    overwrite: bool = False,
    step: Callable[[str], None] | None = None,
) -> Path:
    """Write ADC cubes, maps, detections and truth of every frame into one Zarr store (format 3).

    Arrays are made for all frames first and then written region by region, a frame at a time, so that memory does not
    grow with the number of frames. Every array has named dimensions; :func:`~shenron_rt.export.open_dataset` opens a
    radar's group as an ``xarray.Dataset``.

    Parameters
    ----------
    run : RunSource, Run or path
        A run folder, or one that :func:`~shenron_rt.export.open_run` has opened.
    path : path
        The store to make, ``.zarr``.
    radars, frames, overwrite, step
        As for :func:`~shenron_rt.export.export_mcap`.

    Returns
    -------
    Path

    Raises
    ------
    NotFoundError, InputError
        No such run, radar or frame; zarr is not installed; the place is taken; the disk refuses.
    """
    require("export to zarr", "zarr", "data", "zarr")
    import zarr

    source, target = open_run(run, radars=radars, frames=frames), Path(path)
    with whole_folder(target, overwrite=overwrite, marker=_MARKER) as folder:
        root = zarr.open_group(folder, mode="w", zarr_format=3)
        root.attrs.update(
            {
                "run": source.name, "made_from": source.kind, "version": source.version,
                "radars": [r.name for r in source.radars],
            }
        )  # fmt: skip
        for radar in source.radars:
            _write_radar(root.create_group(radar.name), source, radar, step)
    return target


def _write_radar(group: Any, source: RunSource, radar: RunRadar, step: Callable[[str], None] | None) -> None:
    """Make the arrays of one radar, then write them frame by frame."""
    first = radar.frames[0]
    adc, cube = first.has("adc.npz"), first.cube(radar.profile)
    names = source.names_of(first)
    for frame in radar.frames[1:]:
        names |= source.names_of(frame)
    ids = np.array(sorted(names), dtype=np.int64)
    counts = [len(f.detections()) for f in radar.frames]
    sizes = Sizes(len(radar.frames), max(counts, default=0), len(ids))
    group.attrs.update(
        {
            "profile": plain(radar.profile.model_dump(mode="json", exclude_none=True)),
            "mount_xyz_m": list(radar.mount.xyz), "mount_ypr_deg": list(radar.mount.ypr_deg),
            "range_window": None if cube is None else cube.range_window,
            "doppler_window": None if cube is None else cube.doppler_window,
            "noise_power_w": None if cube is None else cube.noise_power_w,
            "frame": "radar: x forward, y left, z up; velocity positive = receding; azimuth positive = left",
            "time": "scene seconds of mid-frame, which maps, detections and objects refer to",
        }
    )  # fmt: skip
    axes = axes_of(radar, cube, ids, [names[i] for i in ids.tolist()])
    for name, (dims, values, attributes) in axes.items():
        array = group.create_array(name, data=values, dimension_names=dims)
        array.attrs.update(attributes)
    specs = frame_arrays(radar, sizes, adc=adc, cube=cube, truth=first.has("returns.npz")) | detection_arrays(sizes)
    arrays = {name: _create(group, spec, name) for name, spec in specs.items()}
    for row, frame in enumerate(radar.frames):
        for name, values in _frame_values(radar, frame, ids, sizes).items():
            if name in arrays:
                arrays[name][row] = values
        if step is not None:
            step(f"{radar.name} frame {frame.index}")


def _create(group: Any, spec: ArraySpec, name: str) -> Any:
    chunks = (1, *(max(n, 1) for n in spec.shape[1:]))
    array = group.create_array(
        name, shape=spec.shape, dtype=spec.dtype, chunks=chunks, dimension_names=spec.dims, fill_value=spec.fill
    )
    array.attrs.update(spec.attributes)
    return array


def _frame_values(radar: RunRadar, frame: RunFrame, ids: IntArray, sizes: Sizes) -> dict[str, NDArray[Any]]:
    """Return everything of one frame by the name of its array."""
    values: dict[str, Any] = {}
    adc, cube, returns = frame.adc(), frame.cube(radar.profile), frame.returns()
    if adc is not None:
        values["adc"] = adc.data.astype(np.complex64)
    if cube is not None:
        values |= {"range_doppler": cube.range_doppler, "range_azimuth": cube.range_azimuth}
    values |= _truth(frame.record, returns, cube, ids)
    values |= _detections(frame.detections(), sizes.detections)
    return values


def _truth(
    record: Mapping[str, Any], returns: Returns | None, cube: RadarCube | None, ids: IntArray
) -> dict[str, NDArray[Any]]:
    if returns is None:
        return {}
    values: dict[str, NDArray[Any]] = {f"object_{k}": v for k, v in object_means(returns, ids).items()}
    told = {int(o["id"]): o for o in record.get("objects", ())}
    detected = [bool(told.get(i, {}).get("detected", False)) for i in ids.tolist()]
    snr = [told.get(i, {}).get("snr_db") for i in ids.tolist()]
    tags = [SemanticTag[str(told.get(i, {}).get("tag") or "Unlabeled")] for i in ids.tolist()]
    values["object_detected"] = np.array(detected, dtype=np.bool_)
    values["object_snr_db"] = np.array([np.nan if s is None else s for s in snr], dtype=np.float64)
    values["object_tag"] = np.array([int(t) for t in tags], dtype=np.uint8)
    if cube is not None:
        values["label_range_doppler"] = doppler_label(returns, cube)
        values["label_range_azimuth"] = azimuth_label(returns, cube)
    return values


def _detections(found: Detections, width: int) -> dict[str, NDArray[Any]]:
    """Return the columns of the detections, padded to the longest frame's."""
    values: dict[str, NDArray[Any]] = {"n_detections": np.asarray(len(found), dtype=np.int32)}
    columns = {name: found.table[name] for name in found.table.dtype.names or ()} | {"ghost": found.ghost}
    for name, column in columns.items():
        kind = column.dtype.kind
        fill = np.nan if kind == "f" else NOTHING if kind == "i" else 0
        padded = np.full(width, fill, dtype=column.dtype)
        padded[: len(column)] = column
        values[f"detection_{name}"] = padded
    return values
