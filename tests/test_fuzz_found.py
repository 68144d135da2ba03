"""What fuzzing and the sanitizers have found, each by the smallest input that shows it."""

from __future__ import annotations

import numpy as np
import pytest

from rlacd import _native
from rlacd.solid.load import load_mesh
from rlacd.solid.repair import repair


def triangles(unit: float) -> tuple[np.ndarray, np.ndarray]:
    random = np.random.default_rng(0)
    vertices = np.clip(random.normal(size=(60, 3)), -1, 1) * unit
    return vertices, random.integers(0, 60, (80, 3)).astype(np.int32)


@pytest.mark.parametrize("unit", [5e-324, 1e-310, 1e-200, 1e149])
def test_surfaces_of_any_size_can_be_asked_for_closest_points(unit: float) -> None:
    """Bins along an axis shorter than 1e-307 had no numbers: a tree of boxes read far out of bounds."""
    vertices, faces = triangles(unit)
    _, on = _native.Surface(vertices, faces).closest(vertices)
    assert ((on >= 0) & (on < 80)).all()


@pytest.mark.parametrize("unit", [1e155, 1e308])
def test_coordinates_whose_squares_overflow_are_refused(unit: float) -> None:
    """All distances were infinite, no triangle the nearest: number -1 was looked up."""
    vertices, faces = triangles(unit)
    with pytest.raises(ValueError, match="1e150"):
        _native.Surface(vertices, faces)
    with pytest.raises(ValueError, match="1e150"):
        _native.Surface(vertices / unit, faces).closest(vertices)


def test_a_point_that_is_no_number_is_refused() -> None:
    vertices, faces = triangles(1)
    vertices[3, 1] = np.nan
    with pytest.raises(ValueError, match="not finite"):
        _native.Surface(vertices, faces)


@pytest.mark.parametrize(("count", "step"), [(12, "slab"), (60, "wrapped")])
def test_sheets_that_all_cross_are_wrapped_when_they_are_many(count: int, step: str) -> None:
    """Uniting some hundred of them one by one took a quarter of an hour."""
    random = np.random.default_rng(0)
    corners = random.normal(size=(count, 2, 3))
    vertices = np.concatenate([corners, -corners.sum(axis=1, keepdims=True)], axis=1).reshape(-1, 3)  # around 0
    solid = repair(load_mesh((vertices, np.arange(3 * count).reshape(-1, 3))), threads=1)
    assert {body.step for body in solid.bodies} == {step}
    assert solid.manifold.volume() > 0
