"""shenron_rt: ray-traced FMCW radar simulation of automotive scenes.

Public names are imported when first used, so that importing the package is cheap.
"""

from __future__ import annotations

import importlib
import importlib.metadata
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .attribution import Explanation as Explanation
    from .attribution import explain as explain
    from .batch import BatchResult as BatchResult
    from .batch import run_batch as run_batch
    from .comparison import Comparison as Comparison
    from .comparison import compare as compare
    from .config.materials import Material as Material
    from .config.materials import MaterialTable as MaterialTable
    from .config.materials import load_materials as load_materials
    from .config.plan import BatchPlan as BatchPlan
    from .config.plan import load_plan as load_plan
    from .config.profile import RadarProfile as RadarProfile
    from .config.profile import load_profile as load_profile
    from .config.scene import Scene as Scene
    from .config.scene import load_scene as load_scene
    from .dsp import Detections as Detections
    from .dsp import RadarCube as RadarCube
    from .dsp import detect as detect
    from .dsp import process as process
    from .errors import BackendError as BackendError
    from .errors import ConfigError as ConfigError
    from .errors import InputError as InputError
    from .errors import NotFoundError as NotFoundError
    from .errors import ShenronError as ShenronError
    from .frames import Pose as Pose
    from .lidar.frame import LidarFrame as LidarFrame
    from .lidar.read import read_semantic_lidar as read_semantic_lidar
    from .pipeline import Frame as Frame
    from .pipeline import simulate as simulate
    from .pipeline import simulate_all as simulate_all
    from .rcs import RcsSweep as RcsSweep
    from .rcs import sweep_rcs as sweep_rcs
    from .report import write_report as write_report
    from .returns import Returns as Returns
    from .returns import illuminate as illuminate
    from .scatterers import Scatterers as Scatterers
    from .scene.mesh import TaggedMesh as TaggedMesh
    from .scene.readers import read_mesh as read_mesh
    from .scene.rounding import round_mesh as round_mesh
    from .scene.shapes import make_shape as make_shape
    from .synthesis import AdcCube as AdcCube
    from .synthesis import synthesize as synthesize
    from .tags import SemanticTag as SemanticTag
    from .tracing import trace as trace
    from .tracing.lidar import cast_lidar as cast_lidar

_HOME = {
    "AdcCube": "synthesis",
    "BackendError": "errors",
    "BatchPlan": "config.plan",
    "BatchResult": "batch",
    "Comparison": "comparison",
    "ConfigError": "errors",
    "Detections": "dsp",
    "Explanation": "attribution",
    "Frame": "pipeline",
    "InputError": "errors",
    "LidarFrame": "lidar.frame",
    "Material": "config.materials",
    "MaterialTable": "config.materials",
    "NotFoundError": "errors",
    "Pose": "frames",
    "RadarCube": "dsp",
    "RadarProfile": "config.profile",
    "RcsSweep": "rcs",
    "Returns": "returns",
    "Scatterers": "scatterers",
    "Scene": "config.scene",
    "SemanticTag": "tags",
    "ShenronError": "errors",
    "TaggedMesh": "scene.mesh",
    "cast_lidar": "tracing.lidar",
    "compare": "comparison",
    "detect": "dsp",
    "explain": "attribution",
    "illuminate": "returns",
    "load_materials": "config.materials",
    "load_plan": "config.plan",
    "load_profile": "config.profile",
    "load_scene": "config.scene",
    "make_shape": "scene.shapes",
    "process": "dsp",
    "read_mesh": "scene.readers",
    "round_mesh": "scene.rounding",
    "read_semantic_lidar": "lidar.read",
    "run_batch": "batch",
    "simulate": "pipeline",
    "simulate_all": "pipeline",
    "sweep_rcs": "rcs",
    "synthesize": "synthesis",
    "trace": "tracing",
    "write_report": "report",
}

__all__ = [*sorted(_HOME), "__version__"]


def __getattr__(name: str) -> Any:  # what a module attribute is depends on its name
    if name == "__version__":
        return importlib.metadata.version("shenron-rt")
    if name in _HOME:
        value = getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
        globals()[name] = value
        return value
    if name in ("dsp", "physics"):
        return importlib.import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
