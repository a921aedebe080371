"""Measure a corner reflector over range: ``python examples/corner_range.py``; ``--write`` makes the docs' page.

A 20 dBsm trihedral at 24.1 GHz from 5 to 160 m, from the scene to the RCS of its detection: in free space against its
near-range law, over asphalt against the exact sum of four paths. About three minutes on two cores, most of it theory.
"""

from __future__ import annotations

import argparse
import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.interpolate import CubicSpline

import shenron_rt as srt
from shenron_rt._typing import ComplexArray, FloatArray
from shenron_rt.physics import (
    four_path_factor,
    near_range_trihedral_matrix,
    trihedral_scattering_matrix,
    two_ray_factor,
)

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "corner-reflector.md"
BEGIN, END = "<!-- numbers -->", "<!-- end of numbers -->"
PROFILE = srt.load_profile("radarbook_200mhz")
LEG_M, HEIGHT_M = 0.247, 1.0
CORNER = f"trihedral:triangular,a={LEG_M}"
RANGES = np.arange(5.0, 160.1, 2.5)
CORNER_ID = 5
ASPHALT = srt.load_materials()["asphalt"]
#: Permittivity, and the heights of radar and corner [m].
GROUND = (ASPHALT.permittivity_at(PROFILE.center_hz), HEIGHT_M, HEIGHT_M)
ROUGH_M = ASPHALT.roughness_rms_m


def detected(distance: float, *, road: bool) -> float:
    """Return the RCS of the corner's strongest detection [dBsm]."""
    corner = {
        "id": CORNER_ID, "shape": CORNER, "xyz_m": [distance, 0, HEIGHT_M], "ypr_deg": [180, 0, 0], "aim": 10_000,
        "tag": "Other",
    }  # fmt: skip
    asphalt = {"name": "road", "shape": "ground:400x40", "xyz_m": [190, 0, 0], "material": "asphalt"}
    radar = {"name": "r", "profile": PROFILE, "xyz_m": [0, 0, HEIGHT_M]}
    scene = srt.Scene(static=[asphalt] if road else [], actors=[corner], radars=[radar])
    found = srt.simulate(scene, max_bounces=5 if road else 3, rays=5000).detections
    return float(found.rcs_dbsm[found.object_id == CORNER_ID][0])


def turntable(distance: float, elevation_deg: float, **more: object) -> complex:
    """Return the scattering amplitude of the corner alone [m]."""
    options = {"frequency_hz": PROFILE.center_hz, "azimuth_deg": 0.0, "distance_m": distance, **more}
    return complex(srt.sweep_rcs(CORNER, elevation_deg=elevation_deg, **options).amplitude.item())


def over_road(distance: FloatArray, amplitudes: ComplexArray) -> FloatArray:
    """Return the level of the four paths from direct, mixed and reflected amplitudes (n, 3) [dBsm]."""
    direct, mixed, reflected = amplitudes.T
    below = -np.arctan(2.0 * HEIGHT_M / distance)
    pattern = PROFILE.pattern(np.zeros_like(below), below) / PROFILE.pattern(np.zeros(1), np.zeros(1))
    factor = four_path_factor(
        *GROUND, distance, PROFILE.center_hz, "VV", roughness_rms_m=ROUGH_M,
        mixed=mixed / direct * np.sqrt(pattern), reflected=reflected / direct * pattern,
    )  # fmt: skip
    return np.asarray(20 * np.log10(np.abs(direct * factor)))


def amplitudes_at(distance: FloatArray) -> ComplexArray:
    """Return direct, mixed and reflected scattering amplitudes of the corner, (n, 3) [m]."""
    rows = []
    for r in distance.tolist():
        below, indirect = -float(np.degrees(np.arctan(2 * HEIGHT_M / r))), float(np.hypot(r, 2 * HEIGHT_M))
        mixed = turntable(indirect, below, bistatic=(0.0, 0.0))
        rows.append([turntable(r, 0.0), mixed, turntable(indirect, below)])
    return np.array(rows)


