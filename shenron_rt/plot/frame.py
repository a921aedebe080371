"""All pictures of one frame."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from .._typing import FloatArray, IntArray
from ._style import save
from .birds_eye import birds_eye
from .range_doppler import range_doppler
from .range_profile import range_profile
from .top_view import top_view
from .truth import truth_of

if TYPE_CHECKING:
    from ..run_summary import FrameLike

__all__ = ["write_pictures"]


def write_pictures(
    folder: Path,
    frame: FrameLike,
    *,
    names: Mapping[int, str] | None = None,
    mesh: tuple[FloatArray, IntArray] | None = None,
    title: str = "",
) -> list[Path]:
    """Write ``range_profile.png``, ``range_doppler.png``, ``range_azimuth.png`` and, with scatterers, ``top_view.png``.

    Parameters
    ----------
    folder : path
    frame : Frame, or a processed capture without scatterers
    names : mapping of int to str, optional
        Names of the objects by id.
    mesh : ((v, 3) float, (f, 3) int), optional
        The scene's triangles in the radar frame [m].
    title : str
        What the run is; stands before the name of each picture.

    Returns
    -------
    list of Path
    """
    from ..dsp import noise_threshold

    cube, found = frame.cube, frame.detections
    searched = cube.bursts[0] if cube.bursts else cube
    returns = getattr(frame, "returns", None)
    truth = truth_of(returns, names)
    if returns is not None and not returns.calibrated:
        title = f"{title} (released counts, not dBm)".strip()
    head = f"{title} \u2013 " if title else ""
    figures = {
        "range_profile": range_profile(
            searched,
            found,
            threshold=noise_threshold(searched, pfa=cube.profile.processing.pfa),
            truth=truth,
            title=f"{head}range profile",
        ),
        "range_doppler": range_doppler(cube, found, truth=truth, title=f"{head}range-Doppler"),
        "range_azimuth": birds_eye(cube, found, truth=truth, title=f"{head}range-azimuth"),
    }
    scatterers = getattr(frame, "scatterers", None)
    if scatterers is not None:
        figures["top_view"] = top_view(
            scatterers,
            getattr(frame, "returns", None),
            found,
            mesh=mesh,
            reach_m=cube.profile.max_range_m,
            title=f"{head}scatterers, top view",
        )
    return [save(figure, folder / f"{name}.png") for name, figure in figures.items()]
