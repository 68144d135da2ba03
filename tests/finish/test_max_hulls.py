"""A limit on hulls: kept, without effect where the result keeps it anyway, and never worse for being larger."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

import rlacd
from rlacd.criteria import Concavity
from rlacd.merge.merge import united_in_turn
from rlacd.run import Run, Work
from rlacd.solid.component import Component, Part
from tests.hulls import assert_same_hulls
from tests.shapes import box, trimesh_of


def cabinet() -> Manifold:
    rooms = [box((0.02, -0.1, 0.02 + 0.445 * i), (0.88, 0.43, 0.445 + 0.445 * i)) for i in range(4)]
    return box((0, 0, 0), (0.9, 0.45, 1.8)) - sum(rooms[1:], rooms[0])


def drawer() -> Manifold:
    inside = box((-0.195, -0.145, 0.005), (0.195, 0.145, 0.2))
    return box((-0.2, -0.15, 0), (0.2, 0.15, 0.12)) - inside + box((-0.22, -0.17, -0.01), (0.22, -0.15, 0.14))


def mug() -> Manifold:
    handle = Manifold.cylinder(0.9, 2.6, 2.6, 24, True) - Manifold.cylinder(1, 1.8, 1.8, 24, True)
    outside = Manifold.cylinder(9, 4, 4, 24) + handle.rotate((90, 0, 0)).translate((4, 0, 4.5))
    return outside - Manifold.cylinder(10, 3.7, 3.7, 24).translate((0, 0, 0.4))


ACCURACY = 0.001
"""Of concavities above the threshold: a fiftieth of it."""

CRITERIA: list[tuple[str, dict[str, Any]]] = [
    ("concavity", {}),
    ("concavity", {"quality": "fast", "max_vertices": 24}),
    ("volume", {"criterion": "volume", "volume_tolerance": 0.05, "quality": "fast"}),
    ("navigable", {"criterion": rlacd.NavigableSpace(0.05, 0.02), "quality": "fast"}),
]


def error(result: rlacd.Decomposition, criterion: str) -> float:
    entry = result.report[criterion]
    return float(entry["intrusion"]["max"] if criterion == "navigable" else entry["max"])


@pytest.mark.parametrize(
    ("shape", "most"),
    [pytest.param(drawer, 8, marks=pytest.mark.slow)]
    + [pytest.param(shape, 39, marks=pytest.mark.nightly) for shape in (cabinet, drawer, mug)],
)
@pytest.mark.parametrize(("criterion", "options"), CRITERIA)
@pytest.mark.promise("max-hulls")
def test_a_limit_is_kept_and_a_larger_one_never_fits_worse(
    shape: Callable[[], Manifold], most: int, criterion: str, options: dict[str, Any]
) -> None:
    mesh = trimesh_of(shape())
    free = rlacd.decompose(mesh, **options)
    last = np.inf
    for limit in range(1, most + 1):
        result = rlacd.decompose(mesh, max_hulls=limit, **options)
        assert len(result) <= limit
        assert result.report["hausdorff"]["under"] < 0.005
        if limit >= len(free):
            assert_same_hulls(result, free)
            assert result.report["warnings"] == free.report["warnings"]
            break
        worst = error(result, criterion)
        assert worst <= last + (ACCURACY if criterion == "concavity" else 1e-9)
        assert worst > error(free, criterion)
        assert result.report["warnings"], "it says by how much"
        last = worst


def test_parts_are_united_one_by_one_until_one_is_left_or_the_work_is_spent() -> None:
    boxes = [Component(Manifold.cube((1, 1, 1)).translate((3 * i, 0, 0))) for i in range(5)]

    def united(work: float) -> list[tuple[int, float, float]]:
        states = united_in_turn(boxes, Part.glued, Concavity(0.05), Work(work), Run(1))
        return [(len(parts), sum(part.volume for part in parts), worst) for parts, worst in states]

    every = united(1e9)
    assert [count for count, _, _ in every] == [5, 4, 3, 2, 1]
    assert [volume for _, volume, _ in every] == pytest.approx([5] * 5)
    assert every[0][2] < 0.05 < every[1][2] < every[-1][2]
    assert [count for count, _, _ in united(0)] == [5]


def test_coarser_thresholds_are_tried_where_the_finest_has_used_up_its_account(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rlacd.find_parts.MOST_CUTTING", 3e4)
    result = rlacd.decompose(trimesh_of(mug()), max_hulls=4, quality="fast")
    assert error(result, "concavity") < 0.5
