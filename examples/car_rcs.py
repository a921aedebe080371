"""Measure the echo of a car round the full circle: ``python examples/car_rcs.py``; ``--write`` makes the docs' picture.

Prints the table of docs/car-rcs.md. ``--mesh FILE --lift M`` measures another vehicle (ROS axes, metres) beside it.
A degree of aspect at one height takes about 0.1 s; the default, three heights in steps of 1 deg, a few minutes.
"""

from __future__ import annotations

import argparse
import logging
from pathlib import Path

import numpy as np

import shenron_rt as srt

ROOT = Path(__file__).resolve().parents[1]
PROFILE = srt.load_profile("awrl1432")
DISTANCE_M = 25.0
# The reference point of "apparent RCS": the middle of the car, at the height where it is widest.
CENTRE_HEIGHT_M = 0.65
AIM_RAYS = 20_000

# 3GPP TR 38.901 (Release 19, sensing), vehicle with distinct lobes: mean level and the lobes' maxima [dBsm], and the
# spread [dB] inside which the bundled car shall stay.
MEAN_DBSM, SPREAD_DB = 11.25, 3.41
LOBES = {"left": (90.0, 20.8), "right": (270.0, 20.8), "front": (0.0, 15.5), "back": (180.0, 14.6)}
SECTOR_DEG = 15.0


def received(height: float, **content: object) -> float:
    """Return the power of object 1 in the frame of a radar at the origin, ``height`` above ground [W]."""
    radar = {"name": "r", "profile": "awrl1432", "xyz_m": (0, 0, height)}
    scene = srt.Scene(radars=[radar], **content)
    returns = srt.illuminate(srt.trace(scene, PROFILE, rays=2_000, seed=1), PROFILE)
    return returns.power_by_object().get(1, 0.0)


def pattern(vehicle: dict[str, object], azimuth_deg: np.ndarray, height: float, lift: float = 0.0) -> np.ndarray:
    """Return the apparent RCS [m^2] for directions of the radar seen from the vehicle (0 = ahead, + left).

    The vehicle turns; a point target of 1 m^2 in its place gives the scale, so that antenna, power and radome drop out.
    """
    point = {"id": 1, "xyz_m": (DISTANCE_M, 0, CENTRE_HEIGHT_M), "rcs_dbsm": 0}
    scale = received(height, point_targets=[point])
    actor = {"id": 1, "name": "vehicle", "xyz_m": (DISTANCE_M, 0, lift), "aim": AIM_RAYS, **vehicle}
    turned = [received(height, actors=[{**actor, "ypr_deg": (180 - a, 0, 0)}]) for a in azimuth_deg]
    return np.array(turned) / scale


def figures(azimuth_deg: np.ndarray, sigma: np.ndarray) -> dict[str, float]:
    """Return the median over the circle and the maximum in +-15 deg about each lobe [dBsm]."""
    level = 10 * np.log10(np.maximum(sigma, 1e-12))
    found = {"median": float(np.median(level))}
    for name, (centre, _) in LOBES.items():
        off = np.abs((azimuth_deg - centre + 180) % 360 - 180)
        found[name] = float(level[off <= SECTOR_DEG + 1e-9].max())
    return found


def row(label: str, found: dict[str, float]) -> str:
    """Return a table row, values outside the band marked with an exclamation mark."""
    bands = {"median": MEAN_DBSM} | {name: level for name, (_, level) in LOBES.items()}
    cells = [f"{v:.1f}{'' if abs(v - bands[k]) <= SPREAD_DB else ' !'}" for k, v in found.items()]
    return f"| {label} | {' | '.join(cells)} |"


def draw(azimuth_deg: np.ndarray, curves: dict[str, np.ndarray], file: Path) -> None:
    """Draw RCS over aspect with the bands."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(9, 4.2), layout="constrained")
    axes.axhspan(MEAN_DBSM - SPREAD_DB, MEAN_DBSM + SPREAD_DB, color="0.9", label="median shall lie here")
    for centre, level in LOBES.values():
        x = np.array([centre - SECTOR_DEG, centre + SECTOR_DEG])
        axes.fill_between(x, level - SPREAD_DB, level + SPREAD_DB, color="tab:orange", alpha=0.25, lw=0)
    axes.fill_between([345, 360], 15.5 - SPREAD_DB, 15.5 + SPREAD_DB, color="tab:orange", alpha=0.25, lw=0)
    axes.fill_between([], [], [], color="tab:orange", alpha=0.25, label="maximum shall lie here")
    for label, sigma in curves.items():
        axes.plot(azimuth_deg, 10 * np.log10(np.maximum(sigma, 1e-3)), lw=1, label=label)
    axes.set(xlim=(0, 360), ylim=(-5, 30), xticks=range(0, 361, 45))
    axes.set(xlabel="direction of the radar seen from the car [deg], 0 = ahead, + left", ylabel="apparent RCS [dBsm]")
    axes.set_title(f"Bundled car, {PROFILE.name}, {DISTANCE_M:g} m, no ground")
    axes.grid(alpha=0.3)
    axes.legend(ncols=3, fontsize=8)
    figure.savefig(file, dpi=110)
    plt.close(figure)


def main() -> None:
    """Measure, print, and draw where asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--step", type=float, default=1.0, help="step of the aspect [deg]")
    parser.add_argument("--heights", type=float, nargs="+", default=[0.5, 0.75, 1.0], help="of the radar [m]")
    parser.add_argument("--shape", default="car")
    parser.add_argument("--mesh", help="another vehicle to measure beside it")
    parser.add_argument("--lift", type=float, default=0.0, help="of that mesh above the ground [m]")
    parser.add_argument("--write", action="store_true", help="write docs/images/car_rcs.png")
    args = parser.parse_args()
    logging.disable(logging.WARNING)
    azimuth = np.arange(0.0, 360.0, args.step)
    print("| vehicle, radar height | median | left | right | front | back |")
    print("|---|---|---|---|---|---|")
    bounds = " | ".join(f"{level:g} ± {SPREAD_DB}" for level in (MEAN_DBSM, *(level for _, level in LOBES.values())))
    print(f"| wanted | {bounds} |")
    curves = {}
    for height in args.heights:
        curves[f"{height:g} m"] = pattern({"shape": args.shape}, azimuth, height)
        print(row(f"{args.shape}, {height:g} m", figures(azimuth, curves[f"{height:g} m"])), flush=True)
        if args.mesh:
            other = {"mesh": str(Path(args.mesh).resolve()), "mesh_frame": "ros_z_up", "tag": "Car"}
            sigma = pattern(other, azimuth, height, args.lift)
            print(row(f"{Path(args.mesh).stem}, {height:g} m", figures(azimuth, sigma)), flush=True)
    if args.write:
        draw(azimuth, curves, ROOT / "docs" / "images" / "car_rcs.png")


if __name__ == "__main__":
    main()
