"""The dual-state loss against targets worked out by hand, and the replay buffer that feeds it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

torch = pytest.importorskip("torch", reason="needs the extra train")

from rlacd.errors import RlacdError  # noqa: E402
from rlacd.learn.paper.loss import bellman_loss, boltzmann, cost_loss, dual_state_target, soft_value  # noqa: E402
from rlacd.learn.paper.record import Transition, whole_returns  # noqa: E402
from rlacd.learn.paper.replay import Replay  # noqa: E402

Q = torch.tensor([[1.0, 2.0, 3.0], [4.0, 0.0, -1.0]])
MASK = torch.tensor([[True, True, False], [True, True, True]])


def test_value_is_the_greatest_valid_q_at_temperature_zero() -> None:
    assert soft_value(Q, MASK, 0).tolist() == [2.0, 4.0]


def test_soft_value_by_hand() -> None:
    expected = [2 * math.log(math.exp(0.5) + math.exp(1.0)), 2 * math.log(math.exp(2) + 1 + math.exp(-0.5))]
    assert soft_value(Q, MASK, 2.0).tolist() == pytest.approx(expected, rel=1e-6)


@given(st.lists(st.floats(-1000, 1000), min_size=2, max_size=20), st.floats(0.01, 10))
def test_soft_value_lies_between_the_maximum_and_the_maximum_plus_t_log_n(q: list[float], temperature: float) -> None:
    mask = torch.ones(1, len(q), dtype=torch.bool)
    value = soft_value(torch.tensor([q]), mask, temperature).item()
    assert max(q) - 1e-2 <= value <= max(q) + temperature * math.log(len(q)) + 1e-2


def test_boltzmann_by_hand_and_in_the_limit() -> None:
    chances = boltzmann(Q, MASK, 2.0)
    assert chances[0].tolist() == pytest.approx([1 / (1 + math.exp(0.5)), 1 / (1 + math.exp(-0.5)), 0])
    assert boltzmann(Q, MASK, 0).tolist() == [[0, 1, 0], [1, 0, 0]]
    assert torch.allclose(boltzmann(Q, MASK, 1e-3), boltzmann(Q, MASK, 0))


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
    q = Q.clone().requires_grad_()
    loss = bellman_loss(q, torch.tensor([1, 0]), torch.tensor([12.0, 4.0]), 10.0)
    assert loss.item() == pytest.approx(0.5 * (1 + 0) / 2)
    loss.backward()
    assert q.grad is not None
    assert q.grad.tolist() == [pytest.approx([0, -1.0 / 10 / 2, 0]), [0, 0, 0]]


def test_cost_loss_by_hand_depends_on_the_ratio_only() -> None:
    assert cost_loss(torch.tensor([-2.0, -8.0]), torch.tensor([-1.0, -8.0])).item() == pytest.approx(
        math.log(2) ** 2 / 4
    )
    assert cost_loss(torch.tensor([-20.0]), torch.tensor([-10.0])) == cost_loss(
        torch.tensor([-2.0]), torch.tensor([-1.0])
    )


def test_whole_returns_by_hand() -> None:
    # 0 falls into 1 and 2, then 2 into 3 and 4, and 1 is finished by its cut; 3 and 4 are left when the episode ends.
    cuts = [Transition(0, {1: 0.5, 2: 0.25}), Transition(2, {3: 0.5, 4: 1.0}), Transition(1, {})]
    returns = whole_returns(cuts, [1.0, 10.0, 100.0])
    assert returns == [(1 + 0.5 * 100 + 0.25 * 10, {3: 0.125, 4: 0.25}), (10.0, {3: 0.5, 4: 1.0}), (100.0, {})]


class Model:
    """What a replay buffer has to behave like: a list of whole transitions, nothing shared."""

    def __init__(self, replay: Replay) -> None:
        self.replay = replay
        self.transitions: list[tuple[float, int, float, list[float], list[float]]] = []
        self.frontier: list[tuple[int, float]] = []
        self.made = 0

    def component(self) -> tuple[int, float]:
        self.made += 1
        mask = np.zeros(11, dtype=bool)
        mask[self.made % 11] = True
        return self.replay.add_component(np.full(3, self.made, np.float32), mask), float(self.made)

    def step(self, children: int) -> None:
        if not self.frontier:
            self.frontier.append(self.component())
        row, name = self.frontier.pop(0)
        new = [self.component() for _ in range(children)]
        shares = [0.5 / (i + 1) for i in range(children)]
        self.replay.add(row, self.made % 11, -name, [r for r, _ in new], shares)
        self.replay.release(row)
        self.transitions.append((name, self.made % 11, -name, [n for _, n in new], shares))
        self.frontier += new


@given(st.integers(1, 9), st.lists(st.integers(0, 3), min_size=1, max_size=60))
@settings(max_examples=60, deadline=None)
def test_replay_gives_back_the_last_transitions_and_forgets_the_rest(capacity: int, children: list[int]) -> None:
    replay = Replay(capacity, 3, 11)
    model = Model(replay)
    for count in children:
        model.step(count)
    kept = {name: rest for name, *rest in model.transitions[-capacity:]}
    assert len(replay) == len(kept)
    batch = replay.sample(40, np.random.default_rng(0))
    for i in range(40):
        plane, reward, names, shares = kept[float(batch.features[i, 0])]
        mine = batch.owner == i
        assert (batch.planes[i], batch.rewards[i]) == (plane, np.float32(reward))
        assert batch.child_features[mine, 0].tolist() == names
        assert [int(m.argmax()) for m in batch.child_masks[mine]] == [int(n) % 11 for n in names]
        assert batch.child_discounts[mine] == pytest.approx(shares)
    needed = {name for name, *_ in model.transitions[-capacity:]} | {n for _, n in model.frontier}
    needed |= {n for *_, names, _ in model.transitions[-capacity:] for n in names}
    assert replay.components == len(needed)


def test_restored_replay_goes_on_as_the_saved_one() -> None:
    one, other = Replay(20, 3, 11), Replay(20, 3, 11)
    model = Model(one)
    for count in [2, 1, 0, 2] * 12:
        model.step(count)
    other.restore({name: array.copy() for name, array in one.state().items()})
    for replay in (one, other):
        model.replay, frontier = replay, list(model.frontier)
        model.step(2)
        model.frontier = frontier
        model.made -= 2
    a, b = one.sample(64, np.random.default_rng(3)), other.sample(64, np.random.default_rng(3))
    for name in vars(a):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name


def test_nothing_to_sample_is_reported() -> None:
    with pytest.raises(RlacdError, match="nothing to learn from"):
        Replay(4, 1, 2).sample(1, np.random.default_rng(0))
