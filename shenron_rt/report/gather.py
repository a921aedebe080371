"""All that a page says of one radar, each file of the run read once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from .._typing import FloatArray
from ..plot.truth import Truth, truth_of
from ..run_source import RunRadar, RunSource
from .arrays import Arrays
from .maps import MapPools, add_maps
from .points import add_detections, add_echoes, sampled_echoes
from .settings import profile_record
from .truth import add_truth

if TYPE_CHECKING:
    from ..dsp import Detections
    from .geometry import SceneMeshes

__all__ = ["Limits", "radar_record"]


class Limits(NamedTuple):
    """What a page takes: cells of a map, and echoes of a frame."""

    map_cells: float
    frame_echoes: int


class _Frame(NamedTuple):
    """What is kept of one frame."""

    detections: Detections | None
    levels: dict[str, FloatArray]
    truth: list[Truth]
    echoes: tuple[FloatArray, FloatArray, int] | None


def radar_record(
    arrays: Arrays,
    prefix: str,
    source: RunSource,
    radar: RunRadar,
    meshes: SceneMeshes | None,
    limits: Limits,
    progress: Callable[[str], object],
) -> dict[str, Any]:
    """Add the arrays of one radar to a page and return the rest.

    Parameters
    ----------
    arrays : Arrays
    prefix : str
        That the names of its arrays begin with.
    source : RunSource
    radar : RunRadar
    meshes : SceneMeshes, optional
        Of the scene, where there is one.
    limits : Limits
    progress : callable
        Called with a phrase before each frame.
    """
    pools = MapPools(limits.map_cells)
    names = {} if source.scene is None else source.scene.object_names()
    seen: list[_Frame] = []
    for frame in radar.frames:
        progress(f"{radar.name} frame {frame.index}")
        returns = frame.returns()
        seen.append(
            _Frame(
                frame.detections() if frame.has("detections.csv") else None,
                pools.levels(frame.maps()),
                truth_of(returns, names),
                sampled_echoes(returns, limits.frame_echoes),
            )
        )
    bodies, middles = ([], {}) if meshes is None else meshes.add_poses(arrays, prefix, radar)
    return {
        "name": radar.name,
        "prefix": prefix,
        "profile": profile_record(radar.profile),
        "mount": {"xyz_m": radar.mount.xyz, "ypr_deg": radar.mount.ypr_deg},
        "frames": [{"frame": f.index, "time_s": f.start_s, "mid_s": f.mid_s} for f in radar.frames],
        "maps": add_maps(arrays, prefix, radar.profile, pools, [f.levels for f in seen]),
        "detections": add_detections(arrays, prefix, [f.detections for f in seen]),
        "echoes": add_echoes(arrays, prefix, [f.echoes for f in seen]),
        "objects": add_truth(arrays, prefix, radar, names, _truths(seen), middles),
        "bodies": bodies,
    }


def _truths(seen: Sequence[_Frame]) -> list[list[Truth]]:
    return [frame.truth for frame in seen]
