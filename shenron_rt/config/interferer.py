"""Other radars of a scene that transmit into those that are simulated."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field

from ._base import Placed, Vector3
from .profile import RadarProfile

__all__ = ["Interferer"]


class Interferer(Placed):
    """Another radar: pose of its antenna in the world (it looks along its own +x), and when its frames begin.

    ``start_s`` is the scene time of its first frame; frames follow each other every ``frame_period_s``, that of the
    scene where it is absent. ``tx_power_dbm`` replaces its profile's.
    """

    name: str = "interferer"
    profile: str | Path | RadarProfile = "awrl1432"
    velocity_mps: Vector3 = (0.0, 0.0, 0.0)
    tx_power_dbm: float | None = None
    start_s: float = 0.0
    frame_period_s: Annotated[float, Field(gt=0)] | None = None
