"""The dual-state loss against targets worked out by hand, and the replay buffer that feeds it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

torch = pytest.importorskip("torch", reason="needs the extra train")

from rlacd.errors import RlacdError  # noqa: E402
from rlacd.learn.episodes import Episode  # noqa: E402
from rlacd.learn.q_network import bellman_loss, dual_state_target, soft_value  # noqa: E402
from rlacd.learn.replay import Replay, Seen, Transition  # noqa: E402

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


def test_whole_returns_by_hand() -> None:
    # 0 falls into 1 and 2, then 2 into 3 and 4, and 1 is finished by its cut; 3 and 4 are left when the episode ends.
    episode = Episode(
        *(np.zeros((5, 1), np.float16), np.ones((5, 2), bool)),
        *(np.array([0, 2, 1]), np.zeros(3, int), np.array([1.0, 10.0, 100.0])),
        *(np.array([1, 2, 3, 4]), np.array([0, 0, 1, 1]), np.array([0.5, 0.25, 0.5, 1.0])),
        parts=3,
        ended=2,
    )
    expected = [(1 + 0.5 * 100 + 0.25 * 10, {3: 0.125, 4: 0.25}), (10.0, {3: 0.5, 4: 1.0}), (100.0, {})]
    assert Episode.from_bytes(episode.to_bytes()).returns() == expected


def component(number: int) -> Seen:
    return Seen(np.full(3, number, np.float16), np.arange(11) == number % 11)


@given(st.integers(1, 9), st.lists(st.integers(0, 3), min_size=1, max_size=60))
@settings(max_examples=40, deadline=None)
def test_replay_gives_back_the_last_transitions_also_when_restored(capacity: int, children: list[int]) -> None:
    replay, made, added = Replay(capacity), 1, {}
    for count in children:
        left = tuple((component(made + 1 + i), 0.5 / (i + 1)) for i in range(count))
        added[float(made)] = Transition(component(made), made % 11, -made, left)
        replay.add(added[float(made)])
        made += 1 + count
    restored = Replay(capacity)
    restored.restore(replay.state())
    kept = dict(list(added.items())[-capacity:])
    assert len(replay) == len(restored) == len(kept)
    batch, again = (r.sample(40, np.random.default_rng(0)) for r in (replay, restored))
    for name in vars(batch):
        assert np.array_equal(getattr(batch, name), getattr(again, name)), name
    for i in range(40):
        cut, mine = kept[float(batch.features[i, 0])], batch.owner == i
        assert (batch.planes[i], batch.rewards[i]) == (cut.plane, cut.reward)
        assert batch.child_features[mine, 0].tolist() == [float(c.features[0]) for c, _ in cut.children]
        assert [m.tolist() for m in batch.child_masks[mine]] == [c.mask.tolist() for c, _ in cut.children]
        assert batch.child_discounts[mine] == pytest.approx([d for _, d in cut.children])


def test_nothing_to_sample_is_reported() -> None:
    with pytest.raises(RlacdError, match="nothing to learn from"):
        Replay(4).sample(1, np.random.default_rng(0))
