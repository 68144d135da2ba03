"""The replay buffer: a ring of transitions, which share what is known of the components that they refer to."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from rlacd.errors import RlacdError
from rlacd.solid.arrays import BoolArray


@dataclass(eq=False)
class Seen:
    """A component: its key, a digest of its features; those, or none if values are not asked for; and valid planes.

    `fewest` is the number of cuts that the best of all episodes needed to finish it, infinite for those never cut.
    """

    key: bytes
    features: NDArray[np.float16]
    mask: BoolArray
    fewest: float = math.inf


Children = Sequence[tuple[Seen, float, float]]
"""The unfinished components that cuts left, with discounts and excess (`CutProcess.excess`)."""


@dataclass(frozen=True)
class Transition:
    """A cut: what it divided, by which plane, what the network sees of that, its reward, what it left, its excess."""

    state: Seen
    plane: int
    features: NDArray[np.float16]
    reward: float
    children: Children
    excess: float


class Replay:
    """A ring of transitions; a full one forgets its oldest.

    Parameters
    ----------
    capacity : int
    unknown : float
        Cuts that a component counts which no episode has finished.
    values : bool
        Whether values of children are asked for, so that their features are kept.
    """

    def __init__(self, capacity: int, unknown: float = 1.0, values: bool = True) -> None:
        self.capacity, self._unknown, self._values = capacity, unknown, values
        self._held: list[Transition] = []
        self._next = 0
        self._seen: WeakValueDictionary[bytes, Seen] = WeakValueDictionary()

    def __len__(self) -> int:
        return len(self._held)

    def seen(self, features: NDArray[np.float16], mask: BoolArray) -> Seen:
        """Get what is known of a component: the same for all with the same features."""
        key = hashlib.sha256(features.tobytes()).digest()
        known = self._seen.get(key)
        if known is None:
            known = self._seen[key] = Seen(key, features if self._values else features[:0, ..., :0], mask)
        return known

    def cuts(self, children: Children) -> float:
        """The fewest cuts seen, from one on that left `children`."""
        return 1 + sum(child.fewest if child.fewest < math.inf else self._unknown for child, _, _ in children)

    def count(self, cuts: Sequence[tuple[Seen, Children]]) -> None:
        """Note the fewest cuts of the components that an episode cut, in its order."""
        for component, children in reversed(cuts):
            component.fewest = min(component.fewest, self.cuts(children))

    def add(self, transition: Transition) -> None:
        """Add a transition."""
        if len(self._held) < self.capacity:
            self._held.append(transition)
        else:
            self._held[self._next] = transition
        self._next = (self._next + 1) % self.capacity

    def sample(self, count: int, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
        """Draw B = `count` transitions uniformly, with replacement.

        Returns
        -------
        dict of arrays
            features float32 [B, D], planes int64 [B], rewards float32 [B], and cuts float32 [B], the fewest seen from
            this one on; excess float32 [B]. Of the C children: owner int64 [C], their row; child_features float32
            [C, D] or [C, A, D]; child_masks bool [C, A], never all False in a row; child_discounts and
            child_excess float32 [C].
        """
        if not self._held:
            raise RlacdError("there is nothing to learn from yet; let `learning_starts` be at least 1.")
        drawn = [self._held[i] for i in rng.integers(len(self._held), size=count)]
        children = [(row, *child) for row, t in enumerate(drawn) for child in t.children]
        first = drawn[0].state
        shape = len(children), *first.features.shape
        return {
            "features": np.stack([t.features for t in drawn]).astype(np.float32),
            "planes": np.array([t.plane for t in drawn]),
            "rewards": np.array([t.reward for t in drawn], np.float32),
            "cuts": np.array([self.cuts(t.children) for t in drawn], np.float32),
            "excess": np.array([t.excess for t in drawn], np.float32),
            "child_features": np.array([child[1].features for child in children], np.float32).reshape(shape),
            "child_masks": np.array([child[1].mask for child in children], np.bool_).reshape(-1, len(first.mask)),
            "child_discounts": np.array([child[2] for child in children], np.float32),
            "child_excess": np.array([child[3] for child in children], np.float32),
            "owner": np.array([child[0] for child in children], np.int64),
        }

    def state(self) -> dict[str, NDArray[Any]]:
        """Return everything as arrays, for a checkpoint; each component once."""
        number: dict[Seen, int] = {}
        for t in self._held:
            for seen in (t.state, *(child for child, _, _ in t.children)):
                number.setdefault(seen, len(number))
        links = [(i, number[c], *rest) for i, t in enumerate(self._held) for c, *rest in t.children]
        cuts = [(number[t.state], t.plane, t.reward, t.excess) for t in self._held]
        return {
            "keys": np.array([[*seen.key] for seen in number], np.uint8),
            "features": np.array([seen.features for seen in number], np.float16),
            "masks": np.array([np.packbits(seen.mask) for seen in number], np.uint8),
            "fewest": np.array([seen.fewest for seen in number]),
            "taken": np.array([t.features for t in self._held], np.float16),
            "cuts": np.array(cuts, np.float64).reshape(-1, 4),
            "links": np.array(links, np.float64).reshape(-1, 4),
            "cursor": np.array([self._next, len(next(iter(number)).mask) if number else 0]),
        }

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Restore the result of `state`."""
        self._next, actions = (int(x) for x in state["cursor"])
        masks: Any = np.unpackbits(state["masks"], axis=1, count=actions).astype(bool) if actions else []
        keys = [key.tobytes() for key in state["keys"]]
        columns = (keys, state["features"], masks, state["fewest"].tolist())
        seen = [Seen(*row) for row in zip(*columns, strict=True)]
        self._seen = WeakValueDictionary(zip(keys, seen, strict=True))
        children: list[list[tuple[Seen, float, float]]] = [[] for _ in state["cuts"]]
        for owner, child, discount, excess in state["links"].tolist():
            children[int(owner)].append((seen[int(child)], discount, excess))
        cuts = zip(state["cuts"].tolist(), state["taken"], children, strict=True)
        self._held = [Transition(seen[int(s)], int(p), f, r, tuple(left), e) for (s, p, r, e), f, left in cuts]
