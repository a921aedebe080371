"""Draw the data flow of the package: ``python examples/data_flow.py`` writes docs/images/data_flow.png."""

from __future__ import annotations

import sys
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

IMAGE = Path(__file__).resolve().parents[1] / "docs" / "images" / "data_flow.png"

# name, what it holds, x, y
VALUES = [
    ("Scene", "meshes, tags, actors,\nradars, weather, seed", 0.0, 1.6),
    ("Scatterers", "x y z  v  cos  id  tag\narea, material, footprint", 2.35, 1.6),
    ("Returns", "complex amplitude √W,\nposition, velocity", 4.7, 1.6),
    ("AdcCube", "chirp × antenna × sample,\nnoise, bits", 4.7, 0.0),
    ("RadarCube", "range × velocity × channel,\nmaps and axes", 2.35, 0.0),
    ("Detections", "range, velocity, angle,\nSNR, RCS, truth", 0.0, 0.0),
]
# from, to, function, where it lives
STAGES = [
    ("Scene", "Scatterers", "trace", "tracing"),
    ("Scatterers", "Returns", "illuminate", "echo, physics"),
    ("Returns", "AdcCube", "synthesize", "synthesis"),
    ("AdcCube", "RadarCube", "process", "dsp"),
    ("RadarCube", "Detections", "detect", "dsp"),
]
WIDTH, HEIGHT = 1.55, 0.85
INK, FILL, SIDE = "#1f4e79", "#eaf1f8", "#fbf3e4"


def draw() -> Figure:
    """Return the picture."""
    figure = Figure(figsize=(9.6, 4.4), dpi=110)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_xlim(-0.15, 6.4)
    axes.set_ylim(-0.62, 3.2)
    axes.axis("off")
    place = {name: (x, y) for name, _, x, y in VALUES}

    def box(x: float, y: float, width: float, height: float, color: str) -> None:
        shape = FancyBboxPatch((x, y), width, height, boxstyle="round,pad=0.03", fc=color, ec=INK, lw=1.2)
        axes.add_patch(shape)

    def arrow(start: tuple[float, float], end: tuple[float, float]) -> None:
        axes.add_patch(FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=14, color=INK, lw=1.4))

    for name, text, x, y in VALUES:
        box(x, y, WIDTH, HEIGHT, FILL)
        axes.text(x + WIDTH / 2, y + 0.66, name, ha="center", va="center", fontsize=12, weight="bold", color=INK)
        axes.text(x + WIDTH / 2, y + 0.27, text, ha="center", va="center", fontsize=8.5)
    for source, target, verb, home in STAGES:
        (x0, y0), (x1, y1) = place[source], place[target]
        if y0 == y1:
            step = 1 if x1 > x0 else -1
            edge = x0 + (WIDTH + 0.05 if step > 0 else -0.05)
            end = x1 + (-0.05 if step > 0 else WIDTH + 0.05)
            arrow((edge, y0 + HEIGHT / 2), (end, y0 + HEIGHT / 2))
            middle = (edge + end) / 2
            axes.text(middle, y0 + 0.55, verb, ha="center", va="bottom", fontsize=10, family="monospace")
            axes.text(middle, y0 + 0.32, home, ha="center", va="top", fontsize=7.5, color="#666666")
        else:
            x = x0 + WIDTH / 2
            arrow((x, y0 - 0.05), (x, y1 + HEIGHT + 0.05))
            axes.text(
                x + 0.08, (y0 + y1 + HEIGHT) / 2 + 0.03, verb, ha="left", va="bottom", fontsize=10, family="monospace"
            )
            axes.text(x + 0.08, (y0 + y1 + HEIGHT) / 2 - 0.03, home, ha="left", va="top", fontsize=7.5, color="#666666")

    box(2.35, 2.85, WIDTH + 2.35, 0.24, SIDE)
    axes.text(4.3, 2.97, "RadarProfile: waveform, array, antenna, receiver", ha="center", va="center", fontsize=9)
    for name in ("Scatterers", "Returns"):
        x = place[name][0] + WIDTH / 2
        arrow((x, 2.80), (x, place[name][1] + HEIGHT + 0.05))
    note = "Scatterers and all that follows: frame of one radar, mid-frame"
    axes.text(0.0, 1.22, note, fontsize=9, color="#666666", ha="left", va="center", style="italic")
    axes.text(
        3.125, -0.42, "run folder: config, summary, npz, csv, pictures   (shenron-rt run)", ha="center", fontsize=9
    )
    for name in ("Detections", "RadarCube", "AdcCube"):
        x = place[name][0] + WIDTH / 2
        arrow((x, -0.06), (x, -0.26))
    box(0.0, -0.52, 6.25, 0.24, SIDE)
    return figure


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGE
    target.parent.mkdir(parents=True, exist_ok=True)
    draw().savefig(target, metadata={"Software": None})
    print(target)
