"""The frames of a run in the order of their time stamps, with the poses of the scene at each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from ..run_source import RunFrame, RunRadar, RunSource
from .poses import PlacedBody, ScenePoses, Transform, identity_ego

__all__ = ["EPOCH_S", "Moment", "stamp_ns", "timeline"]

#: Scene second 0 in files whose time stamps count from 1970 [s]: 2001-09-09 01:46:40 UTC. Not 0, which ROS reads as
#: "the newest there is"; a round number, so that the scene's seconds can be read off a stamp.
EPOCH_S = 1_000_000_000


def stamp_ns(time_s: float, epoch_s: int = EPOCH_S) -> int:
    """Return scene seconds as nanoseconds since 1970."""
    return epoch_s * 1_000_000_000 + round(time_s * 1e9)


@dataclass(frozen=True)
class Moment:
    """One frame of one radar and where everything is at its middle.

    Parameters
    ----------
    radar : RunRadar
    frame : RunFrame
    first : bool
        The first of the run.
    leading : bool
        Of the first radar: what stands beside the radars comes once a frame, with it.
    """

    radar: RunRadar
    frame: RunFrame
    first: bool
    leading: bool
    _poses: ScenePoses | None = field(repr=False)

    @property
    def knows_world(self) -> bool:
        """Whether the run has a scene."""
        return self._poses is not None

    def ego(self) -> Transform:
        """Return the ego frame in the world; of a run without a scene it is the world."""
        return identity_ego() if self._poses is None else self._poses.ego(self.frame.mid_s)

    def bodies(self, *, moving: bool) -> list[PlacedBody]:
        """Return the moving or the static bodies of the scene; none of a run without one."""
        return [] if self._poses is None else self._poses.bodies(self.frame.mid_s, moving=moving)


def timeline(source: RunSource, step: Callable[[str], None] | None = None) -> Iterator[Moment]:
    """Yield the frames of all radars by rising time stamp; ``step`` is told of each when it is done with."""
    poses = None if source.scene is None else ScenePoses(source.scene)
    for count, (radar, frame) in enumerate(source.in_order()):
        yield Moment(radar, frame, count == 0, radar is source.radars[0], poses)
        if step is not None:
            step(f"{radar.name} frame {frame.index}")
