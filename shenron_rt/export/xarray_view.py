"""A radar's group of a Zarr store as an ``xarray.Dataset``."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError, NotFoundError, did_you_mean
from .target import require

if TYPE_CHECKING:
    import xarray

__all__ = ["open_dataset"]

#: Arrays that say where, not what.
_COORDINATES = ("time_s", "chirp_start_s", "sample_time_s", "antenna_position_m")


def open_dataset(path: str | os.PathLike[str], radar: str | None = None) -> xarray.Dataset:
    """Open a store that :func:`~shenron_rt.export.export_zarr` wrote; nothing is read before it is asked for.

    Parameters
    ----------
    path : path
        The store.
    radar : str, optional
        May be left out where the store has one radar.

    Returns
    -------
    xarray.Dataset
        Variables over ``frame``, with the axes of the profile as coordinates; attributes carry the profile.

    Raises
    ------
    NotFoundError
        No store.
    InputError
        No such radar, several and none named, a store of something else, or xarray and zarr are not installed.
    """
    require("open_dataset", "xarray", "data", "xarray")
    require("open_dataset", "zarr", "data", "zarr")
    import xarray

    store = Path(path)
    if not (store / "zarr.json").is_file():
        raise NotFoundError(f"{store}: not a Zarr store, it has no zarr.json")
    attributes = json.loads((store / "zarr.json").read_text(encoding="utf-8")).get("attributes", {})
    known = [str(name) for name in attributes.get("radars", ())]
    if not known:
        raise InputError(f"{store}: a Zarr store, but none that export --to zarr wrote; its root names no radars")
    if radar is None and len(known) != 1:
        raise InputError(f"{store}: the store has {len(known)} radars, say which: radar= one of {known}")
    if radar is not None and radar not in known:
        raise InputError(f"{store}: no radar {radar!r}; {did_you_mean(radar, known)}")
    opened = xarray.open_zarr(store, group=radar or known[0], consolidated=False, chunks=None)
    named = opened.set_coords([name for name in _COORDINATES if name in opened])
    return named.assign_coords(object_name=("object", list(named["object"].attrs["names"])))
