"""Measure the results table of the README: ``python examples/results.py``; ``--write`` also puts it there.

Levels are compared with closed forms, times are those of this machine. Takes about a minute.
"""

from __future__ import annotations

import logging
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import shenron_rt as srt
from shenron_rt.constants import FOUR_PI_CUBED
from shenron_rt.tracing.backend import backend_status, choose_backend

ROOT = Path(__file__).resolve().parents[1]
BEGIN, END = "<!-- results -->", "<!-- end of results -->"
PROFILE = srt.load_profile("awrl1432")
MOUNT = {"name": "r", "xyz_m": (0, 0, 0)}

Row = tuple[str, str, str]  # what, expected, measured


def per_square_metre(distance: float) -> float:
    """Return received power of 1 m^2 on boresight by the radar equation [W]."""
    a = PROFILE.antenna
    gain = 10 ** ((a.gain_tx_dbi + a.gain_rx_dbi - a.radome_loss_db) / 10)
    return PROFILE.tx_power_w * gain * PROFILE.wavelength_m**2 / (FOUR_PI_CUBED * distance**4)


def apparent_rcs(shape: str, distance: float, *, seeds: int = 1, shift: float = 0.0, aim: int | None = None) -> float:
    """Return the mean apparent RCS of a metal shape on boresight, radar at ``distance`` from its origin [m^2]."""
    part = {"id": 1, "shape": shape, "ypr_deg": (180, 0, 0), "material": "metal", "aim": aim}
    powers = []
    for seed in range(seeds):
        offset = shift * np.random.default_rng(seed).uniform(-1, 1, 2)
        scene = srt.Scene(static=[{**part, "xyz_m": (distance, *offset)}], radars=[MOUNT], seed=seed)
        powers.append(srt.illuminate(srt.trace(scene), PROFILE).power_by_object().get(1, 0.0))
    return float(np.mean(powers)) / per_square_metre(distance)


def near_range_plate(side: float, distance: float, n: int = 1201) -> float:
    """Return the apparent RCS of a square metal plate by direct summation of the physical-optics integral [m^2]."""
    k = 2 * np.pi / PROFILE.wavelength_m
    edge = (np.arange(n) + 0.5) / n * side - side / 2
    r = np.sqrt(distance**2 + edge[:, None] ** 2 + edge[None] ** 2)
    field = np.sum(distance / r * np.exp(-2j * k * (r - distance)) / r**2) * (side / n) ** 2
    return float(4 * np.pi / PROFILE.wavelength_m**2 * np.abs(field * distance**2) ** 2)


def db(value: float) -> float:
    """Return 10 log10."""
    return 10 * float(np.log10(value))


def level(name: str, expected: float, measured: float) -> Row:
    """Return a row that compares two cross sections [m^2]."""
    return name, f"{db(expected):.2f} dBsm", f"{db(measured):.2f} dBsm ({db(measured / expected):+.2f} dB)"


def levels() -> list[Row]:
    """Compare cross sections with closed forms."""
    rows = []
    for distance in (3.0, 10.0, 30.0):
        side = max(1.5 * distance, 20.0)
        mirror = apparent_rcs(f"plate:{side}x{side}", distance, seeds=10, shift=0.25 * side)
        rows.append(level(f"large metal plate at {distance:g} m (mirror, pi R^2)", np.pi * distance**2, mirror))
    small = apparent_rcs("plate:0.1x0.1", 30.0, aim=20_000)
    rows.append(
        level("0.1 m metal plate at 30 m (4 pi A^2/lambda^2)", 4 * np.pi * 1e-4 / PROFILE.wavelength_m**2, small)
    )
    near = apparent_rcs("plate:0.3x0.3", 10.0, aim=20_000)
    rows.append(level("0.3 m metal plate at 10 m (near range, direct sum)", near_range_plate(0.3, 10.0), near))
    sphere = apparent_rcs("sphere:r=0.1", 10.1, aim=20_000) * (10.0 / 10.1) ** 4
    rows.append(level("0.1 m radius metal sphere, 10 m to its nearest point (pi a^2)", np.pi * 0.01, sphere))
    return rows


