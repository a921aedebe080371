"""Colours of a page: perceptually uniform for power, diverging with a white zero for velocity."""

from __future__ import annotations

import numpy as np

from .._typing import FloatArray, IntArray

__all__ = ["diverging", "sequential"]


def sequential() -> IntArray:
    """Return viridis, (256, 3) uint8."""
    from matplotlib import colormaps

    colours: FloatArray = colormaps["viridis"](np.arange(256))[:, :3]
    return np.asarray(np.rint(colours * 255), dtype=np.uint8)


def diverging() -> IntArray:
    """Return blue over white to red, (255, 3) uint8: the middle, 127, is white, so that what stands has no colour.

    Approaching is blue, receding red, as light is shifted.
    """
    from matplotlib import colormaps

    side = np.linspace(0, 0.5, 128)
    lut = np.concatenate([colormaps["RdBu_r"](side)[:, :3], colormaps["RdBu_r"](1 - side[-2::-1])[:, :3]])
    # the map's own middle is a light grey: lift each colour by what its lightness is short of there
    weight = 1 - np.abs(np.linspace(-1, 1, 255))
    lifted = lut + (1 - lut[127]) * weight[:, None] ** 4
    return np.asarray(np.rint(np.clip(lifted, 0, 1) * 255), dtype=np.uint8)
