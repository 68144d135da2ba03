"""What a search tries next: which clusters are cut anew by whom, and which parts are given away."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum

import numpy as np

from rlacd.search.neighbours import Cluster, Neighbours

SIZES = (3, 4, 5, 6, 8)
"""So many parts are cut anew together: two seldom become one, and more take too long."""

BATCH = 8
"""Trials made of one state at a time; the same whatever the number of threads, so that the result is too."""

REPEATS = 4
"""So often a part may be given to the same others, each time by other cuts."""

DRAWS = 10
"""A way of trying is left for this batch when so many draws in a row gave nothing new."""


class Move(Enum):
    """What can be done to a state."""

    RECUT = "a cluster is cut anew by a policy"
    SHIFT = "a part gives pieces to those around"
    DISSOLVE = "a part is divided among those around"


AS_LONG_AS = {Move.SHIFT: 3.0, Move.DISSOLVE: 1.5}
"""Giving a part away takes about as long as it takes to cut a cluster of so many anew."""


@dataclass(frozen=True)
class Trial:
    """What to try: with which parts, the ids of those around, which policy cuts, and the seed of what is drawn."""

    move: Move
    cluster: Cluster
    policy: int | None = None
    around: Cluster = ()
    seed: int = 0


@dataclass
class _Tally:
    """How often something was tried, and how many parts that gained."""

    tried: int = 0
    gained: int = 0

    @property
    def rate(self) -> float:
        """Parts gained a try, from a hopeful start."""
        return (self.gained + 1) / (self.tried + 10)


class Ways:
    """Ways of trying: so many parts cut anew by this policy, or one that is given away in this manner.

    Those that turned out well are taken more often.
    """

    def __init__(self, policies: int) -> None:
        self._ways: list[tuple[Move, int, int | None]] = [
            *((Move.RECUT, size, policy) for size in SIZES for policy in range(policies)),
            (Move.SHIFT, 1, None),
            (Move.DISSOLVE, 1, None),
        ]
        self._kinds = {(move, size): _Tally() for move, size, _ in self._ways}
        self._policies = [_Tally() for _ in range(policies)]
        self._cut: list[set[Cluster]] = [set() for _ in range(policies)]
        self._given: dict[tuple[Move, int, Cluster], int] = {}

    def draw(self, here: Neighbours, random: np.random.Generator, reach: float) -> Iterator[Trial]:
        """Draw up to `BATCH` trials of disjoint clusters, none that was made before."""
        taken: set[int] = set()
        worth = np.array([self._worth(*way) for way in self._ways])
        for way in random.choice(len(self._ways), BATCH, p=worth / worth.sum()):
            move, size, policy = self._ways[way]
            for _ in range(DRAWS):
                trial = _giver(here, random, move, reach) if policy is None else _cluster(here, random, size, policy)
                if trial is None:
                    break
                if taken.isdisjoint(trial.cluster) and self.is_new(trial):
                    taken.update(trial.cluster)
                    yield trial
                    break

    def is_new(self, trial: Trial) -> bool:
        """Whether the trial was not made before, or not too often; it is from now on."""
        if trial.policy is not None:
            known = trial.cluster in self._cut[trial.policy]
            self._cut[trial.policy].add(trial.cluster)
            return not known
        key = trial.move, trial.cluster[0], trial.around
        self._given[key] = self._given.get(key, 0) + 1
        return self._given[key] <= REPEATS

    def count(self, trial: Trial, gain: int) -> None:
        """Remember what a try gave."""
        tallies = [self._kinds[trial.move, len(trial.cluster)]]
        if trial.policy is not None:
            tallies.append(self._policies[trial.policy])
        for tally in tallies:
            tally.tried += 1
            tally.gained += gain

    def _worth(self, move: Move, size: int, policy: int | None) -> float:
        """Parts gained by the time it takes, which is about in proportion to the size of a cluster."""
        rate = self._kinds[move, size].rate
        if policy is None:
            return len(self._policies) * rate / AS_LONG_AS[move]
        return rate * self._policies[policy].rate / self._usual / size

    @property
    def _usual(self) -> float:
        return sum(tally.rate for tally in self._policies) / len(self._policies)


def _cluster(here: Neighbours, random: np.random.Generator, size: int, policy: int) -> Trial | None:
    cluster = here.draw(size, random)
    return None if cluster is None else Trial(Move.RECUT, cluster, policy)


def _giver(here: Neighbours, random: np.random.Generator, move: Move, reach: float) -> Trial | None:
    if len(here.parts) < 2:
        return None
    return giving_away(move, here, here.draw_small(random), random, reach)


def giving_away(move: Move, here: Neighbours, giver: int, random: np.random.Generator, reach: float) -> Trial:
    """Let a part be given to those within reach."""
    return Trial(move, (giver,), None, here.near(giver, reach), int(random.integers(2**32)))
