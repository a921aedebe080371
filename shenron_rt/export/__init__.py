"""Run folders in other tools' formats: MCAP for Foxglove, ROS 2 bags, PCD, PLY, CSV, Zarr.

Every optional library is imported inside functions of one module; where it is missing, the error has the command that
installs it.
"""

from __future__ import annotations

from ..run_source import open_run
from .clouds import export_clouds
from .mcap import export_mcap, layout_path
from .ros2 import export_ros2
from .timeline import EPOCH_S, stamp_ns
from .xarray_view import open_dataset
from .zarr_store import export_zarr

__all__ = [
    "EPOCH_S",
    "export_clouds",
    "export_mcap",
    "export_ros2",
    "export_zarr",
    "layout_path",
    "open_dataset",
    "open_run",
    "stamp_ns",
]
