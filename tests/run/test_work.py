"""Work: accounts are kept, and what a bound on work cuts short is the same for any number of threads."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from manifold3d import Manifold, OpType

import rlacd
from rlacd import cut_and_merge
from rlacd.run import Run, Work
from tests.hulls import assert_same_hulls
from tests.shapes import box, trimesh_of
from tests.shapes_large import screws, sponge

PRICES = st.lists(st.floats(0, 50), max_size=40)


@given(st.floats(0, 200), PRICES)
def test_no_more_is_spent_than_there_is(most: float, prices: list[float]) -> None:
    work = Work(most)
    paid = [price for price in prices if work.pay(price)]
    assert sum(paid) <= work.done <= most
    assert work.is_spent == (len(paid) < len(prices))
    assert paid == prices[: len(paid)]  # once something was refused, so is all that follows


@given(st.floats(0, 200), st.floats(0, 200), PRICES)
def test_an_allowance_is_part_of_the_account(most: float, units: float, prices: list[float]) -> None:
    run = Run(1).alone(most)
    with run.limited(units, cuts="cut"):
        for price in prices:
            run.work.pay(price)
        spent, used_up = run.work.done, run.work.is_spent
        assert spent <= units
    assert run.work.done == spent <= most
    assert not run.work.is_spent
    assert run.cut_short == ({"cut"} if used_up else set())


def crossing() -> Any:
    return screws(60, sides=6)


def grate() -> trimesh.Trimesh:
    holes = [box((i, j, -1), (i + 0.7, j + 0.7, 1)) for i in range(6) for j in range(6)]
    return trimesh_of(box((-0.3, -0.3, 0), (6, 6, 0.2)) - Manifold.batch_boolean(holes, OpType.Add))


@pytest.mark.parametrize(
    "shape",
    [pytest.param(grate, marks=pytest.mark.slow), pytest.param(lambda: sponge(2), marks=pytest.mark.slow), crossing],
)
@pytest.mark.promise("bounded")
def test_the_default_stays_within_its_account(shape: Callable[[], Any]) -> None:
    solid = shape()
    one, three = (rlacd.decompose(solid, threads=threads) for threads in (1, 3))
    fast = rlacd.decompose(solid, quality="fast")
    search = one.report["search"]
    assert 0 < search["work"] <= search["allowed"]
    assert search["work"] == three.report["search"]["work"]
    assert len(one) <= len(fast)
    assert_same_hulls(one, three)


@pytest.mark.slow
def test_a_pass_whose_merging_is_cut_short_meets_the_threshold_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    solid = sponge(2)
    whole = rlacd.decompose(solid, quality="fast")
    monkeypatch.setattr(cut_and_merge, "MOST_MERGING", 1e5)
    short = rlacd.decompose(solid, quality="fast")
    assert len(short) > len(whole)
    assert short.report["concavity"]["max"] <= 0.05
    for result, expected in ((whole, False), (short, True)):
        assert any("merging stopped" in warning for warning in result.report["warnings"]) == expected
