"""The pieces of all parts are a partition of the solid after each stage, and each lies in its part's hull."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold, OpType

import rlacd
from rlacd.solid.component import Part
from rlacd.solid.distance import hull_union
from tests.shapes import block, table, trimesh_of

STAGES: dict[str, Callable[[Any], list[Sequence[Part]]]] = {
    "rlacd.find_parts.cut_and_merge": lambda done: [done.pieces, done.parts],
    "rlacd.search.levels.cut_and_merge": lambda done: [done.pieces, done.parts],
    "rlacd.find_parts.grow_cover": lambda parts: [parts],
    "rlacd.find_parts.eliminate_parts": lambda parts: [parts],
    "rlacd.find_parts.search": lambda found: found[0],
}
"""The functions of the stages, and the states that each leaves."""

SLIVERS = 1e-5
"""Share of the volume that may be lost as slivers."""

TOUCHING = 1e-8
"""How far a corner of a piece may lie outside its part's hull, by rounding."""


def assert_partition(parts: Sequence[Part]) -> None:
    whole = parts[0].whole
    assert all(part.whole is whole for part in parts), "pieces of one solid"
    volume = sum(piece.volume for part in parts for piece in part.members)
    assert (1 - SLIVERS) * whole.volume <= volume <= (1 + 1e-6) * whole.volume
    for part in parts:
        corners = np.concatenate([piece.vertices[np.unique(piece.faces)] for piece in part.members])
        assert hull_union([part.hull], 1).distance(corners, 1).max() <= TOUCHING


@pytest.fixture
def states(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Asserts it of all states that stages leave; their names, as they come."""
    seen: list[str] = []

    def watched(path: str, stage: Callable[..., Any], states: Callable[[Any], list[Sequence[Part]]]) -> Any:
        def run(*arguments: Any, **named: Any) -> Any:
            result = stage(*arguments, **named)
            for state in states(result):
                assert_partition(state)
                seen.append(path)
            return result

        return run

    for path, states in STAGES.items():
        monkeypatch.setattr(path, watched(path, pkgutil.resolve_name(path), states))
    return seen


def hash_sign() -> trimesh.Trimesh:
    """Four bars that cross: hulls overlap there, pieces do not."""
    bars = [block(2, 0.2, 0.2, (0, y, 0)) for y in (-0.5, 0.5)] + [block(0.2, 2, 0.2, (x, 0, 0)) for x in (-0.5, 0.5)]
    return trimesh_of(Manifold.batch_boolean(bars, OpType.Add))


def ring() -> trimesh.Trimesh:
    return trimesh.creation.torus(1.0, 0.2, major_sections=24, minor_sections=12)


@pytest.mark.parametrize("asked", [{"quality": "fast"}, {}, {"criterion": "distance"}, {"criterion": "volume"}])
@pytest.mark.parametrize("mesh", [table(), hash_sign(), ring()], ids=["table", "crossing", "ring"])
def test_pieces_of_the_parts_are_a_partition(states: list[str], mesh: trimesh.Trimesh, asked: dict[str, Any]) -> None:
    rlacd.decompose(mesh, threads=1, **asked)
    assert "rlacd.find_parts.cut_and_merge" in states


@pytest.mark.nightly
def test_pieces_of_real_meshes_are_a_partition(states: list[str], corpus: Path) -> None:
    for name in (corpus / "quick.txt").read_text().split():
        rlacd.decompose(corpus / name, threads=1)
    assert "rlacd.find_parts.search" in states
