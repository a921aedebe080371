"""One seed per run, one generator per (frame, radar, stage).

A stage draws from its own stream, so that adding a draw in one stage never shifts another, and a frame's numbers do
not depend on which frames were rendered before it or by how many workers.
"""

from __future__ import annotations

import zlib

import numpy as np

__all__ = ["frame_generator"]


def frame_generator(seed: int, frame: int, radar: str, stage: str) -> np.random.Generator:
    """Return the generator of one stage of one frame of one radar.

    Parameters
    ----------
    seed : int
        Seed of the run, >= 0.
    frame : int
        Frame index, >= 0.
    radar : str
        Name of the radar; ``""`` where there is only a profile.
    stage : str
        What draws: ``"rays"``, ``"speckle"``, ``"noise"`` ...

    Returns
    -------
    numpy.random.Generator
    """
    words = (int(frame), zlib.crc32(radar.encode()), zlib.crc32(stage.encode()))
    return np.random.default_rng(np.random.SeedSequence(entropy=int(seed), spawn_key=words))
