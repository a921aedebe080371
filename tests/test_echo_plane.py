"""Where the antenna's V lies against the plane of incidence, with a normal and without."""

from __future__ import annotations

import numpy as np
import pytest

from shenron_rt.echo.plane import across_share
from shenron_rt.scatterers import Scatterers
from shenron_rt.tags import SemanticTag


def _rows(position: np.ndarray, normal: np.ndarray, tag: SemanticTag, *, known: bool) -> Scatterers:
    n = len(position)
    u = position / np.linalg.norm(position, axis=1)[:, None]
    return Scatterers(
        position=position, range_rate=np.zeros(n), cos_incidence=-np.einsum("ij,ij->i", normal, u),
        object_id=np.zeros(n, np.uint32), tag=np.full(n, tag, np.uint8), normal=normal if known else None,
    )  # fmt: skip


def _share(rows: Scatterers) -> np.ndarray:
    u = rows.position / rows.range[:, None]
    return across_share(rows, np.arange(len(rows)), u)


def test_an_upright_surface_needs_no_normal_where_its_tag_tells(rng: np.random.Generator) -> None:
    n = 200
    turn = rng.uniform(0, 2 * np.pi, n)
    normal = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(n)])
    position = np.column_stack([rng.uniform(3, 40, n), rng.uniform(-10, 10, n), rng.uniform(-1, 4, n)])
    normal *= -np.sign(np.einsum("ij,ij->i", normal, position))[:, None]  # towards the radar
    exact = _share(_rows(position, normal, SemanticTag.Walls, known=True))
    # 1 - sin^2(el) - cos^2(theta) loses digits where the wall faces the radar
    assert _share(_rows(position, normal, SemanticTag.Walls, known=False)) == pytest.approx(exact, abs=1e-9)
    assert np.all(_share(_rows(position, normal, SemanticTag.Car, known=False)) == 0)  # a car's parts stand in any way


def test_level_ground_has_v_in_the_plane_and_a_normal_goes_before_the_tag() -> None:
    position = np.array([[10.0, 3.0, -1.0], [4.0, -2.0, -1.0]])
    up = np.broadcast_to([0.0, 0.0, 1.0], (2, 3))
    for tag, known in ((SemanticTag.Roads, False), (SemanticTag.Roads, True), (SemanticTag.Walls, True)):
        assert _share(_rows(position, up, tag, known=known)) == pytest.approx([0.0, 0.0], abs=1e-12)
