"""The maps of a frame as PNG: those of the run, or drawn now."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from ..run_source import MAPS, RunFrame, RunRadar, RunSource

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["map_pictures"]


def map_pictures(source: RunSource, radar: RunRadar, frame: RunFrame) -> dict[str, bytes]:
    """Return the PNG of every map; none where the run has neither pictures nor cubes.

    The picture that the run drew is taken as it is; drawing one takes a fraction of a second.
    """
    drawn = {name: frame.folder / f"{name}.png" for name in MAPS}
    if all(file.is_file() for file in drawn.values()):
        return {name: file.read_bytes() for name, file in drawn.items()}
    cube = frame.cube(radar.profile)
    if cube is None:
        return {}
    from ..plot import birds_eye, range_doppler
    from ..plot.truth import truth_of

    found, truth = frame.detections(), truth_of(frame.returns(), source.names_of(frame))
    head = f"{source.name}, {radar.name} ({radar.profile.name}), frame {frame.index}"
    figures = {
        "range_doppler": range_doppler(cube, found, truth=truth, title=f"{head} \u2013 range-Doppler"),
        "range_azimuth": birds_eye(cube, found, truth=truth, title=f"{head} \u2013 range-azimuth"),
    }
    return {name: _png(figure) for name, figure in figures.items()}


def _png(figure: Figure) -> bytes:
    file = io.BytesIO()
    # without the date and version that the file would carry: the same frame gives the same bytes
    figure.savefig(file, format="png", pil_kwargs={"compress_level": 3}, metadata={"Software": None})
    return file.getvalue()
