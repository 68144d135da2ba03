"""The replay buffer: transitions of single components, stored by their features.

A component's features are stored once, as a row in half precision, even if one transition starts from it and another
leads to it; rows that no transition in the buffer refers to are reused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rlacd.errors import RlacdError
from rlacd.policies.observe import Float32Array
from rlacd.solid.arrays import BoolArray


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
    """A ring of transitions.

    Parameters
    ----------
    capacity : int
        Maximum number of transitions.
    dim : int
        Number of features per component.
    actions : int
        Number of planes per component.
    """

    def __init__(self, capacity: int, dim: int, actions: int) -> None:
        self.capacity, self.dim, self.actions = capacity, dim, actions
        self._features = np.zeros((64, dim), dtype=np.float16)
        self._masks = np.zeros((64, (actions + 7) // 8), dtype=np.uint8)
        self._users = np.zeros(64, dtype=np.int32)
        self._free = list(range(63, -1, -1))
        self._states = np.zeros(capacity, dtype=np.int64)
        self._planes = np.zeros(capacity, dtype=np.int64)
        self._rewards = np.zeros(capacity, dtype=np.float32)
        self._children: list[NDArray[np.int64]] = [np.empty(0, np.int64)] * capacity
        self._discounts: list[Float32Array] = [np.empty(0, np.float32)] * capacity
        self._next = 0
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def components(self) -> int:
        """Number of feature rows in use."""
        return len(self._users) - len(self._free)

    def add_component(self, features: Float32Array, mask: BoolArray) -> int:
        """Store a component's features [D] and valid planes [A]; the row stays until `release`, and while a transition
        refers to it.
        """
        if not self._free:
            self._grow()
        row = self._free.pop()
        self._features[row], self._masks[row] = features, np.packbits(mask)
        self._users[row] = 1
        return row

    def release(self, row: int) -> None:
        """Mark a row as no longer referenced from outside the buffer."""
        self._users[row] -= 1
        if self._users[row] == 0:
            self._free.append(row)

    def features(self, rows: Sequence[int]) -> Float32Array:
        """Features [len(rows), D]."""
        return self._features[np.asarray(rows, dtype=np.int64)].astype(np.float32)

    def masks(self, rows: Sequence[int]) -> BoolArray:
        """Valid planes [len(rows), A]."""
        packed = self._masks[np.asarray(rows, dtype=np.int64)]
        return np.unpackbits(packed, axis=1, count=self.actions).astype(bool)

    def add(self, state: int, plane: int, reward: float, children: Sequence[int], discounts: Sequence[float]) -> None:
        """Add a transition between rows; a full buffer drops its oldest one."""
        i = self._next
        for row in (state, *children):
            self._users[row] += 1
        if self._count == self.capacity:
            for row in (int(self._states[i]), *self._children[i].tolist()):
                self.release(row)
        self._states[i], self._planes[i], self._rewards[i] = state, plane, reward
        self._children[i] = np.asarray(children, dtype=np.int64)
        self._discounts[i] = np.asarray(discounts, dtype=np.float32)
        self._next = (i + 1) % self.capacity
        self._count = min(self._count + 1, self.capacity)

    def sample(self, count: int, rng: np.random.Generator) -> TransitionBatch:
        """Draw `count` transitions uniformly, with replacement."""
        if self._count == 0:
            raise RlacdError("there is nothing to learn from yet; let `warmup` be at least 1.")
        index = rng.integers(self._count, size=count)
        children = [self._children[i] for i in index]
        rows = np.concatenate(children)
        return TransitionBatch(
            self._features[self._states[index]].astype(np.float32),
            self._planes[index],
            self._rewards[index],
            self._features[rows].astype(np.float32),
            self.masks(rows),  # type: ignore[arg-type]
            np.concatenate([self._discounts[i] for i in index]),
            np.repeat(np.arange(count), [len(c) for c in children]),
        )

    def state(self) -> dict[str, NDArray[Any]]:
        """Return everything as arrays, for a checkpoint."""
        children, discounts = self._children[: self._count], self._discounts[: self._count]
        return {
            "features": self._features,
            "masks": self._masks,
            "users": self._users,
            "free": np.array(self._free, dtype=np.int64),
            "states": self._states[: self._count],
            "planes": self._planes[: self._count],
            "rewards": self._rewards[: self._count],
            "children": np.concatenate([np.empty(0, np.int64), *children]),
            "discounts": np.concatenate([np.empty(0, np.float32), *discounts]),
            "counts": np.array([len(c) for c in children], dtype=np.int64),
            "cursor": np.array([self._next, self._count], dtype=np.int64),
        }

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Restore the result of `state` from a buffer with the same parameters."""
        self._features, self._masks = state["features"].copy(), state["masks"].copy()
        self._users = state["users"].copy()
        self._free = state["free"].tolist()
        self._next, self._count = (int(x) for x in state["cursor"])
        self._states[: self._count] = state["states"]
        self._planes[: self._count] = state["planes"]
        self._rewards[: self._count] = state["rewards"]
        ends = np.cumsum(state["counts"])[:-1]
        if self._count:
            self._children[: self._count] = np.split(state["children"], ends)
            self._discounts[: self._count] = np.split(state["discounts"], ends)

    def _grow(self) -> None:
        size = len(self._users)
        self._features = np.concatenate([self._features, np.zeros_like(self._features)])
        self._masks = np.concatenate([self._masks, np.zeros_like(self._masks)])
        self._users = np.concatenate([self._users, np.zeros_like(self._users)])
        self._free = list(range(2 * size - 1, size - 1, -1))
