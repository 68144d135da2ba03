"""Against exact dynamic programming on trees of cuts: tabular Q-learning (the paper's appendix A) and networks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

pytest.importorskip("torch", reason="needs the extra train")

from benchmarks.tabular import Node, all_nodes, grow, middle_planes, process_of, q_learning

from rlacd.criteria import Concavity
from rlacd.learn.environment import CutEnv
from rlacd.learn.meshes import Solids
from rlacd.learn.options import TrainOptions
from rlacd.learn.train import load_policy, train
from rlacd.planes.sweep import paper_planes, valid_planes
from rlacd.policies import Policy
from rlacd.solid.component import Component
from tests.learning import small_solids
from tests.shapes import box, trimesh_of

CRITERION = Concavity(0.02)


@pytest.fixture(scope="module")
def roots() -> list[Node]:
    solids = [Component(solid) for name, solid in small_solids().items() if name in ("angle", "table", "cross")]
    return [node for solid in solids for node in grow(solid, CRITERION, middle_planes(), depth=3)]


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


def root_values(roots: list[Node], finish_reward: float) -> list[float]:
    process = process_of(roots, alike=False, finish_reward=finish_reward)
    exact = process.solve()
    assert exact is not None
    order = [node for node in all_nodes(roots) if node.outcomes]
    values = process.values(exact)
    return [float(values[order.index(root)]) for root in roots]


def volume_worth(node: Node, unit: float) -> float:
    """Value of a component where only volume is rewarded, by eq. 7 and 8."""
    return max(
        (
            o.saved * node.hull_volume / unit
            + sum(d * volume_worth(c, unit) for c, d in zip(o.children, o.discounts, strict=True))
            for o in node.outcomes
        ),
        default=0.0,
    )


@pytest.mark.parametrize("finish_reward", [0.0, 1.0])
def test_dynamic_programming_agrees_with_recursion_over_the_tree(roots: list[Node], finish_reward: float) -> None:
    assert root_values(roots, finish_reward) == pytest.approx([best(root, finish_reward) for root in roots])


@pytest.mark.parametrize("static_discount", [None, 0.99])
def test_q_learning_converges_to_dynamic_programming_on_trees(roots: list[Node], static_discount: float | None) -> None:
    process = process_of(roots, alike=False, static_discount=static_discount)
    exact = process.solve()
    assert exact is not None
    # Every sample is certain, so steps of size 1 are allowed and the answer is exact.
    learned = q_learning(process, 60 * len(process.pair), np.random.default_rng(0), rate=0.0)[-1]
    assert learned[process.possible] == pytest.approx(exact[process.possible], abs=1e-12)


TWO = middle_planes((0, 2))

LIMIT = Concavity(0.07)


@pytest.fixture
def two_planes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave only two planes to cut a component by."""

    def two(component: Component, candidates: object = None) -> np.ndarray:
        allowed = np.isin(np.arange(150), TWO)
        return allowed & valid_planes(component, paper_planes(component))

    for place in ("learn.environment.valid", "learn.episodes.valid", "policies.network.distinct"):
        monkeypatch.setattr(f"rlacd.{place}_planes", two)


def saved(folder: Path, name: str, solid: Manifold) -> Component:
    """Write a solid to a folder and read it as training does."""
    folder.mkdir(exist_ok=True)
    trimesh_of(solid).export(folder / name)
    read = Solids(folder, folder / "solids").get(name)
    assert read is not None
    return read


@pytest.fixture
def u_shape(tmp_path: Path, two_planes: None) -> Component:
    """A "u" with arms of different height: 31 components in all."""
    solid = box((0, 0, 0), (3, 1, 0.4)) + box((0, 0, 0), (0.4, 1, 2)) + box((2.6, 0, 0), (3, 1, 1))
    return saved(tmp_path / "meshes", "u.ply", solid)


@pytest.mark.nightly
@pytest.mark.parametrize(
    "changes",
    [
        {"target": "one-step"},
        {"target": "return", "epsilon": 0.1},
    ],
    ids=["one step", "return"],
)
def test_networks_reach_the_optimum_of_their_objective(u_shape: Component, tmp_path: Path, changes: Any) -> None:
    """The reward for finishing the whole solid is no part of a component's own value: there is none to compare with."""
    steps = {
        "env_steps": 1500,
        "learning_starts": 100,
        "batch_size": 32,
        "buffer_size": 5000,
        "target_frequency": 50,
        "environments": 1,
    }
    given = {"finish_reward": 0.0, "learning_rate": 1e-3, "epsilon": 0.3, "validation": 0, "rotate": False}
    options = TrainOptions(threshold=LIMIT.threshold, **{**given, **steps, **changes})
    train(tmp_path / "meshes", tmp_path / "run", options, say=lambda line: None)
    policy = load_policy(tmp_path / "run")
    [root] = grow(u_shape, LIMIT, TWO, depth=8)
    unit = CutEnv(u_shape, LIMIT).excess(u_shape) if options.target == "return" else 1
    known = volume_worth(root, root.hull_volume)
    assert (policy._values(u_shape)[TWO] * unit).max() == pytest.approx(known, abs=0.03)
    assert cuts_by(policy, u_shape) in range(3, 11)


def cuts_by(policy: Policy, solid: Component) -> int:
    """Number of cuts that a policy needs, at most 40."""
    cutting, made = CutEnv(solid, LIMIT), 0
    while cutting.unfinished and made < 40:
        component = cutting.unfinished[0]
        plane = policy.choose(component)
        assert plane is not None
        cutting.step(component, plane)
        made += 1
    return made
