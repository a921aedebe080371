"""Axes and units of mesh files, by the program that wrote them, and the matrix that takes each to ROS axes in metres.

Unreal works in centimetres with x forward, y right, z up (left-handed). In file columns (a, b, c):

=================  ===============================  =================  ========
preset             columns are Unreal's             ROS x, y, z        unit
=================  ===============================  =================  ========
carla_exporter     X, Z, Y (CarlaExporter plugin)   a, -c, b           m
ue_obj_cm          X, Z, Y (Export as OBJ)          a, -c, b           cm
ue_gltf            X, Z, Y (glTF exporter)          a, -c, b           m
ue_fbx_cm          X, -Y, Z (FBX export)            a, b, c            cm
libcarla           X, Y, Z (left-handed)            a, -b, c           m
ros_z_up           x forward, y left, z up          a, b, c            m
gltf_y_up          y up, z forward (glTF standard)  c, a, b            m
blender            y up, Blender's own x and y      a, -c, b           m
=================  ===============================  =================  ========

``blender`` is Blender's default OBJ or glTF export of a scene whose x is forward and y left, as an Unreal FBX import
has it. Sources: CARLA's CarlaExporter and LibCarla ``geom/Mesh.cpp``, Unreal's OBJ, glTF and FBX exporters.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from .._typing import ArrayLike, FloatArray
from ..errors import InputError, did_you_mean

__all__ = ["MESH_FRAMES", "UNITS", "mesh_matrix"]

_UE_SWAPPED = ((1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.0, 1.0, 0.0))
_SAME = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
_Rows = tuple[tuple[float, float, float], ...]

#: Preset name -> (rows of the axis matrix, metres per file unit).
MESH_FRAMES: Mapping[str, tuple[_Rows, float]] = MappingProxyType(
    {
        "carla_exporter": (_UE_SWAPPED, 1.0),
        "ue_obj_cm": (_UE_SWAPPED, 0.01),
        "ue_gltf": (_UE_SWAPPED, 1.0),
        "ue_fbx_cm": (_SAME, 0.01),
        "libcarla": (((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0)), 1.0),
        "ros_z_up": (_SAME, 1.0),
        "gltf_y_up": (((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), 1.0),
        "blender": (_UE_SWAPPED, 1.0),
    }
)

#: Unit name -> metres.
UNITS: Mapping[str, float] = MappingProxyType({"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254})


def mesh_matrix(mesh_frame: str | ArrayLike = "ros_z_up", units: str | float = "m") -> FloatArray:
    """Return the 4x4 matrix from file coordinates to ROS axes in metres.

    Parameters
    ----------
    mesh_frame : str or (4, 4) or (3, 3) array_like
        A preset of :data:`MESH_FRAMES`, or the matrix itself; a matrix applies after the unit.
    units : str or float
        ``"m"``, ``"cm"``, ``"mm"``, ``"inch"`` or metres per file unit. The ``_cm`` presets carry their unit; with them
        the default ``"m"`` and ``"cm"`` both mean centimetres, anything else is refused.

    Returns
    -------
    (4, 4) ndarray
        Its determinant is negative where the file is left-handed.

    Raises
    ------
    InputError
        Unknown preset or unit, or a matrix that is not usable; with what is allowed.
    """
    scale = _metres_per_unit(units)
    result = np.eye(4)
    if not isinstance(mesh_frame, str):
        given = np.asarray(mesh_frame, dtype=np.float64)
        if given.shape not in ((3, 3), (4, 4)) or not np.all(np.isfinite(given)):
            raise InputError(f"mesh_frame: a preset name or a finite 4x4 matrix is needed, got shape {given.shape}")
        result[: given.shape[0], : given.shape[1]] = given
        result[:3, :3] *= scale
        return result
    if mesh_frame not in MESH_FRAMES:
        raise InputError(f"unknown mesh_frame {mesh_frame!r}; {did_you_mean(mesh_frame, MESH_FRAMES)}, or a 4x4 matrix")
    axes, own = MESH_FRAMES[mesh_frame]
    if own != 1.0:
        if scale not in (1.0, own):
            raise InputError(f"units {units!r}: mesh_frame {mesh_frame!r} already says centimetres; leave units out")
        scale = own
    result[:3, :3] = scale * np.asarray(axes)
    return result


def _metres_per_unit(units: str | float) -> float:
    if isinstance(units, str):
        if units in UNITS:
            return UNITS[units]
        try:
            scale = float(units)
        except ValueError:
            raise InputError(f"unknown units {units!r}; {did_you_mean(units, UNITS)}, or metres per unit") from None
    else:
        scale = float(units)
    if not (np.isfinite(scale) and scale > 0):
        raise InputError(f"units: metres per file unit must be positive, got {units!r}")
    return scale