def fine_amplitudes(distance: FloatArray, amplitudes: ComplexArray, fine: FloatArray) -> ComplexArray:
    """Return amplitudes between those of the turntable; the elevation from below changes by 0.3 degrees at most.

    Lobes of the corner are a degree wide, those over the road much narrower: these come from the closed form.
    """
    angle = np.linspace(np.arctan(2 * HEIGHT_M / distance[0]), np.arctan(2 * HEIGHT_M / distance[-1]), 80)[1:-1]
    more = 2 * HEIGHT_M / np.tan(angle)
    every = np.concatenate([distance, more])
    order = np.argsort(-every)
    known = np.concatenate([amplitudes, amplitudes_at(more)])
    return np.asarray(CubicSpline(np.arctan(2 * HEIGHT_M / every[order]), known[order])(np.arctan(2 * HEIGHT_M / fine)))


def near_range(distance: FloatArray) -> FloatArray:
    """Return the exact coherent level of one to three bounces in free space [dBsm]."""
    found = [near_range_trihedral_matrix("triangular", LEG_M, PROFILE.wavelength_m, float(r))[0, 0] for r in distance]
    return np.asarray(20 * np.log10(np.abs(found)))


def received_dbm(level_dbsm: FloatArray | float, distance: FloatArray) -> FloatArray:
    """Return the power that a level stands for by the radar equation [dBm]."""
    a = PROFILE.antenna
    gain_db = a.gain_tx_dbi + a.gain_rx_dbi - a.radome_loss_db
    link = PROFILE.tx_power_w * PROFILE.wavelength_m**2 / ((4 * np.pi) ** 3 * distance**4)
    return np.asarray(10 * np.log10(link) + 30 + gain_db + level_dbsm)


def rms(error: FloatArray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(error**2)))


@dataclass(frozen=True)
class Levels:
    """Levels at ``RANGES`` [dBsm]: detected, near-range, far-field in free space; detected and wanted over a road."""

    free: FloatArray
    near: FloatArray
    far: float
    road: FloatArray
    paths: FloatArray

    def table(self) -> str:
        """Return the errors as markdown."""
        beyond = RANGES >= 10
        strong = self.paths > self.near - 10
        rows = [
            ("free space, near-range law of 1+2+3 bounces, 5 to 160 m", self.free - self.near, "max 0.3"),
            (f"free space, {self.far:.2f} dBsm at every range, 10 to 160 m", (self.free - self.far)[beyond], "max 0.3"),
            ("over asphalt, four paths, 5 to 160 m", self.road - self.paths, "RMS 1"),
            ("the same where they leave more than -10 dB", (self.road - self.paths)[strong], ""),
        ]
        lines = ["| detected level against | bar [dB] | mean [dB] | RMS [dB] | largest [dB] |", "|---|---|---|---|---|"]
        for name, error, bar in rows:
            worst = float(error[np.argmax(np.abs(error))])
            lines.append(f"| {name} | {bar} | {np.mean(error):+.2f} | {rms(error):.2f} | {worst:+.2f} |")
        return "\n".join(lines)


