"""Changes that may bring a masked object out: each is tried on the frame's own echoes before it is named."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..config.profile import RadarProfile
from ..dsp import RadarCube, detect, process
from ..synthesis import synthesize
from .sources import Case

__all__ = ["found_in", "process_remedy", "unfolding_remedy", "waveform_remedy"]

#: Windows with low side lobes, tried as a remedy.
_LOW_SIDE_LOBES = "blackmanharris"
#: Threshold statistics that a strong neighbour in the training ring does not lift.
_ROBUST_CFAR = ("so", "os")
#: How much finer velocity and range are made in a trial.
_FACTORS = (2, 4)
#: Share of a chirp period that is sampled where the period has to shrink, and by how much v_max then exceeds the need.
_SAMPLED, _SPARE = 0.9, 1.05


def found_in(cube: RadarCube, object_id: int, cfar: str = "ca") -> bool:
    """Tell whether detection with the profile's settings finds the object in a cube, where it is."""
    settings = cube.profile.processing
    found = detect(cube, pfa=settings.pfa, blanking_m=settings.blanking_m, cfar=cfar)
    return bool(np.any((found.object_id == object_id) & ~found.ghost))


def process_remedy(case: Case, object_id: int) -> str:
    """Return the first change of the processing with which the frame's own samples show the object; empty if none."""
    cube = case.cube
    for pair in _other_windows(cube):
        again = process(case.adc(), range_window=pair[0], doppler_window=pair[1], n_fft=cube.n_fft)
        if found_in(replace(again, returns=case.returns), object_id):
            now = (cube.range_window, cube.doppler_window)
            keys = [f"processing.{axis}_window={name}" for axis, name in zip(("range", "doppler"), pair, strict=True)]
            changed = [f"--set {key}" for key, name, old in zip(keys, pair, now, strict=True) if name != old]
            return f"process with {' '.join(changed)}: tried, it is detected"
    for cfar in _ROBUST_CFAR:
        if found_in(cube, object_id, cfar):
            return f"detect with cfar={cfar!r}, which the neighbour does not lift: tried, it is detected"
    return ""


def _other_windows(cube: RadarCube) -> Iterator[tuple[str, str]]:
    """Yield pairs of windows that are not the cube's, the smallest change first."""
    low, now = _LOW_SIDE_LOBES, (cube.range_window, cube.doppler_window)
    for pair in ((low, now[1]), (now[0], low), (low, low)):
        if pair != now:
            yield pair


def waveform_remedy(case: Case, object_id: int) -> str:
    """Return the first finer waveform whose frame, synthesised from the same echoes, shows the object; empty if none.

    Velocity is made finer by more loops, range by more bandwidth in the same time.
    """
    p = case.cube.profile
    w = p.waveform
    for factor in _FACTORS:
        more = {"chirps": w.chirps * factor}
        if _tried(case, object_id, more):
            bins = f"{p.velocity_resolution_mps:.2g} to {p.velocity_resolution_mps / factor:.2g} m/s"
            return f"{factor} times the loops, {more['chirps']}, resolve {bins}: tried, it is detected"
        wide: dict[str, Any] = {
            "bandwidth_hz": w.bandwidth_hz * factor,
            "samples": w.samples * factor,
            "sample_rate_hz": w.sample_rate_hz * factor,
        }
        if _tried(case, object_id, wide):
            cells = f"{p.range_resolution_m:.2g} to {p.range_resolution_m / factor:.2g} m"
            return f"{factor} times the bandwidth, {w.bandwidth_hz * factor / 1e6:g} MHz, resolve {cells}: tried, found"
    return ""


def unfolding_remedy(case: Case, object_id: int, velocity_mps: float) -> str:
    """Return the chirp period at which a velocity does not fold, with what was tried of it."""
    p = case.cube.profile
    w = p.waveform
    now = float(np.mean(w.periods_s))
    period = p.wavelength_m / (4 * abs(velocity_mps) * _SPARE) / p.n_chirps_per_loop
    change: dict[str, Any] = {"chirp_period_s": period, "chirps": math.ceil(w.chirps * now / period)}
    if period < w.adc_start_s + w.sampled_time_s:
        change["sample_rate_hz"] = w.samples / (_SAMPLED * (period - w.adc_start_s))
    words = f"a chirp every {period * 1e6:.1f} us (now {now * 1e6:.1f} us) does not fold {velocity_mps:+.1f} m/s"
    return f"{words}: tried, it is detected" if _tried(case, object_id, change) else words


def _tried(case: Case, object_id: int, waveform: Mapping[str, Any]) -> bool:
    """Synthesise and process the frame's echoes with another waveform, and tell whether the object is detected."""
    p = case.cube.profile
    data = p.model_dump()
    data["waveform"] |= waveform
    changed = RadarProfile.model_validate(data)
    samples = synthesize(
        case.returns, changed, noise="thermal" if case.cube.noise_added else None, seed=case.seed, frame=case.frame,
        radar=case.radar,
    )  # fmt: skip
    cube = process(samples, range_window=case.cube.range_window, doppler_window=case.cube.doppler_window)
    return found_in(cube, object_id)
