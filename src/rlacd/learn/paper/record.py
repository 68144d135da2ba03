"""An episode's transitions as arrays, so that it can be sent from where it was played and stored in checkpoints."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rlacd.learn.files import packed, unpacked
from rlacd.learn.paper.mdp import Reward
from rlacd.solid.arrays import BoolArray, FloatArray

Longs: TypeAlias = NDArray[np.int64]

ENDED = ("terminal", "stuck", "cap", "nothing", "lost")
"""Ways to end: all parts finished; some cannot be cut; truncated; nothing to cut; the episode could not be played."""


@dataclass(frozen=True)
class Transition:
    """A cut: the component cut, by its number in the record, and the discounts of the unfinished ones it left."""

    state: int
    children: dict[int, float]


def whole_returns(cuts: Sequence[Transition], rewards: Sequence[float]) -> list[tuple[float, dict[int, float]]]:
    """Discounted sum of the rewards of each cut and of all later ones of the same component.

    Returned with the components that were left uncut when the episode was truncated, and their discounts.
    """
    returns: list[tuple[float, dict[int, float]]] = []
    of: dict[int, tuple[float, dict[int, float]]] = {}
    for cut, reward in zip(reversed(cuts), reversed(rewards), strict=True):
        total = reward
        left: dict[int, float] = {}
        for child, discount in cut.children.items():
            gained, below = of.get(child, (0.0, {child: 1.0}))
            total += discount * gained
            left |= {row: discount * weight for row, weight in below.items()}
        of[cut.state] = total, left
        returns.append(of[cut.state])
    return returns[::-1]


@dataclass(frozen=True, eq=False)
class Record:
    """An episode of T cuts, with N components in the frontier over time.

    Attributes
    ----------
    features : float16 [N, D]
        Of the components, in the order in which they were appended to the frontier.
    masks : bool [N, A]
        Their valid planes.
    discounts : float64 [N]
        Discount of each as a child; 1 for the initial components.
    joined : int64 [1 + T]
        Number of components that joined at the start, and by each cut.
    index : int64 [T]
        Index in the frontier of the component cut; the cut removes it.
    planes : int64 [T]
    rewards : float64 [T, 3]
        The fields of `Reward`.
    values : float64 [T]
        The greatest Q of the component cut, as seen by the player; nan without a network.
    parts : int64
        Number of components at the end.
    ended : int64
        Index into `ENDED`.
    """

    features: NDArray[np.float16]
    masks: BoolArray
    discounts: FloatArray
    joined: Longs
    index: Longs
    planes: Longs
    rewards: FloatArray
    values: FloatArray
    parts: int
    ended: int

    @classmethod
    def empty(cls, ended: str) -> Record:
        """Create the record of an episode without a cut."""
        ints, floats = np.empty(0, np.int64), np.empty(0)
        return cls(
            features=np.empty((0, 0), np.float16),
            masks=np.empty((0, 0), np.bool_),
            discounts=floats,
            joined=np.zeros(1, np.int64),
            index=ints,
            planes=ints,
            rewards=np.empty((0, 3)),
            values=floats,
            parts=0,
            ended=ENDED.index(ended),
        )

    @property
    def cuts(self) -> int:
        """Number of cuts T."""
        return len(self.planes)

    @property
    def how(self) -> str:
        """Return how it ended."""
        return ENDED[self.ended]

    def transitions(self, discount: float | None) -> list[Transition]:
        """Which components each cut left; `discount` replaces the recorded ones."""
        joined, cuts = self.joined.tolist(), []
        frontier, new = list(range(joined[0])), joined[0]
        for index, count in zip(self.index.tolist(), joined[1:], strict=True):
            children = {c: self.discounts[c] if discount is None else discount for c in range(new, new + count)}
            cuts.append(Transition(frontier.pop(index), children))
            frontier += children
            new += count
        return cuts

    def reward(self, cut: int) -> Reward:
        """Get the reward of a cut."""
        return Reward(*self.rewards[cut].tolist())

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Return all fields as arrays."""
        return {field.name: np.asarray(getattr(self, field.name)) for field in dataclasses.fields(self)}

    @classmethod
    def of(cls, arrays: Mapping[str, NDArray[np.generic]]) -> Record:
        """Restore a record from `arrays`."""
        whole = {"parts": int(arrays["parts"]), "ended": int(arrays["ended"])}
        return cls(**{**arrays, **whole})  # type: ignore[arg-type]

    def as_bytes(self) -> bytes:
        """Serialise it for `from_bytes`."""
        return packed(self.arrays())

    @classmethod
    def from_bytes(cls, content: bytes) -> Record:
        """Read the result of `as_bytes`."""
        return cls.of(unpacked(content))
