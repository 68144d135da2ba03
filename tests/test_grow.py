"""Hulls that grow through the solid: bars that cross are found again, and other solids pay nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold, OpType

from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.cut_and_merge import cut_and_merge
from rlacd.merge import grow_cover
from rlacd.planes.sweep import SweepCache
from rlacd.policies import make_policy
from rlacd.run import Run
from rlacd.solid.component import Component, Part
from tests.shapes import bent_bar, box, dense, from_manifold, own_volume, to_manifold, together
from tests.test_redistribute import depth_outside

CRITERION = Concavity(0.05)


def bars(count: int, seed: int) -> Component:
    """A connected solid of long bars at random, in the frame."""
    draw, solid = np.random.default_rng(seed), []
    for _ in range(count):
        half = draw.uniform((0.5, 0.06, 0.06), (1.0, 0.12, 0.12))
        bar = box(tuple(-half), tuple(half)).rotate(draw.uniform(0, 360, 3))
        solid.append(bar.translate(draw.uniform(-0.4, 0.4, 3)))
    return Component(max(Manifold.batch_boolean(solid, OpType.Add).decompose(), key=lambda body: body.volume()))


def merged(solid: Component, run: Run) -> list[Part]:
    tree = CutTree(solid, make_policy("greedy", SweepCache(), None), run)
    return cut_and_merge(tree, CRITERION, run).parts


@settings(max_examples=15, deadline=None)
@given(st.integers(2, 5), st.integers(0, 1000), st.floats(0.05, 0.1))
def test_what_grows_holds_its_hull_and_the_solid_comes_no_deeper_into_it(count: int, seed: int, depth: float) -> None:
    solid = bars(count, seed)
    with Run(1) as run:
        piece = max((member for part in merged(solid, run) for member in part.members), key=lambda one: one.volume)
    spaces = solid.filling.grown(piece.hull.vertices, piece.hull.faces, depth)
    normals, offsets = spaces[:, :3], spaces[:, 3]
    assert (piece.hull.vertices @ normals.T <= offsets + 1e-9).all()
    inside = (offsets - dense(from_manifold(to_manifold(solid.vertices, solid.faces))) @ normals.T).min(axis=1)
    assert inside.max() <= depth + 1e-9


def test_bars_that_cross_take_fewer_parts_that_are_tight_and_lose_nothing() -> None:
    solid, found = bars(8, 0), []
    for threads in (1, 2, 3):
        with Run(threads) as run:
            before = merged(solid, run)
            found.append(grow_cover(before, CRITERION, run, solid))
    after, whole = found[0], to_manifold(solid.vertices, solid.faces)
    assert len(after) < len(before)
    for part in after:
        inside = whole ^ to_manifold(part.hull.vertices, part.hull.faces)
        assert CRITERION.is_met(Component(inside)), "the solid clipped by another library"
    assert depth_outside(dense(from_manifold(whole)), after) < 5e-3, "no more than slivers"
    assert own_volume(after) == pytest.approx(solid.volume, rel=1e-2)
    for others in found[1:]:
        assert [part.hull.vertices.tobytes() for part in others] == [part.hull.vertices.tobytes() for part in after]


@pytest.mark.parametrize("solid", [together(bent_bar()), Component(box((0, 0, 0), (2, 1, 1)))], ids=["bent", "box"])
def test_where_nothing_crosses_no_work_is_done(solid: Component) -> None:
    with Run(1) as run:
        parts = merged(solid, run)
        done = run.work.done
        assert grow_cover(parts, CRITERION, run, solid) is parts
        assert run.work.done == done


@pytest.mark.parametrize("units", [0, 3_000, 30_000])
def test_without_enough_work_the_merged_parts_stay(units: int) -> None:
    solid = bars(8, 0)
    with Run(1) as run:
        parts = merged(solid, run)
        with run.limited(units):
            assert grow_cover(parts, CRITERION, run, solid) is parts
        assert run.stopped_by is None
