"""Pictures of the data classes. Matplotlib is imported when a figure is made, and no display or backend is touched."""

from __future__ import annotations

from .antenna import antenna_cuts
from .birds_eye import birds_eye
from .explain import explain_waterfall
from .frame import write_pictures
from .range_doppler import range_doppler
from .range_profile import range_profile
from .top_view import top_view
from .tracks import track_view

__all__ = [
    "antenna_cuts", "birds_eye", "explain_waterfall", "range_doppler", "range_profile", "top_view", "track_view",
    "write_pictures",
]  # fmt: skip
