"""What an episode has to teach, as arrays: they come from wherever it was played, and wait in checkpoints."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rlacd.learn.files import packed, unpacked
from rlacd.learn.paper.mdp import Reward
from rlacd.solid.arrays import BoolArray, FloatArray

Longs: TypeAlias = NDArray[np.int64]

ENDED = ("terminal", "stuck", "cap", "nothing", "lost")
"""How episodes end: all parts are finished, or cannot be cut; broken off; nothing to cut; nobody could play it."""


@dataclass(frozen=True, eq=False)
class Record:
    """An episode of T cuts, in which N components were to be cut.

    Attributes
    ----------
    features : float16 [N, D]
        Of the components, in the order in which they joined the frontier, always at its end.
    masks : bool [N, A]
        Their valid planes.
    fill : float64 [N]
        Share of the hull that the solid fills: 1 - fill is all the volume that cutting can save.
    discounts : float64 [N]
        Of each, as a child of what was cut; 1 for those that the episode began with.
    joined : int64 [1 + T]
        How many joined when the episode began, and by each cut.
    index : int64 [T]
        Which of the frontier was cut; it left the frontier.
    planes : int64 [T]
    rewards : float64 [T, 4]
        The fields of `Reward`.
    values : float64 [T]
        The greatest Q of what was cut, as the player saw it; nan where it did not look.
    parts : int64
        Components at the end.
    ended : int64
        Index into `ENDED`.
    """

    features: NDArray[np.float16]
    masks: BoolArray
    fill: FloatArray
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
        """Make the record of an episode without a cut."""
        ints, floats = np.empty(0, np.int64), np.empty(0)
        return cls(
            features=np.empty((0, 0), np.float16),
            masks=np.empty((0, 0), np.bool_),
            fill=floats,
            discounts=floats,
            joined=np.zeros(1, np.int64),
            index=ints,
            planes=ints,
            rewards=np.empty((0, 4)),
            values=floats,
            parts=0,
            ended=ENDED.index(ended),
        )

    @property
    def cuts(self) -> int:
        """T."""
        return len(self.planes)

    @property
    def how(self) -> str:
        """Tell how it ended."""
        return ENDED[self.ended]

    def reward(self, cut: int) -> Reward:
        """Get the reward of a cut."""
        return Reward(*self.rewards[cut].tolist())

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """Get everything as arrays."""
        return {field.name: np.asarray(getattr(self, field.name)) for field in dataclasses.fields(self)}

    @classmethod
    def of(cls, arrays: Mapping[str, NDArray[np.generic]]) -> Record:
        """Make the record of what `arrays` gave."""
        whole = {"parts": int(arrays["parts"]), "ended": int(arrays["ended"])}
        return cls(**{**arrays, **whole})  # type: ignore[arg-type]

    def as_bytes(self) -> bytes:
        """Write it, to be read by `from_bytes`."""
        return packed(self.arrays())

    @classmethod
    def from_bytes(cls, content: bytes) -> Record:
        """Read what `as_bytes` wrote."""
        return cls.of(unpacked(content))
