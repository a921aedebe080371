"""The four-view composite of one LiDAR frame, as released and corrected: the picture of docs/shenron-model.md.

python examples/shenron_views.py FRAME --side-file META [--tag-table 0.9.14] [-o docs/images/shenron_views.png]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from shenron_rt.cshenron import ShenronRadarModel
from shenron_rt.lidar import LidarFrame, read_semantic_lidar

#: Shown below the strongest pixel [dB].
DYNAMIC_DB = 60.0


def point_list(frame: LidarFrame) -> np.ndarray:
    """Return C-Shenron's (n, 6) list of a frame: ego axes of CARLA, y right, canonical tags."""
    ego = frame.sensor_pose.apply(frame.position) * [1.0, -1.0, 1.0]
    return np.column_stack([ego, frame.cos_incidence, frame.object_id, frame.tag])


def main() -> None:
    """Read a frame, render both composites and draw them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("frame", type=Path)
    parser.add_argument("--side-file", type=Path, required=True, help="sensor pose and actors of the frame")
    parser.add_argument("--tag-table", default="0.9.14")
    parser.add_argument("-o", "--output", type=Path, default=Path("shenron_views.png"))
    options = parser.parse_args()
    frame = read_semantic_lidar(options.frame, tag_table=options.tag_table, frame="carla", side_file=options.side_file)
    points = point_list(frame)
    placed = {"tags": "0.9.14", "grid": frame.grid, "lidar": frame.sensor_pose}

    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(11, 5), layout="constrained")
    for axis, preset, unit in zip(axes, ("as_released", "corrected"), ("counts", "sqrt(W)"), strict=True):
        composite = ShenronRadarModel("ti_cascade", preset, **placed).fblr(points)
        level = 20 * np.log10(np.maximum(composite, 1e-12 * composite.max()))
        shown = axis.imshow(
            level, vmin=level.max() - DYNAMIC_DB, vmax=level.max(), extent=(-37.5, 37.5, -37.5, 37.5), cmap="viridis"
        )
        axis.set(title=f"shenron:{preset}", xlabel="right [m]", ylabel="ahead [m]")
        figure.colorbar(shown, ax=axis, label=f"magnitude [dB re 1 {unit}]")
    figure.savefig(options.output, dpi=70)


if __name__ == "__main__":
    main()
