"""The public C-Shenron pipeline, clean-room: its points, loss, ADC samples, images and detector."""

from __future__ import annotations

from ..echo.shenron import ShenronModel
from .dsp import cartesian_image, cfar, doppler_slice, fblr, range_angle, view_mask
from .model import ShenronRadarModel

__all__ = [
    "ShenronModel", "ShenronRadarModel", "cartesian_image", "cfar", "doppler_slice", "fblr", "range_angle", "view_mask",
]  # fmt: skip
