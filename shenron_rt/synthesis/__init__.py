"""Returns -> AdcCube."""

from .adc import AdcCube
from .synthesize import synthesize

__all__ = ["AdcCube", "synthesize"]
