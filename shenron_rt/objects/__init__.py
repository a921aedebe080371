"""Objects from points: detections gathered to objects, objects tracked over frames, tracks held against the truth."""

from __future__ import annotations

from .clusters import Clusters, ClusterSettings, cluster
from .metrics import Identity, Ospa, identity_metrics, ospa
from .observe import Observation, Truth
from .track import Tracking, TrackRow, observe_frame, observe_run, track
from .tracker import Measurement, Track, Tracker, TrackerSettings

__all__ = [
    "ClusterSettings",
    "Clusters",
    "Identity",
    "Measurement",
    "Observation",
    "Ospa",
    "Track",
    "TrackRow",
    "Tracker",
    "TrackerSettings",
    "Tracking",
    "Truth",
    "cluster",
    "identity_metrics",
    "observe_frame",
    "observe_run",
    "ospa",
    "track",
]
