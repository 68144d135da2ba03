"""The decision process: the same components as `decompose` under the same policy, and the paper's rewards."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

pytest.importorskip("torch", reason="needs the extra train")

from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.learn.meshes import list_meshes
from rlacd.learn.process import Cut, CutProcess, terminal_reward
from rlacd.planes.sweep import paper_planes, sweep, valid_planes
from rlacd.run import Run
from rlacd.solid.component import Component, Plane
from tests.learning import GreedyOverMask, greedy_plane, small_solids, write_meshes
from tests.test_sweep import SOLIDS

CRITERION = Concavity(0.04)


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    return write_meshes(tmp_path / "meshes")


def volumes(components: list[Component]) -> list[tuple[float, float]]:
    return sorted((c.volume, c.hull.volume) for c in components)


def cut_greedily(cutting: CutProcess) -> list[Cut]:
    """Cut to the end."""
    earned = []
    while cutting.unfinished:
        index = cutting.largest()
        component = cutting.unfinished[index]
        number = greedy_plane(component)
        assert number is not None
        cut = cutting.cut(index, cutting.candidates(component).plane(number))
        earned.append(cut)
    return earned


@pytest.mark.parametrize("name", small_solids())
def test_the_same_policy_reaches_the_same_components_as_decompose(name: str) -> None:
    solid = Component(small_solids()[name])
    with Run(1) as run:
        done, left = CutTree(solid, GreedyOverMask(), run).cut_until(CRITERION)
    cutting = CutProcess(solid, CRITERION)
    start = sum(c.hull.volume for c in cutting.all)
    earned = cut_greedily(cutting)
    assert volumes(cutting.finished) == volumes(done)
    assert volumes(cutting.stuck) == volumes(left)
    end = sum(c.hull.volume for c in cutting.finished + cutting.stuck)
    assert sum(cut.saved for cut in earned) * solid.hull.volume == pytest.approx(start - end, abs=1e-9)
    paid = terminal_reward(len(cutting.finished)) if earned and cutting.terminal else 0
    assert sum(cut.finishes for cut in earned) == paid


def test_reward_of_an_angle_by_hand() -> None:
    solid = Component(small_solids()["angle"])  # two boxes, 2 x 1 x 0.3 and 0.3 x 1 x 1.2 on top of it
    cutting = CutProcess(solid, CRITERION)
    plane = Plane((0.0, 0.0, 1.0), 0.3)
    cut = cutting.cut(0, plane)
    hull = (2 * 1.5 - (2 - 0.3) * (1.5 - 0.3) / 2) * 1.0
    assert solid.hull.volume == pytest.approx(hull)
    assert cut.saved == pytest.approx((hull - 0.6 - 0.36) / hull)
    assert cut.finishes == 1
    assert cutting.terminal
    assert (cut.left.unfinished, cut.discounts, len(cut.left.finished)) == ([], [], 2)


def test_rewards_are_relative_to_the_whole_solids_hull_and_discounts_to_the_components() -> None:
    cutting = CutProcess(Component(small_solids()["table"]), CRITERION)
    hull = before = cutting.unfinished[0].hull.volume
    while cutting.unfinished:
        component = cutting.unfinished[0]
        cut = cutting.cut(0, cutting.candidates(component).plane(greedy_plane(component) or 0))
        after = sum(c.hull.volume for c in cutting.all)
        assert cut.saved == pytest.approx((before - after) / hull)
        before = after
        whole = max(component.hull.volume, sum(c.hull.volume for c in cut.left.all))
        assert cut.discounts == [pytest.approx(c.hull.volume / whole) for c in cut.left.unfinished]
        assert sum(cut.discounts) <= 1


def test_terminal_reward_falls_with_the_number_of_parts() -> None:
    assert terminal_reward(2) == 1
    assert terminal_reward(3) == pytest.approx(1 / (1 + math.log(2)))
    assert terminal_reward(11) == pytest.approx(1 / (1 + math.log(10)))


def test_valid_planes_need_no_sweep_and_are_valid_by_it() -> None:
    differ = total = 0
    for solid in SOLIDS.values():
        for piece in Component(solid()).pieces():
            candidates = paper_planes(piece)
            cheap, exact = valid_planes(piece, candidates), sweep(piece, candidates).valid()
            assert not exact.any() or not (cheap & ~exact).any()
            differ += int((cheap != exact).sum())
            total += len(exact)
    assert differ < 0.1 * total


def test_unreadable_meshes_are_left_out_and_counted(meshes: Path) -> None:
    listed = list_meshes(meshes, max_faces=1000, validation=2, seed=0)
    assert listed.unreadable == 1
    assert len(listed.training) == 3
    assert len(listed.validation) == 2
    assert "deeper/table.ply" in listed.training + listed.validation
    assert list_meshes(meshes, max_faces=12, validation=0, seed=0).training == ("box.ply",)
