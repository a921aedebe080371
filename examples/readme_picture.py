"""Make the README's pictures: ``python examples/readme_picture.py [FOLDER]``, by default in docs/images.

readme.png: left the scene ``highway`` from above with the power that each place returns, right what the radar makes of
it. braking.png: the range-azimuth picture of ``shenron-rt run braking``.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from PIL import Image

import shenron_rt as srt
from shenron_rt.plot import write_pictures
from shenron_rt.scene.world import World, build_world, load_bodies

IMAGES = Path(__file__).resolve().parents[1] / "docs" / "images"
SCENE = "highway"
REACH_M, SIDE_M = 95.0, 24.0
RING, NAME = "#35e0ff", {"color": "white", "fontsize": 9}


def world_of(scene: srt.Scene, frame: srt.Frame) -> World:
    """Return the scene's triangles in the radar frame."""
    bodies, materials = load_bodies(scene)
    return build_world(scene, scene.radar(frame.radar), frame.time + frame.profile.frame_mid_s, bodies, materials)


def from_above(axes: Axes, frame: srt.Frame, world: World) -> None:
    """Draw mesh outlines and the received power of each place, y to the left."""
    corners = world.vertices[world.faces][:, :, [1, 0]]
    normal_z = np.abs(world.face_normal[:, 2])
    edges = corners[normal_z < 0.99][:, [0, 1, 2, 0]]
    axes.add_collection(LineCollection(list(edges), colors="#8a93a3", linewidths=0.5, alpha=0.8))
    step = 0.5
    bins = (np.arange(-SIDE_M, SIDE_M + step, step), np.arange(0.0, REACH_M + step, step))
    echo = frame.returns
    power, _, _ = np.histogram2d(
        echo.position[:, 1], echo.position[:, 0], bins=bins, weights=np.abs(echo.amplitude) ** 2
    )
    level = 10 * np.log10(np.maximum(power.T, 1e-30)) + 30
    level[level < -200] = np.nan
    axes.pcolormesh(bins[0], bins[1], level, cmap="inferno", vmin=-190, vmax=-105, rasterized=True)
    found = frame.detections
    axes.plot(found.y, found.x, ls="none", marker="o", ms=7, mfc="none", mec=RING, mew=1.0)
    axes.set_xlim(SIDE_M, -SIDE_M)
    axes.set_ylim(0, REACH_M)
    axes.set_aspect("equal")
    axes.set_xlabel("y left [m]")
    axes.set_ylabel("x forward [m]")
    axes.set_title("echoes over the mesh, detections ringed", fontsize=10)


def range_doppler(axes: Axes, figure: Figure, frame: srt.Frame, names: dict[int, str]) -> None:
    """Draw the range-Doppler map with the strongest detection of each object named."""
    cube, found = frame.cube, frame.detections
    level = 10 * np.log10(np.maximum(cube.range_doppler, 1e-30)) + 30
    top = float(np.ceil(level.max()))
    image = axes.pcolormesh(
        cube.velocity_mps,
        cube.range_m,
        level,
        cmap="inferno",
        vmin=np.floor(10 * np.log10(cube.noise_power_w) + 30),
        vmax=top,
        rasterized=True,
    )
    axes.plot(found.velocity, found.range, ls="none", marker="o", ms=7, mfc="none", mec=RING, mew=1.0)
    for number in np.unique(found.object_id[found.object_id > 0]):
        row = int(np.flatnonzero(found.object_id == number)[0])
        at = (found.velocity[row], found.range[row])
        side = -8 if at[0] > 0.6 * cube.velocity_mps[-1] else 8
        truth = frame.scatterers.range_rate[frame.scatterers.object_id == number].mean()
        folded = " (folded)" if abs(found.velocity[row] - truth) > frame.profile.max_velocity_mps else ""
        axes.annotate(
            names[int(number)] + folded,
            at,
            xytext=(side, 5),
            textcoords="offset points",
            ha="left" if side > 0 else "right",
            **NAME,
        )
    axes.set_xlim(-frame.profile.max_velocity_mps - 0.5, frame.profile.max_velocity_mps + 0.5)
    axes.set_ylim(0, REACH_M)
    axes.set_xlabel("range rate [m/s], + receding")
    axes.set_ylabel("range [m]")
    axes.set_title(f"range-Doppler, {frame.profile.name}", fontsize=10)
    figure.colorbar(image, ax=axes, label="dBm", pad=0.02)


def draw() -> Figure:
    """Render the frame and return the picture."""
    scene = srt.load_scene(SCENE)
    frame = srt.simulate(scene)
    figure = Figure(figsize=(10.0, 5.4), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.65))
    for axes in (left, right):
        axes.set_facecolor("#101014")
    from_above(left, frame, world_of(scene, frame))
    range_doppler(right, figure, frame, scene.object_names())
    return figure


def birds_eye(target: Path) -> None:
    """Write the range-azimuth picture of ``braking``, in 256 colours to keep it small."""
    scene = srt.load_scene("braking")
    frame = srt.simulate(scene)
    with tempfile.TemporaryDirectory() as folder:
        write_pictures(Path(folder), frame, names=scene.object_names(), title="braking")
        with Image.open(Path(folder) / "range_azimuth.png") as picture:
            picture.convert("RGB").quantize(256).save(target, optimize=True)


if __name__ == "__main__":
    images = Path(sys.argv[1]) if len(sys.argv) > 1 else IMAGES
    images.mkdir(parents=True, exist_ok=True)
    draw().savefig(images / "readme.png", metadata={"Software": None})
    birds_eye(images / "braking.png")
    for name in ("readme.png", "braking.png"):
        print(f"{images / name}: {(images / name).stat().st_size / 1e3:.0f} kB")
