"""A part that gives pieces of itself away: nothing is lost, every part stays feasible, and small parts vanish."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold

from rlacd.clock import Clock
from rlacd.criteria import Concavity
from rlacd.merge import merge_parts
from rlacd.planes.sweep_cache import SweepCache
from rlacd.search.budget import SearchBudget
from rlacd.search.context import SearchContext, by_score
from rlacd.search.neighbourhood import Neighbourhood, cost
from rlacd.search.part_graph import PartGraph
from rlacd.search.transfer import transfer
from rlacd.solid.component import Component, Part
from rlacd.workers import Workers
from tests.shapes import bent_bar, box, own_volume, stacks, together

CRITERION = Concavity(0.05)


def neighbourhood(solid: Component, parts: list[Part], workers: Workers, seed: int) -> Neighbourhood:
    rankings, sweeps = [by_score("hull-sum")], SweepCache(12, 0)
    return Neighbourhood(
        SearchContext(solid, CRITERION, workers, seed, rankings=rankings, near_sweeps=sweeps),
        parts,
    )


def test_what_no_part_can_take_whole_is_divided() -> None:
    parts = bent_bar()
    with Workers(1) as workers:
        assert len(merge_parts(parts, CRITERION, workers, Clock())) == 3
    left, middle, right = parts
    solid = together(parts)
    gains = []
    for seed in range(20):
        exchange = transfer(middle, [left, right], CRITERION, np.random.default_rng(seed), solid)
        if exchange is None:
            continue
        gains.append(exchange.gain)
        assert exchange.gain >= 0
        assert exchange.out[0] is middle
        assert all(CRITERION.is_met(part) for part in exchange.into)
        assert own_volume(exchange.into) == pytest.approx(own_volume(exchange.out), rel=1e-6)
    assert max(gains) == 1


def test_a_part_that_fits_into_another_is_taken_at_once() -> None:
    slab, crumb = Component(box((0, 0, 0), (1, 1, 0.2))), Component(box((0.4, 0.4, 0.2), (0.6, 0.6, 0.22)))
    solid = together([slab, crumb])
    exchange = transfer(crumb, [slab], CRITERION, np.random.default_rng(0), solid)
    assert exchange is not None
    assert (len(exchange.out), len(exchange.into)) == (2, 1)
    assert exchange.into[0].volume == pytest.approx(0.2 + 0.04 * 0.02)


def test_small_parts_take_nothing_from_large_ones() -> None:
    slab, crumb = Component(box((0, 0, 0), (1, 1, 0.2))), Component(box((0.4, 0.4, 0.2), (0.6, 0.6, 0.22)))
    solid = together([slab, crumb])
    assert transfer(slab, [crumb], CRITERION, np.random.default_rng(0), solid) is None
    assert transfer(slab, [], CRITERION, np.random.default_rng(0), solid) is None


@settings(max_examples=40, deadline=None)
@given(stacks(), st.integers(0, 2**32 - 1))
def test_nothing_is_lost(stack: list[Component], seed: int) -> None:
    solid = together(stack)
    giver, *around = sorted(stack, key=lambda part: part.hull.volume)
    exchange = transfer(giver, around, CRITERION, np.random.default_rng(seed), solid)
    again = transfer(giver, around, CRITERION, np.random.default_rng(seed), solid)
    assert (exchange is None) == (again is None)
    if exchange is None or again is None:
        return
    assert [part.volume for part in exchange.into] == [part.volume for part in again.into]
    assert set(exchange.out) <= set(stack)
    assert exchange.gain in (0, 1)
    assert all(CRITERION.is_met(part) for part in exchange.into)
    assert own_volume(exchange.into) == pytest.approx(own_volume(exchange.out), rel=1e-6)
    assert not {id(part) for part in exchange.out} & {id(part) for part in exchange.into}


def test_the_search_divides_the_bent_bar() -> None:
    parts = bent_bar()
    with Workers(1) as workers:
        state = neighbourhood(together(parts), parts, workers, 0)
        outcome = state.run(SearchBudget(Clock(), None, 3), 60)
    assert len(outcome.parts) == 2
    assert all(CRITERION.is_met(part) for part in outcome.parts)


def test_a_search_gives_back_the_best_it_has_seen() -> None:
    """Shifting makes hulls larger where it saves no part; that must not come out."""
    parts = [Component(box((x, 0, 0), (x + 0.1 + 0.02 * x, 1, 1 - 0.3 * (x > 1)))) for x in np.arange(4) * 0.5]
    bars = [*parts, *(Component(bent.manifold.translate((0, 3, 0))) for bent in bent_bar())]
    solid = together(bars)
    with Workers(1) as workers:
        for seed in range(3):
            state = neighbourhood(solid, bars, workers, seed)
            reached = cost(bars)
            for _ in range(3):
                outcome = state.run(SearchBudget(Clock(), None, len(bars)), 8)
                assert cost(outcome.parts) <= reached
                reached = cost(outcome.parts)


def test_small_parts_are_drawn_more_often_and_only_those_near_take() -> None:
    places = [(0.0, 1.0), (1.05, 0.1), (1.2, 0.5), (5.0, 1.0)]
    parts: list[Part] = [Component(box((x, 0, 0), (x + width, 1, 1))) for x, width in places]
    with Workers(1) as workers:
        here = PartGraph(parts, CRITERION, workers)
    assert here.near(1, 0.1) == (0, 2)
    assert here.near(0, 0.04) == ()
    assert here.near(3, 10) == (0, 1, 2)
    random = np.random.default_rng(0)
    drawn = np.bincount([here.draw_small(random) for _ in range(2000)], minlength=4)
    assert drawn[1] > drawn[2] > drawn[0]
    assert drawn.min() > 0


def test_a_search_without_gain_ends() -> None:
    """A cube and a ball on it: pieces can be given away for ever, and two parts are the least there can be."""
    cube, ball = Component(box((-1, -1, -1), (1, 1, 0))), Component(Manifold.sphere(0.7, 24).translate((0, 0, 0.7)))
    solid = Component(cube.manifold + ball.manifold)
    parts: list[Part] = [cube, Component(solid.manifold - cube.manifold)]
    with Workers(1) as workers:
        state = neighbourhood(solid, parts, workers, 0)
        outcome = state.run(SearchBudget(Clock(), None, 2), 1000)
    assert outcome.exhausted
    assert outcome.steps < 1000
    assert len(outcome.parts) == 2
