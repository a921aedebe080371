"""A run as one HTML page: scene, maps, points, objects and settings, without anything from outside."""

from __future__ import annotations

from .write import write_report

__all__ = ["write_report"]
