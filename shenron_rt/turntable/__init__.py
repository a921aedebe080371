"""What is made of a turntable sweep: statistics over aspect, range profiles, images, convergence, plans, references."""

from __future__ import annotations

from .convergence import Convergence, ConvergenceStep, converge
from .imaging import IsarImage, RangeProfile, isar_image, range_profile
from .plan import SweepPlan, plan_sweep
from .reference import Reference, reference_of
from .statistics import AngularStatistics, angular_statistics

__all__ = [
    "AngularStatistics",
    "Convergence",
    "ConvergenceStep",
    "IsarImage",
    "RangeProfile",
    "Reference",
    "SweepPlan",
    "angular_statistics",
    "converge",
    "isar_image",
    "plan_sweep",
    "range_profile",
    "reference_of",
]