def point_targets() -> list[Row]:
    """Compare a point target of 30 dBsm with the radar equation, in the samples and as detected."""
    adc_error, detected_error = [], []
    for distance in (5.0, 20.0, 50.0, 90.0):
        target = {"id": 1, "xyz_m": (distance, 0, 0), "rcs_dbsm": 30}
        frame = srt.simulate(srt.Scene(point_targets=[target], radars=[MOUNT]), noise=None)
        adc_error.append(db(float(np.mean(np.abs(frame.adc.data) ** 2)) / (1000 * per_square_metre(distance))))
        detected_error.append(float(frame.detections.rcs_dbsm[0]) - 30)
    quiet = srt.synthesize(srt.illuminate(srt.trace(srt.Scene(radars=[MOUNT])), PROFILE), PROFILE, seed=1)
    noise = db(float(np.mean(np.abs(quiet.data) ** 2)) / PROFILE.noise_power_w)
    return [
        ("30 dBsm point, 5 to 90 m: power of the samples", "radar equation", f"{worst(adc_error):+.3f} dB at worst"),
        ("the same: detected RCS", "30 dBsm", f"{worst(detected_error):+.2f} dB at worst"),
        ("noise of the samples", "k T0 F f_s", f"{noise:+.3f} dB"),
    ]


def worst(errors: list[float]) -> float:
    """Return the largest error with its sign."""
    return max(errors, key=abs)


def synthesis() -> list[Row]:
    """Compare fast synthesis with the direct sum."""
    rng = np.random.default_rng(1)
    n = 300
    returns = srt.Returns(
        amplitude=rng.standard_normal((n, 2)).view(np.complex128)[:, 0],
        position=rng.uniform((2, -40, -2), (95, 40, 5), (n, 3)),
        velocity=rng.uniform(-60, 60, (n, 3)),
        object_id=np.zeros(n, dtype=np.uint32),
        tag=np.zeros(n, dtype=np.uint8),
        coherent=np.ones(n, dtype=bool),
        bounces=np.ones(n, dtype=np.uint8),
        scatterer=np.arange(n),
        center_hz=PROFILE.center_hz,
    )
    exact = srt.synthesize(returns, PROFILE, noise=None, method="direct").data
    fast = srt.synthesize(returns, PROFILE, noise=None, accuracy=1e-6).data
    error = float(np.sqrt(np.mean(np.abs(fast - exact) ** 2) / np.mean(np.abs(exact) ** 2)))
    return [("fast synthesis against the direct sum, up to 60 m/s, accuracy 1e-6", "<= 1e-6", f"{error:.1e}")]


def braking() -> list[Row]:
    """Report the car of the default scene."""
    frame = srt.simulate(srt.load_scene("braking"))
    found = frame.detections
    row = int(np.flatnonzero(found.object_id == 101)[0])
    where = f"{found.range[row]:.2f} m, {np.degrees(found.azimuth[row]):+.1f} deg, {found.velocity[row]:+.2f} m/s"
    return [
        (
            "`braking`: the car, 25 m ahead and 5 m/s slower",
            "25.0 m, 0 deg, -5 m/s",
            f"{where}, SNR {found.snr_db[row]:.1f} dB",
        )
    ]


def fastest(call: Callable[[], object], repeat: int) -> float:
    """Return the shortest of some wall times [s]."""
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def times() -> list[Row]:
    """Time the main job, warm and cold, and the fallback."""
    scene = srt.load_scene("braking")
    best = choose_backend()

    def frame(backend: str, accuracy: float = 1e-4) -> Callable[[], object]:
        return lambda: srt.simulate(scene, backend=backend, accuracy=accuracy)

    frame(best)()
    rows = [(f"`braking`, a warm frame of 300 k rays, {best}", "", f"{fastest(frame(best), 3):.2f} s")]
    rows.append(("the same, scalar fallback", "", f"{fastest(frame('scalar'), 1):.1f} s"))
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "shenron_rt.cli", "run", "braking", "-o", f"{folder}/run"]
        start = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True)
        rows.append(
            ("`shenron-rt run braking`, cold, files and pictures included", "", f"{time.perf_counter() - start:.1f} s")
        )
    code = "import time; t = time.perf_counter(); import shenron_rt; print(time.perf_counter() - t)"
    lines = [subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True) for _ in range(3)]
    rows.append(("`import shenron_rt`", "", f"{min(float(line.stdout) for line in lines) * 1e3:.0f} ms"))
    return rows


def table() -> str:
    """Return the whole table as markdown."""
    rows = [*levels(), *point_targets(), *synthesis(), *braking(), *times()]
    lines = ["| what | expected | measured |", "|---|---|---|", *(f"| {a} | {b} | {c} |" for a, b, c in rows)]
    cores = len(os.sched_getaffinity(0))
    detail = backend_status(choose_backend()).detail
    lines += ["", f"Measured with version {srt.__version__}, {cores} CPU cores ({platform.machine()}), {detail}."]
    return "\n".join(lines)


if __name__ == "__main__":
    logging.disable(logging.WARNING)
    text = table()
    print(text)
    if "--write" in sys.argv:
        readme = ROOT / "README.md"
        before, rest = readme.read_text(encoding="utf-8").split(BEGIN)
        after = rest.split(END)[1]
        readme.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}", encoding="utf-8")
