"""Fixtures shared by all tests."""

from __future__ import annotations

import os
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def corpus() -> Path:
    """The folder of real meshes: $RLACD_MESHES, or ../shared/meshes beside the checkout; skips where there is none."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "meshes"
    folder = Path(os.environ.get("RLACD_MESHES", beside))
    if not (folder / "index.csv").is_file():
        pytest.skip(f"no folder of real meshes at {folder} (set RLACD_MESHES)")
    return folder
