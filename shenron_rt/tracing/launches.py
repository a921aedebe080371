"""Cells on their way to a scene, with the random numbers that belong to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .._parallel import map_blocks
from .._typing import ComplexArray, FloatArray, NDArray
from .launch import Cells

__all__ = ["Launch", "launch_directions"]


@dataclass(frozen=True)
class Launch:
    """Cells, and the generator of the random numbers that belong to each, whatever it will hit."""

    cells: Cells
    generator: np.random.Generator

    def draw(self) -> tuple[ComplexArray, FloatArray]:
        """Return (n,) unit-power complex Gaussian and (n, 2) uniform numbers in [-1, 1]."""
        n = len(self.cells)
        gauss = self.generator.standard_normal((n, 2))
        gauss *= np.sqrt(0.5)
        return gauss.view(np.complex128)[:, 0], self.generator.uniform(-1.0, 1.0, (n, 2))


def launch_directions(launches: list[Launch]) -> NDArray[np.float32]:
    """Return (3, n) float32 directions of all cells of all launches."""
    total = sum(len(launch.cells) for launch in launches)
    directions = np.empty((3, total), dtype=np.float32)
    start = 0
    for launch in launches:
        part = directions[:, start : start + len(launch.cells)]

        def fill(rows: slice, part: NDArray[np.float32] = part, cells: Cells = launch.cells) -> None:
            part[:, rows] = cells.directions_of(rows).T

        map_blocks(fill, len(launch.cells))
        start += len(launch.cells)
    return directions
