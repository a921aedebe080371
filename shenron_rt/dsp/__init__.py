"""Radar signal processing: windows, spectra, angles, CFAR, detections."""

from __future__ import annotations

from .angle import bartlett, bartlett_2d, capon, covariance, music, steering
from .cfar import cfar_statistic, cfar_threshold
from .cfar_constants import cfar_alpha, cfar_pfa
from .cfar_design import CfarWindow
from .cube import RadarCube, process
from .detect import detect, noise_threshold
from .detections import DETECTION_DTYPE, Detections
from .windows import WINDOWS, WindowFigures, window, window_figures

__all__ = [
    "DETECTION_DTYPE",
    "WINDOWS",
    "CfarWindow",
    "Detections",
    "RadarCube",
    "WindowFigures",
    "bartlett",
    "bartlett_2d",
    "capon",
    "cfar_alpha",
    "cfar_pfa",
    "cfar_statistic",
    "cfar_threshold",
    "covariance",
    "detect",
    "music",
    "noise_threshold",
    "process",
    "steering",
    "window",
    "window_figures",
]
