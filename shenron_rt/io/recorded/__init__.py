"""Recorded radar data that stands beside ours: hardware logs and CARLA's own radar."""

from __future__ import annotations

from .carla_radar import read_carla_radar
from .point_cloud import PointCloud
from .ti_tlv import TiLog, read_ti_tlv, write_ti_tlv

__all__ = ["PointCloud", "TiLog", "read_carla_radar", "read_ti_tlv", "write_ti_tlv"]
