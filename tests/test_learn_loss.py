"""The dual-state loss against targets worked out by hand, and the replay buffer that feeds it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

torch = pytest.importorskip("torch", reason="needs the extra train")

from rlacd.errors import RlacdError  # noqa: E402
from rlacd.learn.q_network import bellman_loss, dual_state_target, soft_value  # noqa: E402
from rlacd.learn.replay import Replay, Seen, Transition  # noqa: E402

Q = torch.tensor([[1.0, 2.0, 3.0], [4.0, 0.0, -1.0]])
MASK = torch.tensor([[True, True, False], [True, True, True]])


def test_value_is_the_greatest_valid_q_at_temperature_zero() -> None:
    assert soft_value(Q, MASK, 0).tolist() == [2.0, 4.0]


def test_soft_value_by_hand() -> None:
    expected = [2 * math.log(math.exp(0.5) + math.exp(1.0)), 2 * math.log(math.exp(2) + 1 + math.exp(-0.5))]
    assert soft_value(Q, MASK, 2.0).tolist() == pytest.approx(expected, rel=1e-6)


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
    assert (
        bellman_loss(torch.tensor([2.0, 4.0]), torch.tensor([1, 0]), torch.tensor([12.0, 4.0]), 10.0) == loss.detach()
    )
    loss.backward()
    assert q.grad is not None
    assert q.grad.tolist() == [pytest.approx([0, -1.0 / 10 / 2, 0]), [0, 0, 0]]


def component(number: int, replay: Replay) -> Seen:
    return replay.seen(np.full(3, number, np.float16), np.arange(11) == number % 11)


def test_fewest_cuts_by_hand() -> None:
    replay = Replay(9, unknown=100)
    a, b, c, d = (component(i, replay) for i in range(4))
    replay.count([(a, ((b, 1.0), (c, 1.0))), (b, ()), (c, ((d, 1.0),))])  # d is left when the episode ends
    assert [x.fewest for x in (a, b, c, d)] == [1 + 1 + 101, 1, 1 + 100, math.inf]
    replay.count([(component(2, replay), ((d, 1.0),)), (d, ())])  # another episode comes to the same component
    assert [x.fewest for x in (a, b, c, d)] == [103, 1, 2, 1]
    assert replay.cuts(((b, 1.0), (c, 1.0))) == 4


@given(st.integers(1, 9), st.lists(st.integers(0, 3), min_size=1, max_size=60))
@settings(max_examples=40, deadline=None)
def test_replay_gives_back_the_last_transitions_also_when_restored(capacity: int, children: list[int]) -> None:
    replay, made, added = Replay(capacity), 1, {}
    for count in children:
        state, *below = (component(made + i, replay) for i in range(count + 1))
        left = tuple((child, 0.5 / (i + 1)) for i, child in enumerate(below))
        replay.count([(state, left)])
        added[float(made)] = Transition(state, made % 11, state.features, -made, left)
        replay.add(added[float(made)])
        made += 1 + count
    restored = Replay(capacity)
    restored.restore(replay.state())
    kept = dict(list(added.items())[-capacity:])
    assert len(replay) == len(restored) == len(kept)
    batch, again = (r.sample(40, np.random.default_rng(0)) for r in (replay, restored))
    for name in batch:
        assert np.array_equal(batch[name], again[name]), name
    for i in range(40):
        cut, mine = kept[float(batch["features"][i, 0])], batch["owner"] == i
        assert (batch["planes"][i], batch["rewards"][i], batch["cuts"][i]) == (
            cut.plane,
            cut.reward,
            1 + len(cut.children),
        )
        assert batch["child_features"][mine, 0].tolist() == [float(c.features[0]) for c, _ in cut.children]
        assert [m.tolist() for m in batch["child_masks"][mine]] == [c.mask.tolist() for c, _ in cut.children]
        assert batch["child_discounts"][mine] == pytest.approx([d for _, d in cut.children])


def test_nothing_to_sample_is_reported() -> None:
    with pytest.raises(RlacdError, match="nothing to learn from"):
        Replay(4).sample(1, np.random.default_rng(0))
