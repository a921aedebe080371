"""A Foxglove layout that opens an export: 3-D view, maps, range of the strongest detection, link budget, objects."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from ..run_source import RunSource
from .poses import EGO, WORLD

__all__ = ["layout_json"]

#: Colour limits of velocities [m/s] and SNR [dB] of point clouds.
_SPEED_MPS = 15.0


def layout_json(source: RunSource, topics: Sequence[str]) -> str:
    """Return the layout as JSON, in the form that Foxglove and Lichtblick import from a file.

    Parameters
    ----------
    source : RunSource
    topics : sequence of str
        Of the MCAP file; only those get a panel.
    """
    names = [r.name for r in source.radars]
    panels: dict[str, Any] = {"3D!scene": _three_dee(source, topics)}
    pictures = []
    for radar in names:
        for name in ("range_doppler", "range_azimuth"):
            topic = f"/radar/{radar}/{name}"
            if topic in topics:
                pictures.append(f"Image!{radar}_{name}")
                panels[pictures[-1]] = {"imageMode": {"imageTopic": topic}, "foxglovePanelTitle": f"{radar} {name}"}
    panels["Plot!strongest"] = _plot(names)
    panels["RosOut!budget"] = {
        "searchTerms": [], "minLogLevel": 1, "topicToRender": "/link_budget", "foxglovePanelTitle": "Link budget",
    }  # fmt: skip
    tables = []
    for radar in names:
        tables.append(f"Table!{radar}_objects")
        title = f"{radar}: objects, term by term"
        panels[tables[-1]] = {"topicPath": f"/radar/{radar}/objects.objects", "foxglovePanelTitle": title}
    top: Any = "3D!scene"
    if pictures:
        top = _split("row", top, _stack("column", pictures), 62)
    bottom = _split("row", "Plot!strongest", _split("row", "RosOut!budget", _stack("column", tables), 50), 34)
    layout = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("column", top, bottom, 66),
    }
    return json.dumps(layout, indent=2) + "\n"


def _split(direction: str, first: Any, second: Any, percentage: float) -> dict[str, Any]:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": percentage}


def _stack(direction: str, items: Sequence[str]) -> Any:
    """Return equal shares for all items."""
    if len(items) == 1:
        return items[0]
    return _split(direction, items[0], _stack(direction, items[1:]), 100 / len(items))


def _cloud(field: str, low: float, high: float, size: float) -> dict[str, Any]:
    return {
        "visible": True, "colorMode": "colormap", "colorField": field, "colorMap": "turbo",
        "minValue": low, "maxValue": high, "pointSize": size, "pointShape": "circle",
    }  # fmt: skip


def _three_dee(source: RunSource, topics: Sequence[str]) -> dict[str, Any]:
    shown: dict[str, Any] = {}
    for topic in topics:
        if topic.startswith("/lidar/"):
            shown[topic] = _cloud("z", -2.5, 4.0, 1.5)
        elif topic.startswith("/recorded/"):
            shown[topic] = {"visible": True, "colorMode": "flat", "flatColor": "#ff8c1a", "pointSize": 8}
        elif topic.endswith("/points"):
            shown[topic] = _cloud("velocity", -_SPEED_MPS, _SPEED_MPS, 9)
        elif topic == "/scene":
            shown[topic] = {"visible": True}
    return {
        "foxglovePanelTitle": source.name,
        # behind and above the ego vehicle, looking ahead
        "cameraState": {
            "distance": 45, "perspective": True, "phi": 62, "thetaOffset": 90, "fovy": 45, "near": 0.5, "far": 5000,
            "target": [0, 0, 0], "targetOffset": [12, 0, 0], "targetOrientation": [0, 0, 0, 1],
        },
        "followMode": "follow-pose",
        "followTf": EGO,
        "fixedFrame": WORLD,
        "scene": {"backgroundColor": "#15181e", "transforms": {"axisScale": 0.8, "showLabel": True, "labelSize": 0.1}},
        "transforms": {},
        "topics": shown,
        "layers": {"grid": {"layerId": "foxglove.Grid", "visible": True, "frameId": EGO, "size": 100, "divisions": 10}},
    }  # fmt: skip


def _plot(radars: Sequence[str]) -> dict[str, Any]:
    paths = [
        {
            "value": f"/radar/{radar}/strongest.range_m", "label": f"{radar}: range of the strongest [m]",
            "enabled": True, "timestampMethod": "receiveTime",
        }
        for radar in radars
    ]  # fmt: skip
    return {
        "paths": paths, "foxglovePanelTitle": "Range of the strongest detection", "showXAxisLabels": True,
        "showYAxisLabels": True, "showLegend": True, "legendDisplay": "floating", "isSynced": True,
        "xAxisVal": "timestamp", "minYValue": 0,
    }  # fmt: skip
