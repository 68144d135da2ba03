"""The example: a mug hangs by its handle where it is made of hulls, and falls where it is one."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def example() -> ModuleType:
    pytest.importorskip("mujoco", reason="the extra sim is not installed")
    spec = importlib.util.spec_from_file_location("mug_example", ROOT / "examples" / "mug.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def test_the_mug_is_one_closed_body_with_one_handle(example: ModuleType) -> None:
    mug = example.mug()
    assert mug.is_watertight
    assert mug.body_count == 1
    assert mug.euler_number == 0, "a cup with a handle is a torus to a topologist"


@pytest.mark.nightly
def test_the_mug_hangs_by_its_handle_and_its_one_hull_falls(tmp_path: Path, example: ModuleType) -> None:
    hulls, one = example.main(tmp_path, threads=1)
    assert hulls.held
    assert hulls.height > 0.2
    assert hulls.speed**2 / (2 * 9.81) < 0.01, "it may swing for minutes, but not so high that it gets off the peg"
    assert not one.held
    assert one.height < 0.06


@pytest.mark.nightly
def test_a_dropped_mug_comes_to_rest_on_the_ground(tmp_path: Path, example: ModuleType) -> None:
    example.main(tmp_path, threads=1)
    rest = example.drop(tmp_path / "mug.xml")
    assert rest.held
    assert rest.speed < 0.05
    assert 0.03 < rest.height < 0.06, "upright or on its side, not in the ground"
    lowest = min(triangles[..., 2].min() for triangles, _ in rest.geoms[1:])
    assert abs(lowest) < 2e-3
