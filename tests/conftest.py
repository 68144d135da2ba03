"""Fixtures shared by all tests."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# Every push draws the same examples, so that it fails only for what it changes; RLACD_RANDOM=1 draws others each time.
# No limits on time: the machine may be busy.
UNTIMED = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("push", UNTIMED, derandomize=True)
settings.register_profile("random", UNTIMED, derandomize=False)
settings.load_profile("random" if os.environ.get("RLACD_RANDOM") else "push")


class CorpusPath(type(Path())):  # type: ignore[misc]
    """A folder that may hold some of the real meshes only: a test that asks for others is skipped."""

    def __truediv__(self, name: str | Path) -> CorpusPath:
        path = CorpusPath(super().__truediv__(name))
        if not path.exists():
            pytest.skip(f"{name} is not among the real meshes")
        return path


@pytest.fixture(scope="session")
def corpus() -> Path:
    """The folder of real meshes: $RLACD_MESHES, or ../shared/meshes beside the checkout; skips where there is none.

    ``python -m benchmarks fetch FOLDER`` brings most of those of the folders ``test`` and ``vhacd_set``.
    """
    beside = Path(__file__).resolve().parents[2] / "shared" / "meshes"
    folder = Path(os.environ.get("RLACD_MESHES", beside))
    if not (folder / "index.csv").is_file():
        pytest.skip(f"no folder of real meshes at {folder} (set RLACD_MESHES)")
    return CorpusPath(folder)
