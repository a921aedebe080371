"""Compare the two doors of one scene: ``python examples/lidar_convergence.py``; ``--write`` makes the docs' picture.

A semantic LiDAR of our own stands at the radar and its density is raised from 1x to 100x. Prints the tables of
docs/lidar-twin.md: incoherent power per object against the mesh door (linear means over the seeds), what changes with
what a LiDAR knows and where it stands, and whether brightness depends on its channels. A few minutes;
``--seeds 3 --densities 1,4`` takes seconds.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

import shenron_rt as srt
from shenron_rt.config.scene import LidarMount
from shenron_rt.lidar import lidar_scatterers

ROOT = Path(__file__).resolve().parents[1]
PROFILE = srt.load_profile("awrl1432")
RADAR = srt.Pose((2.0, 0.0, 1.0))
ROOF = srt.Pose((0.0, 0.0, 2.5))
#: 1x: 64 channels over 100 degrees, which hold the radar's pattern down to -40 dB, and as wide a step in azimuth.
CHANNELS, UPPER_DEG, LOWER_DEG = 64, 40.0, -60.0
RAYS = 100_000
NAMES = {1: "road", 2: "wall", 3: "post", 101: "car", 102: "walker"}

Powers = dict[int, float]


def scene() -> srt.Scene:
    """Return a street with one thing of each kind; everything has an id of its own and stands."""
    post = {"id": 3, "xyz_m": (12, 3, 2), "aim": 20_000}
    return srt.Scene(
        name="street",
        static=[
            {"id": 1, "shape": "ground:120x30", "xyz_m": (62, 0, 0), "tag": "Roads", "material": "asphalt"},
            {"id": 2, "shape": "box:30x0.3x3", "xyz_m": (25, 6, 1.5), "tag": "Walls", "material": "concrete"},
            {**post, "shape": "cylinder:r=0.15,l=4", "tag": "Poles", "material": "concrete"},
        ],
        actors=[
            {"id": 101, "shape": "car", "xyz_m": (14, 0, 0), "aim": 20_000},
            {"id": 102, "shape": "pedestrian", "xyz_m": (9, -3, 0), "aim": 20_000},
        ],
        radars=[{"name": "front", "profile": PROFILE, "xyz_m": RADAR.xyz}],
    )


def incoherent(scatterers: srt.Scatterers) -> Powers:
    """Return the incoherent power of every object [W]."""
    returns = srt.illuminate(scatterers, PROFILE)
    power = np.where(returns.coherent, 0.0, np.abs(returns.amplitude) ** 2)
    return {i: float(power[returns.object_id == i].sum()) for i in NAMES}


def mean(power: Callable[[int], Powers], seeds: int) -> Powers:
    """Return linear means over the seeds."""
    drawn = [power(seed) for seed in range(seeds)]
    return {i: float(np.mean([d[i] for d in drawn])) for i in NAMES}


def lidar_at(pose: srt.Pose, channels: int, step_deg: float, seed: int, **span: float) -> LidarMount:
    """Return a LiDAR whose grid is turned by a random part of its cell, as the radar's rays are."""
    upper, lower = span.get("upper", UPPER_DEG), span.get("lower", LOWER_DEG)
    cell = (upper - lower) / (channels - 1)
    yaw, pitch = np.random.default_rng(seed).uniform(-0.5, 0.5, 2) * (step_deg, cell)
    return LidarMount(
        xyz_m=pose.xyz, ypr_deg=(yaw, pitch, 0.0), channels=channels, upper_deg=upper, lower_deg=lower, range_m=200.0,
        points_per_second=round(360.0 / step_deg) * channels * 10,
    )  # fmt: skip


def through_lidar(place: srt.Scene, mount: LidarMount, seed: int, **carried: bool) -> Powers:
    """Return the incoherent powers that the second door gives."""
    frame = srt.cast_lidar(place, mount, time=PROFILE.frame_mid_s, **carried)
    return incoherent(lidar_scatterers(frame, PROFILE, RADAR, seed=seed))


