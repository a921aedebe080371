"""A small frame made by hand, for tests of run folders and pictures."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from shenron_rt.config.profile import RadarProfile, load_profile
from shenron_rt.dsp import detect, process
from shenron_rt.returns import Returns
from shenron_rt.scatterers import Scatterers
from shenron_rt.synthesis import synthesize
from shenron_rt.tags import SemanticTag

NAMES = {0: "static", 7: "post", 8: "car", 9: "hidden"}


def hand_made_returns(profile: RadarProfile) -> Returns:
    """Return a post at (20, 4, 0), a car at (30, -3, 0) that comes at 5 m/s, and two static echoes."""
    position = np.array([[20.0, 4.0, 0.0], [30.0, -3.0, 0.0], [10.0, 0.0, 0.0], [12.0, 1.0, 0.0]])
    velocity = np.zeros((4, 3))
    velocity[1, 0] = -5.0
    # 30, 20, 10 and 10 dB over the noise of one sample
    level = np.sqrt(profile.noise_power_w * 10.0 ** np.array([3.0, 2.0, 1.0, 1.0]))
    return Returns(
        amplitude=level.astype(np.complex128),
        position=position,
        velocity=velocity,
        object_id=np.array([7, 8, 0, 0], dtype=np.uint32),
        tag=np.array([SemanticTag.Poles, SemanticTag.Car, SemanticTag.Roads, SemanticTag.Roads], dtype=np.uint8),
        coherent=np.array([True, True, False, False]),
        bounces=np.ones(4, dtype=np.uint8),
        scatterer=np.arange(4),
        center_hz=profile.center_hz,
    )


def hand_made_frame(name: str = "awrl1432", index: int = 0, **overrides: Any) -> SimpleNamespace:
    """Return what :func:`shenron_rt.simulate` would, of four echoes."""
    profile = load_profile(name, {"waveform.samples": 128, "waveform.chirps": 32, **overrides})
    returns = hand_made_returns(profile)
    scatterers = Scatterers(
        position=returns.position,
        range_rate=np.einsum("ij,ij->i", returns.position, returns.velocity) / np.linalg.norm(returns.position, axis=1),
        cos_incidence=np.ones(4),
        object_id=returns.object_id,
        tag=returns.tag,
        velocity=returns.velocity,
    )
    adc = synthesize(returns, profile, seed=3, frame=index)
    cube = process(adc)
    return SimpleNamespace(
        scatterers=scatterers, returns=returns, adc=adc, cube=cube, detections=detect(cube), profile=profile, seed=3,
        backend="scalar", radar="front", time=0.1 * index, frame=index,
    )  # fmt: skip
