"""Draw the pictures of docs/waveforms.md: python examples/waveform_pictures.py [FOLDER].

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
    axes.set(xlabel="distance from the beat frequency [kHz]", ylabel="single-sideband noise [dBc/Hz]", ylim=(-160, -70))
    axes.grid(alpha=0.3, which="both")
    axes.legend(
        title="dots: synthesised\nlines: L(f) 4 sin² π f τ", loc="lower left", fontsize=8, title_fontsize=8, ncols=2
    )
    figure.savefig(file, dpi=130)


def main(folder: Path) -> None:
    """Draw all pictures into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    draw_phase_noise(folder / "phase_noise.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[1] / "docs/images")
