"""A small street, rendered once, and what a page about it holds."""

from __future__ import annotations

import html.parser
import json
from pathlib import Path
from typing import Any

import numpy as np

from shenron_rt.cli import main
from shenron_rt.report.arrays import decoded

#: A name that would end a script or open a tag if a page did not escape it.
NASTY = "</script><script>alert(1)</script>&\"'<b>"
SCENE = """
version: 1
name: street
description: A car & a wall
seed: 5
frame_period_s: 0.1
ego: {xyz_m: [10, 5, 0], ypr_deg: [30, 0, 0], velocity_mps: [8.66, 5, 0]}
static:
  - {id: 40, name: wall, shape: "box:10x0.3x3", xyz_m: [24, 18, 1.5], ypr_deg: [30, 0, 0], tag: Walls,
     material: concrete}
actors:
  - {id: 101, name: NAME, shape: "box:4x2x1.5", xyz_m: [29.05, 16, 0.8], ypr_deg: [30, 0, 0],
     velocity_mps: [4.33, 2.5, 0], yaw_rate_deg_s: 5, tag: Car, material: car_paint}
  - {id: 102, name: inside, shape: "box:1x1x1", aim: 500, xyz_m: [-20, -10, 1.5], tag: Other, material: concrete}
  - {id: 103, name: shell, shape: "box:3x3x3", aim: 500, xyz_m: [-20, -10, 1.5], tag: Other, material: concrete}
  - {id: 104, name: saloon, shape: car, xyz_m: [35, 25, 0], ypr_deg: [40, 0, 0], velocity_mps: [5, 4, 0],
     articulation: auto}
point_targets:
  - {id: 900, name: post, xyz_m: [27, 12, 1], rcs_dbsm: 5}
radars:
  - {name: front, profile: awrl1432, xyz_m: [2.0, 0, 1.0]}
  - {name: left, profile: awrl1432, xyz_m: [0.0, 1.0, 1.0], ypr_deg: [40, 0, 0]}
"""
FRAMES = 5


def street_run(folder: Path, name: str = NASTY) -> Path:
    """Render five frames of two radars over a street, by the command line; return the run folder."""
    scene = folder / "street.yaml"
    scene.write_text(SCENE.replace("NAME", json.dumps(name)), encoding="utf-8")
    options = ["--frames", f"0:{FRAMES}", "--rays", "2000", "--no-pictures", "--json"]
    for setting in ("profile.waveform.samples=64", "profile.waveform.chirps=32"):
        options += ["--set", setting]
    assert main(["run", str(scene), "-o", str(folder / "run"), *options]) == 0
    return folder / "run"


class Page(html.parser.HTMLParser):
    """What a page embeds: ``about``, ``arrays`` and ``json`` by name; ``tags`` as (name, attributes)."""

    def __init__(self, file: Path) -> None:
        super().__init__()
        self.text = file.read_text(encoding="utf-8")
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.arrays: dict[str, Any] = {}
        self.json: dict[str, Any] = {}
        self._open: dict[str, str | None] = {}
        self.feed(self.text)
        self.close()

    @property
    def about(self) -> dict[str, Any]:
        """The page's description of the run."""
        found: dict[str, Any] = self.json["about"]
        return found

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._open = dict(attrs) if tag == "script" else {}

    def handle_data(self, data: str) -> None:
        name, kind, shape = (self._open.get(k) for k in ("id", "data-kind", "data-shape"))
        if name and kind and shape:
            self.arrays[name] = decoded(data, kind, shape)
        elif name and self._open.get("type") == "application/json":
            self.json[name] = json.loads(data)
        self._open = {}

    def detections(self, prefix: str, frame: int) -> dict[str, np.ndarray]:
        """Return the columns of the detections of one frame."""
        radar = next(r for r in self.about["radars"] if r["prefix"] == prefix)
        rows = slice(*radar["detections"]["start"][frame : frame + 2])
        table = self.arrays[f"{prefix}.detections"]
        columns = {n: table[i, rows] for i, n in enumerate(self.about["columns"]["detections"])}
        return columns | {"object_id": self.arrays[f"{prefix}.detection_id"][rows]}

    def chains(self, prefix: str, frame: int) -> tuple[list[str], list[bool]]:
        """Return chain and ghost of the detections of one frame."""
        known = next(r for r in self.about["radars"] if r["prefix"] == prefix)["detections"]
        rows = slice(*known["start"][frame : frame + 2])
        chains = [known["chains"][i] for i in self.arrays[f"{prefix}.detection_chain"][rows]]
        return chains, self.arrays[f"{prefix}.detection_ghost"][rows].astype(bool).tolist()
