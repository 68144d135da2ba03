"""The decision process is that of `decompose`, its rewards are the paper's; loss and replay, against work by hand."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

pytest.importorskip("torch", reason="needs the extra train")

import torch

from rlacd.criteria import Concavity
from rlacd.cut import CutTree
from rlacd.learn.dqn import Experience, ReplayBuffer, bellman_loss, dual_state_target
from rlacd.learn.environment import CutEnv, Step, terminal_reward
from rlacd.learn.episodes import Episode
from rlacd.learn.meshes import Solids
from rlacd.learn.options import TrainOptions
from rlacd.learn.train import load_policy, train
from rlacd.planes.candidates import OFFSETS_PER_AXIS
from rlacd.planes.sweep import paper_planes, sweep, valid_planes
from rlacd.policies import Policy
from rlacd.run import Run
from rlacd.solid.component import Component, Plane
from tests.learning import GreedyOverMask, greedy_plane, small_solids
from tests.shapes import box, trimesh_of
from tests.test_sweep import SOLIDS

CRITERION = Concavity(0.04)


def volumes(components: list[Component]) -> list[tuple[float, float]]:
    return sorted((c.volume, c.hull.volume) for c in components)


def cut_greedily(cutting: CutEnv) -> list[Step]:
    """Cut to the end."""
    earned = []
    while cutting.unfinished:
        component = cutting.largest()
        number = greedy_plane(component)
        assert number is not None
        cut = cutting.step(component, cutting.candidates(component).plane(number))
        earned.append(cut)
    return earned


@pytest.mark.parametrize("name", small_solids())
def test_the_same_policy_reaches_the_same_components_as_decompose(name: str) -> None:
    solid = Component(small_solids()[name])
    with Run(1) as run:
        done, left = CutTree(solid, GreedyOverMask(), run).cut_until(CRITERION)
    cutting = CutEnv(solid, CRITERION)
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
    cutting = CutEnv(solid, CRITERION)
    plane = Plane((0.0, 0.0, 1.0), 0.3)
    cut = cutting.step(cutting.unfinished[0], plane)
    hull = (2 * 1.5 - (2 - 0.3) * (1.5 - 0.3) / 2) * 1.0
    assert solid.hull.volume == pytest.approx(hull)
    assert cut.saved == pytest.approx((hull - 0.6 - 0.36) / hull)
    assert cut.finishes == 1
    assert cutting.terminal
    assert (cut.left.unfinished, cut.discounts, len(cut.left.finished)) == ([], [], 2)


def test_rewards_are_relative_to_the_whole_solids_hull_and_discounts_to_the_components() -> None:
    cutting = CutEnv(Component(small_solids()["table"]), CRITERION)
    hull = before = cutting.unfinished[0].hull.volume
    while cutting.unfinished:
        component = cutting.unfinished[0]
        cut = cutting.step(component, cutting.candidates(component).plane(greedy_plane(component) or 0))
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


def test_dual_state_target_by_hand() -> None:
    # Three cuts: both sides unfinished, nothing left, and one side in three pieces.
    target = dual_state_target(
        torch.tensor([100.0, 1000.0, 0.0]),
        torch.tensor([500.0, 200.0, 10.0, 20.0, 30.0]),
        torch.tensor([0.5, 0.25, 0.1, 0.2, 0.3]),
        torch.tensor([0, 0, 2, 2, 2]),
    )
    assert target.tolist() == pytest.approx([100 + 250 + 50, 1000, 1 + 4 + 9])


def test_loss_by_hand_and_only_through_the_planes_taken() -> None:
    q = torch.tensor([[1.0, 2.0, 3.0], [4.0, 0.0, -1.0]], requires_grad=True)
    planes, target = torch.tensor([1, 0]), torch.tensor([5.0, 4.0])
    loss = bellman_loss(q, planes, target)
    assert loss.item() == pytest.approx(0.5 * (9 + 0) / 2)
    assert bellman_loss(torch.tensor([[2.0], [4.0]]), planes, target) == loss.detach(), "of the planes taken alone"
    loss.backward()
    assert q.grad is not None
    assert q.grad.tolist() == [pytest.approx([0, -3.0 / 2, 0]), [0, 0, 0]]


def test_returns_over_a_tree_by_hand() -> None:
    # 0 is cut into 1 and 2; 1 into 3, which is never cut; 2 to the end.
    episode = Episode(
        np.zeros((4, 1), np.float16),
        np.ones((4, 1), np.bool_),
        np.zeros(4),
        *(np.array([0, 1, 2]), np.zeros(3, np.int64), np.array([100.0, 10.0, 1.0])),
        *(np.array([1, 2, 3]), np.array([0, 0, 1]), np.array([0.5, 0.25, 0.9])),
        parts=9,
        ended="cap",
    )
    assert episode.returns().tolist() == [100 + 5 + 0.25, 10, 1]
    assert episode.rewards.tolist() == [100, 10, 1]


def experience(number: int, children: list[int]) -> Experience:
    """An episode whose cut t divides component 9 * number + t; it leaves so many of the components that follow."""
    cuts, left = len(children), sum(children)
    names = 9.0 * number + np.arange(cuts + left)
    return Experience(
        taken=np.array(names[:cuts, None], np.float16),
        planes=np.arange(cuts) % 11,
        rewards=-names[:cuts],
        excess=names[:cuts] / 100,
        owner=np.repeat(np.arange(cuts), children),
        discounts=0.5 / (1 + np.arange(left)),
        features=np.array(names[cuts:, None], np.float16),
        masks=np.arange(11) == (np.arange(left) % 11)[:, None],
    )


@given(st.integers(1, 9), st.lists(st.lists(st.integers(0, 3), min_size=1, max_size=4), min_size=1, max_size=20))
@settings(max_examples=40, deadline=None)
def test_replay_gives_back_the_last_cuts_also_when_restored(capacity: int, episodes: list[list[int]]) -> None:
    replay, added = ReplayBuffer(capacity), []
    for number, children in enumerate(episodes):
        added.append(experience(number, children))
        replay.add(added[-1])
    restored = ReplayBuffer(capacity)
    restored.restore(replay.state())
    kept = {float(e.taken[t, 0]): (e, t) for e in added for t in range(len(e.planes))}
    least = min(capacity, len(kept))
    assert least <= len(replay) == len(restored) < capacity + 4
    batch, again = (r.sample(40, np.random.default_rng(0)) for r in (replay, restored))
    for name in batch:
        assert np.array_equal(batch[name], again[name]), name
    last = list(kept)[-len(replay) :]
    for i, name in enumerate(batch["features"][:, 0].tolist()):
        assert name in last
        (cut, t), mine = kept[name], batch["owner"] == i
        left = cut.owner == t
        assert (batch["planes"][i], batch["rewards"][i]) == (cut.planes[t], np.float32(cut.rewards[t]))
        assert batch["excess"][i] == np.float32(cut.excess[t])
        assert batch["child_features"][mine, 0].tolist() == cut.features[left, 0].tolist()
        assert np.array_equal(batch["child_masks"][mine], cut.masks[left])
        assert batch["child_discounts"][mine] == pytest.approx(cut.discounts[left])


# --- the exact optimum, by recursion over all trees of cuts by two planes ---------------------------------------------


def worth(component: Component, unit: float) -> float:
    """Value of a component where only volume is rewarded, in units of a volume: eq. 7 and 8 as they stand."""
    best = 0.0
    for plane in TWO:
        cutting = CutEnv(component, LIMIT)
        if not cutting.unfinished:
            break
        cut = cutting.step(component, cutting.candidates(component).plane(plane))
        if cut.left.stuck != [component]:
            below = sum(d * worth(c, unit) for c, d in zip(cut.left.unfinished, cut.discounts, strict=True))
            best = max(best, cut.saved * component.hull.volume / unit + below)
    return best


TWO = [axis * OFFSETS_PER_AXIS + OFFSETS_PER_AXIS // 2 for axis in (0, 2)]
"""Those that halve a component along x and z."""

LIMIT = Concavity(0.07)


@pytest.fixture
def two_planes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave only two planes to cut a component by."""

    def two(component: Component, candidates: object = None) -> np.ndarray:
        allowed = np.isin(np.arange(150), TWO)
        return allowed & valid_planes(component, paper_planes(component))

    for place in ("learn.environment.valid", "learn.episodes.valid", "policies.network.distinct"):
        monkeypatch.setattr(f"rlacd.{place}_planes", two)


@pytest.fixture
def u_shape(tmp_path: Path, two_planes: None) -> Component:
    """A "u" with arms of different height: 31 components in all."""
    solid = box((0, 0, 0), (3, 1, 0.4)) + box((0, 0, 0), (0.4, 1, 2)) + box((2.6, 0, 0), (3, 1, 1))
    (tmp_path / "meshes").mkdir()
    trimesh_of(solid).export(tmp_path / "meshes" / "u.ply")
    read = Solids(tmp_path / "meshes", tmp_path / "solids").get("u.ply")
    assert read is not None
    return read


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
    unit = CutEnv(u_shape, LIMIT).excess(u_shape) if options.target == "return" else 1
    known = worth(u_shape, u_shape.hull.volume)
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
