"""The replay buffer: a ring of transitions, which share the arrays of the components that they refer to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rlacd.errors import RlacdError
from rlacd.solid.arrays import BoolArray, Float32Array


@dataclass(frozen=True, eq=False)
class Seen:
    """A component: features float16 [D], and valid planes bool [A]."""

    features: NDArray[np.float16]
    mask: BoolArray


@dataclass(frozen=True)
class Transition:
    """A cut: what it divided and by which plane, its reward, and the unfinished components it left with discounts."""

    state: Seen
    plane: int
    reward: float
    children: tuple[tuple[Seen, float], ...]


@dataclass(frozen=True, eq=False)
class TransitionBatch:
    """B transitions and their C unfinished children.

    Attributes
    ----------
    features : float32 [B, D]
    planes : int64 [B]
    rewards : float32 [B]
    child_features : float32 [C, D]
    child_masks : bool [C, A]
        Never all False in a row.
    child_discounts : float32 [C]
        gamma.
    owner : int64 [C]
        Batch row of each child.
    """

    features: Float32Array
    planes: NDArray[np.int64]
    rewards: Float32Array
    child_features: Float32Array
    child_masks: BoolArray
    child_discounts: Float32Array
    owner: NDArray[np.int64]


class Replay:
    """A ring of transitions; a full one forgets its oldest."""

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self._held: list[Transition] = []
        self._next = 0

    def __len__(self) -> int:
        return len(self._held)

    def add(self, transition: Transition) -> None:
        """Add a transition."""
        if len(self._held) < self.capacity:
            self._held.append(transition)
        else:
            self._held[self._next] = transition
        self._next = (self._next + 1) % self.capacity

    def sample(self, count: int, rng: np.random.Generator) -> TransitionBatch:
        """Draw `count` transitions uniformly, with replacement."""
        if not self._held:
            raise RlacdError("there is nothing to learn from yet; let `warmup` be at least 1.")
        drawn = [self._held[i] for i in rng.integers(len(self._held), size=count)]
        children = [(row, child, discount) for row, t in enumerate(drawn) for child, discount in t.children]
        first = drawn[0].state
        return TransitionBatch(
            np.stack([t.state.features for t in drawn]).astype(np.float32),
            np.array([t.plane for t in drawn]),
            np.array([t.reward for t in drawn], np.float32),
            np.array([c.features for _, c, _ in children], np.float32).reshape(-1, len(first.features)),
            np.array([c.mask for _, c, _ in children], np.bool_).reshape(-1, len(first.mask)),
            np.array([discount for _, _, discount in children], np.float32),
            np.array([row for row, _, _ in children], np.int64),
        )

    def state(self) -> dict[str, NDArray[Any]]:
        """Return everything as arrays, for a checkpoint; each component once."""
        number: dict[Seen, int] = {}
        for t in self._held:
            for seen in (t.state, *(child for child, _ in t.children)):
                number.setdefault(seen, len(number))
        links = [(i, number[c], d) for i, t in enumerate(self._held) for c, d in t.children]
        cuts = [(number[t.state], t.plane, t.reward) for t in self._held]
        return {
            "features": np.array([seen.features for seen in number], np.float16),
            "masks": np.array([np.packbits(seen.mask) for seen in number], np.uint8),
            "cuts": np.array(cuts, np.float64).reshape(-1, 3),
            "links": np.array(links, np.float64).reshape(-1, 3),
            "cursor": np.array([self._next, len(next(iter(number)).mask) if number else 0]),
        }

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Restore the result of `state`."""
        self._next, actions = (int(x) for x in state["cursor"])
        masks: Any = np.unpackbits(state["masks"], axis=1, count=actions).astype(bool) if actions else []
        seen = [Seen(*pair) for pair in zip(state["features"], masks, strict=True)]
        children: list[list[tuple[Seen, float]]] = [[] for _ in state["cuts"]]
        for owner, child, discount in state["links"].tolist():
            children[int(owner)].append((seen[int(child)], discount))
        cuts = zip(state["cuts"].tolist(), children, strict=True)
        self._held = [Transition(seen[int(s)], int(p), r, tuple(left)) for (s, p, r), left in cuts]