def decibels(power: Powers, reference: Powers) -> list[float]:
    """Return power over reference of every object [dB]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return [float(10 * np.log10(np.float64(power[i]) / reference[i])) for i in NAMES]


def show(title: str, rows: Sequence[tuple[str, Sequence[float]]]) -> None:
    """Print a Markdown table."""
    print(f"\n| {title} | {' | '.join(NAMES.values())} |\n|---|{'---|' * len(NAMES)}")
    for name, values in rows:
        print(f"| {name} | {' | '.join(f'{v:+.2f}' if np.isfinite(v) else 'none' for v in values)} |")


def convergence(place: srt.Scene, mesh: Powers, densities: Sequence[int], seeds: int) -> list[list[float]]:
    """Return the deviation of the LiDAR door from the mesh door for each density [dB]."""
    curve = []
    for density in densities:
        channels = round(CHANNELS * np.sqrt(density))
        step = (UPPER_DEG - LOWER_DEG) / (channels - 1)

        def power(seed: int, channels: int = channels, step: float = step) -> Powers:
            return through_lidar(place, lidar_at(RADAR, channels, step, seed), seed, materials=True)

        curve.append(decibels(mean(power, seeds), mesh))
    return curve


def causes(place: srt.Scene, mesh: Powers, seeds: int) -> list[tuple[str, list[float]]]:
    """Return what each thing a LiDAR does not know is worth, at 16x."""
    channels, step = CHANNELS * 4, (UPPER_DEG - LOWER_DEG) / (CHANNELS * 4 - 1)

    def seen(pose: srt.Pose, **carried: bool) -> list[float]:
        return decibels(
            mean(lambda s: through_lidar(place, lidar_at(pose, channels, step, s), s, **carried), seeds), mesh
        )

    def whole(seed: int) -> Powers:
        found = srt.illuminate(srt.trace(place, PROFILE, seed=seed, rays=RAYS), PROFILE).power_by_object()
        return {i: found.get(i, 0.0) for i in NAMES}

    return [
        ("LiDAR at the radar, materials carried", seen(RADAR, materials=True)),
        (
            "... and normals: mirror-like part added",
            seen(RADAR, materials=True, normals=True),
        ),
        ("LiDAR at the radar, tags alone", seen(RADAR)),
        ("LiDAR on the roof, materials carried", seen(ROOF, materials=True)),
        ("mesh door with its coherent part", decibels(mean(whole, seeds), mesh)),
    ]


def channels_table(place: srt.Scene, seeds: int, model: str) -> list[tuple[str, list[float]]]:
    """Return the sum of all |a|^2 against that at 512 channels, from a roof LiDAR of +10 to -30 degrees."""

    def power(channels: int) -> Powers:
        def one(seed: int) -> Powers:
            mount = lidar_at(ROOF, channels, 0.4, seed, upper=10.0, lower=-30.0)
            rows = lidar_scatterers(srt.cast_lidar(place, mount, normals=True), PROFILE, RADAR, seed=seed)
            returns = srt.illuminate(rows, PROFILE, model=model)
            level = np.abs(returns.amplitude) ** 2
            return {i: float(level[returns.object_id == i].sum()) for i in NAMES}

        return mean(one, seeds)

    powers = {channels: power(channels) for channels in (64, 128, 256, 512)}
    return [(f"{channels} channels", decibels(found, powers[512])) for channels, found in powers.items()]


def picture(densities: Sequence[int], curve: Sequence[Sequence[float]], path: Path) -> None:
    """Draw deviation over density."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(7.0, 4.0), layout="constrained")
    axes.axhspan(-0.5, 0.5, color="0.92", label="within 0.5 dB")
    for values, name in zip(np.transpose(curve), NAMES.values(), strict=True):
        axes.plot(densities, values, marker="o", label=name)
    axes.set(xscale="log", xlabel="density of the LiDAR [x]", ylabel="LiDAR door over mesh door [dB]")
    axes.set_title("Incoherent power per object, LiDAR at the radar", loc="left")
    axes.legend(ncols=2)
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Print the tables; draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--densities", default="1,3,10,30,100")
    parser.add_argument("--write", action="store_true", help="write docs/images/lidar_convergence.png")
    options = parser.parse_args()
    densities = [int(d) for d in options.densities.split(",")]
    place = scene()
    mesh = mean(lambda s: incoherent(srt.trace(place, PROFILE, seed=s, rays=RAYS)), options.seeds)
    curve = convergence(place, mesh, densities, options.seeds)
    show("density, LiDAR over mesh [dB]", [(f"{d}x", row) for d, row in zip(densities, curve, strict=True)])
    show("cause, over the mesh door's incoherent power [dB]", causes(place, mesh, options.seeds))
    for model in ("physical", "shenron", "shenron:as_released"):
        show(f"{model}: roof LiDAR, over 512 channels [dB]", channels_table(place, options.seeds, model))
    if options.write:
        picture(densities, curve, ROOT / "docs" / "images" / "lidar_convergence.png")


if __name__ == "__main__":
    main()
