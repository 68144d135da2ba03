"""The paper's appendix A: tabular dual-state Q-learning finds what dynamic programming does, or grows without bound."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="needs the extra train")

from rlacd.criteria import Concavity
from rlacd.errors import RlacdError
from rlacd.io.read.load import load_mesh
from rlacd.learn.paper.tabular import Node, all_nodes, grow, middle_planes, process_of, q_learning
from rlacd.repair.repair import repair
from rlacd.solid.component import Component
from tests.learning import small_solids

CRITERION = Concavity(0.02)


@pytest.fixture(scope="module")
def roots() -> list[Node]:
    solids = [Component(solid) for name, solid in small_solids().items() if name in ("angle", "table", "cross")]
    return [node for solid in solids for node in grow(solid, CRITERION, middle_planes(), depth=3)]


@pytest.fixture(scope="module")
def real_roots(corpus: Path) -> list[Node]:
    found: list[Node] = []
    names = sorted(p for p in (corpus / "train").rglob("*.ply") if p.stat().st_size < 8_000)
    for path in names[:: len(names) // 12]:
        try:
            found += grow(Component(repair(load_mesh(path)).manifold), CRITERION, middle_planes(), depth=3)
        except (RlacdError, ValueError):  # flat
            continue
    return [node for node in found if node.outcomes]


def best(node: Node, finish_reward: float) -> float:
    """Value of a node by recursion over the tree: eq. 7 and 8 as they stand."""
    return max(
        (
            o.saved
            + finish_reward * o.finished
            + sum(d * best(c, finish_reward) for c, d in zip(o.children, o.discounts, strict=True))
            for o in node.outcomes
        ),
        default=0.0,
    )


def most_saved(node: Node) -> float:
    """The most hull volume that any way through the tree saves, in the solid's own unit: no discounts at all."""
    return max(
        (o.saved * node.hull_volume + sum(most_saved(c) for c in o.children) for o in node.outcomes), default=0.0
    )


def root_values(roots: list[Node], finish_reward: float) -> list[float]:
    process = process_of(roots, alike=False, finish_reward=finish_reward)
    exact = process.solve()
    assert exact is not None
    order = [node for node in all_nodes(roots) if node.outcomes]
    values = process.values(exact)
    return [float(values[order.index(root)]) for root in roots]


@pytest.mark.parametrize("finish_reward", [0.0, 1.0])
def test_dynamic_programming_agrees_with_recursion_over_the_tree(roots: list[Node], finish_reward: float) -> None:
    assert root_values(roots, finish_reward) == pytest.approx([best(root, finish_reward) for root in roots])


def test_shares_of_the_hull_make_the_return_the_volume_saved(roots: list[Node]) -> None:
    expected = [most_saved(root) / root.hull_volume for root in roots]
    assert root_values(roots, 0.0) == pytest.approx(expected)


@pytest.mark.parametrize("static_discount", [None, 0.99])
def test_q_learning_converges_to_dynamic_programming_on_trees(roots: list[Node], static_discount: float | None) -> None:
    process = process_of(roots, alike=False, static_discount=static_discount)
    exact = process.solve()
    assert exact is not None
    # Every sample is certain, so steps of size 1 are allowed and the answer is exact.
    learned = q_learning(process, 60 * len(process.pair), np.random.default_rng(0), rate=0.0)[-1]
    assert learned[process.possible] == pytest.approx(exact[process.possible], abs=1e-12)


def error(process: object, exact: np.ndarray, q: np.ndarray) -> float:
    return float(np.abs(q - exact)[process.possible].max())  # type: ignore[attr-defined]


@pytest.mark.nightly
@pytest.mark.parametrize("static_discount", [None, 0.4])
def test_with_loops_q_learning_converges_where_discounts_add_up_to_less_than_one(
    real_roots: list[Node], static_discount: float | None
) -> None:
    process = process_of(real_roots, alike=True, static_discount=static_discount)
    exact = process.solve()
    assert exact is not None
    history = q_learning(process, 300_000, np.random.default_rng(0), every=1000)
    assert error(process, exact, history[-1]) < 0.05 * np.abs(exact).max()
    assert error(process, exact, history[-1]) < 0.2 * error(process, exact, history[1])


@pytest.mark.nightly
def test_with_loops_q_learning_diverges_where_discounts_add_up_to_more_than_one(real_roots: list[Node]) -> None:
    process = process_of(real_roots, alike=True, static_discount=0.9)
    assert process.solve() is None
    sizes = [np.abs(q).max() for q in q_learning(process, 100_000, np.random.default_rng(0), every=10_000)]
    bound = 2 / (1 - 0.9)  # of any return, were there but one side
    assert sizes[-1] > 100 * bound
    assert all(later > earlier for earlier, later in itertools.pairwise(sizes))
