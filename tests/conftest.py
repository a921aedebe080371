"""Fixtures shared by all tests."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

# No test judges time, and a failing example must fail again: the same draws everywhere.
settings.register_profile(
    "project", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow], print_blob=True
)
settings.load_profile("project")


def _shared(folder: str) -> Path:
    """Return a folder of the shared reference material, or skip: the project is complete without it."""
    roots = [Path(p) for p in (os.environ.get("SHENRON_RT_SHARED"),) if p]
    roots.append(Path(__file__).resolve().parents[2] / "shared")
    for root in roots:
        if (root / folder).is_dir():
            return root / folder
    pytest.skip(f"no shared {folder} folder beside the checkout (set SHENRON_RT_SHARED)")


@pytest.fixture(scope="session")
def shared_reference() -> Path:
    """Folder of the reference tables."""
    return _shared("reference")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the real meshes and LiDAR frames."""
    return _shared("data")


@pytest.fixture
def rng() -> np.random.Generator:
    """Generator with a fixed seed."""
    return np.random.default_rng(20_250_101)


@pytest.fixture(scope="session")
def street_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run folder of three frames of a street with a car ahead, few rays, no pictures."""
    from export_tools import STREET, run_scene

    folder = tmp_path_factory.mktemp("street")
    (folder / "street.yaml").write_text(STREET, encoding="utf-8")
    return run_scene(folder / "run", str(folder / "street.yaml"), "--frames", "0:3")
