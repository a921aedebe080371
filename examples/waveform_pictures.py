"""Draw the pictures of docs/waveforms.md: python examples/waveform_pictures.py [FOLDER].

unfolding.png: Doppler spectra of the building at the end of ``highway`` in both bursts of a staggered frame.
interference.png: one chirp with a burst of another radar's, and the range profile without and with it.
phase_noise.png: what de-chirping leaves of phase noise at three ranges, measured over some frames, and in closed form.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import shenron_rt as srt
from shenron_rt.constants import SPEED_OF_LIGHT
from shenron_rt.physics import dechirped_phase_noise, single_sideband_level

OSCILLATOR = [[1e4, -75], [1e5, -80], [1e6, -93], [1e7, -113]]
FRAMES = 4


def beat_noise(profile: srt.RadarProfile, distance: float) -> tuple[np.ndarray, np.ndarray]:
    """Return offsets [Hz] and single-sideband phase noise [1/Hz] of a still target, of FRAMES frames."""
    scene = srt.Scene(
        point_targets=[{"id": 1, "xyz_m": (2 + distance, 0, 1), "rcs_dbsm": 60 + 40 * np.log10(distance / 20)}]
    )
    returns = srt.illuminate(srt.trace(scene, profile, rays=100), profile)
    clean = srt.synthesize(returns, profile, noise=None, accuracy=1e-9).data[:, 0]
    rate, n = profile.waveform.sample_rate_hz, profile.waveform.samples
    taper, total = np.hanning(n + 2)[1:-1], np.zeros(n // 2 + 1)
    for frame in range(FRAMES):
        data = srt.synthesize(returns, profile, frame=frame, accuracy=1e-9).data[:, 0]
        power = np.abs(np.fft.rfft(np.angle(data * clean.conj()) * taper, axis=1)) ** 2
        total += power.mean(axis=0) / (rate * np.sum(taper**2)) / FRAMES
    return np.arange(len(total)) * rate / n, total


def draw_phase_noise(file: Path) -> None:
    """Draw phase_noise.png."""
    profile = srt.load_profile(
        "awrl1432", {"array.line": 1, "receiver.phase_noise_dbc_hz": OSCILLATOR, "receiver.temperature_k": 1e-6}
    )
    figure, axes = plt.subplots(figsize=(7.2, 4.0), layout="constrained")
    fine = np.geomspace(4e4, 6.2e6, 600)
    axes.semilogx(
        fine / 1e3, 10 * np.log10(single_sideband_level(fine, OSCILLATOR)), "k--", lw=1, label="oscillator L(f)"
    )
    for colour, distance in zip(("tab:red", "tab:blue", "tab:green"), (75.0, 10.0, 0.5), strict=True):
        offset, level = beat_noise(profile, distance)
        exact = dechirped_phase_noise(fine, 2 * distance / SPEED_OF_LIGHT, OSCILLATOR)
        axes.semilogx(fine / 1e3, 10 * np.log10(np.maximum(exact, 1e-20)), color=colour, lw=1, alpha=0.6)
        dots = slice(2, -1)
        axes.semilogx(
            offset[dots] / 1e3, 10 * np.log10(level[dots]), ".", ms=3.5, color=colour, label=f"{distance:g} m"
        )
    axes.set(xlabel="offset from the beat frequency [kHz]", ylabel="single-sideband noise [dBc/Hz]", ylim=(-160, -70))
    axes.grid(alpha=0.3, which="both")
    axes.legend(
        title="dots: synthesised\nlines: L(f) 4 sin² π f τ", loc="lower left", fontsize=8, title_fontsize=8, ncols=2
    )
    figure.savefig(file, dpi=130)


def draw_unfolding(file: Path) -> None:
    """Draw unfolding.png."""
    profile = srt.load_profile("awrl1432_staggered", {"processing.ambiguity": "staggered"})
    frame = srt.simulate(srt.load_scene("highway"), profile, seed=1, rays=60_000, accuracy=1e-3)
    table = frame.detections.table
    building = table[table["object_id"] == 50][0]
    figure, axes = plt.subplots(figsize=(7.2, 3.6), layout="constrained")
    for burst, colour in zip(frame.cube.bursts, ("tab:blue", "tab:orange"), strict=True):
        row = np.argmin(np.abs(burst.range_m - building["range"]))
        power = 10 * np.log10(burst.range_doppler[row - 1 : row + 2].max(axis=0)) + 30
        span = 2 * burst.profile.max_velocity_mps
        label = f"{burst.profile.loop_period_s * 1e6:.1f} µs, 2 v_max {span:.1f} m/s"
        axes.plot(burst.velocity_mps, power, color=colour, lw=1.5, label=label)
        repeated = np.concatenate([burst.velocity_mps + fold * span for fold in range(-2, 3)])
        axes.plot(repeated, np.tile(power, 5), color=colour, lw=0.7, alpha=0.45)
    axes.axvline(building["velocity"], color="k", lw=0.8, ls=":")
    axes.set(xlabel="range rate [m/s]", ylabel="power in the building's range [dBm]", xlim=(-90, 90))
    axes.set_title(f"both bursts agree at {building['velocity']:.1f} m/s only", fontsize=9)
    axes.grid(alpha=0.3)
    axes.legend(title="bold: as measured; thin: repeated", fontsize=8, title_fontsize=8, loc="lower right")
    figure.savefig(file, dpi=130)


def draw_interference(file: Path) -> None:
    """Draw interference.png."""
    profile = srt.load_profile("awrl1432", {"processing.range_window": "rect", "processing.doppler_window": "rect"})
    other = srt.load_profile(
        "awrl1432", {"waveform.bandwidth_hz": 160e6, "waveform.carrier_hz": 77.1e9, "waveform.chirp_period_s": 36.45e-6}
    )
    target = {"id": 9, "xyz_m": (32, 0, 1), "rcs_dbsm": 15}
    facing = {"profile": other, "xyz_m": (62, 2, 1), "ypr_deg": (180, 0, 0), "tx_power_dbm": 20}
    scenes = [srt.Scene(point_targets=[target]), srt.Scene(point_targets=[target], interferers=[facing])]
    clean, hit = (srt.simulate(s, profile, rays=100, seed=2) for s in scenes)
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.6, 3.6), layout="constrained")
    w, k, delay = profile.waveform, profile.slope_hz_per_s, float(np.hypot(60, 2)) / SPEED_OF_LIGHT
    time = np.arange(w.samples) / w.sample_rate_hz * 1e6
    left.plot(time, hit.adc.data[0, 0].real * 1e6, lw=0.8)
    crossing = (other.waveform.carrier_hz - w.carrier_hz - other.slope_hz_per_s * delay) / (k - other.slope_hz_per_s)
    lasts = w.sample_rate_hz / (k - other.slope_hz_per_s)
    left.axvspan(crossing * 1e6, (crossing + lasts) * 1e6, color="tab:red", alpha=0.15, label="crossing + f_s/|Δk|")
    left.set(xlabel="time in the first chirp [µs]", ylabel="I of receiver 0 [µ√W]")
    left.legend(fontsize=8)
    difference = np.abs(hit.adc.data - clean.adc.data)
    added = np.mean(difference > 0) * difference.max() ** 2
    for frame, label in ((hit, "with"), (clean, "without")):
        power = frame.cube.range_doppler.mean(axis=1)
        right.plot(frame.cube.range_m, 10 * np.log10(power) + 30, lw=0.9, label=f"{label} interference")
    floor = clean.cube.noise_power_w
    for level in (floor, floor * (1 + added / profile.noise_power_w)):
        right.axhline(10 * np.log10(level) + 30, color="k", lw=0.8, ls="--")
    right.set(xlabel="range [m]", ylabel="mean over Doppler [dBm]", title="rectangular windows")
    right.legend(title="dashed: closed form", fontsize=8, title_fontsize=8)
    for axes in (left, right):
        axes.grid(alpha=0.3)
    figure.savefig(file, dpi=130)


def main(folder: Path) -> None:
    """Draw all pictures into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    draw_unfolding(folder / "unfolding.png")
    draw_interference(folder / "interference.png")
    draw_phase_noise(folder / "phase_noise.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[1] / "docs/images")
