"""What each correction of the shenron model changes, in dB, on one frame: the table of docs/shenron-model.md.

python examples/shenron_corrections.py                                   # the bundled scene "braking"
python examples/shenron_corrections.py --lidar frame.ply --side-file frame.meta.yaml --tag-table 0.9.14
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

import shenron_rt as srt
from shenron_rt.echo.shenron import ShenronModel
from shenron_rt.lidar import lidar_scatterers, read_semantic_lidar

BUMPER, GROUND = srt.Pose((2.0, 0.0, 1.0)), srt.Pose((0.0, 0.0, 0.0))
#: What static rows are summed under.
STATIC = "static"


def powers(scatterers: srt.Scatterers, profile: srt.RadarProfile, model: ShenronModel) -> dict[str, float]:
    """Return the sum of abs(a)^2 of every object by its tag and id."""
    echoes = srt.illuminate(scatterers, profile, model=model)
    found = {}
    for number in np.unique(scatterers.object_id):
        mine = echoes.object_id == number
        tag = srt.SemanticTag(int(scatterers.tag[scatterers.object_id == number][0])).name
        found[f"{tag} {number}" if number else STATIC] = float(np.sum(np.abs(echoes.amplitude[mine]) ** 2))
    return found


def decibels(after: dict[str, float], before: dict[str, float], name: str) -> str:
    """Return the change in dB; words where an object begins or ceases to return anything."""
    was, now = before.get(name, 0.0), after.get(name, 0.0)
    silent = 1e-20 * max(before.values())
    if was < silent:
        return "appears" if now > 1e-20 * max(after.values()) else "silent"
    change = round(10 * np.log10(now / was), 1)
    return f"{change:+.1f}" if change else "0"


def table(scatterers: Callable[[srt.Pose], srt.Scatterers], profile: srt.RadarProfile) -> str:
    """Return the table as Markdown: switch alone over as_released / switch on over the corrected model without it."""
    at_bumper, at_ground = scatterers(BUMPER), scatterers(GROUND)
    released, corrected = ShenronModel.as_released(), ShenronModel.corrected()
    first, last = powers(at_ground, profile, released), powers(at_bumper, profile, corrected)
    names = list(first)
    head = ["switch", *names]
    rows = [head, ["---"] * len(head)]
    for switch in ShenronModel.switches():
        alone = powers(at_bumper if switch == "mount" else at_ground, profile, replace(released, **{switch: True}))
        without = powers(at_ground if switch == "mount" else at_bumper, profile, replace(corrected, **{switch: False}))
        cells = [f"{decibels(alone, first, n)} / {decibels(last, without, n)}" for n in names]
        rows.append([f"`{switch}`", *cells])
    everything = replace(corrected, calibrated=False)
    total = [decibels(powers(at_bumper, profile, everything), first, n) for n in names]
    rows.append(["all but `calibrated`", *total])
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def main() -> None:
    """Read or trace a frame and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--lidar", type=Path, help="frame of a semantic LiDAR; default: trace the scene braking")
    parser.add_argument("--side-file", type=Path, help="sensor pose and actors of that frame")
    parser.add_argument("--tag-table", default="0.9.14", help="numbering of its tags")
    parser.add_argument("--profile", default="ti_cascade")
    options = parser.parse_args()
    profile = srt.load_profile(options.profile)
    if options.lidar is None:
        scene = srt.load_scene("braking")
        radar = scene.radar(None)

        def scatterers(mount: srt.Pose) -> srt.Scatterers:
            place = radar.model_copy(update={"xyz_m": mount.xyz, "ypr_deg": mount.ypr_deg})
            return srt.trace(scene.model_copy(update={"radars": (place,)}), profile, rays=50_000)
    else:
        frame = read_semantic_lidar(
            options.lidar, tag_table=options.tag_table, frame="carla", side_file=options.side_file
        )

        def scatterers(mount: srt.Pose) -> srt.Scatterers:
            seen = lidar_scatterers(frame, profile, mount)
            return seen.select(seen.position[:, 0] > 0.8)  # ahead, as the released crop has it

    print(table(scatterers, profile))


if __name__ == "__main__":
    main()
