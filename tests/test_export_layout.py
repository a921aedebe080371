"""The Foxglove layout names topics and fields that the file has, and settings that the panels know."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from export_tools import read_mcap

from shenron_rt.cli import main

pytest.importorskip("foxglove", reason="foxglove-sdk is not installed (extra mcap)")


@pytest.fixture(scope="module")
def drive(street_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("layout") / "drive.mcap"
    assert main(["export", str(street_run), "--to", "mcap", "-o", str(path), "--lidar"]) == 0
    return path


@pytest.fixture(scope="module")
def layout(drive: Path) -> dict[str, Any]:
    return json.loads(drive.with_name("drive.layout.json").read_text())


def _leaves(node: Any) -> list[str]:
    if isinstance(node, str):
        return [node]
    assert set(node) == {"direction", "first", "second", "splitPercentage"}
    assert node["direction"] in ("row", "column")
    assert 0 < node["splitPercentage"] < 100
    return _leaves(node["first"]) + _leaves(node["second"])


def test_every_panel_stands_in_the_layout_once(layout: dict[str, Any]) -> None:
    assert sorted(_leaves(layout["layout"])) == sorted(layout["configById"])
    kinds = {name.split("!")[0] for name in layout["configById"]}
    assert kinds == {"3D", "Image", "Plot", "RosOut", "Table"}


def test_panels_show_topics_and_fields_of_the_file(drive: Path, layout: dict[str, Any]) -> None:
    topics = read_mcap(drive)
    panels = layout["configById"]
    shown = panels["3D!scene"]["topics"]
    assert set(shown) == {"/scene", "/radar/front/points", "/lidar/roof/points"}
    for topic, settings in shown.items():
        if "colorField" in settings:
            assert settings["colorField"] in {f.name for f in topics[topic][0].message.fields}
    frames = {f for t in topics["/tf"][0].message.transforms for f in (t.parent_frame_id, t.child_frame_id)}
    assert {panels["3D!scene"]["followTf"], panels["3D!scene"]["fixedFrame"]} <= frames
    images = {p["imageMode"]["imageTopic"] for name, p in panels.items() if name.startswith("Image!")}
    assert images == {"/radar/front/range_doppler", "/radar/front/range_azimuth"} <= set(topics)
    paths = [p["value"] for p in panels["Plot!strongest"]["paths"]] + [panels["Table!front_objects"]["topicPath"]]
    for path in paths:
        topic, field = re.fullmatch(r"(/[^.]+)\.(\w+)", path).groups()
        assert field in topics[topic][0].message
    assert panels["RosOut!budget"]["topicToRender"] in topics


def test_settings_are_those_of_foxgloves_own_description_of_its_panels(layout: dict[str, Any]) -> None:
    layouts = pytest.importorskip("foxglove.layouts")
    described = {
        "3D": layouts.ThreeDeeConfig,
        "Image": layouts.ImageConfig,
        "Plot": layouts.PlotConfig,
        "RosOut": layouts.LogConfig,
        "Table": layouts.TableConfig,
    }
    for name, settings in layout["configById"].items():
        own = {k: v for k, v in settings.items() if k != "foxglovePanelTitle"}  # stands beside them in a layout file
        # an unknown setting is a TypeError here
        described[name.split("!")[0]](**{_snake(k): v for k, v in own.items()})
    cloud = layout["configById"]["3D!scene"]["topics"]["/radar/front/points"]
    layouts.BaseRendererPointCloudTopicSettings(**{_snake(k): v for k, v in cloud.items()})
    layouts.ThreeDeeCameraState(**{_snake(k): v for k, v in layout["configById"]["3D!scene"]["cameraState"].items()})


def _snake(name: str) -> str:
    return re.sub(r"(?<!^)(?=[A-Z])", "_", name).lower()