def draw(levels: Levels, fine: FloatArray, paths: FloatArray, file: Path) -> None:
    """Draw the range profile of the bundled scene, power over range, and the errors of the levels."""
    figure = Figure(figsize=(9.0, 10.5), dpi=90, layout="constrained")
    FigureCanvasAgg(figure)
    street, power, error = figure.subplots(3, 1, height_ratios=(1.0, 1.6, 0.9))
    draw_street(street)
    one_way = two_ray_factor(*GROUND, fine, PROFILE.center_hz, "VV", roughness_rms_m=ROUGH_M)
    lobes = 20.0 + 40 * np.log10(np.abs(one_way))
    power.plot(fine, received_dbm(lobes, fine), color="0.75", lw=0.6, label="20 dBsm point, no pattern: two_ray_factor")
    power.plot(fine, received_dbm(paths, fine), color="tab:orange", lw=1.0, label="over asphalt: four-path sum")
    power.plot(RANGES, received_dbm(levels.road, RANGES), "o", ms=4, color="tab:red", label="over asphalt: detected")
    power.plot(RANGES, received_dbm(levels.near, RANGES), color="tab:blue", lw=1.0, label="free space: near-range law")
    power.plot(RANGES, received_dbm(levels.free, RANGES), "s", ms=3, color="tab:cyan", label="free space: detected")
    power.set(ylabel="received power [dBm]", ylim=(-140, -40))
    power.set_title("corner a = 0.247 m and radar 1 m up, 24.1 GHz", fontsize=10)
    error.axhspan(-0.3, 0.3, color="0.92", zorder=0)
    for off, marker, color, label in (
        (levels.road - levels.paths, "o-", "tab:red", "over asphalt - four paths"),
        (levels.free - levels.near, "s-", "tab:cyan", "free space - near range"),
    ):
        error.plot(RANGES, off, marker, ms=3, lw=0.8, color=color, label=label)
    error.set(xlabel="range [m]", ylabel="error [dB]", ylim=(-2, 2))
    for axes in (power, error):
        axes.set(xlim=(4.5, 165), xscale="log")
        axes.set_xticks([5, 10, 20, 40, 80, 160], ["5", "10", "20", "40", "80", "160"])
        axes.minorticks_off()
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    figure.savefig(file, metadata={"Software": None})


def draw_street(axes: Axes) -> None:
    """Draw the range profile of the bundled scene with one bounce and with its own five."""
    scene = srt.load_scene("corner_reflector")
    for bounces, color in ((1, "0.6"), (scene.max_bounces, "tab:blue")):
        frame = srt.simulate(scene, max_bounces=bounces)
        profile = 10 * np.log10(frame.cube.range_doppler.max(axis=1)) + 30
        axes.plot(frame.cube.range_m, profile, color=color, lw=1.2, label=f"max_bounces: {bounces}")
    for row in frame.detections.table:
        if row["object_id"] in (10, 20, 30):
            at = (float(row["range"]), 10 * np.log10(float(row["power"])) + 32)
            axes.annotate(f"{row['range']:.2f} m, {row['rcs_dbsm']:.1f} dBsm", at, ha="left", fontsize=8)
    axes.set(xlim=(0, 60), ylim=(-145, -50), xlabel="range [m]", ylabel="power [dBm]")
    axes.set_title("bundled scene corner_reflector: strongest Doppler cell", fontsize=10)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)


def main() -> None:
    """Measure, print, and write where asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="the table and the picture of docs/corner-reflector.md")
    parser.add_argument("--picture", type=Path, help="draw into this file")
    options = parser.parse_args()
    logging.disable(logging.WARNING)
    known = amplitudes_at(RANGES)
    far = trihedral_scattering_matrix("triangular", LEG_M, PROFILE.wavelength_m, 0.0)[0, 0]
    levels = Levels(
        free=np.array([detected(r, road=False) for r in RANGES.tolist()]),
        near=near_range(RANGES),
        far=float(20 * np.log10(np.abs(far))),
        road=np.array([detected(r, road=True) for r in RANGES.tolist()]),
        paths=over_road(RANGES, known),
    )
    print(levels.table())
    picture = ROOT / "docs" / "images" / "corner_range.png" if options.write else options.picture
    if picture is not None:
        fine = np.concatenate([np.arange(RANGES[0], 40.0, 0.02), np.arange(40.0, RANGES[-1], 0.1)])
        draw(levels, fine, over_road(fine, fine_amplitudes(RANGES, known, fine)), picture)
    if options.write:
        before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
        PAGE.write_text(f"{before}{BEGIN}\n{levels.table()}\n{END}{rest.split(END)[1]}", encoding="utf-8")


if __name__ == "__main__":
    main()
