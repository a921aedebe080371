"""Frames whose content is known, for tests of comparisons."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from shenron_rt.config.profile import RadarProfile, load_profile
from shenron_rt.dsp import detect, process
from shenron_rt.returns import Returns, illuminate
from shenron_rt.scatterers import Scatterers
from shenron_rt.synthesis import synthesize
from shenron_rt.tags import SemanticTag

ROWS = 900


def small_profile(**overrides: Any) -> RadarProfile:
    """Return ``awrl1432`` with a cube small enough for a test."""
    return load_profile("awrl1432", {"waveform.samples": 128, "waveform.chirps": 16, **overrides})


def patch(
    object_id: int,
    center: tuple[float, float, float],
    *,
    size: float = 1.0,
    rows: int = ROWS,
    cosine: float = 0.8,
    area: float = 2.0,
    tag: SemanticTag = SemanticTag.Walls,
    material: str | None = None,
    seed: int = 0,
) -> dict[str, Any]:
    """Return the rows of a square patch across the line of sight: ``area`` in all, one cosine."""
    spread = np.random.default_rng(seed).uniform(-size / 2, size / 2, (rows, 2))
    at = np.asarray(center, dtype=np.float64)
    return {
        "position": at + np.column_stack([np.zeros(rows), spread]), "cos_incidence": np.full(rows, cosine),
        "area": np.full(rows, area / rows), "object_id": np.full(rows, object_id, dtype=np.uint32),
        "tag": np.full(rows, tag, dtype=np.uint8), "material": material,
    }  # fmt: skip


def scatterers_of(*patches: dict[str, Any], seed: int = 1, **fields: Any) -> Scatterers:
    """Join patches; ``material`` on all of them or on none."""
    joined = {k: np.concatenate([p[k] for p in patches]) for k in patches[0] if k != "material"}
    names = tuple(dict.fromkeys(p["material"] for p in patches if p["material"] is not None))
    if names:
        index = [np.full(len(p["area"]), names.index(p["material"]), dtype=np.uint16) for p in patches]
        fields = {"material": np.concatenate(index), "material_names": names, **fields}
    rows = len(joined["area"])
    return Scatterers(**joined, range_rate=np.zeros(rows), velocity=np.zeros((rows, 3)), seed=seed, **fields)


def frame_of(
    scatterers: Scatterers, profile: RadarProfile | None = None, *, returns: Returns | None = None, index: int = 0
) -> SimpleNamespace:
    """Return what :func:`shenron_rt.simulate` would, from scatterers or from echoes given."""
    used = profile or small_profile()
    echoes = illuminate(scatterers, used) if returns is None else returns
    adc = synthesize(echoes, used, seed=3, accuracy=1e-3)
    cube = process(adc)
    return SimpleNamespace(
        scatterers=scatterers, returns=echoes, adc=adc, cube=cube, detections=detect(cube), profile=used, seed=3,
        backend="scalar", radar="front", time=0.0, frame=index,
    )  # fmt: skip
