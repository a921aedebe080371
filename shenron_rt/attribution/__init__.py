"""Attribution: what became of every object's echo, from the transmitter to the verdict."""

from __future__ import annotations

from .contributions import Contributions
from .explain import Explanation, explain
from .records import FrameExplanation, ObjectExplanation, Share, Stage, Verdict, Waterfall

__all__ = [
    "Contributions",
    "Explanation",
    "FrameExplanation",
    "ObjectExplanation",
    "Share",
    "Stage",
    "Verdict",
    "Waterfall",
    "explain",
]
