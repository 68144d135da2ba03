"""Colours by adjacency: hulls that touch never share a hue."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import trimesh

from rlacd.io.write.palette import hull_colors
from rlacd.view.coloring import HUES, color_hulls, neighbours


def boxes(places: np.ndarray, size: float = 1.0) -> list[trimesh.Trimesh]:
    return [trimesh.creation.box((size,) * 3, trimesh.transformations.translation_matrix(place)) for place in places]


def grid(count: int) -> np.ndarray:
    return np.array(list(itertools.product(range(count), repeat=3)), dtype=float)


def check(hulls: list[trimesh.Trimesh]) -> None:
    rgb, rank = color_hulls(hulls)
    for one, others in enumerate(neighbours(hulls)):
        assert all((rgb[one] != rgb[other]).any() for other in others)
        assert len(others) >= HUES or all(rank[one] != rank[other] for other in others)
    hues = {bytes(color) for color in hull_colors(HUES)}
    assert {bytes(color) for color in rgb[: min(len(hulls), 4)]} <= hues or len(hulls) > HUES


@pytest.mark.parametrize(
    ("places", "most"),
    [(grid(5), 26), (grid(3) * 1.05, 0), (np.zeros((30, 3)), 29), (grid(1), 0), (np.zeros((0, 3)), 0)],
)
def test_neighbours_of_boxes_that_touch_have_other_hues(places: np.ndarray, most: int) -> None:
    hulls = boxes(places)
    assert max(map(len, neighbours(hulls)), default=0) == most
    check(hulls)
