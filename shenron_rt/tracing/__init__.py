"""Ray tracing: the only place that imports Mitsuba."""

from .trace import trace as trace

__all__ = ["trace"]
