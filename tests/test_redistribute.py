"""A part that is divided among others: nothing is lost, what they take is tight, and it is gone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rlacd import _native
from rlacd.criteria import Concavity
from rlacd.criteria.criterion import Criterion
from rlacd.search.operators import Exchange, redistribute
from rlacd.solid.component import Component, Part
from tests.shapes import bent_bar, box, own_volume, stacks, together

CRITERION = Concavity(0.05)


def depth_outside(points: np.ndarray, parts: Sequence[Part]) -> float:
    """How far the outermost of some points is from the nearest hull."""
    distance = np.full(len(points), np.inf)
    for part in parts:
        surface = _native.Surface(part.hull.vertices, part.hull.faces)
        away = np.where(surface.winding(points, 2.0, 1) > 0.5, 0.0, surface.distance(points, 1))
        distance = np.minimum(distance, away)
    return float(distance.max())


def check(exchange: Exchange, part: Part, around: Sequence[Part], criterion: Criterion) -> None:
    assert exchange.gain == 1
    assert exchange.out[0] is part
    assert set(exchange.out[1:]) <= set(around)
    assert all(criterion.is_met(new) for new in exchange.into)
    assert own_volume(exchange.into) == pytest.approx(own_volume(exchange.out), rel=1e-6)
    corners = np.concatenate([member.vertices for member in part.members])
    assert depth_outside(corners, exchange.into) < 1e-6, "all of it is in the hulls of those that took it"


def test_a_part_is_divided_between_its_neighbours() -> None:
    left, middle, right = bent_bar()
    solid = together([left, middle, right])
    found = [redistribute(middle, [left, right], CRITERION, np.random.default_rng(seed), solid) for seed in range(5)]
    assert any(found)
    for exchange in found:
        if exchange is not None:
            check(exchange, middle, [left, right], CRITERION)
            assert len(exchange.into) == 2


def test_a_part_that_sticks_out_stays() -> None:
    slab, pin = Component(box((0, 0, 0), (1, 1, 0.2))), Component(box((0.4, 0.4, 0.2), (0.6, 0.6, 0.9)))
    solid = together([slab, pin])
    assert redistribute(pin, [slab], CRITERION, np.random.default_rng(0), solid) is None
    assert redistribute(pin, [], CRITERION, np.random.default_rng(0), solid) is None


def test_all_or_nothing() -> None:
    """A half that fits into a neighbour does not go there if the other half fits nowhere."""
    slab, long = Component(box((0, 0, 0), (1, 1, 0.2))), Component(box((1, 0, 0), (3, 1, 0.2)))
    tower = Component(box((2.9, 0, 0.2), (3, 1, 1.5)))
    parts: list[Part] = [slab, tower]
    bent = Part.glued(long, tower)
    solid = together([slab, long, tower])
    assert redistribute(bent, [slab], CRITERION, np.random.default_rng(0), solid) is None
    assert redistribute(long, parts, CRITERION, np.random.default_rng(0), solid) is not None


@settings(max_examples=30, deadline=None)
@given(stacks(), st.integers(0, 2**32 - 1))
def test_nothing_is_lost(stack: list[Component], seed: int) -> None:
    solid = together(stack)
    part, *around = sorted(stack, key=lambda part: part.hull.volume)
    once, again = (redistribute(part, around, CRITERION, np.random.default_rng(seed), solid) for _ in range(2))
    assert (once is None) == (again is None)
    if once is not None and again is not None:
        check(once, part, around, CRITERION)
        assert [p.volume for p in once.into] == [p.volume for p in again.into]
