"""The second door: frames of a semantic LiDAR."""

from .crops import crop_ego, crop_old_pipeline, thin
from .door import lidar_scatterers
from .evidence import TableSuggestion, suggest_tag_table
from .frame import LidarFrame
from .grid import LidarGrid, estimate_grid, surface_area
from .normals import estimate_normals
from .read import read_semantic_lidar
from .side_file import ActorState, SideFile, read_side_file
from .sweeps import merge_sweeps, sweep_motion

__all__ = [
    "ActorState", "LidarFrame", "LidarGrid", "SideFile", "TableSuggestion", "crop_ego", "crop_old_pipeline",
    "estimate_grid", "estimate_normals", "lidar_scatterers", "merge_sweeps", "read_semantic_lidar", "read_side_file",
    "suggest_tag_table", "surface_area", "sweep_motion", "thin",
]  # fmt: skip
